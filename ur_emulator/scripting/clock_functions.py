"""The builtin `time`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.clock import Clock
from urscript.errors import ScriptRuntimeError
from urscript.values import Struct


def clock_functions(clock: Clock) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin that reads the controller's clock."""

    def time(thread: object, mode: float = 0) -> Struct:
        if mode:
            raise ScriptRuntimeError(
                f"time: mode {int(mode)}, the system's clock, is not modelled: a box counts robot time; "
                "allowed: 0"
            )
        microseconds = clock.tick * clock.generation.period_us
        seconds, rest = divmod(microseconds, 1_000_000)
        return Struct({"sec": seconds, "nanosec": rest * 1000})

    return {"time": time}
