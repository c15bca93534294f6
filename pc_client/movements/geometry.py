"""Boxes and similarity transforms of space: the little geometry that movements need."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError

__all__ = ["LIBRARY_SHIFTS", "UR3_BOX", "WORKING_BOXES", "Box", "Similarity", "read_only"]


def read_only(values: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    if shape is not None:
        array = array.reshape(shape)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-parallel box by its lowest and highest corner, m, in the robot's base frame."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not all(
            math.isfinite(a) and math.isfinite(b) and a < b for a, b in zip(self.low, self.high, strict=True)
        ):
            raise MovementError(
                f"box from {self.low} to {self.high} m: each low edge must lie below its high edge"
            )

    @property
    def size(self) -> NDArray[np.float64]:
        """Edge lengths, (3,), m."""
        return np.subtract(self.high, self.low)

    @property
    def centre(self) -> NDArray[np.float64]:
        """Midpoint, (3,), m."""
        return 0.5 * np.add(self.high, self.low)

    def shrunk(self, margin: float) -> Box:
        """The box less a margin (m) on every side."""
        return Box(
            (self.low[0] + margin, self.low[1] + margin, self.low[2] + margin),
            (self.high[0] - margin, self.high[1] - margin, self.high[2] - margin),
        )

    def contains(self, p: ArrayLike, tolerance: float = 0.0) -> bool:
        """Whether all points p, (..., 3), m, lie inside, or outside by no more than the tolerance (m)."""
        points = np.asarray(p, dtype=np.float64)
        return bool(
            np.all(points >= np.subtract(self.low, tolerance))
            and np.all(points <= np.add(self.high, tolerance))
        )


#: Where an arm with its tool at RPY(0, 3/4 pi, 0) runs .35 m/s in every direction below its joint speed
#: limits, in one branch of its inverse kinematics, clear of itself and of the table. Source: a search for the
#: largest box on a grid (UR3 25 mm, others 50 mm) with the nominal kinematics. A UR3e has the UR3's, for the
#: movements that lie in it.
WORKING_BOXES: Mapping[str, Box] = MappingProxyType(
    {
        "ur3": Box((0.275, -0.2, 0.15), (0.425, 0.2, 0.35)),
        "ur5": Box((0.3, -0.4, 0.15), (0.65, 0.4, 0.55)),
        "ur10": Box((0.4, -0.7, 0.15), (0.85, 0.7, 0.8)),
        "ur3e": Box((0.275, -0.2, 0.15), (0.425, 0.2, 0.35)),
        "ur5e": Box((0.35, -0.45, 0.1), (0.65, 0.45, 0.6)),
        "ur7e": Box((0.35, -0.45, 0.1), (0.65, 0.45, 0.6)),
        "ur10e": Box((0.4, -0.65, 0.15), (0.95, 0.65, 0.8)),
        "ur12e": Box((0.4, -0.65, 0.15), (0.95, 0.65, 0.8)),
        "ur16e": Box((0.45, -0.5, 0.15), (0.7, 0.5, 0.6)),
        "ur8long": Box((0.55, -0.9, 0.15), (1.3, 0.9, 1.0)),
        "ur15": Box((0.5, -0.65, 0.15), (1.0, 0.65, 0.75)),
        "ur18": Box((0.5, -0.45, 0.2), (0.75, 0.45, 0.6)),
        "ur20": Box((0.55, -0.85, 0.2), (1.3, 0.85, 1.05)),
        "ur30": Box((0.6, -0.6, 0.15), (1.05, 0.6, 0.75)),
    }
)
UR3_BOX = WORKING_BOXES["ur3"]

#: By how much the movements of the library, which lie in the UR3's box, are moved for an arm that cannot do
#: them there, m: as little as brings the UR3's box into the arm's.
LIBRARY_SHIFTS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "ur5e": (0.075, 0.0, 0.0),
        "ur7e": (0.075, 0.0, 0.0),
        "ur10e": (0.125, 0.0, 0.0),
        "ur12e": (0.125, 0.0, 0.0),
        "ur16e": (0.175, 0.0, 0.0),
        "ur8long": (0.275, 0.0, 0.0),
        "ur15": (0.225, 0.0, 0.0),
        "ur18": (0.225, 0.0, 0.05),
        "ur20": (0.275, 0.0, 0.05),
        "ur30": (0.325, 0.0, 0.0),
    }
)


@dataclass(frozen=True, slots=True)
class Similarity:
    """p -> scale * R p + shift: moves, scales and rotates, and changes no angle and no ratio of lengths.

    Attributes:
        scale: > 0.
        R: rotation, (3, 3).
        shift: m, (3,).
    """

    scale: float
    R: NDArray[np.float64]
    shift: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", read_only(self.R, (3, 3)))
        object.__setattr__(self, "shift", read_only(self.shift, (3,)))
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise MovementError(f"scale {self.scale}: a movement is scaled by a number greater than 0")
        if not np.allclose(self.R @ self.R.T, np.eye(3), atol=1e-9) or np.linalg.det(self.R) < 0.0:
            raise MovementError(
                "the rotation of a similarity must be a proper rotation matrix (orthonormal, determinant +1)"
            )
        if not np.all(np.isfinite(self.shift)):
            raise MovementError(f"shift {self.shift.tolist()} m: give finite numbers")

    def points(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3), m, where they go."""
        return self.scale * p @ self.R.T + self.shift

    def vectors(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Differences of points, velocities, accelerations (n, 3), where they go."""
        return self.scale * v @ self.R.T
