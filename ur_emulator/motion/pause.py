"""Pauses: time on the path runs slower and slower until it stands still, and on again later.

What pauses on its path goes on exactly where it stopped. What was stopped in a hurry, or moved by hand
meanwhile, first goes back to where it left its path: slowly, all joints together (chosen; a real box leaves
the way back to the operator).
"""

from __future__ import annotations

from typing import NamedTuple

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, StopJ
from ur_emulator.motion.leg import move_j
from ur_emulator.motion.move import Move
from ur_emulator.motion.target import JointTarget

# How fast time slows down and comes back [1/s]. Chosen: like the speed slider, at rest after 0.25 s.
PAUSE_RATE = 4.0
# Leading axis on the way back to the path [rad/s, rad/s^2]. Chosen: a careful speed.
RETURN_SPEED, RETURN_ACCELERATION = 0.25, 1.0


class TimeScaling:
    """How fast time passes on the path: a factor that ramps between 1 and 0.

    Attributes:
        paused: it goes to 0, else to 1.
        factor: present one.
        slowing: how fast it goes to 0 [1/s].
    """

    def __init__(self) -> None:
        self.paused = False
        self.factor = 1.0
        self.slowing = PAUSE_RATE

    @property
    def is_normal(self) -> bool:
        """True when nothing of a pause is left."""
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
    """What goes on after a pause.

    Attributes:
        generator: a move, or a stream if it is renewed.
        owner: whose it is.
        q: where the move left its path [rad].
    """

    generator: Generator
    owner: object | None
    q: Vector6


class ReturnToPath:
    """The way back to where a move left its path; then the move itself begins.

    Attributes:
        done: back on the path.
        move: that goes on then.
        back_to: joint angles to go to [rad].
    """

    def __init__(self, move: Move, back_to: Vector6) -> None:
        self.move = move
        self.back_to = back_to
        self._way: Move | None = None
        self.done = False

    @property
    def is_braking(self) -> bool:
        """True until the way back has begun."""
        return self._way is None

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Come to rest if need be, then go back."""
        if self._way is None:
            if any(target.qd):
                return StopJ(RETURN_ACCELERATION).step(target, dt, scale)
            leg = move_j(target.q, self.back_to, self.move.leg.tool, a=RETURN_ACCELERATION, v=RETURN_SPEED)
            self._way = Move(leg)
        way = self._way
        after = way.step(target, dt, scale)
        self.done = way.done
        return after
