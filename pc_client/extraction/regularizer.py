"""The regularizer: it chooses between chains that explain a recording equally well.

The data leave two things open. For narrow speed profiles sigma is hardly visible; and two neighbouring
strokes may grow without limit in opposite directions, since only their sum is visible. So the cost of a fit
has a weak regularizer of two terms: ln sigma is near the middle of the values of handwriting, and the peak
speed of a stroke is not far above the top speed of the part:

    regularizer = weight * sum over strokes of [ (ln(sigma / .2) / .5)^2 + (peak speed / top speed)^2 ]

The weight is the residual per independent number of a 12 Hz signal. So one term weighs as much as one number
in noise and little against what the data show, and it vanishes together with the residual: clean strokes are
recovered unchanged.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.extraction.chain import Chain

__all__ = ["Regularizer", "RegularizerTerms", "regularizer_terms"]

#: Middle and spread (of the logarithm) of sigma in handwriting, section 2 of the theory notes.
_SIGMA, _SPREAD = 0.2, 0.5
_SQRT_TWO_PI = math.sqrt(2.0 * math.pi)


class Regularizer(NamedTuple):
    """How strongly a fit is regularized.

    Attributes:
        weight: of the regularizer in the cost.
        top_speed: of the part, > 0.
    """

    weight: float
    top_speed: float


class RegularizerTerms(NamedTuple):
    """The regularizer at a chain: cost, and for every stroke its part of the normal equations.

    Attributes:
        cost: of all strokes.
        gradient: (s, columns), downhill.
        matrix: (s, columns, columns). The columns are the target at which the stroke begins and the
            variables of the stroke, as in `model.linearise`.
    """

    cost: float
    gradient: NDArray[np.float64]
    matrix: NDArray[np.float64]


def regularizer_terms(chain: Chain, regularizer: Regularizer) -> RegularizerTerms:
    """Cost, gradient and (Gauss-Newton) matrix of the regularizer."""
    root = math.sqrt(regularizer.weight)
    count, dim = len(chain), chain.targets.shape[1]
    size = 6 if dim == 2 else 8
    half = 0.5 * chain.arc_angle
    per_chord = root / (np.sinc(half / math.pi) * chain.width * _SQRT_TWO_PI * regularizer.top_speed)
    peak = per_chord[:, None] * chain.chords
    skew = root * np.log(chain.sigma / _SIGMA) / _SPREAD
    jacobian = np.zeros((count, dim + 1, dim + size))
    for i in range(dim):
        jacobian[:, i, i] = -per_chord
        jacobian[:, i, size + i] = per_chord
    jacobian[:, :dim, dim + 1] = -peak
    straight = np.abs(half) < 1e-3
    safe = np.where(straight, 1.0, half)
    slope = np.where(straight, half / 6.0, 0.5 / safe - 0.5 / np.tan(safe))
    jacobian[:, :dim, dim + 3] = slope[:, None] * peak
    jacobian[:, dim, dim + 2] = root / (_SPREAD * chain.sigma)
    value = np.column_stack((peak, skew))
    return RegularizerTerms(
        float(np.sum(value**2)),
        -np.einsum("sri,sr->si", jacobian, value),
        jacobian.transpose(0, 2, 1) @ jacobian,
    )
