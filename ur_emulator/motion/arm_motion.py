"""Who moves the arm, and where to: the current generator, its owner, and the running joint target.

The rules of ownership come from the controller's behaviour as users report it:

* only one script thread moves the arm at a time; a second one gets "Another thread is already controlling
  the robot";
* ownership ends when the motion has brought the arm to rest, or when the owner ends or is killed;
* a velocity command lives only as long as it is renewed in every cycle: when the next `speedj` is late the
  arm
  begins to stop (the stutter seen by every driver that streams too slowly), and when the program ends it
  stops.

Must not know scripts or physics: an owner is any object, compared by identity.
"""

from __future__ import annotations

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, Hold, StopJ, Streamed
from ur_emulator.motion.move import Move
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
    """The motion state of the arm: one generator, one owner, one target."""

    def __init__(self, q: Vector6) -> None:
        self.target = JointTarget(q)
        self._generator: Generator = _HOLD
        self._owner: object | None = None
        self._renewed = False
        self._scale = 1.0

    @property
    def is_moving(self) -> bool:
        """True unless the target stands still and nothing is about to move it."""
        return self._generator is not _HOLD

    @property
    def owner(self) -> object | None:
        """The object that controls the arm at present, or None."""
        return self._owner

    @property
    def goal(self) -> Vector6:
        """Joint positions that the present move leads to; the target's own if no move has a goal [rad]."""
        generator = self._generator
        goal = generator.goal if isinstance(generator, Move) else None
        return self.target.q if goal is None else goal

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
        """Take the arm from whoever has it and ramp it to rest, leading axis at `deceleration` [rad/s^2]."""
        self._owner = None
        if self._generator is not _HOLD:
            self._generator = StopJ(deceleration)

    def place(self, q: Vector6) -> None:
        """Set the target to `q` at rest, without a path: the joints were moved by something else."""
        self._owner = None
        self._generator = _HOLD
        self.target = JointTarget(q)

    def step(self, dt: float, scale: float) -> JointTarget:
        """Advance one cycle and return the new target.

        Args:
            dt: duration of a cycle [s].
            scale: speed scaling of the trajectory asked for, 0..1; a moving arm takes it on gradually.

        Raises:
            UnreachableError: the move's path leads where the arm cannot be.
        """
        generator = self._generator
        if generator is _HOLD:
            if any(self.target.qd) or any(self.target.qdd):
                self.target = self.target.at_rest()
            self._scale = scale
            return self.target
        if scale != self._scale:
            change = SCALING_RATE * dt
            self._scale = scale = min(max(scale, self._scale - change), self._scale + change)
        if isinstance(generator, Streamed):
            if not self._renewed:
                generator = self._generator = generator.when_lost()
            self._renewed = False
        self.target = generator.step(self.target, dt, scale)
        if generator.done and not isinstance(generator, Streamed):
            self._generator = _HOLD
            self._owner = None
        return self.target
