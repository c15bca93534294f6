"""The motion along the path of a program: the current generator, its owner, and their pauses.

The rules of ownership are the controller's behaviour as users report it:

* only one script thread moves the arm at a time; a second one gets "Another thread is already controlling
  the robot";
* ownership ends when the motion has brought the arm to rest, or when the owner ends or is killed;
* a velocity command must be renewed in every cycle: when the next `speedj` is late the arm begins to stop
  (drivers that stream too slowly see a stutter), and when the program ends it stops.

Must not know scripts or physics: an owner is any object, compared by identity.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, Hold, JointTarget, StopJ, Streamed
from ur_emulator.motion.leg import move_j
from ur_emulator.motion.move import Move

# --- Pauses: the time on the path slows down to a standstill, and speeds up again later
#
# An arm that has stopped on its path continues exactly there. An arm that has left its path, in a fast stop
# or moved by hand, first returns to where it left it: slowly, all joints together (chosen; a real box
# leaves that to the operator).


# Rate of change of the time scaling [1/s]. Chosen: as for the speed slider, at rest after 0.25 s.
PAUSE_RATE = 4.0
# Leading axis on the return to the path [rad/s, rad/s^2]. Chosen: slow.
RETURN_SPEED, RETURN_ACCELERATION = 0.25, 1.0


class TimeScaling:
    """The rate of time on the path: a factor that ramps between 1 and 0.

    Attributes:
        paused: the factor goes to 0, else to 1.
        factor: in this cycle.
        slowing: its rate of change to 0 [1/s].
    """

    def __init__(self) -> None:
        self.paused = False
        self.factor = 1.0
        self.slowing = PAUSE_RATE

    @property
    def is_normal(self) -> bool:
        """True without a pause, at a factor of 1."""
        return not self.paused and self.factor == 1.0

    def step(self, dt: float) -> float:
        """Advance the ramp by a cycle."""
        if self.paused:
            self.factor = max(0.0, self.factor - self.slowing * dt)
        else:
            self.factor = min(1.0, self.factor + PAUSE_RATE * dt)
        return self.factor

    def reset(self) -> None:
        """End a pause without a ramp."""
        self.paused = False
        self.factor = 1.0


class Suspended(NamedTuple):
    """What continues after a pause.

    Attributes:
        generator: a move, or a stream if it is renewed.
        owner: of the arm.
        q: where the move left its path [rad].
    """

    generator: Generator
    owner: object | None
    q: Vector6


class ReturnToPath:
    """The return to where a move left its path; then the move continues.

    Attributes:
        done: back on the path.
        move: that continues then.
        back_to: joint angles on the path [rad].
    """

    def __init__(self, move: Move, back_to: Vector6) -> None:
        self.move = move
        self.back_to = back_to
        self._return: Move | None = None
        self.done = False

    @property
    def is_braking(self) -> bool:
        """True until the return has begun."""
        return self._return is None

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Come to rest, then return."""
        if self._return is None:
            if any(target.qd):
                return StopJ(RETURN_ACCELERATION).step(target, dt, scale)
            leg = move_j(target.q, self.back_to, self.move.leg.tool, a=RETURN_ACCELERATION, v=RETURN_SPEED)
            self._return = Move(leg)
        move = self._return
        after = move.step(target, dt, scale)
        self.done = move.done
        return after


# Rate of change of the speed scaling [1/s], so that the joint speeds have no step. Chosen.
SCALING_RATE = 4.0

HOLD = Hold()


class OwnershipError(Exception):
    """Another owner has the arm."""


