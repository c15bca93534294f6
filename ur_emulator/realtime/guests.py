"""Other threads with long work beside a loop: they work while it sleeps.

Python runs one thread at a time. A guest that computes would get the interpreter whenever the loop lets go of
it for a moment, in the middle of a cycle, some twenty times in each; and getting it back takes a while every
time, on a busy machine milliseconds. So guests ask between their steps and wait until the loop sleeps.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# A loop that finds no sleep at all must not keep its guests from ever finishing: after waiting so long [s]
# they work for so long [s] without asking.
LONGEST_WAIT = 0.020
FREE_WORK = 0.004


class Guests:
    """The guests of one loop."""

    def __init__(self, *, wait: bool) -> None:
        """Args: wait: the loop has deadlines and its guests work between them; else they work at any time."""
        self._wait = wait
        self._count = 0
        self._lock = threading.Lock()
        self._asleep = threading.Event()

    # --- the loop's side

    def fall_asleep(self) -> None:
        """The loop is about to wait for its next deadline."""
        if self._count:
            self._asleep.set()

    def wake_up(self) -> None:
        """The loop is awake."""
        if self._count:
            self._asleep.clear()

    def leave_alone(self) -> None:
        """The loop has ended: nobody need wait any more."""
        self._wait = False
        self._asleep.set()

    # --- the guests' side

    @contextmanager
    def working(self) -> Iterator[Callable[[], None]]:
        """In this block a guest works; it calls what it gets every few dozen microseconds and may wait."""
        self._count_by(1)
        asleep, free_until = self._asleep, 0.0

        def give_way() -> None:
            nonlocal free_until
            if asleep.is_set() or not self._wait or time.perf_counter() < free_until:
                return
            if not asleep.wait(LONGEST_WAIT):
                free_until = time.perf_counter() + FREE_WORK

        try:
            yield give_way
        finally:
            self._count_by(-1)

    def _count_by(self, change: int) -> None:
        with self._lock:
            self._count += change
