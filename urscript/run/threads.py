"""Cooperative threads: the scheduler of one control cycle.

Every runnable thread runs once a cycle, the main thread first, then the others by age, in the same order
every cycle; each runs until its time slice ends (`NEXT_CYCLE`) or it waits (`Blocked`). A thread whose
condition comes true later in the cycle (a `join` on a thread that ends) continues in the same cycle with
the rest of its budget. Threads are not preempted, so a critical section needs no code: other threads run
only during calls that take time, also inside a critical section. Source: script manual,
thread scheduling; the fixed order: streaming programs stutter without it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

from urscript.dialect import MAX_OPEN_CALLS, MAX_THREADS, Dialect
from urscript.errors import ScriptBudgetError, ScriptRuntimeError
from urscript.run.metering import CLOSING, FREE_CALLS, Meter
from urscript.run.waits import NEXT_CYCLE, OUT_OF_UNITS, Blocked, Wait
from urscript.values import a_type

ThreadBody = Generator[Wait, None, Any]


class ThreadKilled(BaseException):
    """Unwinds a thread that killed itself or its parent; `except Exception` does not catch it."""


class ProgramHalted(BaseException):
    """Unwinds the thread that executed `halt`."""


@dataclass(eq=False, repr=False, slots=True)
class ScriptThread:
    """One thread of a program, and the value of its handle in the script.

    Attributes:
        thread_id: From 1 (the main thread) in the order of starts.
        name: Name of the `thread` definition; of the main thread the program's.
        charge: Charges it statements and units that a builtin has needed beyond those of its row.
        finished: It ended or was killed.
        wait: What it waits for; None when it can run in the next cycle.
        label: Text of the last `$` line it passed.
        budget: Statements it may still run in its time slice.
        slice_used: Its time slice of this cycle is used up.
        depth: How deep it is in recursive functions.
        open_calls: Calls inside one another: the most that its functions allow, and its recursive ones.
        resuming: Units that resuming it takes, because Python passes through all of them.
    """

    thread_id: int
    name: str
    parent: ScriptThread | None
    body: ThreadBody
    charge: Callable[[int, int], None]
    children: list[ScriptThread] = field(default_factory=list)
    finished: bool = False
    wait: Blocked | None = None
    label: str = ""
    budget: float = 0
    slice_used: bool = False
    depth: int = 0
    open_calls: int = 0
    resuming: int = 0
    script_type: ClassVar[str] = "thread"

    def subtree(self) -> Iterator[ScriptThread]:
        """Its unfinished descendants, deepest first, then itself."""
        for child in self.children:
            yield from child.subtree()
        if not self.finished:
            yield self

    def __str__(self) -> str:
        return str(self.thread_id)

    def __repr__(self) -> str:
        state = "finished" if self.finished else "waiting" if self.wait else "runnable"
        return f"<thread {self.thread_id} {self.name!r} {state}>"


class Scheduler:
    """Runs the threads of one program.

    A turn is a cycle of the program: every thread has had its time slice. It takes several cycles of the
    robot when the units of a cycle do not suffice.

    Attributes:
        is_between: A turn has begun: the threads go on in the next cycle where they stopped.
        threads: Unfinished threads, the main thread first, then by age.
        main: The thread whose end ends the program.
    """

    def __init__(
        self,
        namespace: dict[str, Any],
        meter: Meter,
        dialect: Dialect,
        thread_ended: Callable[[ScriptThread], None],
    ) -> None:
        self._namespace = namespace
        self._meter = meter
        self._budget = dialect.statement_budget
        self._recursion_limit = dialect.recursion_limit
        self._open_calls = 0
        self._thread_ended = thread_ended
        self._turns = self._take_turns()
        self.is_between = False
        self._count = 0
        self._some_finished = False
        self.threads: list[ScriptThread] = []
        self.main: ScriptThread | None = None

    def start(
        self, function: Callable[[], ThreadBody], name: str, parent: ScriptThread | None, depth: int
    ) -> ScriptThread:
        """Start the generator that `function` makes as a thread; it first runs when its turn comes.

        `depth`: calls inside one another that its functions allow.

        Raises:
            ScriptRuntimeError: the program has as many threads as it may, or as many open calls.
        """
        # Those that end stay in the list until the end of the cycle.
        if len(self.threads) >= MAX_THREADS <= sum(not thread.finished for thread in self.threads):
            raise ScriptRuntimeError(f"too many threads: a program may have {MAX_THREADS} at the same time")
        self._count += 1
        thread = ScriptThread(self._count, name, parent, function(), self._meter.charge)
        thread.budget = self._budget
        self.deepen(thread, depth)
        if parent is None:
            self.main = thread
        else:
            parent.children.append(thread)
        self.threads.append(thread)
        return thread

    def enter(self, thread: ScriptThread) -> ScriptThread:
        """A recursive function is called.

        Raises:
            ScriptRuntimeError: the recursion is too deep, or the program has too many open calls.
        """
        thread.depth += 1
        if thread.depth > self._recursion_limit:
            raise ScriptRuntimeError(f"recursion is deeper than {self._recursion_limit} calls")
        self.deepen(thread, 1)
        return thread

    def leave(self, thread: ScriptThread) -> None:
        """It returns."""
        thread.depth -= 1
        self.deepen(thread, -1)

    def deepen(self, thread: ScriptThread, calls: int) -> None:
        """Count so many calls more inside one another in a thread; below 0 less.

        Raises:
            ScriptRuntimeError: the program has more than it may.
        """
        thread.open_calls += calls
        thread.resuming = max(0, thread.open_calls - FREE_CALLS)
        self._open_calls += calls
        if calls > 0 and self._open_calls > MAX_OPEN_CALLS:
            raise ScriptRuntimeError(
                f"calls are too deep: all threads together may have {MAX_OPEN_CALLS} inside one another"
            )

    def step(self) -> None:
        """Run one control cycle; exceptions of threads are not caught."""
        self.is_between = next(self._turns)

    def _take_turns(self) -> Generator[bool, None, None]:
        """Run the threads in turn; yield at the end of a cycle whether the turn goes on in the next one."""
        while True:
            threads = self.threads
            budget = self._budget
            for thread in threads:
                thread.slice_used = False
                thread.budget = budget
            first_pass = True
            while True:
                progress = False
                waits_inside = False
                index = 0
                # The list grows while it is walked: a new thread gets its slice in the turn of its start.
                while index < len(threads):
                    thread = threads[index]
                    index += 1
                    if thread.slice_used:
                        continue
                    wait = thread.wait
                    if wait is not None:
                        if wait.outside and not first_pass:
                            continue
                        if not wait.ready():
                            waits_inside = waits_inside or not wait.outside
                            continue
                        thread.wait = None
                    while not self._resume(thread):
                        yield True
                    if thread.finished and thread is self.main:
                        yield False
                        return
                    progress = True
                    wait = thread.wait
                    if wait is not None and not wait.outside:
                        waits_inside = True
                if not (progress and waits_inside):
                    break
                first_pass = False
            if self._some_finished:
                self._some_finished = False
                self.threads = [thread for thread in threads if not thread.finished]
            yield False

    def _resume(self, thread: ScriptThread) -> bool:
        """Let a thread run; return False if it stopped because the units of the cycle are used up."""
        meter = self._meter
        work = meter.work
        if work.left <= 0:
            return False
        self._namespace["_T"] = thread
        budget = thread.budget
        meter.grant(budget)
        proceed = thread.body.send
        try:
            while True:
                if thread.resuming:
                    meter.charge(0, thread.resuming)
                wait = proceed(None)
                if wait is NEXT_CYCLE:
                    thread.slice_used = True
                    break
                if wait is OUT_OF_UNITS:
                    if meter.settle() < 0:
                        thread.body.throw(ScriptBudgetError())
                    if work.left <= 0:
                        return False
                    meter.grant(meter.statements)
                elif not wait.ready():
                    thread.wait = wait
                    break
                elif 2 * meter.settle() < budget:
                    thread.slice_used = True
                    break
        except StopIteration:
            self._end(thread)
        except ThreadKilled:
            self._end(thread)
        finally:
            thread.budget = meter.settle()
        return True

    def _end(self, thread: ScriptThread) -> None:
        thread.finished = True
        thread.slice_used = True
        thread.wait = None
        self._open_calls -= thread.open_calls
        # Its running children now belong to its parent: killing that one stops them too.
        if thread.parent is not None:
            thread.parent.children.remove(thread)
            thread.parent.children.extend(thread.children)
        for child in thread.children:
            child.parent = thread.parent
        thread.children = []
        self._some_finished = True
        self._thread_ended(thread)

    def kill(self, by: ScriptThread | None, handle: Any) -> None:
        """Stop the thread of `handle` and its children; 0 is no thread and has no effect.

        Raises:
            ThreadKilled: The killer is among them.
            ScriptRuntimeError: `handle` is no thread.
        """
        thread = thread_of(handle, "kill")
        if thread is None:
            return
        kills_itself = False
        for member in list(thread.subtree()):
            if member is by:
                kills_itself = True
                continue
            self._meter.charge(0, CLOSING * member.resuming)
            member.body.close()
            self._end(member)
        if kills_itself:
            raise ThreadKilled

    def kill_all(self) -> Exception | None:
        """Stop every thread, children first; returns the first error of a builtin's cleanup, if any."""
        fault: Exception | None = None
        for thread in reversed(self.threads):
            if thread.finished:
                continue
            # The cycles that follow, of this program's successor, pay for it.
            self._meter.work.left -= CLOSING * thread.resuming
            try:
                thread.body.close()
            except Exception as error:
                fault = fault or error
            self._end(thread)
        self.threads = []
        self._turns.close()
        self.is_between = False
        return fault


def join(by: ScriptThread, handle: Any) -> ThreadBody:
    """Wait until the thread of `handle` ends; 0 is no thread and has no effect."""
    thread = thread_of(handle, "join")
    if thread is by:
        raise ScriptRuntimeError("a thread cannot join itself")
    if thread is not None and not thread.finished:
        yield Blocked(lambda: thread.finished)


def thread_of(handle: Any, word: str) -> ScriptThread | None:
    """The thread of a handle; None for an integer, because programs preset handles to 0 and kill them.

    Source: driver scripts.
    """
    if isinstance(handle, ScriptThread):
        return handle
    if type(handle) is int or handle is None:
        return None
    raise ScriptRuntimeError(f"{word} needs a thread handle, got {a_type(handle)}")
