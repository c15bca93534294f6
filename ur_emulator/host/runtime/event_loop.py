"""The loop: it waits for sockets or the next deadline, calls back, and lets the boxes advance.

One thread owns the loop and all that is registered with it; other threads may only use
`call_soon_threadsafe`. The loop knows no robot: a service is anything with `advance`, which returns when it
must be called next.

Callbacks go in rounds: every socket that is ready and every call that waits gets one turn in a round. When a
service is due the round is interrupted, and goes on after the service: no crowd of clients delays a cycle,
and no client keeps another from its turn. So a callback must be short: what remains to be done goes into the
next round by `call_soon`. An error in a callback ends its registration, its owner gets the error, and the
loop goes on (see `barrier`).
"""

import gc
import select
import selectors
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from heapq import heappop, heappush
from itertools import count
from typing import Protocol, cast

from ur_emulator.host.runtime.barrier import Failed, guarded

# epoll waits in whole milliseconds; a deadline nearer than this is waited for with select(), which knows
# microseconds.
_COARSE = 0.050
# A sleeping process wakes up late and runs slowly at first: the loop wakes up so long before a deadline [s].
# A box uses that time to compute the cycle that it publishes at the deadline. Services of one loop share it:
# an awake loop uses the processor, and with twenty boxes it would never sleep.
WAKE_UP = 400e-6
# select() takes descriptors below this number only.
_SELECT_LIMIT = 1024
# How long callbacks run when a service is late already, or always due [s]; of a shorter cycle this part.
# Clients that come and go without pause could make boxes fall behind otherwise, more with shorter cycles.
_LATE_TURN, _LATE_PART = 500e-6, 1.0 / 16.0
# How long to poll for an expected event [s]: a client in lockstep answers in half of it.
_POLL_TIME = 200e-6
# Most waits in a row without polling, after polls that failed.
_LONGEST_PAUSE = 32
# In a process of the user: collect rarely, a full collection over a large heap costs more than a cycle has to
# spare; and let threads take short turns, one with long work shares the interpreter with the loop.
_RARELY = (50_000, 20, 100)
_SWITCH_INTERVAL = 1e-4  # s

_lock = threading.Lock()
_running_loops = 0
_before = (gc.get_threshold(), sys.getswitchinterval())


_Ready = tuple[selectors.SelectorKey, int]
_Callback = Callable[[int], None]


@contextmanager
def loop_settings() -> Iterator[None]:
    """Collect rarely and switch threads often in this block, in a process of the user.

    Blocks of several loops may overlap. When the last one ends, the settings are again what they were before
    the first.
    """
    global _running_loops, _before
    with _lock:
        if not _running_loops:
            _before = (gc.get_threshold(), sys.getswitchinterval())
        _running_loops += 1
        gc.set_threshold(*_RARELY)
        sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        yield
    finally:
        with _lock:
            _running_loops -= 1
            if not _running_loops:
                thresholds, interval = _before
                gc.set_threshold(*thresholds)
                sys.setswitchinterval(interval)


class Service(Protocol):
    """A part that advances in the loop."""

    def advance(self, now: float) -> float:
        """Advance to monotonic time `now` [s]; return the time of the next call at the latest."""

    def failed(self, error: Exception) -> None:
        """Take notice of an error in `advance`: the service is not in the loop any more."""


