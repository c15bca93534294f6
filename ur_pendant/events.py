"""What happens at the pages of a window, and what is asked of robots because of it.

Callbacks of viser only put events into one queue. The thread of the window takes them, in their order, and it
alone changes what the window knows. It waits for no robot: what one is asked for is an errand of another
thread, whose end is an event like others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from ur_pendant.robot import plain

Errand = Callable[[], object]

_AGAIN = 2.0
"""Before the same is told again [s]: a button that is held may have the same answer ten times a second."""


class Events:
    """The queue of a window."""

    def __init__(self) -> None:
        self._queue: SimpleQueue[Callable[[], object]] = SimpleQueue()

    def put(self, handle: Callable[[], object]) -> None:
        """Have something done by the window's thread."""
        self._queue.put(handle)

    def entry(
        self, handle: Callable[..., object], read: Callable[[Any], tuple[Any, ...]] = lambda event: (event,)
    ) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """Return a callback for viser: `handle` gets what `read` finds in an event when it happens.

        viser awaits such a callback before the next event. Plain functions it would call in threads, in any
        order.
        """

        async def enter(event: Any) -> None:
            self.put(partial(handle, *read(event)))

        return enter

    def until(self, end: float) -> Iterator[Callable[[], object]]:
        """Yield what is to be done, as it comes, until a time of `time.monotonic`."""
        while (left := end - time.monotonic()) > 0.0:
            try:
                yield self._queue.get(timeout=left)
            except Empty:
                return


class Errands:
    """What people have one robot do. All but `begin` is called by the window's thread."""

    def __init__(self, events: Events) -> None:
        self._events = events
        self._others, self._lane = ThreadPoolExecutor(), ThreadPoolExecutor(1)
        self._waiting: dict[str, Errand] = {}
        self._running: Future[object] | None = None
        self._told: tuple[Any, str] = (None, "")
        self._told_at = 0.0

    def begin(self, client: Any, errand: Errand) -> None:
        """Begin an errand in a thread of its own, whatever the window or other errands wait for."""
        Thread(target=self._run, args=(client, errand), daemon=True).start()

    def ask(self, client: Any, errand: Errand, kind: str = "") -> None:
        """Have an errand done; `client` is told what the robot says to it.

        Errands with a kind follow each other, and one that waits gives way to a newer one of its kind: the
        last is never lost, nor late. Others wait for none of them.
        """
        if kind:
            self._waiting[kind] = partial(self._run, client, errand)
            self._next()
        else:
            self._others.submit(self._run, client, errand)

    def tell(self, client: Any, title: str, text: str) -> None:
        """Tell somebody once."""
        now, before, self._told = time.monotonic(), self._told, (client, text)
        if client is not None and (before != self._told or now - self._told_at > _AGAIN):
            client.add_notification(title, plain(text), auto_close_seconds=6.0)
        self._told_at = now

    def _next(self) -> None:
        """Begin the errand with a kind that waits longest, if none runs."""
        if self._waiting and (self._running is None or self._running.done()):
            self._running = self._lane.submit(self._waiting.pop(next(iter(self._waiting))))
            self._running.add_done_callback(lambda _: self._events.put(self._next))

    def _run(self, client: Any, errand: Errand) -> None:
        """Do an errand, in a thread of its own."""
        title = "Robot"
        try:
            said = errand()
        except Exception as error:
            title, said = "Not done", str(error) or repr(error)
        if said and isinstance(said, str):
            self._events.put(partial(self.tell, client, title, said))
