"""A motion of the joints given as (t, q0 .. q5) samples; planning lays a spline through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import MovementError
from pc_client.movements.geometry import read_only
from pc_client.movements.movement import check_duration, check_name

__all__ = ["JOINT_COLUMNS", "MIN_SAMPLES", "JointTrajectory"]

#: Columns of a file; angles in rad, base to wrist 3.
JOINT_COLUMNS = ("t", "q0", "q1", "q2", "q3", "q4", "q5")

#: Fewest samples: a cubic has four coefficients.
MIN_SAMPLES = 4


@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """Joint angles over time, from rest to rest.

    Attributes:
        t: (n,) times [s], increasing; shifted so that the first is 0.
        q: (n, 6) joint angles [rad], base to wrist 3.
        name: as in tables and file names.

    Raises:
        MovementError: shapes, times or values make no sense, or there are fewer than 4 samples.
    """

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    name: str = "joints"

    def __post_init__(self) -> None:
        t, q = read_only(self.t), read_only(self.q)
        check_name(self.name)
        if t.ndim != 1 or q.shape != (len(t), 6):
            raise MovementError(
                f"{self.name}: t {t.shape} and q {q.shape}: give n times and n rows of six angles in rad"
            )
        if len(t) < MIN_SAMPLES:
            raise MovementError(f"{self.name}: {len(t)} samples; give at least {MIN_SAMPLES}")
        bad = np.flatnonzero(~(np.isfinite(t) & np.isfinite(q).all(axis=1)))
        if len(bad):
            raise MovementError(f"{self.name}: sample {bad[0]} is not finite; give finite numbers")
        stalled = np.flatnonzero(np.diff(t) <= 0.0)
        if len(stalled):
            k = int(stalled[0]) + 1
            raise MovementError(
                f"{self.name}: sample {k} is at t = {t[k]:g} s after {t[k - 1]:g} s: times must increase"
            )
        object.__setattr__(self, "t", read_only(t - t[0]))
        object.__setattr__(self, "q", q)
        check_duration(self.duration, self.name)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.t[-1])
