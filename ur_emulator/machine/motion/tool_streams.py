"""Streams and stops of the tool: its twist changes linearly to a value and stays there, or to rest.

Source: URScript manual CB3 3.15, speedl: "accelerate linearly in Cartesian space and continue with constant
tool speed"; `aRot` for the rotation. That the line is held over any distance is chosen.
"""

from collections.abc import Sequence
from math import hypot
from typing import ClassVar

from protocol.pose import Pose, pose_add, pose_sub
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion.generators import PAUSE_DECELERATION, Generator, JointTarget, Kind, Streamed
from ur_emulator.machine.motion.tool import Tool

# Least deceleration of the tool when speedl is paused [m/s^2]. Chosen: the moves' default.
PAUSE_LINEAR = 1.2

# The tool returns to its line with this time constant [s]; chosen: some cycles of every generation. A joint
# at a singularity cannot follow: the distance that it has to catch up is bounded [m, rad].
CATCH_UP_TIME = 0.05
MAX_LAG = (1e-3, 1e-2)


def twist_towards(now: Sequence[float], goal: Sequence[float], a: float, a_rot: float, dt: float) -> Vector6:
    """Return a twist one cycle on; its linear part changes at most at `a`, its rotation at `a_rot`."""
    return six([*_towards(now[:3], goal[:3], a * dt), *_towards(now[3:], goal[3:], a_rot * dt)])


def _towards(now: Sequence[float], goal: Sequence[float], reach: float) -> list[float]:
    change = [b - a for a, b in zip(now, goal, strict=True)]
    size = hypot(*change)
    if size <= reach:
        return list(goal)
    return [a + reach / size * d for a, d in zip(now, change, strict=True)]


class ToolCourse:
    """Where the tool should be under the twists that were asked for: their integral, from where it began.

    Joint speeds that give a twist only at the ends of the cycles let the tool drift off its line, so the
    joints are held to the integrated pose. One course goes on from command to command of the same tool.
    """

    def __init__(self, tool: Tool) -> None:
        self.tool = tool
        self._pose: Pose = ZERO6
        self._twist = ZERO6
        self._last: JointTarget | None = None

    def twist_at(self, target: JointTarget) -> Vector6:
        """Return the twist of the tool; the course begins anew at a target that is not its own."""
        if target is not self._last:
            self._last = target
            self._pose = self.tool.pose(target.q)
            self._twist = self.tool.twist(target.q, target.qd) if any(target.qd) else ZERO6
        return self._twist

    def step(self, target: JointTarget, twist: Vector6, dt: float) -> JointTarget:
        """Return the target at the end of a cycle in which the twist changes linearly to `twist`."""
        tool = self.tool
        pose = tool.pose(target.q)
        before = self.twist_at(target)
        lag = pose_sub(self._pose, pose)
        lag = six([*_towards(ZERO6[:3], lag[:3], MAX_LAG[0]), *_towards(ZERO6[:3], lag[3:], MAX_LAG[1])])
        way = [0.5 * dt * (v + w) for v, w in zip(before, twist, strict=True)]
        self._pose = pose_add(way, pose_add(lag, pose))
        self._twist = twist
        qd = ZERO6
        if any(twist):
            ahead = [q + dt * v for q, v in zip(target.q, target.qd, strict=True)]
            qd = tool.rates(ahead, [w + error / CATCH_UP_TIME for w, error in zip(twist, lag, strict=True)])
        self._last = target.continued(qd, dt)
        return self._last


class SpeedL(Streamed):
    """Accelerate the tool to a twist in base axes and keep it; `done` when it is reached."""

    def __init__(self, twist: Vector6, a: float, a_rot: float, tool: Tool) -> None:
        """Take the twist [m/s, rad/s] and the accelerations [m/s^2, rad/s^2]."""
        self._twist = twist
        self._a, self._a_rot = a, a_rot
        self.course = ToolCourse(tool)

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the tool's twist towards the goal, in the time of the speed slider."""
        was, twist = self.rescale(scale), ZERO6
        if scale > 0.0:
            unscaled = six([x / was for x in self.course.twist_at(target)])
            unscaled = twist_towards(unscaled, self._twist, self._a, self._a_rot, scale * dt)
            self.done = unscaled == self._twist
            twist = six([scale * x for x in unscaled])
        return self.course.step(target, twist, dt)

    def when_replaced(self, by: Generator) -> None:
        """A command of the same tool goes on from the pose that this one should have reached."""
        super().when_replaced(by)
        if isinstance(by, SpeedL | StopL) and by.course.tool == self.course.tool:
            by.course = self.course

    def when_lost(self) -> Generator:
        """Stop with the accelerations of the last command."""
        return StopL(self._a, self._a_rot, self.course.tool, self.course)

    def when_paused(self) -> Generator:
        """Stop in the direction of the tool, at least with the decelerations of a pause."""
        a, a_rot = max(self._a, PAUSE_LINEAR), max(self._a_rot, PAUSE_DECELERATION)
        return StopL(a, a_rot, self.course.tool, self.course)


class StopL:
    """Decelerate the tool to rest. Source: URScript manual CB3 3.15, stopl."""

    kind: ClassVar[Kind] = Kind.STOP

    def __init__(self, a: float, a_rot: float, tool: Tool, course: ToolCourse | None = None) -> None:
        """Take the decelerations [m/s^2, rad/s^2], and the course that the tool is on, if there is one."""
        self._a, self._a_rot = a, a_rot
        self.course = course or ToolCourse(tool)
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the tool's twist towards zero; the speed slider does not soften a stop."""
        if not any(target.qd):
            self.done = True
            return JointTarget(target.q)
        twist = twist_towards(self.course.twist_at(target), ZERO6, self._a, self._a_rot, dt)
        after = self.course.step(target, twist, dt)
        self.done = after.is_at_rest
        return JointTarget(after.q) if self.done else after
