"""Paths in joint space: a straight line, a cubic, or a path of the tool through the inverse kinematics.

`at(s, near)` gives the joint angles and their derivative with respect to s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.cubic import Cubic
from ur_emulator.motion.path import LEAST_LENGTH, PosePath
from ur_emulator.motion.tool import Tool, UnreachableError


class JointPath(Protocol):
    """A path of the joints; s is radians of the leading axis or metres of the tool.

    Attributes:
        length: greatest s.
        rate: greatest speed when s moves at 1: of the leading axis, or of the tool.
        bend: greatest acceleration when s moves at a constant 1: of the leading axis, or of the tool.
    """

    length: float
    rate: float
    bend: float

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """Return joint angles [rad] and their derivative [rad per unit of s].

        Args:
            s: length travelled.
            near: joint angles close to those at s, for the inverse kinematics [rad].

        Raises:
            UnreachableError: the arm cannot reach that point.
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
        """See JointPath; the end is exactly the goal."""
        if s >= self.length:
            return self._goal, self._share
        return six([p + s * k for p, k in zip(self._start, self._share, strict=True)]), self._share


class JointCurve:
    """A cubic in joint space, in the units of the first move of a blend.

    Attributes:
        speeds: greatest speed of each joint when s moves at 1, (6,).
    """

    def __init__(self, cubic: Cubic, length: float) -> None:
        self._cubic = cubic
        self.length = length
        self.speeds = six([x / length for x in cubic.fastest()])
        self.rate = max(self.speeds)
        self.bend = max(abs(x) for bend in cubic.bends() for x in bend) / length**2

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """See JointPath."""
        q, slope = self._cubic.at(s / self.length)
        return six(q), six([k / self.length for k in slope])


class ToolPath:
    """A path of the tool; s is its length travelled [m]."""

    def __init__(self, path: PosePath, tool: Tool) -> None:
        self.path = path
        self.tool = tool
        self.length = path.length
        self.rate = path.rate
        self.bend = path.bend

    def at(self, s: float, near: Sequence[float]) -> tuple[Vector6, Vector6]:
        """See JointPath."""
        pose, twist = self.path.at(s)
        q = self.tool.joints(pose, near)
        if q is None:
            raise UnreachableError
        return q, self.tool.rates(q, twist)
