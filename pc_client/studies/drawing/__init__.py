"""From a person's drawing to a movement of the arm, and back to a page that compares the two.

    placement   the marks of a drawing as strokes, and where in the workspace and how large they are done
    drawing     `pc_client.drawing`: all marks and the lifts between them in one movement, as slow as needed
    judgement   what the arm did, mapped back, and how well all signals agree with the person
    table       the same for readers, and the page
    figures     its pictures: paths, movement in space, speeds

Knows recordings, movements and planning; moves nothing.
"""
