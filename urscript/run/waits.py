"""What a running thread yields to the scheduler when it cannot go on.

A builtin that takes time is a generator function; each `yield` hands one of these up to the scheduler.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Final


class _NextCycle(Enum):
    NEXT_CYCLE = "next cycle"


NEXT_CYCLE: Final = _NextCycle.NEXT_CYCLE
"""This thread's slice of this cycle is used up: go on in the next one."""


class Blocked:
    """The thread cannot run until `ready()` is true; asked at the start of every cycle.

    Attributes:
        ready: Must be cheap and free of effects: it is asked more often than once a cycle.
        outside: The thread waits for something outside the box (bytes of a peer), so that time must stand
            still in lockstep until it comes.
    """

    __slots__ = ("outside", "ready")

    def __init__(self, ready: Callable[[], bool], outside: bool = False) -> None:
        self.ready = ready
        self.outside = outside


GIVE_WAY: Final = Blocked(lambda: True)
"""For a call that takes time by its nature and happens not to: the thread goes on at once, unless it has used
much of its budget; then this call takes up the rest of the cycle. A program that reads what a peer floods it
with is so never found to have used too much time, however much of it comes at once."""

Wait = _NextCycle | Blocked
"""Everything a thread may yield."""
