"""Speed along a path: the fastest plan within the limits of all its parts.

A plan is made in z, the square of the speed: at a constant acceleration z is a straight line over the length,
z' = 2 a. A curve from the end backwards gives the greatest z from which the arm can stop at the end; one from
the beginning forwards gives the greatest z that the arm can reach. The plan is the lowest of both and the
limits.

On a curved path a part of the acceleration changes the direction: a - b z remains along the path, with the
bend b per unit of length. Units are those of the path.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import inf, sqrt
from typing import NamedTuple

# Factor for rounding when a speed is compared with the curve from the end.
_ROUNDING = 1.0 + 1e-9

# Corners of a plan that are closer than this share of an interval are one corner.
_NOTHING = 1e-12


class Interval(NamedTuple):
    """Part of a path with constant limits.

    Attributes:
        length: of the part, above 0.
        cap: greatest square of the speed, above 0.
        bounds: pairs (a, b): the acceleration along the path is at most a - b z, for all of them.
    """

    length: float
    cap: float
    bounds: tuple[tuple[float, float], ...]

    def slope(self, z: float) -> float:
        """Return the greatest constant change of z per length, away from an end where it is `z`.

        The bounds hold up to the other end, or up to the cap where that comes first.
        """
        least = inf
        for a, b in self.bounds:
            slope = a
            if b > 0.0:
                # Where z is largest, the bound is tightest.
                slope = max(a - b * self.cap, (a - b * z) / (1.0 + 2.0 * self.length * b))
            if slope < least:
                least = slope
        return 2.0 * least if least > 0.0 else 0.0


class Phase(NamedTuple):
    """Part of a plan at constant acceleration: it begins at `s` with speed `v`."""

    s: float
    v: float
    a: float


@dataclass(frozen=True, slots=True)
class SpeedPlan:
    """Length and speed over time; `times` are when each phase begins, the first at 0."""

    phases: tuple[Phase, ...]
    times: tuple[float, ...]
    duration: float
    length: float

    def at(self, t: float) -> tuple[float, float]:
        """Return length travelled and speed at a time; at rest at the end from the end on."""
        if t >= self.duration:
            return self.length, 0.0
        k = max(0, bisect_right(self.times, t) - 1)
        s, v, a = self.phases[k]
        dt = t - self.times[k]
        return s + (v + 0.5 * a * dt) * dt, max(0.0, v + a * dt)


class StoppingCurve(NamedTuple):
    """The greatest squares z of the speed from which the path can still come to rest at a point.

    The knots are lengths, rising; the last is the point. Between them are straight lines.
    """

    knots: tuple[float, ...]
    z: tuple[float, ...]

    def can_stop(self, s: float, speed: float) -> bool:
        """Return whether an arm at `s` with a speed can stop at the point."""
        if s >= self.knots[-1]:
            return False
        k = max(1, bisect_right(self.knots, s))
        s0, s1, z0, z1 = self.knots[k - 1], self.knots[k], self.z[k - 1], self.z[k]
        return speed * speed <= (z0 + (z1 - z0) * (s - s0) / (s1 - s0)) * _ROUNDING


def plan(intervals: Sequence[Interval], entry: float) -> SpeedPlan | None:
    """Return the fastest plan that comes to rest at the end; None if the path begins too fast."""
    backward, slopes = _backward(intervals)
    z = entry * entry
    if z > backward[0] * _ROUNDING:
        return None
    z = min(z, backward[0])
    phases: list[Phase] = []
    times: list[float] = []
    time = begin = 0.0
    for interval, z_end, down in zip(intervals, backward[1:], slopes, strict=True):
        done = 0.0
        for end, z_next in _shape(interval, z, z_end, down):
            length = end - done
            if length > _NOTHING * interval.length:
                v = sqrt(z)
                phases.append(Phase(begin + done, v, 0.5 * (z_next - z) / length))
                times.append(time)
                time += 2.0 * length / (v + sqrt(z_next))
                done = end
            z = z_next
        begin += interval.length
    return SpeedPlan(tuple(phases), tuple(times), time, begin)


def stopping_curve(intervals: Sequence[Interval], stop: float) -> StoppingCurve:
    """Return the greatest speeds from which the arm can stop at a point of a path."""
    cut: list[Interval] = []
    knots = [0.0]
    for interval in intervals:
        length = min(interval.length, stop - knots[-1])
        if length <= 0.0:
            break
        cut.append(interval._replace(length=length))
        knots.append(knots[-1] + length)
    return StoppingCurve(tuple(knots), tuple(_backward(cut)[0]))


def _backward(intervals: Sequence[Interval]) -> tuple[list[float], list[float]]:
    """Return z at the ends of the intervals from which the arm can still stop, and the slopes between."""
    z = 0.0
    found, slopes = [z], []
    for k in range(len(intervals) - 1, -1, -1):
        interval = intervals[k]
        slope = interval.slope(z)
        z = min(z + slope * interval.length, interval.cap, intervals[k - 1].cap if k > 0 else inf)
        found.append(z)
        slopes.append(slope)
    found.reverse()
    slopes.reverse()
    return found, slopes


def _shape(interval: Interval, z: float, z_end: float, down: float) -> list[tuple[float, float]]:
    """Return the corners (length, z) of a plan within one interval: rising, at the cap, falling.

    `z_end` is the greatest z at its end, `down` the greatest slope towards it.
    """
    length, cap, _ = interval
    up = interval.slope(z)
    peak = length
    if up + down > 0.0:
        peak = min(length, max(0.0, (z_end + down * length - z) / (up + down)))
    z_peak = z + up * peak
    if z_peak > cap:
        first = (cap - z) / up
        last = length - (cap - z_end) / down if cap > z_end else length
        return [(first, cap), (last, cap), (length, z_end)]
    return [(peak, z_peak), (length, z_end)] if peak < length else [(length, min(z_peak, z_end))]


class SmoothPlan:
    """A plan whose acceleration has no steps: the jerk is limited.

    The length at a time is the mean of that of another plan over the time before it: over `window` [s], above
    0, in which the acceleration changes. So the path and its end stay as they are, speed and acceleration do
    not become greater, and a step of the acceleration becomes a ramp.
    """

    def __init__(self, plan: SpeedPlan, window: float) -> None:
        self._plan = plan
        self._window = window
        self.duration = plan.duration + window
        ends = (*plan.times[1:], plan.duration)
        parts = [
            _area(phase.s, phase.v, phase.a, end - begin)
            for phase, begin, end in zip(plan.phases, plan.times, ends, strict=True)
        ]
        # Integral of the length over the time at the beginning of each phase, and at the end.
        self._areas = (0.0, *accumulate(parts))

    def at(self, t: float) -> tuple[float, float]:
        """Return length travelled and speed at a time; at rest at the end from the end on."""
        if t >= self.duration:
            return self._plan.length, 0.0
        before = t - self._window
        s0 = self._plan.at(before)[0] if before > 0.0 else 0.0
        s = self._plan.at(t)[0]
        return (self._area(t) - self._area(before)) / self._window, (s - s0) / self._window

    def _area(self, t: float) -> float:
        """Return the integral of the length from the beginning to a time [unit s]."""
        plan = self._plan
        if t <= 0.0:
            return 0.0
        if t >= plan.duration:
            return self._areas[-1] + plan.length * (t - plan.duration)
        k = max(0, bisect_right(plan.times, t) - 1)
        s, v, a = plan.phases[k]
        return self._areas[k] + _area(s, v, a, t - plan.times[k])


def _area(s: float, v: float, a: float, t: float) -> float:
    return (s + (0.5 * v + a * t / 6.0) * t) * t
