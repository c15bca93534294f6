"""Builtins that move the arm: each takes the arm for its thread, sets a generator and waits for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any

from ur_emulator.controller.state import ControllerState
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.arm_motion import PROGRAM_END_DECELERATION, OwnershipError
from ur_emulator.motion.generators import Generator as MotionGenerator
from ur_emulator.motion.generators import MoveJ, SpeedJ, StopJ
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose
from urscript.waits import NEXT_CYCLE

# What a motion builtin is to the interpreter: a generator that yields once per cycle it lasts.
Cycles = Generator[Any, None, None]


def motion_functions(state: ControllerState) -> Mapping[str, Callable[..., Any]]:
    """Return the motion builtins bound to one controller."""
    motion = state.motion

    def take(thread: object, generator: MotionGenerator) -> None:
        try:
            motion.command(thread, generator)
        except OwnershipError:
            raise ScriptRuntimeError("Another thread is already controlling the robot") from None

    def positive(function: str, **limits: float) -> None:
        for name, value in limits.items():
            if not value > 0.0:
                raise ScriptRuntimeError(f"{function}: {name} must be above 0, got {value:g}")

    def movej(thread: object, q: Any, a: float, v: float, t: float, r: float) -> Cycles:
        positive("movej", a=a, v=v)
        if any(motion.target.qd):  # a move begins at rest, also after a program that was replaced in motion
            yield from stopj(thread, PROGRAM_END_DECELERATION)
        start = motion.target.q
        if isinstance(q, Pose):
            solution = state.arm.inverse(tuple(q), start, state.tcp_offset)
            if solution is None:
                raise ScriptRuntimeError(
                    "The robot cannot reach the requested pose. "
                    "Script function movej is unable to find an inverse kinematics solution."
                )
            goal = solution
        else:
            goal = _floats(q)
        generator = MoveJ(start, goal, a=a, v=v, t=t)
        take(thread, generator)
        while not generator.done:
            yield NEXT_CYCLE

    def speedj(thread: object, qd: list[float], a: float, t: float | None) -> Cycles:
        positive("speedj", a=a)
        generator = SpeedJ(_floats(qd), a)
        take(thread, generator)
        if t is not None and t > 0.0:
            # Exactly one cycle for t = step time, whatever the rounding of the division.
            for _ in range(max(1, math.ceil(t / state.period_s - 1e-6))):
                motion.renew()
                yield NEXT_CYCLE
        else:
            while not generator.done:
                motion.renew()
                yield NEXT_CYCLE

    def stopj(thread: object, a: float) -> Cycles:
        positive("stopj", a=a)
        generator = StopJ(a)
        take(thread, generator)
        while not generator.done:
            yield NEXT_CYCLE

    return {"movej": movej, "speedj": speedj, "stopj": stopj}


def _floats(values: Sequence[float]) -> Vector6:
    """Return joint values as floats; a script may write whole numbers."""
    return six([float(value) for value in values])
