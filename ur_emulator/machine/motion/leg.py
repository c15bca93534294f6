"""One move instruction as data: its path, its limits, and the blend it asks for at its end."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import dist, sqrt
from operator import attrgetter

from protocol.pose import Pose
from ur_emulator.machine.models.robot_model import Vector3, Vector6, six
from ur_emulator.machine.motion.path import JointLine, JointPath, PoseLine, PosePath, ToolPath
from ur_emulator.machine.motion.path_samples import Sample, reaches_end, sample_path
from ur_emulator.machine.motion.tool import Tool

# A move is slowed down by at most this factor: keeps its numbers within the range of floats.
_STANDSTILL = 1e12
# Upper bounds of speed and acceleration: above those of all arms, within the range of floats.
_FASTEST, _STRONGEST = 1e6, 1e9
# Points tested from the waypoint outwards to find the border of a blend zone, and bisections then.
_SAMPLES, _HALVINGS = 16, 30
# Joint angles that differ by less are the same solution of the inverse kinematics [rad].
_SAME = 0.01


@dataclass(frozen=True, slots=True)
class Leg:
    """The path of one move instruction to its waypoint, with its limits.

    Attributes:
        path: from the last waypoint to this one.
        tool: kinematics of the tool that moves.
        goal: joint angles at the waypoint [rad]; None if the arm cannot be there.
        goal_pose: pose at the waypoint.
        v, a: speed and acceleration along the path [unit/s, unit/s^2]: of the leading axis in rad, or of the
            tool in m.
        t: duration [s]; above 0 it has priority over `a` and `v`.
        r: blend radius at the waypoint [m]; 0 to end at rest.
        process: the speed stays constant through blends (movep).
        samples: of a path of the tool, up to where the arm can follow it.
        smoothing: time in which the acceleration changes, from rest to rest [s]; 0: it has steps.
        v_max, a_max: greatest that a duration may ask for [unit/s, unit/s^2].
    """

    path: JointPath
    tool: Tool
    goal: Vector6 | None
    goal_pose: Pose
    v: float
    a: float
    t: float = 0.0
    r: float = 0.0
    process: bool = False
    samples: tuple[Sample, ...] = ()
    smoothing: float = 0.0
    v_max: float = _FASTEST
    a_max: float = _STRONGEST

    def at(self, s: float) -> tuple[Vector6, Vector6]:
        """Return the joint angles after the length s and their derivative, or raise UnreachableError."""
        return self.path.at(s, self.near(s))

    def near(self, s: float) -> Vector6:
        """Return joint angles close to those after the length s [rad], for the inverse kinematics."""
        if not self.samples:
            return self.path.at(s, ())[0]
        sample = self.samples[max(0, bisect_right(self.samples, s, key=attrgetter("s")) - 1)]
        return six([q + (s - sample.s) * k for q, k in zip(sample.q, sample.slope, strict=True)])

    def position(self, s: float) -> Vector3:
        """Return the position of the tool after the length s [m]."""
        path = self.path
        return (path.path.at(s)[0] if isinstance(path, ToolPath) else self.tool.pose(path.at(s, ())[0]))[:3]

    def with_duration(self, *, from_blend: bool = False) -> Leg:
        """Return the same leg with `v` and `a` such that it takes `t`, if `t` is given.

        From rest to rest the trapezoid of `a` and `v` is stretched. An end with a blend has no ramp; there
        the speed is chosen for the given acceleration, if that is enough. Where `v_max` or `a_max` is in the
        way, the leg takes longer. Source: URScript manual CB3 3.15, movej: `t` has priority; how is chosen.
        """
        length, t, a = self.path.length, self.t, self.a
        if t <= 0.0 or length <= 0.0:
            return self
        ramps = (not from_blend) + (self.r <= 0.0)
        if ramps == 0:
            v = length / t
        elif ramps == 1:
            a = max(a, 2.0 * length / t**2)
            v = 2.0 * a * length / (a * t + sqrt(max(0.0, (a * t) ** 2 - 2.0 * a * length)))
        else:
            top = min(self.v, sqrt(a * length))
            stretch = min(t / (length / top + top / a), _STANDSTILL)
            v, a = top / stretch, a / stretch**2
            if a > self.a_max:  # with shorter ramps the same time may do
                a = self.a_max
                v = 2.0 * a * length / (a * t + sqrt(max(0.0, (a * t) ** 2 - 4.0 * a * length)))
        return replace(self, v=min(v, self.v_max), a=min(a, self.a_max))

    def starting_at(self, q: Vector6, pose: Pose) -> Leg | None:
        """Return the straight path to the same joint angles from another start, at q [rad].

        None for an arc, since its circle depends on its start, and if the arm would arrive with other joint
        angles.
        """
        path, limits = self.path, {"a": self.a, "v": self.v, "t": self.t, "r": self.r}
        if self.goal is None:
            return None
        if isinstance(path, JointLine):
            leg = move_j(q, self.goal, self.tool, **limits)
        elif isinstance(path, ToolPath) and isinstance(path.path, PoseLine):
            leg = move_tool(PoseLine(pose, self.goal_pose), q, self.tool, **limits, process=self.process)
        else:
            return None
        arrives = leg.goal is not None and all(
            abs(a - b) < _SAME for a, b in zip(leg.goal, self.goal, strict=True)
        )
        return replace(leg, v_max=self.v_max, a_max=self.a_max) if arrives else None

    def last_part(self, r: float, most: float) -> float:
        """Return how much of the path's end is within `r` of the waypoint, at most `most` [unit of s]."""
        end = self.path.length
        return self._part(r, most, lambda d: dist(self.position(end - d), self.goal_pose[:3]))

    def first_part(self, r: float, most: float) -> float:
        """Return how much of the path's beginning is within `r` of its start, at most `most` [unit of s]."""
        start = self.position(0.0)
        return self._part(r, most, lambda d: dist(self.position(d), start))

    def _part(self, r: float, most: float, distance: Callable[[float], float]) -> float:
        path = self.path
        if isinstance(path, ToolPath) and isinstance(path.path, PoseLine):
            rate = path.path.length_rate
            return min(most, r / rate) if rate > 0.0 else most
        return _inside(lambda d: distance(d) <= r, most)


