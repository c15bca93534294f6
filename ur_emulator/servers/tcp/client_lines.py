"""Lines of the log about clients that come and go: a storm of them must not empty the log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from ur_emulator.budgets import BUDGETS

_WINDOW = 60.0  # s


class ClientLines:
    """Writes so many lines a minute, and counts the others.

    Args:
        write: writes a line into the log.
        clock: monotonic seconds; also where the time of the box stands still, clients come and go.
    """

    def __init__(self, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._write = write
        self._clock = clock
        self._began = -math.inf
        self._n = 0

    def write(self, text: str) -> None:
        """Write a line, unless there were too many in this minute."""
        now = self._clock()
        if now - self._began >= _WINDOW:
            left_out = self._n - BUDGETS.client_lines
            self._began, self._n = now, 0
            if left_out > 0:
                self._write(f"{left_out} lines about clients that came and went were left out")
        self._n += 1
        if self._n <= BUDGETS.client_lines:
            self._write(text)
        elif self._n == BUDGETS.client_lines + 1:
            self._write(
                f"clients come and go: beyond {BUDGETS.client_lines} lines a minute they are left out"
            )
