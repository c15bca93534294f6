"""Recordings: one self-describing, append-only MCAP file a run.

    layout      which signals a row holds, and how a row lies in the file
    provenance  what a reader must know to trust and repeat the run
    origin      the words for simulated, real, and not known
    mcap_file   the records around the rows: header, index, summary
    recorder    writes a run, row by row, inside the control loop
    loader      reads a recording back, also one that was cut off
    export      the same rows as CSV or Parquet

Nothing here knows a socket or a wall clock: the same run gives the same bytes.
"""
