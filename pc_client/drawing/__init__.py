"""From a person's drawing to a movement of the arm, and back to a page that compares the two.

    marks            the parts of a drawing, pen down to pen up, as strokes; dots among them
    placement        where in the workspace the sheet is, and how large the drawing is on it
    joining          all parts and the lifts between them in one Sigma-Lognormal movement
    pacing           the least factor by which the arm must be slower
    drawing          the four above in one call
    execution        what the arm did, mapped back into the frame and the time of the recording
    judgement        how well reconstruction, plan and execution agree with the person
    table, page      the same for readers
    shown, figures   its pictures: path_figure, speed_figure, space_figure

Knows recordings, movements and planning; moves nothing.
"""
