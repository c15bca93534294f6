"""Presliding: joint friction with hysteresis, as the contacts of gears and seals have it.

The model is Dahl's with the size of the Stribeck curve, LuGre without its micro-damping: bristles of mean
deflection z in [-1, 1] follow the motion over the presliding angle,

    dz/dq = (sign(dq) - z) / angle,    torque = -size z

so that after a reversal friction changes its sign along the path, whatever the speed, and a joint at rest is
held by a spring. The equation is solved exactly for each sub-step: it is stable for all angles and speeds.

Source: C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new model for control of systems with
friction", IEEE Transactions on Automatic Control 40(3), 1995.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Presliding:
    """The bristles of six joints.

    Args:
        angle: over which they follow a reversal [rad], above 0.
        q: positions (6,) [rad], followed from now on.
        torque: takes the friction (6,) [Nm].
    """

    def __init__(self, angle: float, q: NDArray[np.float64], torque: NDArray[np.float64]) -> None:
        self._angle = angle
        self._now = q
        self._torque = torque
        self._last = q.copy()
        self._bristles = np.zeros(6)
        self._stored = (self._last.copy(), self._bristles.copy())

    def reset(self) -> None:
        """Begin at the present positions, with bristles that are not bent."""
        self._last[:] = self._now
        self._bristles[:] = 0.0

    def apply(self, size: NDArray[np.float64]) -> None:
        """Set the torque for the displacement since the last call; `size` of the friction (6,) [Nm]."""
        moved = self._now - self._last
        ahead = np.sign(moved)
        self._bristles += (ahead - self._bristles) * -np.expm1(-np.abs(moved) / self._angle)
        self._last[:] = self._now
        np.multiply(self._bristles, -size, self._torque)

    def store(self) -> None:
        """Store the present state for `restore`."""
        self._stored = (self._last.copy(), self._bristles.copy())

    def restore(self) -> None:
        """Return to the stored state."""
        self._last[:], self._bristles[:] = self._stored