class PathMotion:
    """One generator, one owner, one target along the path.

    Attributes:
        path: target along the path of the program; what generators see.
        scaling_rate: rate of change of the speed scaling [1/s].
        braking: gives the greatest deceleration of the leading axis [rad/s^2] that the drives can give in a
            stop, in the direction of the path's velocity; None: a stop brakes as it was asked to.
    """

    def __init__(self, q: Vector6) -> None:
        self.path = JointTarget(q)
        self.braking: Callable[[JointTarget], float] | None = None
        self._generator: Generator = HOLD
        self._owner: object | None = None
        self._renewed = False
        self.scaling_rate = SCALING_RATE
        self._scale = 1.0
        self._time_scaling = TimeScaling()
        self._suspended: Suspended | None = None
        # Overlays or a pause: a single test in the hot path.
        self._is_special = False

    @property
    def owner(self) -> object | None:
        """The object that has the arm, or None."""
        return self._owner

    @property
    def scale(self) -> float:
        """Speed scaling of the last cycle, 0..1."""
        return self._scale

    @property
    def goal(self) -> Vector6:
        """Joint angles at the next waypoint; those of the path if there is none [rad]."""
        move = self._move
        goal = None if move is None else move.goal
        return self.path.q if goal is None else goal

    @property
    def _move(self) -> Move | None:
        """The current move, also while it is interrupted."""
        generator = self._generator if self._suspended is None else self._suspended.generator
        if isinstance(generator, ReturnToPath):
            return generator.move
        return generator if isinstance(generator, Move) else None

    def move_of(self, owner: object) -> Move | None:
        """Return the current move of `owner`, if it has one."""
        return self._move if self._owner is owner else None

    def command(self, owner: object, generator: Generator) -> None:
        """Move the arm with `generator` for `owner` from the next cycle on.

        Raises:
            OwnershipError: another owner has the arm.
        """
        if self._owner is not None and self._owner is not owner:
            raise OwnershipError
        if isinstance(self._generator, Streamed):
            self._generator.when_replaced(generator)
        self._owner = owner
        self._generator = generator
        self._renewed = True

    def renew(self) -> None:
        """Renew a streamed velocity for one more cycle."""
        self._renewed = True

    # --- pauses

    @property
    def is_returning(self) -> bool:
        """True while the arm returns to the path that it left in an interruption."""
        return isinstance(self._generator, ReturnToPath)

    def pause(self, deceleration: float = 0.0) -> None:
        """Ramp the arm to rest on its path; a stream is stopped; overlays stand still too.

        Args:
            deceleration: of the leading axis, if that is faster than PAUSE_RATE [rad/s^2].
        """
        scaling = self._time_scaling
        if scaling.paused:
            return
        scaling.paused = self._is_special = True
        speed = max(map(abs, self.path.qd))
        scaling.slowing = max(PAUSE_RATE, deceleration * scaling.factor / speed if speed > 0.0 else 0.0)
        generator = self._generator
        if isinstance(generator, Streamed):
            self._suspend()
            self._generator = StopJ(deceleration) if deceleration else generator.when_paused()

    def resume(self) -> None:
        """End a pause: a move continues, and a stream if it is renewed in this cycle."""
        if not self._time_scaling.paused:
            return
        self._time_scaling.paused = False
        if (suspended := self._suspended) is not None:
            self._suspended = None
            generator, self._owner, back_to = suspended
            self._generator = ReturnToPath(generator, back_to) if isinstance(generator, Move) else generator
            self._renewed = True

    def _suspend(self) -> None:
        generator = self._generator
        if self._suspended is None and isinstance(generator, Move | ReturnToPath | Streamed):
            if isinstance(generator, ReturnToPath):
                self._suspended = Suspended(generator.move, self._owner, generator.back_to)
            else:
                self._suspended = Suspended(generator, self._owner, self.path.q)

    def _abandon(self) -> None:
        """End the current move; it does not continue after a pause."""
        if (move := self._move) is not None:
            move.abandon()
        self._suspended = None

    # --- cycle

    def _advance(self, dt: float, scale: float, time_factor: float) -> JointTarget:
        """Advance on the path by one cycle."""
        generator = self._generator
        if scale != self._scale:
            change = self.scaling_rate * dt
            self._scale = scale = min(max(scale, self._scale - change), self._scale + change)
        if isinstance(generator, Streamed):
            if not self._renewed:
                generator = self._generator = generator.when_lost()
            self._renewed = False
        if self.braking is not None and isinstance(generator, StopJ):
            generator.allowed = self.braking(self.path)
        path = self.path = generator.step(self.path, dt, scale * time_factor)
        if generator.done and not isinstance(generator, Streamed):
            self._end_of(generator)
        return path

    def _end_of(self, generator: Generator) -> None:
        if isinstance(generator, ReturnToPath):
            self._generator = generator.move
            self._time_scaling.factor = 0.0
            self._is_special = True
        else:
            self._generator = HOLD
            self._owner = None
