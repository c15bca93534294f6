"""Interpreter mode: the main thread of a program runs statements that arrive while it waits.

The statements become part of the program: their functions and variables stand in its namespace until they are
cleared. The main thread runs them in the order of their arrival. Source: script manual 5.11.
"""

import marshal
from collections.abc import Callable, Container, Generator, Iterable, Mapping
from typing import Any, Final

from urscript.compile.compiler import CompiledCode
from urscript.compile.interpreter_mode import CompiledStatements
from urscript.errors import ScriptRuntimeError
from urscript.run.host import EnterMode
from urscript.run.metering import Meter
from urscript.run.threads import Scheduler, ScriptThread
from urscript.run.variables import UNDEFINED
from urscript.run.waits import CHECKPOINT, Blocked, Outside, Wait
from urscript.source import Source

_LINK_STATEMENTS: Final = 10
_LINK_UNITS: Final = 2_000
"""What it costs to link a line of statements: 100 µs."""

_NO_SUCH_PLACE: Final = "interpreter_mode cannot be called in the default of a parameter"
_NOT_IN_MAIN: Final = "interpreter_mode can only be called in the main thread of a primary program"
_NESTED: Final = "interpreter_mode cannot be called in interpreter mode: it cannot be nested"


class InterpreterMode:
    """The interpreter mode of one running program.

    Args:
        namespace: The globals of the compiled program.
        bind: Gives builtins by their names in Python.
        texts: Code and text of the program, and of all statements that are linked, by pseudo file name.
        scopes: The names that statements find, pickled, by the function that calls `interpreter_mode`.
        is_secondary: The program is a `sec`, which has no interpreter mode.
    """

    def __init__(
        self,
        namespace: dict[str, Any],
        scheduler: Scheduler,
        meter: Meter,
        bind: Callable[[Iterable[str]], Mapping[str, Any]],
        texts: dict[str, tuple[CompiledCode, Source]],
        scopes: Mapping[str, bytes],
        *,
        is_secondary: bool,
    ) -> None:
        self._namespace = namespace
        self._scheduler = scheduler
        self._meter = meter
        self._bind = bind
        self._texts = texts
        self._scopes = scopes
        self._is_secondary = is_secondary
        self._is_on = False
        # What was linked since all was cleared last: names in the namespace, files in the texts.
        self._names: list[str] = []
        self._files: list[str] = []

    def run(
        self, enter: EnterMode, function: str, values: dict[str, Any]
    ) -> Generator[Wait, None, list[Any]]:
        """Run statements until the mode ends.

        Args:
            function: Python name of the function that calls.
            values: Its locals, by the names that they have for statements.

        Returns:
            The locals afterwards, in the same order.

        Raises:
            ScriptRuntimeError: It is called by another thread than the main one, or by a statement.
        """
        scheduler, namespace = self._scheduler, self._namespace
        main: ScriptThread = namespace["_T"]
        if main is not scheduler.main or self._is_secondary:
            raise ScriptRuntimeError(_NOT_IN_MAIN)
        if self._is_on:
            raise ScriptRuntimeError(_NESTED)
        if function not in self._scopes:
            raise ScriptRuntimeError(_NO_SUCH_PLACE)
        namespace.update(values)
        started_before = {thread.thread_id for thread in scheduler.threads}
        self._is_on = True
        queue = enter(self._scopes[function])
        while not queue.is_ending:
            if queue.is_clearing:
                self._clear(started_before)
                queue.cleared()
            statements = queue.take()
            if statements is None:
                yield Blocked(queue.is_ready, Outside.OPERATOR)
                continue
            scheduler.deepen(main, statements.depth)
            yield from self._link(statements)()
            scheduler.deepen(main, -statements.depth)
            yield CHECKPOINT
        if queue.clears_on_end or queue.is_clearing:
            self._clear(started_before)
        queue.leave()
        self._is_on = False
        return [namespace[name] for name in values]

    def _link(self, statements: CompiledStatements) -> Callable[[], Generator[Wait, None, Any]]:
        """Make statements part of the program; return the function that runs them."""
        namespace, compiled = self._namespace, statements.compiled
        self._meter.charge(_LINK_STATEMENTS, _LINK_UNITS)
        namespace.update(self._bind(name for name in statements.builtins if f"b_{name}" not in namespace))
        namespace.update(compiled.constants)
        namespace.update(dict.fromkeys(statements.variables, UNDEFINED))
        exec(marshal.loads(compiled.code), namespace)
        self._names += (*compiled.function_names, *compiled.constants, *statements.variables)
        self._files.append(compiled.file_name)
        self._texts[compiled.file_name] = compiled, statements.source
        return namespace[statements.entry]  # type: ignore[no-any-return]

    def _clear(self, started_before: Container[int]) -> None:
        """Stop the threads that statements have started, and remove what was linked."""
        main = self._namespace["_T"]
        for child in tuple(main.children):
            if child.thread_id not in started_before:
                self._scheduler.kill(main, child)
        for name in self._names:
            self._namespace.pop(name, None)
        for file_name in self._files:
            self._texts.pop(file_name, None)
        self._names, self._files = [], []
