"""What is preferred among strokes that explain a recording equally well.

The data leave two things open. For narrow bells sigma is hardly seen at all; and two neighbouring strokes may
grow against each other without end, their difference alone being seen. So a fit has two weak wishes: that
ln sigma is near the middle of what hands do, and that the peak speed of a stroke is not far above the top
speed of the part:

    wish = weight * sum over strokes of [ (ln(sigma / .2) / .5)^2 + (peak speed / top speed)^2 ]

The weight is the residual per independent number of a 12 Hz signal. So one wish weighs as much as one number
in noise, nothing against what is seen, and vanishes together with the residual: clean strokes come back
unchanged.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.extraction.chain import Chain

__all__ = ["Preference", "Wishes", "wishes"]

#: Middle and spread (of the logarithm) of sigma in handwriting, section 2 of the theory notes.
_SIGMA, _SPREAD = 0.2, 0.5
_SQRT_TWO_PI = math.sqrt(2.0 * math.pi)


class Preference(NamedTuple):
    """How much is wished.

    Attributes:
        weight: of the wishes in the cost.
        top_speed: of the part, > 0.
    """

    weight: float
    top_speed: float


class Wishes(NamedTuple):
    """The wishes at a chain: cost, and for every stroke its part of the normal equations.

    Attributes:
        cost: of all strokes.
        gradient: (s, columns), downhill.
        matrix: (s, columns, columns). The columns are the target at which the stroke begins and the
            variables of the stroke, as in `model.linearise`.
    """

    cost: float
    gradient: NDArray[np.float64]
    matrix: NDArray[np.float64]


def wishes(chain: Chain, preference: Preference) -> Wishes:
    """Cost, gradient and (Gauss-Newton) matrix of the wishes."""
    root = math.sqrt(preference.weight)
    count, dim = len(chain), chain.targets.shape[1]
    size = 6 if dim == 2 else 8
    half = 0.5 * chain.turn
    per_chord = root / (np.sinc(half / math.pi) * chain.width * _SQRT_TWO_PI * preference.top_speed)
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
    return Wishes(
        float(np.sum(value**2)),
        -np.einsum("sri,sr->si", jacobian, value),
        jacobian.transpose(0, 2, 1) @ jacobian,
    )
