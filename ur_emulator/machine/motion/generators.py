"""Generators of motion: the protocol, and those that stream or stop in joint space.

`step` returns the joint target at the end of the next cycle. A generator begins at the current target and
keeps the rest of its state itself. When `done`, its last target stays in force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from math import inf
from operator import sub
from typing import ClassVar, NamedTuple, Protocol

from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six


class JointTarget(NamedTuple):
    """Set-point of all joints at the end of a control cycle [rad, rad/s]; `qdd` during the cycle [rad/s²]."""

    q: Vector6
    qd: Vector6 = ZERO6
    qdd: Vector6 = ZERO6

    def continued(self, qd: Vector6, dt: float) -> JointTarget:
        """Return the target one cycle of `dt` [s] on, with the velocity `qd` [rad/s], reached linearly."""
        return JointTarget(
            six([q + 0.5 * dt * (v + w) for q, v, w in zip(self.q, self.qd, qd, strict=True)]),
            qd,
            six([(w - v) / dt for v, w in zip(self.qd, qd, strict=True)]),
        )

    @property
    def is_at_rest(self) -> bool:
        """True where all joints are so slow that it counts as standstill."""
        return max(map(abs, self.qd)) <= REST_SPEED


# A joint speed below this counts as standstill: one cycle of it moves a joint by less than an encoder step.
REST_SPEED = 1e-6  # rad/s

# Deceleration of the leading axis when a stream is paused [rad/s^2]. Chosen: what drivers give to stopj.
PAUSE_DECELERATION = 4.0
# Deceleration when no further servoj or torque comes [rad/s^2]. Chosen: that of a program's end.
LOST_DECELERATION = 20.0


class Kind(Enum):
    """What a generator does for the thread that commands it."""

    MOVE = "a move"
    STREAM = "a stream"
    TORQUE = "a torque"
    STOP = "a stop"


class Generator(Protocol):
    """A motion, cycle by cycle, until it is `done`: it has reached its goal."""

    kind: ClassVar[Kind]
    done: bool

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the target at the end of the next cycle from that at the end of the last one.

        `scale` is the speed scaling of the trajectory, 0..1 (speed slider).
        """
        ...


def ramp_towards(
    target: JointTarget, qd_goal: Sequence[float], acceleration: float, dt: float
) -> JointTarget:
    """Return the target one cycle on, its velocity moved towards `qd_goal` [rad/s] on a straight line.

    The joint with the greatest change accelerates at `acceleration` [rad/s²], which is above 0; the others
    arrive together with it ("acceleration of the leading axis"). The position is the integral of the linear
    velocity.
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


class Streamed:
    """A motion that a script must renew in every cycle. Its time is that of the speed slider.

    Source: splines of the maker's driver script, whose live test asks for the whole path at 25 %.

    Attributes:
        a: acceleration of the leading axis, also when it is lost [rad/s^2].
        scale: speed scaling of the last cycle; 0 before the first.
        surplus: scaled time that it has run longer than it was asked to [s].
    """

    kind: ClassVar[Kind] = Kind.STREAM
    done = False
    a = LOST_DECELERATION
    scale = 0.0
    surplus = 0.0

    def fits(self, target: JointTarget, scale: float) -> bool:
        """Return whether the stream can go on from a target.

        An arm that moves by itself at a lowered speed scaling must rest first: in scaled time it would need
        much longer to come to the speed of the stream.
        """
        return self.scale > 0.0 or scale >= 1.0 or not any(target.qd)

    def when_replaced(self, by: Generator) -> None:
        """Hand over to the generator that replaces this one."""
        if isinstance(by, Streamed):
            by.scale, by.surplus = self.scale, self.surplus

    def rescale(self, scale: float) -> float:
        """Take the speed scaling of this cycle; return that of the cycle before it."""
        was, self.scale = self.scale or scale, scale
        return was

    def when_lost(self) -> Generator:
        """Return the generator that stops the arm when the command is not renewed, with its acceleration."""
        return StopJ(self.a)

    def when_paused(self) -> Generator:
        """Return the generator that stops the arm when the program pauses."""
        return StopJ(PAUSE_DECELERATION)

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the target at the end of the next cycle; each stream has its own law."""
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

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the target velocity towards the goal, in the time of the speed slider."""
        was = self.rescale(scale)
        if scale == was == 1.0:
            after = ramp_towards(target, self.qd, self.a, dt)
            self.done = after.qd == self.qd
            return after
        qd = ZERO6
        if scale > 0.0:
            unscaled = JointTarget(target.q, six([v / was for v in target.qd]))
            after = ramp_towards(unscaled, self.qd, self.a, scale * dt)
            self.done = after.qd == self.qd
            qd = six([scale * v for v in after.qd])
        return target.continued(qd, dt)


class StopJ:
    """Decelerate all joints to rest, the leading axis at `a` [rad/s²].

    `allowed` is the greatest deceleration in the next cycle. Source: URScript manual CB3 3.15, stopj.
    """

    kind: ClassVar[Kind] = Kind.STOP

    def __init__(self, a: float) -> None:
        self.a = a
        self.allowed = inf
        self.done = False

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Move the target velocity towards zero; the speed slider does not soften a stop."""
        after = ramp_towards(target, ZERO6, min(self.a, self.allowed), dt)
        self.done = after.is_at_rest
        return JointTarget(after.q) if self.done else after


