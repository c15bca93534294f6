"""Generators of motion: the protocol, and those that stream or stop in joint space.

`step` returns the joint target at the end of the next cycle. A generator begins at the current target and
keeps the rest of its state itself. When `done`, its last target stays in force.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from operator import sub
from typing import Protocol

from ur_emulator.models.robot_model import ZERO6, Vector6, six
from ur_emulator.motion.target import JointTarget

# A joint speed below this counts as standstill: one cycle of it moves a joint by less than an encoder step.
REST_SPEED = 1e-6  # rad/s

# Deceleration of the leading axis when a stream is paused [rad/s^2]. Chosen: what drivers give to stopj.
PAUSE_DECELERATION = 4.0


class Generator(Protocol):
    """A motion, cycle by cycle.

    Attributes:
        done: the motion has reached its goal.
    """

    done: bool

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the target at the end of the next cycle.

        Args:
            target: target at the end of the last cycle.
            dt: duration of a cycle [s].
            scale: speed scaling 0..1 of the trajectory (speed slider).
        """
        ...


def ramp_towards(
    target: JointTarget, qd_goal: Sequence[float], acceleration: float, dt: float
) -> JointTarget:
    """Return the target one cycle on, its velocity moved towards `qd_goal` on a straight line.

    The joint with the greatest change accelerates at `acceleration`; the others arrive together with it
    ("acceleration of the leading axis"). The position is the integral of the linear velocity.

    Args:
        target: target at the end of the last cycle.
        qd_goal: velocity to reach [rad/s], (6,).
        acceleration: of the leading axis [rad/s^2], > 0.
        dt: duration of a cycle [s].
    """
    qd = target.qd
    change = list(map(sub, qd_goal, qd))
    largest = max(map(abs, change))
    reach = acceleration * dt
    if largest <= reach:
        qd_next = six(qd_goal)
        share = 1.0
    else:
        share = reach / largest
        qd_next = six([now + share * delta for now, delta in zip(qd, change, strict=True)])
    half = 0.5 * dt
    per_dt = share / dt
    return JointTarget(
        six([p + half * (a + b) for p, a, b in zip(target.q, qd, qd_next, strict=True)]),
        qd_next,
        six([per_dt * delta for delta in change]),
    )


class Hold:
    """Stands still where the last motion ended."""

    done = True

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the same position, at rest."""
        return target if target.qd is ZERO6 else JointTarget(target.q)


class Streamed:
    """A motion that a script must renew in every cycle."""

    done: bool

    def when_lost(self) -> Generator:
        """Return the generator that stops the arm when the command is not renewed."""
        raise NotImplementedError

    def when_paused(self) -> Generator:
        """Return the generator that stops the arm when the program pauses."""
        return StopJ(PAUSE_DECELERATION)

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """See Generator."""
        raise NotImplementedError


class SpeedJ(Streamed):
    """Accelerate to a joint velocity and keep it.

    Source: URScript manual CB3 3.15, speedj (semantics since 3.2): linear acceleration of the leading axis,
    then constant speed. `done` means that the velocity is reached; the motion continues until another one
    replaces it.
    """

    def __init__(self, qd: Vector6, a: float) -> None:
        self.qd = qd
        self.a = a
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the target velocity towards the goal, scaled by the speed slider."""
        goal = self.qd if scale == 1.0 else six([scale * x for x in self.qd])
        after = ramp_towards(target, goal, self.a, dt)
        self.done = after.qd == goal
        return after

    def when_lost(self) -> Generator:
        """Stop with the acceleration of the last command."""
        return StopJ(self.a)


class StopJ:
    """Decelerate all joints to rest, the leading axis at `a`. Source: URScript manual CB3 3.15, stopj.

    Attributes:
        a: deceleration that is asked for [rad/s^2].
        allowed: the greatest that is allowed in the next cycle [rad/s^2].
    """

    def __init__(self, a: float) -> None:
        self.a = a
        self.allowed = inf
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the target velocity towards zero; the speed slider does not soften a stop."""
        after = ramp_towards(target, ZERO6, min(self.a, self.allowed), dt)
        self.done = max(map(abs, after.qd)) <= REST_SPEED
        return JointTarget(after.q) if self.done else after
