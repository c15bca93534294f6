"""What all builtins that move the arm share: how they take it, and what they demand of their arguments."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any

from ur_emulator.controller.state import ControllerState
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.generators import Generator as MotionGenerator
from ur_emulator.motion.path_motion import OwnershipError
from urscript.errors import ScriptRuntimeError

# What a motion builtin is to the interpreter: a generator that yields once per cycle it lasts.
Cycles = Generator[Any, None, None]

# With less than this [SI units] no arm moves in a lifetime, and squares of it leave the floats.
LEAST_LIMIT = 1e-9


def take_arm(state: ControllerState, thread: object, generator: MotionGenerator) -> None:
    """Let `thread` move the arm with `generator` from the next cycle on."""
    try:
        state.motion.command(thread, generator)
    except OwnershipError:
        raise ScriptRuntimeError("Another thread is already controlling the robot") from None


def require_positive(function: str, **limits: float) -> None:
    """Raise a runtime error for a limit that is not above 0, or not by anything that counts."""
    for name, value in limits.items():
        if not value > 0.0:
            raise ScriptRuntimeError(f"{function}: {name} must be above 0, got {value:g}")
        if value < LEAST_LIMIT:
            raise ScriptRuntimeError(f"{function}: {name} must be at least {LEAST_LIMIT:g}, got {value:g}")


def floats(values: Sequence[float]) -> Vector6:
    """Return six values as floats; a script may write whole numbers."""
    return six(list(map(float, values)))
