"""From recordings to figures of merit, Table I and the report.

    measures      the TCP path of a recording; the signal-to-noise ratio of its velocity (Eq. 10), errors,
                  and where the rest is lost
    run           a recording and all that is measured on it
    signals       a motion as arrays, for programs that import the client
    noise_floor   what the noise of the encoders leaves of a perfect arm, and of an error budget
    inference     means with intervals, paired differences with their test
    groups        groups of runs compared by a figure
    table         Table I: ours beside the paper's
    run_figures   one run, the runs of a movement; loads matplotlib, so import it only to draw
    figures       bars and speeds of all movements; likewise
    report        one self-contained page from a folder of recordings

Everything is computed from recordings alone; nothing here talks to a robot.
"""
