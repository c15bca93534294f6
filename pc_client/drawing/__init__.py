"""From a person's drawing to a movement of the arm, and back to a page that compares the two.

    placement   the marks of a drawing as strokes, and where in the workspace and how large they are done
    joining     all marks and the lifts between them in one movement, as slow as the arm needs it
    drawing     the two above in one call
    execution   what the arm did, mapped back into the frame and the time of the recording
    judgement   how well reconstruction, plan and execution agree with the person
    table       the same for readers, and the page
    figures     its pictures: paths, movement in space, speeds

Knows recordings, movements and planning; moves nothing.
"""
