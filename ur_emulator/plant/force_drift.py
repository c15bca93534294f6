"""ForceDrift: the slow error of the measured force.

A CB3 arm has no force sensor. What it reports wanders by several newtons within minutes, because friction and
temperature do. The sensor of an e-Series arm drifts less, around an offset that the first zero takes away.
The white part of the error is added with the other sensor noise.

Source: UR3/CB3 manual (precision ±10 N, ±5 Nm); forum.universal-robots.com threads 229 and 4481 (offsets of
several newtons, sd 3.6 N). E-Series: see `models/e_series.py`.
"""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream

_TIME_CONSTANT = 120.0  # s; assumed


class ForceDrift:
    """A bounded random walk of all six components, linear between the knots of successive blocks.

    Args:
        fidelity: gives the bounds of drift and offset.
        seed: of the box.
        block_time: time from knot to knot [s].
    """

    def __init__(self, fidelity: Fidelity, seed: int, block_time: float) -> None:
        self._rng = random_stream(seed, "force")
        self._bound = np.repeat([fidelity.force_bias, fidelity.force_bias / fidelity.force_ratio], 3)
        offset = np.repeat([fidelity.force_offset, fidelity.force_offset / fidelity.force_ratio], 3)
        self._offset = offset * random_stream(seed, "force offset").uniform(-1.0, 1.0, 6)
        self._keep = exp(-block_time / _TIME_CONSTANT)
        self._spread = 0.5 * self._bound
        self._knot = np.clip(self._rng.standard_normal(6) * self._spread, -self._bound, self._bound)

    def next_block(self, n: int) -> NDArray[np.float64]:
        """Return drift and offset (n, 6) [N, Nm] of n cycles; the next block begins where this one ends."""
        start = self._knot
        fresh = sqrt(1.0 - self._keep**2) * self._spread * self._rng.standard_normal(6)
        self._knot = np.clip(self._keep * start + fresh, -self._bound, self._bound)
        share = np.arange(n)[:, None] / n
        drift: NDArray[np.float64] = start + share * (self._knot - start)
        return drift + self._offset
