"""Where scripts connect to: names that are looked up, and ports of this process that are closed to them.

The system offers no other method to look a name up than a thread that waits; a few threads serve all boxes of
this process. A thread lives while a name waits for it. A name whose script has gone is forgotten; one that is
being looked up keeps its thread until the system gives up, so a box has only some of the threads.

The closed ports are those of the control API of all boxes of this process. A client that may send programs
could otherwise do through a socket of its program what the control API allows only to the users of this
machine. Every connection of a box asks here with the address that it will use, so names and other forms of an
address change nothing.
"""

import errno
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from ur_emulator.budgets import BUDGETS


@dataclass(frozen=True, slots=True, eq=False)
class LookUp:
    """A name that waits.

    Attributes:
        box: who asks; a box has a share of the threads and of the queue.
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


_CLOSED: Final[dict[object, int]] = {}


def close_to_scripts(owner: object, port: int) -> None:
    """Let no script connect to a port of this machine, until `give_back`."""
    _CLOSED[owner] = port


def give_back(owner: object) -> None:
    """Take back `close_to_scripts`; harmless if there was none."""
    _CLOSED.pop(owner, None)


def is_closed(address: str, port: int) -> bool:
    """Whether scripts must not connect to a port of an IPv4 address, as `inet_ntoa` writes it."""
    # Boxes in other threads come and go: a copy is made at once, an iteration is not.
    return port in tuple(_CLOSED.values()) and _is_of_this_machine(address)


def _is_of_this_machine(address: str) -> bool:
    """Whether this machine has an address: a socket can be bound to no other. In doubt it has."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError as error:
        return error.errno != errno.EADDRNOTAVAIL
    return True
