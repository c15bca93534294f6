"""Paths of the tool and of the joints, as pure functions of the length travelled.

Of the tool: straight line and arc. Orientation turns on the geodesic at a constant rate, on the same
parameter. Sources: URScript manual CB3 3.15, movel and movec. Of the joints: a straight line, or a path of
the tool through the inverse kinematics. Those of blends are in `blend`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, cos, pi, sin, sqrt
from typing import Protocol

from protocol.pose import Pose, pose_add, pose_sub
from ur_emulator.machine.models.robot_model import Vector3, Vector6, six
from ur_emulator.machine.motion.tool import Tool, UnreachableError

# A rotation in place needs a speed too; nothing is published. Chosen: a rotation counts as the path of a
# point at this distance from the tool centre point, if that is longer than the tool's own path [m/rad].
TURN_LEVER = 0.1
# Three points are on a line if the sine of the angle between their chords is below this.
_FLAT = 1e-6
# Points closer than this coincide [m]: the position of the arm is known up to rounding. Chosen: far below the
# repeatability of an arm.
_COINCIDENT = 1e-6
# A length shorter than this is rounding of the kinematics and counts as none [m or rad].
LEAST_LENGTH = 1e-9


class PosePath(Protocol):
    """A path in the space of poses; `measure` gives the size of its velocities and accelerations.

    Attributes:
        length: greatest s [m].
        rate: greatest speed of the pose when s moves at 1; 1 where s is the length itself.
        bend: greatest acceleration of the pose when s moves at a constant 1 [1/m].
    """

    length: float
    rate: float
    bend: float

    def at(self, s: float) -> tuple[Pose, Vector6]:
        """Return the pose at s and its derivative, a twist in base axes per unit of s."""
        ...


def measure(twist: Sequence[float]) -> float:
    """Return the size of a twist, linear first: the greater of its linear part and TURN_LEVER x rotation."""
    x, y, z, rx, ry, rz = twist
    return max(sqrt(x * x + y * y + z * z), TURN_LEVER * sqrt(rx * rx + ry * ry + rz * rz))


def times(k: float, values: Sequence[float]) -> Vector6:
    """Return k times a vector of six."""
    a, b, c, d, e, f = values
    return (k * a, k * b, k * c, k * d, k * e, k * f)


class PoseLine:
    """Straight line from one pose to another.

    `length_rate` is the path length of the tool per unit of s; below 1 where the line is mainly a rotation.
    """

    rate = 1.0
    bend = 0.0

    def __init__(self, start: Sequence[float], goal: Sequence[float]) -> None:
        self._start = start
        self._goal = six(goal)
        self._change = pose_sub(goal, start)
        length = measure(self._change)
        self.length = length if length > LEAST_LENGTH else 0.0
        self._twist = times(1.0 / self.length if self.length > 0.0 else 0.0, self._change)
        self.length_rate = _norm(self._twist)

    def at(self, s: float) -> tuple[Pose, Vector6]:
        """Return the pose and the twist at s; the end is exactly the goal."""
        if s >= self.length:
            return self._goal, self._twist
        return pose_add(times(s / self.length, self._change), self._start), self._twist


class PoseArc:
    """Part of a circle, from a pose through a point to a pose."""

    rate = 1.0

    def __init__(
        self, start: Sequence[float], centre: Vector3, axis: Vector3, angle: float, goal: Pose, *, fixed: bool
    ) -> None:
        """Describe the arc by what `arc_through` finds: its centre [m], and a unit vector as axis.

        The whole angle is above 0 [rad]. `fixed`: the orientation turns with the tangent; that of the goal is
        ignored.
        """
        self._start = start
        self._centre = centre
        self._u = _minus(start, centre)
        self._w = _cross(axis, self._u)
        self._angle = angle
        turn = (axis[0] * angle, axis[1] * angle, axis[2] * angle) if fixed else pose_sub(goal, start)[3:]
        self._turn = turn
        self.length = max(angle * _norm(self._u), 0.0 if fixed else TURN_LEVER * _norm(turn))
        self.bend = _norm(self._u) * (angle / self.length) ** 2
        self._goal = None if fixed else goal

    def at(self, s: float) -> tuple[Pose, Vector6]:
        """Return the pose and the twist at s; the end is exactly the goal, if that has an orientation."""
        share = min(1.0, s / self.length)
        phi = share * self._angle
        sine, cosine = sin(phi), cos(phi)
        k = self._angle / self.length
        vx, vy, vz = (k * (cosine * w - sine * u) for u, w in zip(self._u, self._w, strict=True))
        rx, ry, rz = (value / self.length for value in self._turn)
        twist = (vx, vy, vz, rx, ry, rz)
        if share >= 1.0 and self._goal is not None:
            return self._goal, twist
        x, y, z = (c + cosine * u + sine * w for c, u, w in zip(self._centre, self._u, self._w, strict=True))
        turned = pose_add((0.0, 0.0, 0.0, *(share * value for value in self._turn)), self._start)
        return (x, y, z, *turned[3:]), twist


def arc_through(
    start: Sequence[float], via: Sequence[float], goal: Sequence[float], *, fixed: bool
) -> PosePath:
    """Return the arc from `start` through the position of `via` to `goal`.

    If the points are on a line, or two coincide, there is no circle: the tool moves in a straight line to the
    goal (chosen, not documented). `fixed` is mode 1 of movec: the orientation is fixed to the tangent, the
    goal's rotation is ignored.
    """
    ab, ac = _minus(via, start), _minus(goal, start)
    normal = _cross(ab, ac)
    size = _norm(normal)
    nearest = min(_norm(ab), _norm(ac), _norm(_minus(goal, via)))
    if nearest < _COINCIDENT or size <= _FLAT * _norm(ab) * _norm(ac):
        return PoseLine(start, (*goal[:3], *start[3:]) if fixed else goal)
    axis = (normal[0] / size, normal[1] / size, normal[2] / size)
    # Centre of the circle through three points, seen from the first.
    p, q = _cross(normal, ab), _cross(ac, normal)
    ab2, ac2 = _dot(ab, ab), _dot(ac, ac)
    x, y, z = (o + (ac2 * i + ab2 * j) / (2.0 * size * size) for o, i, j in zip(start[:3], p, q, strict=True))
    centre = (x, y, z)
    u, v = _minus(start, centre), _minus(goal, centre)
    angle = acos(max(-1.0, min(1.0, _dot(u, v) / (_norm(u) * _norm(v)))))
    if _dot(_cross(u, v), axis) < 0.0:
        angle = 2.0 * pi - angle
    return PoseArc(start, centre, axis, angle, six(goal), fixed=fixed)


def _minus(a: Sequence[float], b: Sequence[float]) -> Vector3:
    """Return the way from the position b to a, which may be poses."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _dot(a: Vector3, b: Vector3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _norm(a: Sequence[float]) -> float:
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector3:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class JointPath(Protocol):
    """A path of the joints; s is radians of the leading axis or metres of the tool.

    Its attributes are those of `PosePath`, with `rate` and `bend` of the leading axis, or of the tool.
    """

    length: float
    rate: float
    bend: float

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """Return joint angles [rad] and their derivative [rad per unit of s].

        `near` are joint angles close to those at s [rad], for the inverse kinematics. UnreachableError if the
        arm cannot reach that point.
        """
        ...


class JointLine:
    """Straight line in joint space; s is the angle of the leading axis."""

    rate = 1.0
    bend = 0.0

    def __init__(self, start: Sequence[float], goal: Sequence[float]) -> None:
        self._start = six(start)
        self._goal = six(goal)
        difference = [b - a for a, b in zip(start, goal, strict=True)]
        length = max(map(abs, difference))
        self.length = length if length > LEAST_LENGTH else 0.0
        self._share = six([w / self.length if self.length > 0.0 else 0.0 for w in difference])

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """Return joint angles and their derivative at s; the end is exactly the goal."""
        if s >= self.length:
            return self._goal, self._share
        return six([p + s * k for p, k in zip(self._start, self._share, strict=True)]), self._share


class ToolPath:
    """A path of the tool; s is its length travelled [m]."""

    def __init__(self, path: PosePath, tool: Tool) -> None:
        self.path = path
        self.tool = tool
        self.length = path.length
        self.rate = path.rate
        self.bend = path.bend

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """Return the joint angles that are closest to `near`, and their derivative at s."""
        pose, twist = self.path.at(s)
        q = self.tool.joints(pose, near)
        if q is None:
            raise UnreachableError
        return q, self.tool.rates(q, twist)
