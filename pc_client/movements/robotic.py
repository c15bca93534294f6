"""A robot-like movement: constant speed on every stroke, smoothed to ramps, along straight lines.

The speed is a square wave convolved with one boxcar (trapezoids) or two (S-curves). Length, speed and
acceleration are piecewise polynomials written down in closed form; the convolution has area 1, so the length
of every stroke is kept exactly. `path.py` defines the path.

Source: section II.C; a square wave of the levels l_j / T_j, "smoothed with realistic aspect".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.path import CornerPath
from pc_client.movements.stroke import Motion

__all__ = ["Corners", "PathMotion", "RoboticTrajectory", "SmoothedSquareWave"]

#: What happens at the inner target points: come to rest there, or pass a blended corner with the speed
#: between two levels.
Corners = Literal["stop", "blend"]
#: Of a boxcar [s]; the speed divides by products of two.
_SHORTEST_RAMP = 1e-6


class PathMotion(NamedTuple):
    """Length along the path (m), speed (m/s) and acceleration along the path (m/s^2), each (n,)."""

    s: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SmoothedSquareWave:
    """Levels of speed in windows of time, convolved with boxcars of area 1.

    Attributes:
        windows: (n, 2), s: start and end of each level.
        levels: (n,), m/s.
        ramps: width of the boxcar (s), or of both: the longer one bounds the acceleration by level / width,
            the shorter one bounds the jerk.
    """

    windows: NDArray[np.float64]
    levels: NDArray[np.float64]
    ramps: tuple[float, ...]

    def __post_init__(self) -> None:
        check_ramps(self.ramps)
        object.__setattr__(self, "windows", read_only(self.windows, (-1, 2)))
        object.__setattr__(self, "levels", read_only(self.levels, (-1,)))

    def evaluate(self, t: ArrayLike) -> PathMotion:
        """Length, speed and acceleration at the times t (n,), s."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))[:, None]
        up = _smoothed_step(times - self.windows[:, 0], self.ramps)
        down = _smoothed_step(times - self.windows[:, 1], self.ramps)
        return PathMotion(*((rise - fall) @ self.levels for rise, fall in zip(up, down, strict=True)))


@dataclass(frozen=True, slots=True)
class RoboticTrajectory:
    """The robot-like movement along target points with given stroke durations.

    Attributes:
        target_points: (n, 3), m.
        stroke_durations: (n - 1,), s: the same as those of the human-like twin.
        ramps: boxcar widths, s; their sum must be shorter than every stroke.
        corners: "stop": every stroke is a whole trapezoid that begins and ends at rest, exactly at its target
            points. "blend": the level changes from stroke to stroke, the path rounds each inner target point.
        blend: with "blend" corners, the setback of the blends, m.
    """

    target_points: NDArray[np.float64]
    stroke_durations: NDArray[np.float64]
    ramps: tuple[float, ...]
    corners: Corners = "stop"
    blend: float = 0.0
    path: CornerPath = field(init=False, repr=False, compare=False)
    wave: SmoothedSquareWave = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_ramps(self.ramps)
        if self.corners not in ("stop", "blend"):
            raise MovementError(f'corners "{self.corners}": give "stop" or "blend"')
        if (self.corners == "blend") != (self.blend > 0.0):
            raise MovementError(
                f'blend of {self.blend} m with corners "{self.corners}": '
                '"stop" takes 0, "blend" a length above 0'
            )
        path = CornerPath(self.target_points, self.blend)
        durations = read_only(self.stroke_durations)
        if durations.shape != (len(path.target_points) - 1,):
            raise MovementError(
                f"{durations.size} stroke durations for {len(path.target_points)} target points: "
                f"give {len(path.target_points) - 1}"
            )
        smoothing = sum(self.ramps)
        if not (np.all(np.isfinite(durations)) and np.all(durations > smoothing)):
            raise MovementError(
                f"stroke durations {durations.tolist()} s with ramps {list(self.ramps)} s: "
                f"every stroke must last longer than all ramps together ({smoothing:g} s)"
            )
        object.__setattr__(self, "target_points", path.target_points)
        object.__setattr__(self, "stroke_durations", durations)
        object.__setattr__(self, "path", path)
        object.__setattr__(self, "wave", _square_wave(path, durations, self.ramps, self.corners))

    @property
    def duration(self) -> float:
        """Total time, s: the stroke durations and nothing else; the ramps lie inside."""
        return float(math.fsum(self.stroke_durations))

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        along = self.wave.evaluate(t)
        at = self.path.at(along.s)
        velocity = along.v[:, None] * at.tangent
        acceleration = along.a[:, None] * at.tangent + (along.v**2)[:, None] * at.curvature
        return Motion(at.p, velocity, acceleration)

    def transformed(self, similarity: Similarity) -> RoboticTrajectory:
        """The movement moved, scaled and rotated; its timing is untouched."""
        return RoboticTrajectory(
            similarity.points(self.target_points),
            self.stroke_durations,
            self.ramps,
            self.corners,
            self.blend * similarity.scale,
        )

    def stretched(self, factor: float) -> RoboticTrajectory:
        """The movement `factor` times as slow, ramps included."""
        ramps = tuple(ramp * factor for ramp in self.ramps)
        return RoboticTrajectory(
            self.target_points, self.stroke_durations * factor, ramps, self.corners, self.blend
        )


