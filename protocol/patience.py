"""How long somebody has waited for the other side, counted only while he could have seen it come.

A process that is stopped (SIGSTOP, a debugger, a suspended machine) or gets no processor finds its clock far
ahead when it goes on. That jump says nothing of the other side, so between two looks at the clock no more
than `LONGEST_STEP` counts. No clock here: the time is handed in.
"""

from __future__ import annotations

import math

LONGEST_STEP = 0.1
"""Most that counts between two looks [s]. Who waits looks at least as often."""


class Patience:
    """The time spent with one wait."""

    __slots__ = ("_last", "_spent")

    def __init__(self) -> None:
        self._spent = 0.0
        self._last = math.nan

    def spent(self, now: float) -> float:
        """Look at the clock; the first look begins the wait.

        Args:
            now: monotonic time [s].

        Returns:
            How long the wait has taken [s], jumps of the clock left out.
        """
        if not math.isnan(self._last):
            self._spent += min(now - self._last, LONGEST_STEP)
        self._last = now
        return self._spent

    def restart(self) -> None:
        """End this wait; the next look begins another."""
        self._spent = 0.0
        self._last = math.nan
