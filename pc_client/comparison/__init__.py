"""The comparison of generators: the same time and target points by every model, duplicates aside.

    movement_set  which movements are compared
    signals       planned, sampled and filtered, executed: the signals of one movement, and their figures
    table         one table for the terminal, for documents and for programs
    figure        one page of pictures

Knows recordings and movements; moves nothing.
"""
