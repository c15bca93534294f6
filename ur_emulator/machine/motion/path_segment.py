"""Segments of the path of a chain of moves: parts of moves and the blends between them, with their limits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import ceil, inf, sqrt

from ur_emulator.machine.motion.blend import Blend
from ur_emulator.machine.motion.leg import Leg
from ur_emulator.machine.motion.path import JointPath
from ur_emulator.machine.motion.path_samples import Limits, joint_limits
from ur_emulator.machine.motion.speed_plan import Interval

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
        limits: of the whole path [unit].
        intervals: the limits within the segment, in units of the chain.
    """

    path: JointPath
    begin: float
    end: float
    scale: float
    leg: Leg
    limits: tuple[Limits, ...]
    intervals: tuple[Interval, ...]

    @classmethod
    def of(cls, piece: Leg | Blend, to: Leg, begin: float, scale: float) -> PathSegment:
        """Return a move or a blend from a point of its path on, as it leads to the waypoint of a move."""
        limits, end = _limits(piece, to), piece.path.length
        return cls(piece.path, begin, end, scale, to, limits, _intervals(limits, begin, end, scale))

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


def intervals_of(segments: Iterable[PathSegment]) -> list[Interval]:
    """Return the intervals of a path that consists of segments."""
    return [interval for segment in segments for interval in segment.intervals]


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


def _limits(piece: Leg | Blend, to: Leg) -> tuple[Limits, ...]:
    """Return the limits of a path for its speed, its acceleration and the joints."""
    path = piece.path
    bound = (piece.a / path.rate, path.bend / path.rate)
    speed = min(piece.v, sqrt(piece.a / path.bend) if path.bend > 0.0 else inf)
    found: list[Limits] = []
    for limit in joint_limits(piece.samples, to.tool.arm.robot):
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
