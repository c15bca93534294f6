"""Minimum jerk: the movements with the least integral of the squared third derivative over time.

Between two rests this is one polynomial, x = A (10 u^3 - 15 u^4 + 6 u^5) with u = t / T, along a straight
line: a symmetric speed profile with the peak 1.875 A / T. With inner points to pass at given times it
is the quintic spline through them, continuous up to the fourth derivative: the path is rounded, and the
speed does not fall to zero at the points.

Source: T. Flash and N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical
model" (1985).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError
from pc_client.movements.trajectory import Motion, Similarity

#: What happens at the inner target points: come to rest there, or pass through them at their times.
Passing = Literal["stop", "via"]


class StrokeShape(NamedTuple):
    """The unit stroke, each (n,): share of the length done, 0 to 1, and two derivatives in u = t / T."""

    done: Array
    rate: Array
    rate_change: Array


def stroke_shape(u: ArrayLike) -> StrokeShape:
    """The minimum-jerk stroke from 0 to 1 at the times u = t / T, held to [0, 1]."""
    u = np.clip(np.asarray(u, dtype=np.float64), 0.0, 1.0)
    return StrokeShape(
        u**3 * (10.0 - 15.0 * u + 6.0 * u**2),
        30.0 * u**2 * (1.0 - u) ** 2,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )


@dataclass(frozen=True, slots=True)
class MinimumJerk:
    """The minimum-jerk movement along target points.

    Attributes:
        target_points: (n, 3), m, robot base frame; all of them are reached exactly.
        stroke_durations: (n - 1,), s: times from one target point to the next.
        passing: "stop": every stroke runs from rest to rest on a straight line. "via": one movement that
            passes the inner points.
    """

    target_points: Array
    stroke_durations: Array
    passing: Passing = "stop"
    _times: Array = field(init=False, repr=False, compare=False)
    _spline: BSpline | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        targets, durations = read_only(self.target_points), read_only(self.stroke_durations)
        if targets.ndim != 2 or targets.shape[1] != 3 or len(targets) < 2 or not np.all(np.isfinite(targets)):
            raise MovementError(
                f"minimum jerk with target points of shape {targets.shape}: "
                "give n >= 2 finite points of x, y, z"
            )
        if durations.shape != (len(targets) - 1,):
            raise MovementError(
                f"{durations.size} stroke durations for {len(targets)} target points: give {len(targets) - 1}"
            )
        if not (np.all(np.isfinite(durations)) and np.all(durations > 0.0)):
            raise MovementError(f"stroke durations {durations.tolist()} s: give times above 0 s")
        if self.passing not in ("stop", "via"):
            raise MovementError(f'passing "{self.passing}": give "stop" or "via"')
        times = np.concatenate(([0.0], np.cumsum(durations)))
        times[-1] = math.fsum(durations)
        # The Euler-Poisson equation of the jerk says: sixth derivative zero between the points; free velocity
        # and acceleration at a point to pass make everything up to the fourth derivative continuous there. At
        # rest at both ends.
        rest = [(1, np.zeros(3)), (2, np.zeros(3))]
        is_via = self.passing == "via"
        spline = make_interp_spline(times, targets, k=5, bc_type=(rest, rest)) if is_via else None
        set_fields(self, target_points=targets, stroke_durations=durations)
        set_fields(self, _times=read_only(times), _spline=spline)

    @property
    def duration(self) -> float:
        """Total time, s."""
        return float(self._times[-1])

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        times = np.clip(np.atleast_1d(np.asarray(t, dtype=np.float64)), 0.0, self.duration)
        if self._spline is not None:
            return Motion(self._spline(times), self._spline(times, 1), self._spline(times, 2))
        stroke = np.clip(
            np.searchsorted(self._times, times, side="right") - 1, 0, len(self.stroke_durations) - 1
        )
        duration = self.stroke_durations[stroke]
        shape = stroke_shape((times - self._times[stroke]) / duration)
        leg = np.diff(self.target_points, axis=0)[stroke]
        return Motion(
            self.target_points[stroke] + shape.done[:, None] * leg,
            (shape.rate / duration)[:, None] * leg,
            (shape.rate_change / duration**2)[:, None] * leg,
        )

    def transformed(self, similarity: Similarity) -> MinimumJerk:
        """Moved, scaled and rotated; the timing is untouched."""
        return MinimumJerk(similarity.points(self.target_points), self.stroke_durations, self.passing)

    def stretched(self, factor: float) -> MinimumJerk:
        """`factor` times as slow."""
        return MinimumJerk(self.target_points, self.stroke_durations * factor, self.passing)
