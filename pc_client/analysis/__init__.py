"""From recordings to figures of merit, Table I and the report.

    track    the TCP path of one recording, reference and actual at the same time stamps
    measures the signal-to-noise ratio of the TCP velocity (Eq. 10), errors, and where the rest is lost
    run      all of these for one recording
    table    Table I: ours beside the paper's
    figures  what the pages show (loads matplotlib, so it is imported only when a plot is drawn)
    report   one self-contained page from a folder of recordings
    side_by_side  several experiments in one table and on one page

Everything is computed from recordings alone; nothing here talks to a robot.
"""
