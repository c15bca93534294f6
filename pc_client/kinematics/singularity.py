"""How far a posture is from a singularity, and which joint would race there.

All measures come from the Jacobian in mixed units (m and rad), as is usual for arms of one size; they are
vectorised over stacks of Jacobians, because a plan needs them at every sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class SingularityMeasure(NamedTuple):
    """Measures of a stack of Jacobians (n, 6, 6).

    Attributes:
        sigma_min: (n,) smallest singular value: the twist that joint speed 1 gives in the worst direction.
        condition: (n,) largest over smallest singular value; inf when singular.
        manipulability: (n,) product of all singular values, |det J|.
            Source: Yoshikawa, "Manipulability of robotic mechanisms", 1985.
        racing_joint: (n,) index of the joint that moves most for the worst direction.
    """

    sigma_min: Array
    condition: Array
    manipulability: Array
    racing_joint: NDArray[np.intp]


def measure_singularity(jacobians: ArrayLike) -> SingularityMeasure:
    """Measure a stack of Jacobians.

    Args:
        jacobians: (n, 6, 6), rows linear first.

    Returns:
        One value per Jacobian of each measure.
    """
    J = np.asarray(jacobians, dtype=np.float64)
    _, sigma, Vh = np.linalg.svd(J)
    sigma_min = sigma[:, -1]
    with np.errstate(divide="ignore"):
        condition = sigma[:, 0] / sigma_min
    # The last right singular vector is the joint motion that hardly moves the TCP.
    racing_joint = np.argmax(np.abs(Vh[:, -1, :]), axis=1)
    return SingularityMeasure(sigma_min, condition, np.prod(sigma, axis=1), racing_joint)
