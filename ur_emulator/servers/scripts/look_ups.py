"""Look-ups of host names for all boxes of this process, in a few threads: the system offers no other method.

A thread lives while a name waits for it. A name whose script has gone is forgotten; one that is being looked
up keeps its thread until the system gives up, so a box has only some of the threads.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass

from ur_emulator.budgets import BUDGETS


@dataclass(frozen=True, slots=True, eq=False)
class LookUp:
    """A name that waits.

    Attributes:
        box: who asks; a box has a share of the threads and of the queue.
        host: the name.
        found: called in the thread, with an IPv4 address; "" if there is none.
    """

    box: object
    host: str
    found: Callable[[str], None]


class LookUps:
    """The queue and its threads; may be used from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: list[LookUp] = []
        self._under_way: list[LookUp] = []
        self._n_threads = 0

    def start(self, look_up: LookUp) -> bool:
        """Begin to look a name up; False if too many names of the box wait or no thread can be started."""
        with self._lock:
            if sum(other.box is look_up.box for other in self._waiting) >= BUDGETS.look_ups_waiting:
                return False
            self._waiting.append(look_up)
            if self._n_threads < BUDGETS.look_up_threads:
                try:
                    threading.Thread(target=self._run, name="script-look-up", daemon=True).start()
                    self._n_threads += 1
                except RuntimeError:  # the system has no thread left; one that runs takes it
                    if not self._n_threads:
                        self._waiting.remove(look_up)
                        return False
        return True

    def forget(self, look_up: LookUp) -> None:
        """Take a name out of the queue; harmless if it is not in it."""
        with self._lock:
            if look_up in self._waiting:
                self._waiting.remove(look_up)

    def _run(self) -> None:
        done: LookUp | None = None
        while (look_up := self._next(done)) is not None:
            look_up.found(_address_of(look_up.host))
            done = look_up

    def _next(self, done: LookUp | None) -> LookUp | None:
        """Return the next name whose box may have one more thread; without one the thread ends."""
        with self._lock:
            if done is not None:
                self._under_way.remove(done)
            for look_up in self._waiting:
                if sum(other.box is look_up.box for other in self._under_way) < BUDGETS.look_ups_at_once:
                    self._waiting.remove(look_up)
                    self._under_way.append(look_up)
                    return look_up
            self._n_threads -= 1
            return None


LOOK_UPS = LookUps()


def _address_of(host: str) -> str:
    try:
        found = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_STREAM)
    except (OSError, ValueError):  # not known, or not a name
        return ""
    return str(found[0][4][0]) if found else ""