def move_j(
    start: Sequence[float],
    goal: Sequence[float],
    tool: Tool,
    *,
    a: float,
    v: float,
    t: float = 0.0,
    r: float = 0.0,
) -> Leg:
    """Return a move that is linear in joint space: all joints start and stop together.

    Source: URScript manual CB3 3.15, movej. `start` and `goal` are joint angles (6,) [rad]; the limits are
    those of a `Leg`.
    """
    a, v = min(a, _STRONGEST), min(v, _FASTEST)
    return Leg(JointLine(start, goal), tool, six(goal), tool.pose(goal), v, a, t, r)


def move_tool(
    path: PosePath,
    near: Vector6,
    tool: Tool,
    *,
    a: float,
    v: float,
    t: float = 0.0,
    r: float = 0.0,
    process: bool = False,
) -> Leg:
    """Return a move of the tool along a path. Source: URScript manual CB3 3.15, movel, movep, movec.

    `near` are joint angles at its beginning (6,) [rad]; the limits are those of a `Leg`.
    """
    a, v = min(a, _STRONGEST), min(v, _FASTEST)
    length = path.length
    if length <= 0.0:
        return Leg(ToolPath(path, tool), tool, near, tool.pose(near), v, a, t, r, process)
    samples = sample_path(path, tool, near, max(v, 2.0 * length / t) if t > 0.0 else v)
    goal = samples[-1].q if reaches_end(samples, length, tool.arm.robot) else None
    return Leg(ToolPath(path, tool), tool, goal, path.at(length)[0], v, a, t, r, process, samples)


def _inside(holds: Callable[[float], bool], most: float) -> float:
    """Return the greatest d <= most up to which `holds(d)` is true, to a part in 10^9."""
    for k in range(1, _SAMPLES + 1):
        if not holds(most * k / _SAMPLES):
            low, high = most * (k - 1) / _SAMPLES, most * k / _SAMPLES
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if holds(middle) else (low, middle)
            return low
    return most