# Ranges of the manual; values outside are limited to them.
LOOKAHEAD = (0.03, 0.2)  # s
GAIN = (100.0, 2000.0)  # 1/s^2


class ServoJ(Streamed):
    """Move the joints towards a position that is commanded anew in every cycle; it never ends by itself.

    Source: URScript manual CB3 3.15, servoj: `gain` is "the proportional gain for following the target
    position", and `lookahead_time` "projects the current position forward in time with the current velocity";
    a long one "prevents overshoot". As an equation: qdd = gain (q_goal - (q + lookahead qd)). Its lag behind
    a moving goal is the lookahead time, which users measure (plus the delay of the arm). Where a goal moves
    faster than a joint can, the joint follows at its rated speed: the maker's tests stream such goals and
    expect the arm to arrive.
    """

    def __init__(self, q: Vector6, lookahead: float, gain: float, qd_max: Vector6) -> None:
        """Take the goal [rad], the lookahead time [s], the gain [1/s^2] and the rated speeds [rad/s]."""
        self._q = q
        self._qd_max = qd_max
        self._lookahead = min(max(lookahead, LOOKAHEAD[0]), LOOKAHEAD[1])
        self._gain = min(max(gain, GAIN[0]), GAIN[1])

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Advance by `scale * dt`; the integration is implicit, so that all gains are stable."""
        was = self.rescale(scale)
        if scale <= 0.0:
            return JointTarget(target.q)
        h = scale * dt
        k = h * self._gain
        denominator = 1.0 + k * (self._lookahead + 0.5 * h)
        # Speeds before speed scaling.
        before = [v / was for v in target.qd]
        after = [
            min(max((v + k * (goal - q - 0.5 * h * v)) / denominator, -most), most)
            for q, v, goal, most in zip(target.q, before, self._q, self._qd_max, strict=True)
        ]
        return JointTarget(
            six([q + 0.5 * h * (v + w) for q, v, w in zip(target.q, before, after, strict=True)]),
            six([scale * w for w in after]),
            six([(scale * w - v) / dt for v, w in zip(target.qd, after, strict=True)]),
        )


class TorqueCommand(NamedTuple):
    """What the drives shall give in one cycle.

    Attributes:
        torque: beside gravity and friction [Nm].
        viscous: share of the modelled viscous friction to compensate, by joint.
        coulomb: share of the modelled Coulomb friction, likewise.
    """

    torque: Vector6
    viscous: Vector6
    coulomb: Vector6


class DirectTorque(Streamed):
    """Follow the measured arm while the drives give a torque; `measure` gives its angles and speeds.

    No position is held. Source: URScript manual e-Series 5.25.1, direct_torque: gravity is always
    compensated; without a call in every cycle the robot returns to position control. Chosen: the set-point is
    the measured arm meanwhile, and position control begins by bringing the joints to rest.
    """

    kind: ClassVar[Kind] = Kind.TORQUE

    def __init__(self, command: TorqueCommand, measure: Callable[[], JointTarget]) -> None:
        self.command = command
        self._measure = measure

    def fits(self, target: JointTarget, scale: float) -> bool:
        """Return True: speed scaling has no effect."""
        return True

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the measured arm."""
        return self._measure()
