"""One generator per kind of motion: `step` gives the joint target at the end of the next cycle.

A generator is started from the target that holds at that moment and keeps the rest of its state itself.
`done` says that it has nothing more to do; the last target it gave then holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.profile import Trapezoid
from ur_emulator.motion.target import ZERO6, JointTarget

# A joint speed below this counts as standstill: one cycle of it moves a joint by less than an encoder step.
REST_SPEED = 1e-6  # rad/s


class Generator(Protocol):
    """A motion under way."""

    @property
    def done(self) -> bool:
        """True when the motion has reached what it was asked for."""
        ...

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

    The joint with the longest way to go changes at `acceleration`; the others arrive together with it
    ("acceleration of the leading axis"). The position is the integral of that linear velocity.

    Args:
        target: target at the end of the last cycle.
        qd_goal: velocity to reach [rad/s], (6,).
        acceleration: of the leading axis [rad/s^2], > 0.
        dt: duration of a cycle [s].
    """
    qd = target.qd
    change = [goal - now for goal, now in zip(qd_goal, qd, strict=True)]
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
    """Stand still where the last motion ended."""

    done = True

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the same position, at rest."""
        return target if target.qd is ZERO6 else JointTarget(target.q)


class MoveJ:
    """Rest-to-rest move, linear in joint space, all joints starting and stopping together.

    Source: URScript manual CB3 3.15, movej. Time on the path is scaled by the speed slider.
    """

    def __init__(
        self, start: Sequence[float], goal: Sequence[float], *, a: float, v: float, t: float = 0.0
    ) -> None:
        """Plan the move.

        Args:
            start: joint positions now [rad], (6,).
            goal: joint positions to reach [rad], (6,).
            a: acceleration of the leading axis [rad/s^2].
            v: speed of the leading axis [rad/s].
            t: duration [s]; above 0 it has priority over `a` and `v`.
        """
        self._start = six(start)
        self.goal = six(goal)
        self._way = six([b - a for a, b in zip(self._start, self.goal, strict=True)])
        distance = max(map(abs, self._way))
        self._profile = Trapezoid.from_limits(distance, v, a)
        if t > 0.0:
            self._profile = Trapezoid.from_duration(distance, t, self._profile)
        self._share = six([d / distance if distance > 0.0 else 0.0 for d in self._way])
        self._time = 0.0
        self.done = self._profile.duration == 0.0

    @property
    def duration(self) -> float:
        """Planned duration at full speed [s]."""
        return self._profile.duration

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Advance on the path by `scale * dt`."""
        self._time += scale * dt
        if self._time >= self._profile.duration:
            self.done = True
            return JointTarget(self.goal)
        s, sd, sdd = self._profile.at(self._time)
        return JointTarget(
            six([p + s * u for p, u in zip(self._start, self._share, strict=True)]),
            six([scale * sd * u for u in self._share]),
            six([scale * scale * sdd * u for u in self._share]),
        )


class SpeedJ:
    """Accelerate to a joint velocity and keep it.

    Source: URScript manual CB3 3.15, speedj (semantics since 3.2): linear acceleration of the leading axis,
    then constant speed. `done` means that the velocity is reached; the motion itself goes on until
    something replaces it.
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


class StopJ:
    """Decelerate all joints to rest, the leading axis at `a`. Source: URScript manual CB3 3.15, stopj."""

    def __init__(self, a: float) -> None:
        self.a = a
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the target velocity towards zero; the speed slider does not soften a stop."""
        after = ramp_towards(target, ZERO6, self.a, dt)
        self.done = max(map(abs, after.qd)) <= REST_SPEED
        return JointTarget(after.q) if self.done else after
