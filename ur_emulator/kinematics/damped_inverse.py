"""The damped inverse of a Jacobian: joint speeds for a twist, finite at singularities too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Chosen: changes joint speeds away from singularities by 1e-9 relative at most.
_DAMPING = 1e-12 * np.eye(6)


def joint_speeds(jacobian: NDArray[np.float64], twist: NDArray[np.float64]) -> NDArray[np.floating]:
    """Return the joint speeds (6,) [rad/s] whose twist, `jacobian @ qd`, is closest to the one given.

    Args:
        jacobian: (6, 6).
        twist: (6,), linear first [m/s, rad/s]; a small displacement [m, rad] gives joint steps [rad].
    """
    transposed = jacobian.T
    return np.linalg.solve(transposed @ jacobian + _DAMPING, transposed @ twist)
