"""Who moves the arm, and where to: the current generator, its owner, and the running joint target.

The rules of ownership come from the controller's behaviour as users report it:

* only one script thread moves the arm at a time; a second one gets "Another thread is already controlling
  the robot";
* ownership ends when the motion has brought the arm to rest, or when the owner ends or is killed;
* a velocity command lives only as long as it is renewed in every cycle: when the next `speedj` is late the
  arm begins to stop (the stutter seen by every driver that streams too slowly), and when the program ends it
  stops.

The program moves along a path; overlays may displace the target that the joints get (see `overlay`). A pause
lets the time on the path stand still (see `pause`).

Must not know scripts or physics: an owner is any object, compared by identity.
"""

from __future__ import annotations

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, Hold, StopJ, Streamed
from ur_emulator.motion.move import Move
from ur_emulator.motion.overlay import Overlay, OverlayChain
from ur_emulator.motion.pause import Detour, Pace, Suspended
from ur_emulator.motion.speed_l import StopL
from ur_emulator.motion.target import ZERO6, JointTarget

# Deceleration of the leading axis when a program ends, is replaced or killed while the arm moves. Users
# call the real one "abrupt"; the number is not published. Chosen: the mean of UR's stop category 0 tests on
# the base joint (183 deg/s in 159 ms, UR3/CB3 manual 3.10, appendix "stopping time").
PROGRAM_END_DECELERATION = 20.0  # rad/s^2

# How fast the speed scaling follows the slider [1/s]: a step would be a step of the joints' speed. Chosen.
SCALING_RATE = 4.0

_HOLD = Hold()


class OwnershipError(Exception):
    """A second owner asked for the arm while the first still has it."""


