"""The interface between a running program and its robot.

The language implements control flow, text and mathematics; everything that acts on the robot or reads its
state is a function of the host. `recording_host` is a host without a robot.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

from urscript.compile.interpreter_mode import CompiledStatements
from urscript.run.threads import ScriptThread
from urscript.run.waits import Wait

HostFunction = Callable[..., Any]
"""Called as `f(thread, *arguments)`: all parameters of the catalogue row in order, defaults filled in, types
checked. If the row may take time it is a generator function that yields `waits`, else it returns the value.
Raises ScriptRuntimeError with the message alone. Must not change lists it is given or has returned."""


class Host(Protocol):
    """A robot, as seen by a running program."""

    step_time: float
    """Length of a control cycle in s."""

    def builtins(self) -> Mapping[str, HostFunction]:
        """The builtins of this robot, by URScript name; called once for each start of a program.

        A function of `urscript.builtins` may be replaced: `random` is.
        """
        ...

    def textmsg(self, text: str) -> None:
        """Show `text` in the log and send it to the primary clients."""
        ...

    def thread_ended(self, thread: ScriptThread) -> None:
        """A thread ended, by itself or killed: it owns the arm no longer."""
        ...

    def program_ended(self) -> None:
        """The program ended, for any reason: close its sockets, leave its modes."""
        ...


class StatementQueue(Protocol):
    """Where interpreter mode gets its statements.

    Attributes:
        is_ending: The mode ends when the present statements have ended.
        is_clearing: All that was interpreted is to be cleared when the present statements have ended.
        clears_on_end: It is also cleared when the mode ends.
    """

    is_ending: bool
    is_clearing: bool
    clears_on_end: bool

    def take(self) -> CompiledStatements | None:
        """The next line, which now begins to run; None if none is there."""
        ...

    def is_ready(self) -> bool:
        """Whether there is something to do."""
        ...

    def cleared(self) -> None:
        """All that was interpreted so far is cleared."""
        ...

    def leave(self) -> None:
        """The mode has ended."""
        ...


EnterMode = Callable[[bytes], StatementQueue]
"""What the builtin `interpreter_mode` of a host returns: called with the names that statements find, as
`compile_statements` takes them, it begins the mode."""


@runtime_checkable
class Handle(Protocol):
    """A value with methods, such as a remote-procedure handle."""

    script_type: str

    def call_method(
        self, thread: ScriptThread, method: str, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> Generator[Wait, None, Any]:
        """Call `handle.method(arguments)`; raises ScriptRuntimeError when there is no such method."""
        ...
