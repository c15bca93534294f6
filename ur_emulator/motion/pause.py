"""Pauses: the time on the path slows down to a standstill, and speeds up again later.

An arm that has stopped on its path continues exactly there. An arm that has left its path, in a fast stop or
moved by hand, first returns to where it left it: slowly, all joints together (chosen; a real box leaves that
to the operator).
"""

from __future__ import annotations

from typing import NamedTuple

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, StopJ
from ur_emulator.motion.leg import move_j
from ur_emulator.motion.move import Move
from ur_emulator.motion.target import JointTarget

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