def check_ramps(ramps: tuple[float, ...]) -> None:
    """Refuse ramps that are not one or two boxcar widths of `_SHORTEST_RAMP` at least."""
    if len(ramps) not in (1, 2) or not all(math.isfinite(ramp) and ramp >= _SHORTEST_RAMP for ramp in ramps):
        raise MovementError(
            f"ramps {list(ramps)} s: give one boxcar width (trapezoids) or two (S-curves), "
            f"{_SHORTEST_RAMP:g} s at least"
        )


def _square_wave(
    path: CornerPath, durations: NDArray[np.float64], ramps: tuple[float, ...], corners: Corners
) -> SmoothedSquareWave:
    """The square wave whose smoothed form runs each stroke's length within the stroke's time."""
    edges = np.concatenate(([0.0], np.cumsum(durations)))
    half = 0.5 * sum(ramps)
    begins, ends = edges[:-1].copy(), edges[1:].copy()
    # Smoothing sticks out by half of the ramps at both ends of a level: a level that must begin or end at
    # rest inside its stroke's time is that much shorter, and that much higher.
    if corners == "stop":
        begins += half
        ends -= half
    else:
        begins[0] += half
        ends[-1] -= half
    return SmoothedSquareWave(
        np.column_stack((begins, ends)), np.diff(path.targets_at) / (ends - begins), ramps
    )


def _smoothed_step(t: NDArray[np.float64], ramps: tuple[float, ...]) -> PathMotion:
    """A unit step at 0 convolved with the boxcars, its integral and its derivative.

    Outside the ramp the values are exact (0, or t, 1, 0), so that no rounding gathers with time.
    """
    half = 0.5 * sum(ramps)
    inside = np.clip(t, -half, half)
    if len(ramps) == 1:
        (width,) = ramps
        x = inside + half
        s, v, a = x**2 / (2.0 * width), x / width, np.full_like(x, 1.0 / width)
    else:
        area = ramps[0] * ramps[1]
        knots = ((0.0, 1.0), (ramps[0], -1.0), (ramps[1], -1.0), (ramps[0] + ramps[1], 1.0))
        parts = [(sign, np.maximum(inside + half - knot, 0.0)) for knot, sign in knots]
        s = sum((sign * x**3 for sign, x in parts), np.zeros_like(inside)) / (6.0 * area)
        v = sum((sign * x**2 for sign, x in parts), np.zeros_like(inside)) / (2.0 * area)
        a = sum((sign * x for sign, x in parts), np.zeros_like(inside)) / area
    over = t >= half
    ramping = np.abs(t) < half
    return PathMotion(np.where(over, t, s), np.where(over, 1.0, v), np.where(ramping, a, 0.0))
