"""Segments of the path of a chain of moves: parts of moves and the blends between them, with their limits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, inf, sqrt

from ur_emulator.models.robot_model import RobotModel
from ur_emulator.motion.blend import Blend
from ur_emulator.motion.joint_path import JointCurve, JointPath
from ur_emulator.motion.leg import Leg
from ur_emulator.motion.path_samples import JOINT_SPEED_SHARE, Limits, Sample, joint_limits
from ur_emulator.motion.speed_plan import Interval

# Longest interval on a curve, in units of 1 / bend, and the greatest number of intervals between two limits.
_SHORT, _MOST = 0.25, 32


@dataclass(frozen=True, slots=True)
class PathSegment:
    """A part of a path.

    Attributes:
        path: in its own unit.
        begin, end: of the part [unit].
        scale: units of the chain per unit of the path.
        leg: the move whose waypoint it leads to.
        limits: of the whole path.
        intervals: the limits within the segment, in units of the chain.
    """

    path: JointPath
    begin: float
    end: float
    scale: float
    leg: Leg
    limits: tuple[Limits, ...]
    intervals: tuple[Interval, ...]

    @property
    def length(self) -> float:
        """Length in units of the chain."""
        return (self.end - self.begin) * self.scale

    def cut(self, *, begin: float | None = None, end: float | None = None) -> PathSegment:
        """Return a shorter segment."""
        begin = self.begin if begin is None else begin
        end = self.end if end is None else end
        intervals = _intervals(self.limits, begin, end, self.scale)
        return replace(self, begin=begin, end=end, intervals=intervals)


def segment_of_leg(leg: Leg, begin: float, scale: float) -> PathSegment:
    """Return a move from a point of its path on."""
    path = leg.path
    limits = _limits(path, leg.v, leg.a, leg.samples, _robot(leg))
    intervals = _intervals(limits, begin, path.length, scale)
    return PathSegment(path, begin, path.length, scale, leg, limits, intervals)


def segment_of_blend(blend: Blend, to: Leg, scale: float) -> PathSegment:
    """Return a blend that leads into a move."""
    path = blend.path
    v = blend.v
    if isinstance(path, JointCurve):
        for speed, most in zip(path.speeds, _robot(to).qd_max, strict=True):
            v = min(v, JOINT_SPEED_SHARE * most / speed) if speed > 0.0 else v
    limits = _limits(path, v, blend.a, blend.samples, _robot(to))
    intervals = _intervals(limits, 0.0, path.length, scale)
    return PathSegment(path, 0.0, path.length, scale, to, limits, intervals)


def _intervals(limits: tuple[Limits, ...], begin: float, end: float, scale: float) -> tuple[Interval, ...]:
    """Return the limits from one point of a path to another, in units of the chain."""
    found: list[Interval] = []
    s = begin
    for limit in limits:
        length = min(limit.end, end) - s
        if length > 0.0:
            bounds = limit.bounds
            # What a bend leaves of the acceleration changes with the speed, so not over long intervals.
            n = min(_MOST, max(1, ceil(length / _SHORT * max(b for _, b in bounds))))
            if scale != 1.0:
                bounds = tuple((scale * a, b / scale) for a, b in bounds)
            found += n * [Interval(length * scale / n, (scale * limit.speed) ** 2, bounds)]
            s = limit.end
    return tuple(found)


def _robot(leg: Leg) -> RobotModel:
    return leg.tool.arm.robot


def _limits(
    path: JointPath, v: float, a: float, samples: tuple[Sample, ...], robot: RobotModel
) -> tuple[Limits, ...]:
    """Return the limits of a path for a speed, an acceleration and the joints."""
    bound = (a / path.rate, path.bend / path.rate)
    speed = min(v, sqrt(a / path.bend) if path.bend > 0.0 else inf)
    found: list[Limits] = []
    for limit in joint_limits(samples, robot):
        slower = min(speed, limit.speed)
        bounds = (bound, *(other for other in limit.bounds if not _is_weaker(other, bound, slower)))
        if found and found[-1][1:] == (slower, bounds):
            found.pop()
        found.append(Limits(limit.end, slower, bounds))
    if not found or found[-1].end < path.length:
        found.append(Limits(path.length, speed, (bound,)))
    return tuple(found)


def _is_weaker(one: tuple[float, float], other: tuple[float, float], speed: float) -> bool:
    """Return whether a bound allows more than another at any speed up to a given one."""
    z = speed * speed
    return one[0] >= other[0] and one[0] - one[1] * z >= other[0] - other[1] * z
