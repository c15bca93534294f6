"""Does operations: for other threads, which wait for the result, and for the HTTP port.

All is done in the thread of the loop, step by step as cycles pass.
"""

import threading
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

from ur_emulator.errors import ControlError, NotRunningError
from ur_emulator.host.control_api.operations import make
from ur_emulator.host.control_api.step_operations import Context, StepOperation
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.steps import Finished, Steps, settle
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.controller.events import LogAdded

# Longest value of an argument in the log, in characters.
_MAX_SHOWN = 60


class OperationRunner:
    """Runs operations on one box."""

    def __init__(self, loop: EventLoop, context: Context) -> None:
        self._loop = loop
        self._context = context
        self._lock = threading.Lock()
        self._awaited: set[Future[Any]] = set()
        self._is_closed = False

    def perform(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Do an operation, from any thread but the loop's; return its result, or raise ControlError."""
        if self._loop.is_own_thread:
            raise ControlError(f"{name} called in the thread of the box, which cannot wait: use `submit`")
        future: Future[Any] = Future()
        with self._lock:
            if self._is_closed or not self._loop.is_running:
                raise NotRunningError(
                    NotRunningError.ENDED if self._is_closed else "the box does not run: start it first"
                )
            self._awaited.add(future)

        def start() -> None:
            if not self._is_closed:
                self.begin(name, arguments, settle(future))

        self._loop.call_soon_threadsafe(start, future.set_exception)
        try:
            return future.result()
        finally:
            with self._lock:
                self._awaited.discard(future)

    def begin(self, name: str, arguments: Mapping[str, Any], finished: Finished) -> None:
        """Begin with an operation, in the thread of the loop; `finished` gets its result or its error."""
        self._context.box.steps.start(self.steps(name, arguments), finished)

    def steps(self, name: str, arguments: Mapping[str, Any]) -> Steps[Any]:
        """Check the arguments of an operation, write it into the log, do it, and return its result."""
        box = self._context.box
        operation = make(name, arguments)
        if operation.is_logged and not operation.only_reads:
            given = {key: getattr(operation, key) for key in arguments}
            box.announce(LogAdded("Control", _shown(name, given)))
        if isinstance(operation, StepOperation):
            return (yield from operation.steps(self._context))
        assert isinstance(operation, Command)
        result = yield from box.apply(operation)
        return {**(result or {}), "tick": box.snapshot.tick}

    def close(self) -> None:
        """Inform all threads that wait, after the steps have ended, that the box has ended."""
        with self._lock:
            self._is_closed = True
            awaited = tuple(self._awaited)
        for future in awaited:
            if not future.done():
                future.set_exception(NotRunningError())


def _shown(name: str, arguments: Mapping[str, Any]) -> str:
    """Return an operation as one line for the log."""
    words = [name]
    for key, value in arguments.items():
        if value is None:
            continue
        text = " ".join(str(value).split())
        words.append(f"{key}={text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + '...'}")
    return " ".join(words)
