"""Who moves the arm, and where to: the current generator, its owner, and the running joint target.

The rules of ownership come from the controller's behaviour as users report it:

* only one script thread moves the arm at a time; a second one gets "Another thread is already controlling
  the robot";
* ownership ends when the motion has brought the arm to rest, or when the owner ends or is killed;
* a velocity command lives only as long as it is renewed in every cycle: when the next `speedj` is late the
  arm begins to stop (the stutter seen by every driver that streams too slowly), and when the program ends it
  stops.

The program moves along a path; overlays may displace the target that the joints get (see `overlay`).

Must not know scripts or physics: an owner is any object, compared by identity.
"""

from __future__ import annotations

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, Hold, StopJ, Streamed
from ur_emulator.motion.move import Move
from ur_emulator.motion.overlay import Overlay, OverlayChain
from ur_emulator.motion.target import JointTarget

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
        self._chain = OverlayChain()
        self._overlays = self._chain.overlays
        self._generator: Generator = _HOLD
        self._owner: object | None = None
        self._renewed = False
        self._scale = 1.0

    @property
    def is_moving(self) -> bool:
        """True unless the target stands still and nothing is about to move it."""
        return self._generator is not _HOLD or bool(self._overlays)

    @property
    def owner(self) -> object | None:
        """The object that controls the arm at present, or None."""
        return self._owner

    @property
    def goal(self) -> Vector6:
        """Joint positions that the present move leads to; the path's own if no move has a goal [rad]."""
        generator = self._generator
        goal = generator.goal if isinstance(generator, Move) else None
        return self.path.q if goal is None else goal

    def move_of(self, owner: object) -> Move | None:
        """Return the move that `owner` has under way, if it has one."""
        generator = self._generator
        return generator if self._owner is owner and isinstance(generator, Move) else None

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
            generator = self._generator
            if isinstance(generator, Move) and generator.left:
                self._owner = None
            else:
                self.stop(PROGRAM_END_DECELERATION)

    def stop(self, deceleration: float) -> None:
        """Take the arm from whoever has it and ramp it to rest, leading axis at `deceleration` [rad/s^2].

        All overlays end; where they have led the arm is part of the path from then on.
        """
        self._owner = None
        if self._generator is not _HOLD or self._overlays:
            self._take_over_target()
            self._generator = StopJ(deceleration)

    def place(self, q: Vector6) -> None:
        """Set the target to `q` at rest, without a path: the joints were moved by something else."""
        self._owner = None
        self._generator = _HOLD
        self._chain.clear()
        self.path = self.target = JointTarget(q)

    def retract(self, target: JointTarget) -> None:
        """Take back the last step: `target` is the one from before it."""
        self._chain.clear()
        self.path = self.target = target

    # --- overlays

    def add_overlay(self, overlay: Overlay) -> None:
        """Let an overlay displace the tool from the next cycle on, after those that are active already."""
        self._chain.add(overlay, self.target)

    def remove_overlay(self, overlay: Overlay) -> None:
        """End an overlay, if it is active; the arm stays where it has led it.

        A move under way, or another overlay, goes on displaced by what there is of this one.
        """
        if overlay in self._overlays:
            self._chain.freeze(overlay)
            if self._chain.only_frozen and not isinstance(self._generator, Move):
                self._take_over_target()
                if self._generator is _HOLD and any(self.path.qd):
                    self._generator = StopJ(PROGRAM_END_DECELERATION)

    def _may_settle(self) -> bool:
        """True when no move is on its way along a displaced path, nor has only just ended."""
        generator = self._generator
        return not (any(self.target.qd) if generator is _HOLD else isinstance(generator, Move))

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
        generator = self._generator
        if self._overlays:
            before = self.target
            self._advance(dt, scale)
            self.target = self._chain.displace(self.path, before, dt, 1.0)
            if self._chain.only_frozen and self._may_settle():
                self._take_over_target()
            return self.target
        if generator is _HOLD:
            if any(self.target.qd) or any(self.target.qdd):
                self.path = self.target = self.target.at_rest()
            self._scale = scale
            return self.target
        self.target = self._advance(dt, scale)
        return self.target

    def _advance(self, dt: float, scale: float) -> JointTarget:
        """Advance on the path by one cycle."""
        generator = self._generator
        path = self.path
        if scale != self._scale:
            change = SCALING_RATE * dt
            self._scale = scale = min(max(scale, self._scale - change), self._scale + change)
        if isinstance(generator, Streamed):
            if not self._renewed:
                generator = self._generator = generator.when_lost()
            self._renewed = False
        self.path = path = generator.step(path, dt, scale)
        if generator.done and not isinstance(generator, Streamed):
            self._generator = _HOLD
            self._owner = None
        return path
