"""Runs a loop, in the calling thread or in one of its own, and cleans up after it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ur_emulator.errors import EmulatorError
from ur_emulator.realtime.event_loop import EventLoop

_JOIN_TIMEOUT = 10.0  # s


class LoopRunner:
    """The life of a loop: it runs once, then everything in it is closed."""

    def __init__(self, loop: EventLoop, close: Callable[[], None]) -> None:
        """Prepare.

        Args:
            loop: what runs.
            close: called in the loop's thread after its last turn, whatever ended it.
        """
        self._loop = loop
        self._close = close
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def run(self) -> None:
        """Run in the calling thread until `stop`; an error that ends the loop is raised here."""
        try:
            self._loop.run()
        finally:
            self._close()

    def start(self, name: str) -> None:
        """Run in a thread of its own, called `name`."""
        self._loop.is_running = True
        self._thread = threading.Thread(target=self._run_and_keep_failure, name=name, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Let the loop end, from any thread."""
        self._loop.stop()

    def finish(self) -> BaseException | None:
        """Stop the loop, wait for its thread; return the error that had ended it earlier, if one had.

        A loop that does not end in time is such an error: its ports are still open.
        """
        self.stop()
        if self._thread is not None:
            self._thread.join(_JOIN_TIMEOUT)
            if self._thread.is_alive():
                return EmulatorError(
                    f"the loop of the box did not end within {_JOIN_TIMEOUT:g} s: its ports are still open; "
                    "end the process"
                )
        return self._failure

    def _run_and_keep_failure(self) -> None:
        try:
            self.run()
        except BaseException as failure:
            self._failure = failure
