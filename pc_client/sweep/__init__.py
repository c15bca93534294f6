"""Many experiments from one file: gains x fidelity x movements, side by side, resumable.

    config            the TOML file, read strictly
    controller_axes   its table [controller]: a grid or random samples of settings
    case              one experiment, with an identity that depends on nothing but its content
    box               a simulated arm of a case's own, in a process that never outlives its user
    guard             the little program between the two
    run_case          does one case and measures it
    outcome           what came of a case
    columns           the columns of the table
    measure           a recording as a row
    schedule          all cases over processes or a Dask cluster
    folder            results on disk, one small file a case
    result_store      which cases are settled, which are still to run
    table             the table as Parquet or CSV
    ranking           which setting is the best
    figures, page     plots and the page that shows them
    progress          how far it is, on the terminal

A case is a pure function of its content: the box runs in lockstep and starts afresh, so the same case gives
the same figures to the last bit, wherever it runs. Hence a result that is there needs no second run.
"""
