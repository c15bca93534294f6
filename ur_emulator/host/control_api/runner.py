"""Does operations: for other threads, which wait for the result, and for the HTTP port.

All is done in the thread of the loop, step by step as cycles pass.
"""

import threading
from collections.abc import Generator
from concurrent.futures import Future
from typing import Any
from weakref import WeakSet

from ur_emulator.errors import ControlError, NotRunningError
from ur_emulator.host.control_api.step_operations import Context, StepOperation
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.steps import Finished, Steps, settle
from ur_emulator.machine.commands.operation import CommandOperation, Operation
from ur_emulator.machine.controller.events import LogAdded

# Longest value of an argument in the log, in characters.
_MAX_SHOWN = 60


class OperationRunner:
    """Runs operations on one box."""

    def __init__(self, loop: EventLoop, context: Context) -> None:
        self._loop = loop
        self._context = context
        self._lock = threading.Lock()
        self._awaited: WeakSet[Future[Any]] = WeakSet()
        self._is_closed = False

    def perform(self, operation: Operation[Any]) -> Any:
        """Do an operation, from any thread but the loop's; return its result, or raise ControlError."""
        if self._loop.is_own_thread:
            raise ControlError(
                f"{operation.api_name} called in the thread of the box, which cannot wait: use `submit`"
            )
        future: Future[Any] = Future()
        with self._lock:
            if self._is_closed or not self._loop.is_running:
                raise NotRunningError(
                    NotRunningError.ENDED if self._is_closed else "the box does not run: start it first"
                )
            self._awaited.add(future)

        def start() -> None:
            if not self._is_closed:
                self.begin(operation, settle(future))

        self._loop.call_soon_threadsafe(start, future.set_exception)
        return future.result()

    def begin(self, operation: Operation[Any], finished: Finished) -> None:
        """Begin with an operation, in the thread of the loop; `finished` gets its result or its error."""
        self._context.box.steps.start(self.steps(operation), finished)

    def steps(self, operation: Operation[Any]) -> Steps[Any]:
        """Write an operation into the log, do it, and return its result."""
        box = self._context.box
        if operation.is_logged and not operation.only_reads:
            box.announce(LogAdded("Control", _shown(operation)))
        if isinstance(operation, StepOperation):
            result = operation.steps(self._context)
            return (yield from result) if isinstance(result, Generator) else result
        assert isinstance(operation, CommandOperation)
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


def _shown(operation: Operation[Any]) -> str:
    """Return an operation as one line for the log."""
    words = [operation.api_name]
    for key, value in operation.as_given.items():
        if value is not None:
            text = " ".join(str(value).split())
            words.append(f"{key}={text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + '...'}")
    return " ".join(words)
