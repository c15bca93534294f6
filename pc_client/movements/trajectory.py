"""What makes a movement: a closed form of position, velocity and acceleration in time; its transformations.

The modules beside this one have the five forms: `sigma_lognormal`, `uniform`, `minimum_jerk`, `power_law`,
`samples`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError
from pc_client.files import ALLOWED, MOST_BYTES, is_file_name

LONGEST_DURATION = 1200.0
"""No movement lasts longer [s]: its recording could not be read back (`pc_client.files`)."""


class Motion(NamedTuple):
    """Position (m), velocity (m/s) and acceleration (m/s^2), each (n, 2) or (n, 3)."""

    p: Array
    v: Array
    a: Array


class Trajectory(Protocol):
    """What makes a movement: a closed form of position, velocity and acceleration in time."""

    @property
    def duration(self) -> float:
        """Total time, s."""

    @property
    def target_points(self) -> Array:
        """(n, 3), m."""

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s."""

    def transformed(self, similarity: Similarity) -> Trajectory:
        """The same movement elsewhere."""

    def stretched(self, factor: float) -> Trajectory:
        """The same movement, slower."""


@dataclass(frozen=True, slots=True)
class Similarity:
    """p -> scale * R p + shift: moves, scales and rotates, and changes no angle and no ratio of lengths.

    Attributes:
        scale: > 0.
        R: rotation, (3, 3).
        shift: m, (3,).
    """

    scale: float
    R: Array
    shift: Array

    def __post_init__(self) -> None:
        set_fields(self, R=read_only(self.R, (3, 3)), shift=read_only(self.shift, (3,)))
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise MovementError(f"scale {self.scale}: a movement is scaled by a number greater than 0")
        if not np.allclose(self.R @ self.R.T, np.eye(3), atol=1e-9) or np.linalg.det(self.R) < 0.0:
            raise MovementError(
                "the rotation of a similarity must be a proper rotation matrix (orthonormal, determinant +1)"
            )
        if not np.all(np.isfinite(self.shift)):
            raise MovementError(f"shift {self.shift.tolist()} m: give finite numbers")

    def points(self, p: Array) -> Array:
        """Points (n, 3), m, where they go."""
        return self.scale * p @ self.R.T + self.shift

    def vectors(self, v: Array) -> Array:
        """Differences of points, velocities, accelerations (n, 3), where they go."""
        return self.scale * v @ self.R.T


def about_z(angle: float) -> Array:
    """The rotation (3, 3) by an angle (rad) about z."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def check_name(name: str) -> None:
    """Raise MovementError for a name that is no file name of the same folder on every system."""
    if not is_file_name(name):
        raise MovementError(
            f"a movement is called {name[:MOST_BYTES]!r}: files are named after it, so give {ALLOWED}"
        )


def check_duration(duration: float, whose: str) -> None:
    """Raise MovementError for a duration outside the range of movements."""
    if not 0.0 < duration <= LONGEST_DURATION:  # NaN is not
        raise MovementError(
            f"{whose} with a duration of {duration:g} s: it must last longer than 0 s, "
            f"and {LONGEST_DURATION:g} s at most"
        )
