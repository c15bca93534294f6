"""speedl and stopl: the twist of the tool changes linearly to a value and stays there.

Source: URScript manual CB3 3.15, speedl: "accelerate linearly in Cartesian space and continue with constant
tool speed"; `aRot` for the rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from ur_emulator.models.robot_model import ZERO6, Vector6, six
from ur_emulator.motion.generators import PAUSE_DECELERATION, REST_SPEED, Generator, Streamed
from ur_emulator.motion.target import JointTarget
from ur_emulator.motion.tool import Tool

# Least deceleration of the tool when speedl is paused [m/s^2]. Chosen: the moves' default.
PAUSE_LINEAR = 1.2


def twist_towards(now: Sequence[float], goal: Sequence[float], a: float, a_rot: float, dt: float) -> Vector6:
    """Return a twist one cycle on; its linear part changes at most at `a`, its rotation at `a_rot`."""
    return six([*_towards(now[:3], goal[:3], a * dt), *_towards(now[3:], goal[3:], a_rot * dt)])


def _towards(now: Sequence[float], goal: Sequence[float], reach: float) -> list[float]:
    change = [b - a for a, b in zip(now, goal, strict=True)]
    size = hypot(*change)
    if size <= reach:
        return list(goal)
    return [a + reach / size * d for a, d in zip(now, change, strict=True)]


def _advance(target: JointTarget, twist: Vector6, tool: Tool, dt: float) -> JointTarget:
    """Return the target whose tool moves with `twist` at the end of the cycle."""
    ahead = [q + dt * v for q, v in zip(target.q, target.qd, strict=True)]
    qd = tool.rates(ahead, twist) if any(twist) else ZERO6
    return JointTarget(
        six([q + 0.5 * dt * (v + w) for q, v, w in zip(target.q, target.qd, qd, strict=True)]),
        qd,
        six([(w - v) / dt for v, w in zip(target.qd, qd, strict=True)]),
    )


class SpeedL(Streamed):
    """Accelerate the tool to a twist in base axes and keep it; `done` when it is reached."""

    def __init__(self, twist: Vector6, a: float, a_rot: float, tool: Tool) -> None:
        """Take the twist [m/s, rad/s] and the accelerations [m/s^2, rad/s^2]."""
        self._twist = twist
        self._a, self._a_rot = a, a_rot
        self._tool = tool
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the tool's twist towards the goal, scaled by the speed slider."""
        goal = six([scale * x for x in self._twist])
        now = self._tool.twist(target.q, target.qd) if any(target.qd) else ZERO6
        after = twist_towards(now, goal, self._a, self._a_rot, dt)
        self.done = after == goal
        return _advance(target, after, self._tool, dt)

    def when_lost(self) -> Generator:
        """Stop with the accelerations of the last command."""
        return StopL(self._a, self._a_rot, self._tool)

    def when_paused(self) -> Generator:
        """Stop in the direction of the tool, at least with the decelerations of a pause."""
        return StopL(max(self._a, PAUSE_LINEAR), max(self._a_rot, PAUSE_DECELERATION), self._tool)


class StopL:
    """Decelerate the tool to rest. Source: URScript manual CB3 3.15, stopl."""

    def __init__(self, a: float, a_rot: float, tool: Tool) -> None:
        """Take the decelerations [m/s^2, rad/s^2]."""
        self._a, self._a_rot = a, a_rot
        self._tool = tool
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the tool's twist towards zero; the speed slider does not soften a stop."""
        if not any(target.qd):
            self.done = True
            return JointTarget(target.q)
        now = self._tool.twist(target.q, target.qd)
        after = _advance(target, twist_towards(now, ZERO6, self._a, self._a_rot, dt), self._tool, dt)
        self.done = max(map(abs, after.qd)) <= REST_SPEED
        return JointTarget(after.q) if self.done else after
