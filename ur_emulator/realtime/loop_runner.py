"""Runs a loop, in the calling thread or in one of its own, and closes everything after it."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from ur_emulator.errors import EmulatorError
from ur_emulator.realtime.event_loop import EventLoop

_JOIN_TIMEOUT = 10.0  # s


class LoopRunner(ABC):
    """The life of boxes that share a loop: it runs once, then all of them are closed."""

    _loop: EventLoop
    _thread: threading.Thread | None = None
    _loop_failure: BaseException | None = None

    @abstractmethod
    def listen(self) -> None:
        """Open all ports."""

    @abstractmethod
    def close(self) -> None:
        """Close everything, the loop too; in the thread of the loop after its last turn."""

    @abstractmethod
    def _failure(self) -> Exception | None:
        """Return the error that has ended a box, if there is one."""

    def serve_forever(self) -> None:
        """Run in the calling thread until `stop`; the ports must be open.

        An error that has ended the loop or a box is raised at the end.
        """
        self._run()
        failure = self._failure()
        if failure is not None:
            raise failure

    def stop(self) -> None:
        """Let the loop end, from any thread."""
        self._loop.stop()

    def __enter__(self) -> Self:
        """Open the ports and run the loop in a thread."""
        self.listen()
        self._loop.is_running = True
        self._thread = threading.Thread(target=self._run_in_thread, name="control-box", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the loop; an error that ended it or a box earlier is raised here."""
        self.stop()
        if self._thread is not None:
            self._thread.join(_JOIN_TIMEOUT)
            if self._thread.is_alive():
                self._loop_failure = EmulatorError(
                    f"the loop of the box did not end within {_JOIN_TIMEOUT:g} s: its ports are still open; "
                    "end the process"
                )
        failure = self._loop_failure or self._failure()
        if failure is not None and error is None:
            raise failure

    def _run(self) -> None:
        try:
            self._loop.run()
        finally:
            self.close()

    def _run_in_thread(self) -> None:
        try:
            self._run()
        except BaseException as failure:
            self._loop_failure = failure
