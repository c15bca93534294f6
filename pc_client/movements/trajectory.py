"""What makes a movement: a closed form of position, velocity and acceleration in time; its transformations.

The five forms are the modules beside this one: `sigma_lognormal`, `uniform`, `minimum_jerk`, `power_law`,
`samples`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError
from pc_client.files import ALLOWED, MOST_BYTES, is_file_name

LONGEST_DURATION = 1200.0
"""No movement lasts longer [s]: its recording could not be read back (`pc_client.files`)."""


class Motion(NamedTuple):
    """Position (m), velocity (m/s) and acceleration (m/s^2), each (n, 2) or (n, 3)."""

    p: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]


class Trajectory(Protocol):
    """What makes a movement: a closed form of position, velocity and acceleration in time."""

    @property
    def duration(self) -> float:
        """Total time, s."""
        ...

    @property
    def target_points(self) -> NDArray[np.float64]:
        """(n, 3), m."""
        ...

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s."""
        ...

    def transformed(self, similarity: Similarity) -> Trajectory:
        """The same movement elsewhere."""
        ...

    def stretched(self, factor: float) -> Trajectory:
        """The same movement, slower."""
        ...


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


def read_only(values: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    if shape is not None:
        array = array.reshape(shape)
    array.setflags(write=False)
    return array


def check_name(name: str) -> None:
    """Refuse a name that is no file name of the same folder on every system.

    Raises:
        MovementError: saying what is allowed.
    """
    if not is_file_name(name):
        raise MovementError(
            f"a movement is called {name[:MOST_BYTES]!r}: files are named after it, so give {ALLOWED}"
        )


def check_duration(duration: float, whose: str) -> None:
    """Refuse a duration outside the range of movements.

    Raises:
        MovementError: saying what is allowed.
    """
    if not 0.0 < duration <= LONGEST_DURATION:  # NaN is not
        raise MovementError(
            f"{whose} with a duration of {duration:g} s: it must last longer than 0 s, "
            f"and {LONGEST_DURATION:g} s at most"
        )
