"""Watchdogs of programs over RTDE inputs: a variable that is late pauses or ends the program.

Source: URScript manual CB3 3.15, rtde_set_watchdog. Chosen: a minimum frequency of 0 removes the watchdog;
time is robot time; a paused program is not watched, and its watchdogs restart when it continues.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from protocol.primary.messages import ReportLevel
from ur_emulator.machine.controller.events import ErrorReported

# "Fieldbus input disconnected". Source: user reports of C207A0; that it stands for RTDE inputs is inferred.
DISCONNECTED_CODE = 207


class WatchdogAction(Enum):
    """What happens when a variable is late."""

    IGNORE = "ignore"
    PAUSE = "pause"
    STOP = "stop"


# State of the program, for the message.
_CONSEQUENCE = {WatchdogAction.PAUSE: "paused", WatchdogAction.STOP: "stopped"}


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

        `min_frequency`: how often it must be written at least [Hz]; `action`: what to do when it is not.
        """
        self._watches.pop(variable, None)
        if min_frequency > 0.0 and action is not WatchdogAction.IGNORE:
            # A little less, so that rounding does not add a cycle to a whole number of cycles.
            cycles = max(1, math.ceil(1.0 / (min_frequency * self._period_s) - 1e-9))
            self._watches[variable] = _Watch(cycles, action, tick)

    def written(self, names: Iterable[str], tick: int) -> None:
        """Restart the watchdogs of variables that a client has written."""
        for name in names:
            watch = self._watches.get(name)
            if watch is not None:
                watch.last_tick = tick

    def restart(self, tick: int) -> None:
        """Count from now on, as if every variable had just been written."""
        for watch in self._watches.values():
            watch.last_tick = tick

    def late(self, tick: int) -> tuple[ErrorReported, WatchdogAction] | None:
        """Return what there is to report and to do of a variable that is late; None if none is.

        It is the first one that stops the program, or else the first one.
        """
        late = [row for row in self._watches.items() if tick - row[1].last_tick > row[1].cycles]
        if not late:
            return None
        variable, watch = next((row for row in late if row[1].action is WatchdogAction.STOP), late[0])
        text = (
            f"Fieldbus input disconnected: RTDE input {variable} was not written for "
            f"{watch.cycles * self._period_s:g} s, "
            f"watchdog action {watch.action.value}: the program is {_CONSEQUENCE[watch.action]}"
        )
        return ErrorReported(DISCONNECTED_CODE, 0, ReportLevel.WARNING, text), watch.action

    def clear(self) -> None:
        """Remove all watchdogs: the program has ended."""
        self._watches.clear()
