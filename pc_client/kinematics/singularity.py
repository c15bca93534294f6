"""How far a posture is from a singularity, and which of a UR arm's three singularities that is.

All measures come from the Jacobian in mixed units (m and rad), as is usual for arms of one size; they are
vectorised over stacks of Jacobians, because a plan needs them at every sample.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SINGULARITIES = MappingProxyType(
    {
        0: "the wrist comes above the base axis and the base would race",
        2: "the elbow is stretched or folded",
        4: "wrist 1 and wrist 3 are aligned and would race",
    }
)
"""What happens at the singularity that a joint names.

Source: the factors of det J of a UR arm, a2 a3 sin(q3) sin(q5) r, r being the distance of the wrist centre
from the base axis in the plane of the arm (Hawkins 2013)."""


class SingularityMeasure(NamedTuple):
    """Measures of a stack of Jacobians (n, 6, 6).

    Attributes:
        sigma_min: (n,) smallest singular value: the twist that joint speed 1 gives in the worst direction.
        condition: (n,) largest over smallest singular value; inf when singular.
        manipulability: (n,) product of all singular values, |det J|.
            Source: Yoshikawa, "Manipulability of robotic mechanisms", 1985.
        critical_joint: (n,) joint that names the nearest singularity, a key of SINGULARITIES.
    """

    sigma_min: Array
    condition: Array
    manipulability: Array
    critical_joint: NDArray[np.intp]


def measure_singularity(jacobians: ArrayLike) -> SingularityMeasure:
    """Measure a stack of Jacobians.

    Args:
        jacobians: (n, 6, 6) of a UR arm with the TCP on the axis of wrist 3; linear rows first, in `base`.

    Returns:
        One value per Jacobian of each measure.
    """
    J = np.asarray(jacobians, dtype=np.float64)
    sigma = np.asarray(np.linalg.svd(J, compute_uv=False), dtype=np.float64)
    sigma_min = sigma[:, -1]
    with np.errstate(divide="ignore"):
        condition = sigma[:, 0] / sigma_min
    nearest = np.argmin(_determinant_factors(J), axis=1)
    return SingularityMeasure(
        sigma_min,
        condition,
        np.multiply.reduce(sigma, axis=1),
        np.array(tuple(SINGULARITIES), dtype=np.intp)[nearest],
    )


def _determinant_factors(J: Array) -> Array:
    """Return (n, 3): r / |a2|, |sin q3| and |sin q5|, read off the columns axis x (tcp - origin) and axis."""
    linear, axis = J[:, :3, :], J[:, 3:, :]
    # Columns of parallel axes differ by axis x (link between them), so by the links turned a quarter.
    upper, fore = linear[:, :, 1] - linear[:, :, 2], linear[:, :, 2] - linear[:, :, 3]
    a2, a3 = np.linalg.norm(upper, axis=1), np.linalg.norm(fore, axis=1)
    elbow = np.linalg.norm(np.cross(upper, fore), axis=1) / (a2 * a3)
    wrist = np.linalg.norm(np.cross(axis[:, :, 3], axis[:, :, 5]), axis=1)
    # The base's column is (-y, x, 0) of the TCP; the wrist centre lies d6 behind it on the last axis.
    d6 = np.sum(np.cross(axis[:, :, 4], axis[:, :, 5]) * linear[:, :, 4], axis=1)
    centre_x, centre_y = linear[:, 1, 0] - d6 * axis[:, 0, 5], -linear[:, 0, 0] - d6 * axis[:, 1, 5]
    shoulder = np.abs(centre_y * axis[:, 0, 1] - centre_x * axis[:, 1, 1]) / a2
    return np.stack((shoulder, elbow, wrist), axis=1)
