"""The motion of the arm: along the path of the program, displaced by overlays; its pauses and its stops.

The rules of ownership are the controller's behaviour as users report it:

* only one script thread moves the arm at a time; a second one gets "Another thread is already controlling
  the robot";
* ownership ends when the motion has brought the arm to rest, or when the owner ends or is killed;
* a velocity command must be renewed in every cycle: when the next `speedj` is late the arm begins to stop
  (drivers that stream too slowly see a stutter), and when the program ends it stops.

Must not know scripts or physics: an owner is any object, compared by identity.
"""

from collections.abc import Callable, Iterator
from math import inf
from typing import NamedTuple

from ur_emulator.models.robot_model import ZERO6, Vector6, six
from ur_emulator.motion.generators import (
    DirectTorque,
    Generator,
    Hold,
    JointTarget,
    StopJ,
    StopL,
    Streamed,
    TorqueCommand,
)
from ur_emulator.motion.leg import move_j
from ur_emulator.motion.move import Move
from ur_emulator.motion.overlay import Overlay, OverlayChain

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
    """The rate of time on the path: a factor that ramps to 0 while `paused`, else to 1; `slowing` in 1/s."""

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
    """What continues after a pause: a move that left its path at `q` [rad], or a stream if it is renewed."""

    generator: Generator
    owner: object | None
    q: Vector6


class ReturnToPath:
    """The return to where a move left its path, at `back_to` [rad]; then the move continues."""

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

# The way of a slow arm: at its speed for this long [s], so that rounding is less. Chosen.
_LEAST_LOOK_AHEAD = 0.02

HOLD = Hold()


class OwnershipError(Exception):
    """Another owner has the arm."""


