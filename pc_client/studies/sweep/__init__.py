"""Many experiments from one file: gains x fidelity x movements, side by side, resumable.

    settings   the TOML file; what is tried: grids and searches of [controller]; which setting is the best
    case       one experiment, with an identity that depends on nothing but its content; its outcome
    schedule   does a case, on a simulated arm of its own, and measures it; all cases, side by side
    guard      the little program that ends the process of a simulated arm with its user
    store      which cases are settled: one small file a case, and the table as Parquet or CSV
    page       plots and the page that shows them

A case is a pure function of its content: the box runs in lockstep and starts afresh, so the same case gives
the same figures to the last bit, wherever it runs. Hence a result that is there needs no second run.
"""
