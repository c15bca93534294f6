"""Work that takes several cycles, written as generators, and what advances it.

A generator yields where it has to wait; it is continued after every cycle and when a task of the worker
process has ended. So nothing waits for a clock, and a request is answered after it was done. An error ends
the steps in which it was raised, and the caller that began them gets it.
"""

from collections.abc import Callable, Generator
from concurrent.futures import Future
from typing import Any, TypeVar

from ur_emulator.host.runtime.barrier import Failed, guarded
from ur_emulator.machine.controller.snapshot import Snapshot

T = TypeVar("T")
Steps = Generator[None, None, T]
# Called with the result of the steps, or with the error that ended them.
Finished = Callable[[Any, Exception | None], None]


def result_of(work: T | Steps[T]) -> Steps[T]:
    """Do work to its end and return its result; work that never waits is no generator but the result."""
    return (yield from work) if isinstance(work, Generator) else work


class StepRunner:
    """Advances all steps of one box; in the thread of its loop."""

    def __init__(self, failed: Failed) -> None:
        """Begin with nothing; `failed` is called with an error of ours in the `finished` of steps."""
        self._failed = failed
        self._under_way: list[tuple[Steps[Any], Finished]] = []

    def start(self, steps: Steps[Any], finished: Finished) -> None:
        """Begin with steps; `finished` may be called before this returns."""
        if not self._advance(steps, finished):
            self._under_way.append((steps, finished))

    def publish(self, snapshot: Snapshot) -> None:
        """Go on after a cycle."""
        if self._under_way:
            self.advance()

    def advance(self) -> None:
        """Go on with everything that has begun."""
        under_way, self._under_way = self._under_way, []
        self._under_way = [task for task in under_way if not self._advance(*task)] + self._under_way

    def close(self, error: Exception) -> None:
        """End everything; `finished` is called with the error."""
        under_way, self._under_way = self._under_way, []
        for steps, finished in under_way:
            guarded(self._failed, steps.close)
            guarded(self._failed, finished, None, error)

    def _advance(self, steps: Steps[Any], finished: Finished) -> bool:
        """Take one step; return whether it was the last."""
        try:
            next(steps)
        except StopIteration as end:
            guarded(self._failed, finished, end.value, None)
        except Exception as error:
            guarded(self._failed, finished, None, error)
        else:
            return False
        return True


def settle(future: Future[Any]) -> Finished:
    """Return a function that makes a result or an error that of a future."""

    def finished(result: Any, error: Exception | None) -> None:
        if error is None:
            future.set_result(result)
        else:
            future.set_exception(error)

    return finished
