"""Recordings: one self-describing, append-only MCAP file a run.

    rows        which signals a row holds, and how they lie in its messages
    provenance  what a reader must know to trust and repeat the run; simulated, real, or not known
    arm_view    links and joints of an arm, and the topics by which viewers show it moving
    recorder    writes a run, row by row, inside the control loop; a thread takes the bytes to the disk
    recording   reads a recording back, also one that was cut off
    export      its rows as CSV, Parquet or MAT

Nothing here knows a socket or reads a clock: in lockstep the same run gives the same bytes.
"""