class ArmMotion:
    """One generator on the path of the program, one owner, overlays, and the joint target that follows.

    When a program ends, is replaced or killed during a motion, the leading axis brakes with
    `stop_deceleration`. Users call the real stop "abrupt"; its value is not published. Chosen: the value of
    the maker's tests of stop category 0, from the model of the arm.

    Attributes:
        stop_deceleration: of the leading axis in every stop [rad/s^2].
        path: target along the path of the program, which generators work on.
        target: of the joints; the same object as `path` unless overlays displace it.
        scaling_rate: rate of change of the speed scaling [1/s].
        braking: gives the greatest deceleration of the leading axis [rad/s^2] that the drives can give in a
            stop, in the direction of the path's velocity; None: a stop brakes as it was asked to.
    """

    def __init__(self, q: Vector6, stop_deceleration: float) -> None:
        self.stop_deceleration = stop_deceleration
        self.path = self.target = JointTarget(q)
        self.braking: Callable[[JointTarget], float] | None = None
        self.scaling_rate = SCALING_RATE
        self._generator: Generator = HOLD
        self._owner: object | None = None
        self._renewed = False
        self._scale = 1.0
        self._time_scaling = TimeScaling()
        self._suspended: Suspended | None = None
        self._chain = OverlayChain()
        self._overlays = self._chain.overlays
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
    def is_moving(self) -> bool:
        """True while a generator or an overlay moves the arm, unless a pause has stopped it."""
        return (self._generator is not HOLD or bool(self._overlays)) and not self.is_paused

    @property
    def is_paused(self) -> bool:
        """True when a pause has brought the arm to rest."""
        return self._time_scaling.paused and not any(self.target.qd)

    @property
    def is_returning(self) -> bool:
        """True while the arm returns to the path that it left in an interruption."""
        return isinstance(self._generator, ReturnToPath)

    @property
    def torque(self) -> TorqueCommand | None:
        """What the drives shall give; None where they follow `target`."""
        generator = self._generator
        return generator.command if isinstance(generator, DirectTorque) else None

    def way_to_rest(self, target: JointTarget) -> Iterator[Vector6]:
        """Yield the joint angles half way and at rest if the arm was stopped at a target [rad]."""
        allowed = inf if self.braking is None else self.braking(target)
        braking_time = max(map(abs, target.qd)) / (2.0 * min(self.stop_deceleration, allowed))
        for share in (0.5, 1.0):
            time = share * max(braking_time, _LEAST_LOOK_AHEAD)
            yield six([q + qd * time for q, qd in zip(target.q, target.qd, strict=True)])

    @property
    def _move(self) -> Move | None:
        """The current move, also while it is interrupted."""
        generator = self._generator if self._suspended is None else self._suspended.generator
        if isinstance(generator, ReturnToPath):
            return generator.move
        return generator if isinstance(generator, Move) else None

    # --- commands of the owner

    def move_of(self, owner: object) -> Move | None:
        """Return the current move of `owner`, if it has one."""
        return self._move if self._owner is owner else None

    def command(self, owner: object, generator: Generator) -> None:
        """Move the arm for `owner` from the next cycle on; OwnershipError if another owner has the arm."""
        if self._owner is not None and self._owner is not owner:
            raise OwnershipError
        if isinstance(self._generator, Streamed):
            self._generator.when_replaced(generator)
        self._owner = owner
        self._generator = generator
        self._renewed = True

    def command_torque(self, owner: object, generator: DirectTorque) -> None:
        """Drive the arm by torque for `owner` in the next cycle; overlays end.

        OwnershipError if another owner has the arm.
        """
        self.command(owner, generator)
        self._chain.clear()

    def renew(self) -> None:
        """Renew a streamed velocity for one more cycle."""
        self._renewed = True

    def release(self, owner: object) -> None:
        """End the ownership of `owner`, if it has the arm, and stop its motion at once.

        A move whose instruction has returned for a blend continues to its waypoint: the end of a program is
        the same with and without a blend in its last move.
        """
        if self._owner is owner:
            move = self._move
            if move is not None and move.returned:
                self._owner = None
            else:
                self.stop()

    # --- pauses

    def pause(self, deceleration: float = 0.0) -> None:
        """Ramp the arm to rest on its path; a stream is stopped; overlays stand still too.

        `deceleration` of the leading axis [rad/s²], if that is faster than PAUSE_RATE.
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

    # --- stops

    def stop(self) -> None:
        """Take the arm from its owner and ramp it to rest.

        All overlays and a pause end; the path continues from the displaced target.
        """
        self._abandon()
        self._brake()
        self._time_scaling.reset()

    def interrupt(self) -> None:
        """Pause by a stop that leaves the path.

        Overlays end, and with them a move that they displace.
        """
        if self._overlays:
            self._abandon()
        else:
            self._suspend()
        self._brake()
        self._time_scaling.paused = self._is_special = True
        self._time_scaling.factor = 0.0

    def abort(self) -> None:
        """End a movej or movel, as one whose waypoint is where the arm comes to rest.

        The leading axis brakes with `stop_deceleration`. A real arm does not come to rest if the move has a
        blend radius: it blends into the next one.
        """
        if (move := self._move) is not None and not move.leg.process:
            self._abandon()
            self._brake()

    def place(self, q: Vector6, qd: Vector6 = ZERO6) -> None:
        """Set the target to `q` [rad], where the joints are without a motion of the program.

        If they still move, with `qd` [rad/s], they are ramped to rest. A paused move returns to its path from
        there.
        """
        if self._time_scaling.paused:
            self._suspend()
        else:
            self._abandon()
        self._owner = None
        self._generator = HOLD
        self._chain.clear()
        self.path = self.target = JointTarget(q, qd)
        if any(qd):
            self._generator = StopJ(self.stop_deceleration)

    def retract(self, target: JointTarget) -> None:
        """Undo the last step: `target` is the one before it."""
        self._chain.clear()
        self.path = self.target = target
        if (move := self._move) is not None:
            move.take_back()

    def _brake(self) -> None:
        """Take the arm from its owner and ramp the joint target to rest."""
        self._owner = None
        if self._generator is not HOLD or self._overlays:
            self._take_over_target()
            self._generator = StopJ(self.stop_deceleration)

    # --- overlays

    def add_overlay(self, overlay: Overlay) -> None:
        """Add an overlay from the next cycle on, after those that are active already."""
        self._chain.add(overlay, self.target)
        self._is_special = True

    def has_overlay(self, overlay: Overlay) -> bool:
        """True while an overlay is active."""
        return overlay in self._overlays

    def remove_overlay(self, overlay: Overlay) -> None:
        """End an overlay, if it is active; the arm keeps its last displacement.

        A move or another overlay continues with that displacement.
        """
        if overlay in self._overlays:
            self._chain.keep_last(overlay)
            if self._chain.all_ended and self._move is None:
                self._take_over_target()
                if self._generator is HOLD and any(self.path.qd):
                    self._generator = StopJ(self.stop_deceleration)

    def _may_settle(self) -> bool:
        """True when all overlays have ended, and the move that they displaced has ended at rest."""
        if not self._chain.all_ended or self._move is not None:
            return False
        return self._generator is not HOLD or not any(self.target.qd)

    def _take_over_target(self) -> None:
        self._chain.clear()
        self.path = self.target

    # --- the cycle

    def step(self, dt: float, scale: float) -> JointTarget:
        """Advance one cycle of `dt` [s] and return the new target.

        `scale` is the commanded speed scaling, 0..1; during a motion it is reached gradually.
        UnreachableError if the arm cannot reach the path there.
        """
        if self._is_special:
            return self._special_step(dt, scale)
        if self._generator is HOLD:
            if any(self.target.qd) or any(self.target.qdd):
                self.path = self.target = self.target.at_rest()
            self._scale = scale
            return self.target
        self.target = self._advance(dt, scale, 1.0)
        return self.target

    def _special_step(self, dt: float, scale: float) -> JointTarget:
        """Step with overlays or in a pause."""
        before = self.target
        time_factor = self._time_scaling.step(dt)
        if time_factor > 0.0 or _brakes(self._generator):
            path = self._advance(dt, scale, time_factor)
        else:
            path = self.path = self.path if not any(self.path.qd) else self.path.at_rest()
        if not self._overlays:
            self.target = path
        elif time_factor > 0.0 or any(path.qd):
            self.target = self._chain.displace(path, before, dt, time_factor)
            if self._may_settle():
                self._take_over_target()
        elif any(before.qd) or any(before.qdd):
            self.target = before.at_rest()
        self._is_special = bool(self._overlays) or not self._time_scaling.is_normal
        return self.target

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


def _brakes(generator: Generator) -> bool:
    """True for generators that brake; they do so in a pause too."""
    return isinstance(generator, StopJ | StopL) or (
        isinstance(generator, ReturnToPath) and generator.is_braking
    )