class ArmMotion:
    """The motion state of the arm: one generator, one owner, one target.

    Attributes:
        path: target along the path of the program; what generators see.
        target: what the joints get; the same object as `path` unless overlays displace it.
    """

    def __init__(self, q: Vector6) -> None:
        self.path = self.target = JointTarget(q)
        self._generator: Generator = _HOLD
        self._owner: object | None = None
        self._renewed = False
        self._scale = 1.0
        self._chain = OverlayChain()
        self._overlays = self._chain.overlays
        self._pace = Pace()
        self._suspended: Suspended | None = None
        # Overlays or a pause: one test in the hot path instead of three.
        self._is_special = False

    @property
    def is_moving(self) -> bool:
        """True unless the target stands still and nothing is about to move it."""
        return (self._generator is not _HOLD or bool(self._overlays)) and not self.is_paused

    @property
    def owner(self) -> object | None:
        """The object that controls the arm at present, or None."""
        return self._owner

    @property
    def goal(self) -> Vector6:
        """Joint positions that the present move leads to; the path's own if no move has a goal [rad]."""
        move = self._move
        goal = None if move is None else move.goal
        return self.path.q if goal is None else goal

    @property
    def _move(self) -> Move | None:
        """The move under way, also while it is interrupted."""
        generator = self._generator if self._suspended is None else self._suspended.generator
        if isinstance(generator, Detour):
            return generator.move
        return generator if isinstance(generator, Move) else None

    def move_of(self, owner: object) -> Move | None:
        """Return the move that `owner` has under way, if it has one."""
        return self._move if self._owner is owner else None

    def command(self, owner: object, generator: Generator) -> None:
        """Let `owner` move the arm with `generator` from the next cycle on.

        Raises:
            OwnershipError: somebody else has the arm.
        """
        if self._owner is not None and self._owner is not owner:
            raise OwnershipError
        self._owner = owner
        self._generator = generator
        self._renewed = True

    def renew(self) -> None:
        """Keep a streamed velocity alive for one more cycle."""
        self._renewed = True

    def release(self, owner: object) -> None:
        """End the ownership of `owner`, if it has it; a motion still under way is stopped at once.

        A move whose instruction has ended for a blend is on its last way to the waypoint and may arrive: a
        program that ends with it is no different from one whose last move does not blend.
        """
        if self._owner is owner:
            move = self._move
            if move is not None and move.left:
                self._owner = None
            else:
                self.stop(PROGRAM_END_DECELERATION)

    # --- stops

    def stop(self, deceleration: float) -> None:
        """Take the arm from whoever has it and ramp it to rest, leading axis at `deceleration` [rad/s^2].

        All overlays end; where they have led the arm is part of the path from then on. So does a pause.
        """
        self._abandon()
        self._brake(deceleration)
        self._pace.reset()

    def place(self, q: Vector6, qd: Vector6 = ZERO6) -> None:
        """Set the target to `q` [rad], without a path: the joints were moved by something else.

        If they still move, with `qd` [rad/s], they are ramped to rest. In a pause, what was under way goes on
        from there.
        """
        if self._pace.paused:
            self._suspend()
        else:
            self._abandon()
        self._owner = None
        self._generator = _HOLD
        self._chain.clear()
        self.path = self.target = JointTarget(q, qd)
        if any(qd):
            self._generator = StopJ(PROGRAM_END_DECELERATION)

    def retract(self, target: JointTarget) -> None:
        """Take back the last step: `target` is the one from before it."""
        self._chain.clear()
        self.path = self.target = target
        if (move := self._move) is not None:
            move.take_back()

    def _brake(self, deceleration: float) -> None:
        self._owner = None
        if self._generator is not _HOLD or self._overlays:
            self._take_over_target()
            self._generator = StopJ(deceleration)

    def _abandon(self) -> None:
        """Give up the move under way, for good."""
        if (move := self._move) is not None:
            move.abandon()
        self._suspended = None

    # --- pauses

    @property
    def is_pausing(self) -> bool:
        """True from `pause` to `resume`."""
        return self._pace.paused

    @property
    def is_paused(self) -> bool:
        """True when a pause has brought the arm to rest."""
        return self._pace.paused and not any(self.target.qd)

    @property
    def is_returning(self) -> bool:
        """True while the arm goes back to the path that an interruption led it away from."""
        return isinstance(self._generator, Detour)

    def pause(self) -> None:
        """Ramp the arm to rest on its path; a stream ends like one that is not renewed any more.

        Overlays stand still too.
        """
        if self._pace.paused:
            return
        self._pace.paused = self._is_special = True
        generator = self._generator
        if isinstance(generator, Streamed):
            self._suspend()
            self._generator = generator.when_paused()

    def interrupt(self, deceleration: float) -> None:
        """Pause without regard for the path: ramp to rest, leading axis at `deceleration` [rad/s^2].

        Overlays end, and with them a move that they have led away from its path.
        """
        if self._overlays:
            self._abandon()
        else:
            self._suspend()
        self._brake(deceleration)
        self._pace.paused = self._is_special = True
        self._pace.factor = 0.0

    def resume(self) -> None:
        """End a pause: a move goes on where it stopped, a stream if it is renewed in this cycle."""
        if not self._pace.paused:
            return
        self._pace.paused = False
        if (suspended := self._suspended) is not None:
            self._suspended = None
            generator, self._owner, back_to = suspended
            self._generator = Detour(generator, back_to) if isinstance(generator, Move) else generator
            self._renewed = True

    def _suspend(self) -> None:
        generator = self._generator
        if self._suspended is None and isinstance(generator, Move | Detour | Streamed):
            if isinstance(generator, Detour):
                self._suspended = Suspended(generator.move, self._owner, generator.back_to)
            else:
                self._suspended = Suspended(generator, self._owner, self.path.q)

    # --- overlays

    def add_overlay(self, overlay: Overlay) -> None:
        """Let an overlay displace the tool from the next cycle on, after those that are active already."""
        self._chain.add(overlay, self.target)
        self._is_special = True

    def has_overlay(self, overlay: Overlay) -> bool:
        """True while an overlay is active."""
        return overlay in self._overlays

    def remove_overlay(self, overlay: Overlay) -> None:
        """End an overlay, if it is active; the arm stays where it has led it.

        A move under way, or another overlay, goes on displaced by what there is of this one.
        """
        if overlay in self._overlays:
            self._chain.freeze(overlay)
            if self._chain.only_frozen and self._move is None:
                self._take_over_target()
                if self._generator is _HOLD and any(self.path.qd):
                    self._generator = StopJ(PROGRAM_END_DECELERATION)

    def _may_settle(self) -> bool:
        """True when no overlay acts any more, no move is on a displaced path nor has only just ended."""
        if not self._chain.only_frozen or self._move is not None:
            return False
        return self._generator is not _HOLD or not any(self.target.qd)

    def _take_over_target(self) -> None:
        self._chain.clear()
        self.path = self.target

    # --- cycle

    def step(self, dt: float, scale: float) -> JointTarget:
        """Advance one cycle and return the new target.

        Args:
            dt: duration of a cycle [s].
            scale: speed scaling of the trajectory asked for, 0..1; a moving arm takes it on gradually.

        Raises:
            UnreachableError: the move's path leads where the arm cannot be.
        """
        if self._is_special:
            return self._special_step(dt, scale)
        if self._generator is _HOLD:
            if any(self.target.qd) or any(self.target.qdd):
                self.path = self.target = self.target.at_rest()
            self._scale = scale
            return self.target
        self.target = self._advance(dt, scale, 1.0)
        return self.target

    def _special_step(self, dt: float, scale: float) -> JointTarget:
        """Do a cycle with overlays or in a pause."""
        before = self.target
        pace = self._pace.step(dt)
        if pace > 0.0 or _brakes(self._generator):
            path = self._advance(dt, scale, pace)
        else:
            path = self.path = self.path if not any(self.path.qd) else self.path.at_rest()
        if not self._overlays:
            self.target = path
        elif pace > 0.0:
            self.target = self._chain.displace(path, before, dt, pace)
            if self._may_settle():
                self._take_over_target()
        elif any(before.qd) or any(before.qdd):
            self.target = before.at_rest()
        self._is_special = bool(self._overlays) or not self._pace.is_normal
        return self.target

    def _advance(self, dt: float, scale: float, pace: float) -> JointTarget:
        """Advance on the path by one cycle."""
        generator = self._generator
        if scale != self._scale:
            change = SCALING_RATE * dt
            self._scale = scale = min(max(scale, self._scale - change), self._scale + change)
        if isinstance(generator, Streamed):
            if not self._renewed:
                generator = self._generator = generator.when_lost()
            self._renewed = False
        path = self.path = generator.step(self.path, dt, scale * pace)
        if generator.done and not isinstance(generator, Streamed):
            self._end_of(generator)
        return path

    def _end_of(self, generator: Generator) -> None:
        if isinstance(generator, Detour):
            self._generator = generator.move
            self._pace.factor = 0.0
            self._is_special = True
        else:
            self._generator = _HOLD
            self._owner = None


def _brakes(generator: Generator) -> bool:
    """True for what comes to rest by itself, in a pause too."""
    return isinstance(generator, StopJ | StopL) or (isinstance(generator, Detour) and generator.is_braking)