class EventLoop:
    """A selector, deadlines, and calls from other threads.

    Attributes:
        is_running: `run` has been called, or will be at once; it has not returned.
    """

    def __init__(self, *, precise: bool = True) -> None:
        """Make the loop; deadlines that are not `precise` to the microsecond save a system call a wait."""
        self._selector = selectors.DefaultSelector()
        self._services: list[Service] = []
        self._calls: deque[Callable[[], None]] = deque()
        self._round: deque[Callable[[], None]] = deque()
        # Calls for later: their time, then the order in which they came.
        self._timers: list[tuple[float, int, Callable[[], None]]] = []
        self._order = count()
        self._stopping = False
        self.is_running = False
        self._thread = 0
        self._late_turn = _LATE_TURN
        self._expects_soon = False
        self._pause = 1
        self._skip = 0
        self._waker, self._wake_end = socket.socketpair()
        for end in (self._waker, self._wake_end):
            end.setblocking(False)
        self.watch(self._wake_end, selectors.EVENT_READ, self._drain_wakes, end_loop)
        # Waits of less than a millisecond select the selector's own descriptor, of epoll or kqueue.
        self._descriptor = self._selector.fileno() if precise else None

    # --- sockets

    def watch(self, sock: socket.socket, events: int, callback: _Callback, failed: Failed) -> None:
        """Call `callback(events)` whenever `sock` is ready for one of `events`; replaces an earlier watch.

        After an error in it, `sock` is not watched any more, and `failed` is called with the error.
        """
        try:
            self._selector.register(sock, events, (callback, failed))
        except KeyError:
            self._selector.modify(sock, events, (callback, failed))

    def unwatch(self, sock: socket.socket) -> None:
        """Stop watching `sock`; harmless if it is not watched."""
        with suppress(KeyError, ValueError):
            self._selector.unregister(sock)

    def expect_soon(self) -> bool:
        """Expect that a socket will be ready within a fraction of a millisecond.

        Sleeping and waking up takes longer than that, so the next wait polls first. When nothing comes in
        time (another process needs the processor), the next waits do not poll: twice as many each time.

        Returns:
            Whether the next wait polls: a processor is free.
        """
        self._expects_soon = True
        return not self._skip

    # --- services

    def keep_pace(self, period: float) -> None:
        """Have a service with a cycle of so many seconds; late, it waits for callbacks for a part of that."""
        self._late_turn = min(self._late_turn, _LATE_PART * period)

    def add(self, service: Service) -> None:
        """Let `service` advance in this loop."""
        self._services.append(service)

    def remove(self, service: Service) -> None:
        """Take `service` out of this loop."""
        if service in self._services:
            self._services.remove(service)

    # --- calls

    def call_soon(self, call: Callable[[], None], failed: Failed) -> None:
        """Run `call` in the next round, after the sockets that are ready then; in the loop's thread.

        An error in it goes to `failed`.
        """
        self._calls.append(partial(guarded, failed, call))

    def call_later(self, delay: float, call: Callable[[], None], failed: Failed) -> None:
        """As `call_soon`, after `delay` seconds or a little later: for what needs no cycle."""
        timer: Callable[[], None] = partial(guarded, failed, call)
        heappush(self._timers, (time.monotonic() + delay, next(self._order), timer))

    # --- other threads

    @property
    def is_own_thread(self) -> bool:
        """True in the thread that runs the loop."""
        return threading.get_ident() == self._thread

    def call_soon_threadsafe(self, call: Callable[[], None], failed: Failed) -> None:
        """As `call_soon`, from any thread; beside `stop` the only method for other threads."""
        self.call_soon(call, failed)
        self._wake()

    def stop(self) -> None:
        """Let `run` return, soon."""
        self._stopping = True
        self._wake()

    # --- running

    def run(self) -> None:
        """Run until `stop`; an error without an owner ends the loop and is raised here."""
        self.is_running = True
        self._thread = threading.get_ident()
        try:
            with loop_settings():
                while not self._stopping:
                    now = time.monotonic()
                    deadline = now + 1.0
                    for service in tuple(self._services):
                        try:
                            deadline = min(deadline, service.advance(now))
                        except Exception as error:
                            self.remove(service)
                            service.failed(error)
                    while self._timers and self._timers[0][0] <= now:
                        self._calls.append(heappop(self._timers)[2])
                    if self._timers:
                        deadline = min(deadline, self._timers[0][0])
                    self._dispatch(deadline)
        finally:
            self.is_running = False
            self._thread = 0

    def close(self) -> None:
        """Release the selector and the wake-up pipe; the loop must not run any more."""
        self._selector.close()
        self._waker.close()
        self._wake_end.close()

    def _dispatch(self, deadline: float) -> None:
        """Go on with the round, or wait for the next one until `deadline`; stop when a service is due."""
        if not self._round:
            ready = self._wait(deadline)
            self._round.extend(partial(self._call_back, key, events) for key, events in ready)
            self._round.extend(self._calls.popleft() for _ in range(len(self._calls)))
        end = self._end_of_turn(deadline)
        while self._round:
            self._round.popleft()()
            if time.monotonic() >= end:
                return

    def _call_back(self, key: selectors.SelectorKey, events: int) -> None:
        """Call back for a socket that was ready at the beginning of the round, and still wants to know."""
        # A callback before this one may have closed the socket, and another may have its number by now.
        now = self._selector.get_map().get(key.fd)
        if now is not None and now.fileobj is key.fileobj and events & now.events:
            callback, failed = now.data
            try:
                callback(events & now.events)
            except Exception as error:
                self.unwatch(cast(socket.socket, now.fileobj))
                failed(error)

    def _end_of_turn(self, deadline: float) -> float:
        """Return until when callbacks may run."""
        now, lead = time.monotonic(), self._lead
        if now < deadline - lead:
            return deadline - lead
        return deadline if now < deadline else now + self._late_turn

    @property
    def _lead(self) -> float:
        """How long before a deadline a service may use the loop [s]."""
        return WAKE_UP / max(1, len(self._services))

    def _wait(self, deadline: float) -> list[_Ready]:
        """Wait for ready sockets until `deadline`; not at all if calls wait."""
        timeout = max(0.0, deadline - time.monotonic()) if not self._calls else 0.0
        ready = self._poll(timeout) if self._expects_soon else []
        if ready:
            return ready
        if self._descriptor is not None and 0.0 < timeout < _COARSE:
            return self._wait_precisely(self._descriptor, deadline)
        return self._selector.select(timeout)

    def _wait_precisely(self, descriptor: int, deadline: float) -> list[_Ready]:
        """Wait for a deadline to some microseconds: sleep for most of it, watch the clock for the rest.

        Between the two it returns, so that services can use the rest.
        """
        sleep = deadline - time.monotonic() - self._lead
        if sleep > 0.0:
            ready: list[_Ready] = []
            if descriptor < _SELECT_LIMIT:
                select.select([descriptor], [], [], sleep)
            else:
                ready = self._selector.select((int(sleep * 1e3) - 0.5) * 1e-3)
            return ready or self._selector.select(0.0)
        while not (ready := self._selector.select(0.0)) and time.monotonic() < deadline:
            pass
        return ready

    def _poll(self, timeout: float) -> list[_Ready]:
        """Poll for a ready socket for a fraction of a millisecond, unless the last polls failed."""
        self._expects_soon = False
        if self._skip:
            self._skip -= 1
            return []
        end = time.perf_counter() + min(timeout, _POLL_TIME)
        while not (ready := self._selector.select(0.0)):
            if time.perf_counter() > end:
                self._skip = self._pause
                self._pause = min(2 * self._pause, _LONGEST_PAUSE)
                return []
        self._pause = 1
        return ready

    def _wake(self) -> None:
        # A full pipe wakes the loop as well; a closed one has no loop to wake.
        with suppress(OSError):
            self._waker.send(b"\0")

    def _drain_wakes(self, events: int) -> None:
        with suppress(BlockingIOError):
            self._wake_end.recv(4096)


def end_loop(error: Exception) -> None:
    """Let an error of ours end the loop."""
    raise error
