"""The builtin `time`. Source: script manual e-Series 5.19, time: modes, seconds since 1970."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_emulator.controller.clock import CLOCK_EPOCH, Clock
from urscript.values import Struct

_SYSTEM_CLOCK = 2


def clock_functions(clock: Clock) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin that reads the controller's clock."""

    def time(thread: object, mode: float = 0) -> Struct:
        seconds, rest = divmod(clock.tick * clock.generation.period_us, 1_000_000)
        if mode == _SYSTEM_CLOCK:
            seconds += int(CLOCK_EPOCH.timestamp())
        return Struct({"sec": seconds, "nanosec": rest * 1000})

    return {"time": time}
