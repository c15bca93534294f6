"""The comparison of generators: the same time and target points by every model, duplicates aside.

    movement_set  which movements are compared
    filtering     one filter for what was planned and what was measured
    likeness      the figures of one signal: smoothness, peaks, power law, top speed and acceleration
    signals       planned, sampled and filtered, executed: the signals of one movement
    table         one table for the terminal, for documents and for programs
    figure        one page of pictures

Knows recordings and movements; moves nothing.
"""
