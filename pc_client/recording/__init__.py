"""Recordings: one self-describing, append-only MCAP file a run.

    layout        which signals a row holds, and how they lie in its messages
    ros_messages  the messages that viewers know
    arm_view      the topics by which viewers show a moving arm
    provenance    what a reader must know to trust and repeat the run
    origin        the words for simulated, real, and not known
    outbox        bytes on their way to a disk that may fail, and the thread that writes them
    recorder      writes a run, row by row, inside the control loop
    loader        reads a recording back, also one that was cut off
    export        the same rows as CSV or Parquet

Nothing here knows a socket or reads a clock: in lockstep the same run gives the same bytes.
"""
