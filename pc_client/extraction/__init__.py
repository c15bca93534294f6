"""From recorded movements of a pen or a hand to Sigma-Lognormal strokes: the model turned round.

    recording, files, sources    what was recorded, and how it is read
    smoothing                    the signal on a uniform grid, low-passed at 12 Hz, and its speed peaks
    closed_forms, initial        first strokes from the shape of the speed profiles
    chain, model, refine         strokes as arrays, their derivatives, joint least squares in space and time
    addition, fitting            further strokes while they pay; the order of it all
    extract                      the result: strokes and how well they reconstruct the recording
    batch, results, figures      many files, their table and their pictures

Nothing here knows a robot or a unit of length. docs/extraction.md explains how it works.
"""
