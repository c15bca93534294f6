"""From recorded movements of a pen or a hand to Sigma-Lognormal strokes: the inverse of the model.

    pen              what was recorded, and how it is read
    smoothing        the signal on a uniform grid, low-passed at 12 Hz, and its speed peaks
    initial          first strokes from the shape of the speed profiles
    chain, refine    strokes as arrays, their derivatives, joint least squares in space and time
    fitting          further strokes while they raise the SNR; the sequence of a fit
    extract          the result: strokes and how well they reconstruct the recording
    batch, figures   many files, their table and their pictures

The package is independent of robots and of the unit of length. docs/extraction.md explains how it works.
"""
