"""Watchdogs of programs over RTDE inputs: a variable that is not written often enough ends the program.

Source: URScript manual CB3 3.15, rtde_set_watchdog. Chosen: `pause` stops the program too, for programs here
cannot be paused; a minimum frequency of 0 removes the watchdog; time is robot time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from protocol.primary_messages import ReportLevel
from ur_emulator.controller.events import ErrorReported

# "Fieldbus input disconnected". Source: user reports of C207A0; that it stands for RTDE inputs is inferred.
DISCONNECTED_CODE = 207


class WatchdogAction(Enum):
    """What happens when a variable is late."""

    IGNORE = "ignore"
    PAUSE = "pause"
    STOP = "stop"


@dataclass(slots=True)
class _Watch:
    cycles: int
    action: WatchdogAction
    last_tick: int


class Watchdogs:
    """The watchdogs of the running program, by variable."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._watches: dict[str, _Watch] = {}

    def __bool__(self) -> bool:
        return bool(self._watches)

    def set(self, variable: str, min_frequency: float, action: WatchdogAction, tick: int) -> None:
        """Watch a variable from now on, as if it had just been written; replaces its earlier watchdog.

        Args:
            variable: name of an RTDE input.
            min_frequency: how often it must be written at least [Hz].
            action: what to do when it is not.
            tick: present one.
        """
        self._watches.pop(variable, None)
        if min_frequency > 0.0 and action is not WatchdogAction.IGNORE:
            # A hair less, lest rounding make one cycle more of a whole number of them.
            cycles = max(1, math.ceil(1.0 / (min_frequency * self._period_s) - 1e-9))
            self._watches[variable] = _Watch(cycles, action, tick)

    def written(self, names: Iterable[str], tick: int) -> None:
        """Take note of variables that a client has written."""
        for name in names:
            watch = self._watches.get(name)
            if watch is not None:
                watch.last_tick = tick

    def late(self, tick: int) -> ErrorReported | None:
        """Return what to report of the first variable that is late, or None."""
        for variable, watch in self._watches.items():
            if tick - watch.last_tick > watch.cycles:
                limit = watch.cycles * self._period_s
                return ErrorReported(
                    DISCONNECTED_CODE,
                    0,
                    ReportLevel.WARNING,
                    f"Fieldbus input disconnected: RTDE input {variable} was not written for {limit:g} s, "
                    f"watchdog action {watch.action.value}: the program is stopped",
                )
        return None

    def clear(self) -> None:
        """Forget all: the program has ended."""
        self._watches.clear()
