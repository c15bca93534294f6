"""What a running thread yields to the scheduler when it cannot continue.

A builtin that takes time is a generator function; each `yield` passes one of these to the scheduler.
"""

from collections.abc import Callable
from enum import Enum
from typing import Final


class _Signal(Enum):
    NEXT_CYCLE = "next cycle"
    OUT_OF_UNITS = "out of units"


NEXT_CYCLE: Final = _Signal.NEXT_CYCLE
"""The thread's time slice of this cycle is used up: it continues in the next one."""


class Outside(Enum):
    """Who outside the box lets a thread wait. In lockstep, time stops meanwhile."""

    PEER = "a program, whose bytes or connection have not come"
    OPERATOR = "a person, or who acts for one: only if nothing else in the box needs time"


class Blocked:
    """The thread cannot run until `ready()` is true.

    Attributes:
        ready: Called once a cycle or more often; must be cheap and without side effects.
        outside: Who outside the box it waits for; None: for the box itself.
    """

    __slots__ = ("outside", "ready")

    def __init__(self, ready: Callable[[], bool], outside: Outside | None = None) -> None:
        self.ready = ready
        self.outside = outside


OUT_OF_UNITS: Final = _Signal.OUT_OF_UNITS
"""What the thread was granted is used up: compiled code asks whether it may go on (see `metering`)."""

CHECKPOINT: Final = Blocked(lambda: True)
"""For a call that may wait but need not now: the thread continues at once, unless it has used half of its
budget; then its time slice ends. So a program that reads a flood of data does not exceed its budget."""

Wait = _Signal | Blocked
"""Everything a thread may yield."""
