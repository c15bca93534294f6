"""The blend between two moves: a curve from r before the waypoint to r behind it, tangent to both.

There are three shapes. Between two moves of the tool it is a cubic in position and orientation relative to
the waypoint; between straight lines that is a parabola, the path of a constant acceleration. Between two
straight process moves (movep) it is a circular arc, on which the speed stays constant. If one of the moves is
a joint move, it is a cubic in joint space.
Source: URScript manual CB3 3.15, `r` of the moves, "circular blends" of movep; the other shapes are chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, cos, dist, hypot, pi, sin, sqrt, tan

from protocol.pose import Pose, pose_add, pose_sub
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.motion.leg import Leg
from ur_emulator.machine.motion.path import JointLine, JointPath, PoseLine, PosePath, ToolPath, measure, times
from ur_emulator.machine.motion.path_samples import JOINT_SPEED_SHARE, Sample, reaches_end, sample_path
from ur_emulator.machine.motion.tool import UnreachableError
from ur_hil.arithmetic import add_up

# Above this angle the arc of a movep would be too narrow: the cubic is used [rad].
_SHARPEST_ARC = 0.9 * pi
_STRAIGHT = 1e-6  # m/m
_SAMPLES = 8  # intervals of a blend, for its greatest speed
# Where the lengths before and behind the waypoint differ by a greater factor, a blend of two joint moves is
# shaped as if they differed by this one: else the curve overshoots.
_GREATEST_RATIO = 3.0

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Blend:
    """A blend; it begins and ends with the velocities of the two moves.

    Attributes:
        path: the curve, in units of the first move.
        leave: where on the first move it begins.
        enter: where on the second move it ends.
        scale: units of the first move per unit of the second.
        v: greatest speed, in units of the first move.
        a: greatest acceleration of what `path.rate` and `path.bend` measure.
        samples: of a path of the tool.
    """

    path: JointPath
    leave: float
    enter: float
    scale: float
    v: float
    a: float
    samples: tuple[Sample, ...] = ()


def blend(first: Leg, second: Leg, r: float, most: float) -> Blend | None:
    """Return the blend of two moves around the waypoint between them.

    None when there is no length to blend, or the arm cannot follow the curve.

    Args:
        r: radius [m]; reduced where it covers more than half of the second move.
        most: how much of the end of the first move it may replace.
    """
    before = first.last_part(r, most)
    after = second.first_part(r, 0.5 * second.path.length)
    if before <= 0.0 or after <= 0.0 or first.goal is None:
        return None
    a, b, tool = first.path, second.path, first.tool
    if isinstance(a, ToolPath) and isinstance(b, ToolPath):
        # As long before the waypoint as behind it, so the speed is the same at both ends of the curve.
        enter = min(before, after)
        leave = a.length - enter
        curve = _tool_curve(first, second, a.path, b.path, leave, enter)
        v = max(first.v, second.v)
        samples = sample_path(curve, tool, first.near(leave), v)
        if not reaches_end(samples, curve.length, tool.arm.robot):
            return None
        limit = min(first.a, second.a)
        return Blend(ToolPath(curve, tool), leave, enter, 1.0, v / curve.rate, limit, samples)
    if isinstance(b, ToolPath) and (not second.samples or second.samples[-1].s < after):
        return None
    leave = a.length - before
    try:
        (start_q, slope), (end_q, end_slope) = first.at(leave), second.at(after)
    except UnreachableError:
        return None
    if isinstance(a, ToolPath) or isinstance(b, ToolPath):
        scale, length, end_length = before / after, 2.0 * before, 2.0 * after
    else:
        scale, length = 1.0, min(before + after, _GREATEST_RATIO * min(before, after))
        end_length = length
    cubic = Cubic.between(start_q, times(length, slope), end_q, times(end_length, end_slope))
    joint_curve = JointCurve(cubic, length)
    v = max(first.v, scale * second.v)
    if scale == 1.0 and isinstance(a, JointLine):
        v /= joint_curve.rate
    for speed, most in zip(joint_curve.speeds, tool.arm.robot.qd_max, strict=True):
        v = min(v, JOINT_SPEED_SHARE * most / speed) if speed > 0.0 else v
    limit = min(leg.a for leg in (first, second) if isinstance(leg.path, JointLine))
    return Blend(joint_curve, leave, after, scale, v, limit)


def _tool_curve(
    first: Leg, second: Leg, a: PosePath, b: PosePath, leave: float, enter: float
) -> PoseCurve | PoseCorner:
    (start, slope), (end, end_slope) = a.at(leave), b.at(enter)
    waypoint, length = first.goal_pose, 2.0 * enter
    if first.process and second.process and isinstance(a, PoseLine) and isinstance(b, PoseLine):
        corner = _corner(start, slope, end, end_slope, waypoint)
        if corner is not None:
            return corner
    cubic = Cubic.between(
        pose_sub(start, waypoint), times(length, slope), pose_sub(end, waypoint), times(length, end_slope)
    )
    return PoseCurve(cubic, waypoint, length)


@dataclass(frozen=True, slots=True)
class Cubic:
    """The shape of all blends: c0 + c1 u + c2 u^2 + c3 u^3 for u in 0..1, in any number of coordinates."""

    c0: Vector
    c1: Vector
    c2: Vector
    c3: Vector

    @classmethod
    def between(
        cls, start: Sequence[float], slope: Sequence[float], end: Sequence[float], end_slope: Sequence[float]
    ) -> Cubic:
        """Return the curve with these values and derivatives at u = 0 and u = 1 (Hermite's form)."""
        difference = [b - a for a, b in zip(start, end, strict=True)]
        return cls(
            tuple(start),
            tuple(slope),
            tuple(3.0 * w - 2.0 * a - b for w, a, b in zip(difference, slope, end_slope, strict=True)),
            tuple(a + b - 2.0 * w for w, a, b in zip(difference, slope, end_slope, strict=True)),
        )

    def at(self, u: float) -> tuple[Vector, Vector]:
        """Return the point and the derivative with respect to u."""
        rows = list(zip(self.c0, self.c1, self.c2, self.c3, strict=True))
        return (
            tuple(a + u * (b + u * (c + u * d)) for a, b, c, d in rows),
            tuple(b + u * (2.0 * c + u * 3.0 * d) for _, b, c, d in rows),
        )

    def fastest(self) -> Vector:
        """Return for each coordinate the greatest absolute value of the derivative."""
        found = []
        for b, c, d in zip(self.c1, self.c2, self.c3, strict=True):
            values = [b, b + 2.0 * c + 3.0 * d]
            if d != 0.0 and 0.0 < -c / (3.0 * d) < 1.0:
                values.append(b - c * c / (3.0 * d))
            found.append(max(map(abs, values)))
        return tuple(found)

    def bends(self) -> tuple[Vector, Vector]:
        """Return the second derivatives at both ends; in between it is a mixture of them."""
        return (
            tuple(2.0 * c for c in self.c2),
            tuple(2.0 * c + 6.0 * d for c, d in zip(self.c2, self.c3, strict=True)),
        )


class JointCurve:
    """A cubic in joint space, in the units of the first move of a blend.

    `speeds` (6,) are the greatest speeds of the joints when s moves at 1.
    """

    def __init__(self, cubic: Cubic, length: float) -> None:
        self._cubic = cubic
        self.length = length
        self.speeds = six([x / length for x in cubic.fastest()])
        self.rate = max(self.speeds)
        self.bend = max(abs(x) for bend in cubic.bends() for x in bend) / length**2

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """Return joint angles and their derivative at s."""
        q, slope = self._cubic.at(s / self.length)
        return six(q), six([k / self.length for k in slope])


class PoseCurve:
    """A cubic in position and rotation vector relative to a waypoint; s is proportional to its parameter."""

    def __init__(self, cubic: Cubic, waypoint: Pose, length: float) -> None:
        self._cubic = cubic
        self._waypoint = waypoint
        self.length = length
        self.rate = _fastest(self)
        self.bend = max(map(measure, cubic.bends())) / length**2

    def at(self, s: float) -> tuple[Pose, Vector6]:
        """Return the pose and the twist at s."""
        value, slope = self._cubic.at(s / self.length)
        twist = (*slope[:3], *_turn_rate(value[3:], slope[3:]))
        return pose_add(value, self._waypoint), times(1.0 / self.length, twist)


class PoseCorner:
    """A circular arc between two lines; the orientation follows a cubic."""

    def __init__(
        self, start: Pose, u: Vector, w: Vector, radius: float, angle: float, turn: Cubic, waypoint: Pose
    ) -> None:
        self._start = start
        self._u, self._w = u, w  # unit vectors: along the first line, and towards the centre
        self._radius = radius
        self._turn = turn
        self._waypoint = waypoint
        self.length = radius * angle
        self.rate = _fastest(self)
        turning = max(measure((0.0, 0.0, 0.0, *bend)) for bend in turn.bends())
        self.bend = max(1.0 / radius, turning / self.length**2)

    def at(self, s: float) -> tuple[Pose, Vector6]:
        """Return the pose and the twist at s."""
        phi = s / self._radius
        sine, rise = self._radius * sin(phi), self._radius * (1.0 - cos(phi))
        x, y, z = (p + sine * u + rise * w for p, u, w in zip(self._start[:3], self._u, self._w, strict=True))
        vx, vy, vz = (cos(phi) * u + sin(phi) * w for u, w in zip(self._u, self._w, strict=True))
        value, slope = self._turn.at(s / self.length)
        turned = pose_add((0.0, 0.0, 0.0, *value), (0.0, 0.0, 0.0, *self._waypoint[3:]))
        rx, ry, rz = (k / self.length for k in _turn_rate(value, slope))
        return (x, y, z, *turned[3:]), (vx, vy, vz, rx, ry, rz)


def _fastest(path: PosePath) -> float:
    """Return the greatest speed of the pose on a path when s moves at 1."""
    return max(measure(path.at(path.length * k / _SAMPLES)[1]) for k in range(_SAMPLES + 1))


def _corner(start: Pose, slope: Vector6, end: Pose, end_slope: Vector6, waypoint: Pose) -> PoseCorner | None:
    """Return the arc tangent to two lines; None if it would be too narrow, or a line is mainly a rotation."""
    d1, d2 = slope[:3], end_slope[:3]
    r, r2 = dist(start[:3], waypoint[:3]), dist(end[:3], waypoint[:3])
    # The speed is constant only where s is the path length of the tool on both lines.
    if abs(hypot(*d1) - 1.0) > _STRAIGHT or abs(hypot(*d2) - 1.0) > _STRAIGHT or min(r, r2) <= 0.0:
        return None
    if abs(r - r2) > 1e-6 * min(r, r2):
        return None
    cosine = add_up(x * y for x, y in zip(d1, d2, strict=True))
    angle = acos(max(-1.0, min(1.0, cosine)))
    if angle < 1e-4 or angle > _SHARPEST_ARC:
        return None
    w = tuple((y - cosine * x) / sin(angle) for x, y in zip(d1, d2, strict=True))
    radius = min(r, r2) / tan(0.5 * angle)
    length = radius * angle
    turn = Cubic.between(
        pose_sub(start, waypoint)[3:],
        [length * k for k in slope[3:]],
        pose_sub(end, waypoint)[3:],
        [length * k for k in end_slope[3:]],
    )
    return PoseCorner(start, d1, w, radius, angle, turn, waypoint)


def _turn_rate(rotvec: Sequence[float], slope: Sequence[float]) -> tuple[float, float, float]:
    """Return the angular velocity in base axes of a rotation vector that changes at `slope`.

    The left Jacobian of SO(3).
    """
    x, y, z = rotvec
    theta2 = x * x + y * y + z * z
    if theta2 < 1e-8:
        b, c = 0.5 - theta2 / 24.0, 1.0 / 6.0 - theta2 / 120.0
    else:
        theta = sqrt(theta2)
        b, c = (1.0 - cos(theta)) / theta2, (theta - sin(theta)) / (theta2 * theta)
    i, j, k = slope
    px, py, pz = y * k - z * j, z * i - x * k, x * j - y * i
    return (
        i + b * px + c * (y * pz - z * py),
        j + b * py + c * (z * px - x * pz),
        k + b * pz + c * (x * py - y * px),
    )
