"""A program, compiled (`CompiledProgram`) and running (`RunningProgram`).

    text -> source -> parser -> nodes -> resolver -> compiler -> CompiledProgram -> start(host) -> step() ...

`compile_program` is the entry point; it raises the first error, `urscript.check` finds all of a text.
"""

from __future__ import annotations

import marshal
import pickle
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Final

from urscript.catalogue import CB3_3_15, Catalogue
from urscript.compile.compiler import CompiledCode, compile_resolved
from urscript.dialect import Dialect, dialect_for
from urscript.errors import ScriptCompileError, ScriptRuntimeError, ScriptSyntaxError, StackEntry
from urscript.names.living_scope import living_scopes
from urscript.names.resolver import resolve
from urscript.names.scopes import ResolvedProgram
from urscript.run import runtime, variables
from urscript.run.interpreter_mode import InterpreterMode
from urscript.run.metering import Meter, WorkBudget
from urscript.run.threads import ProgramHalted, Scheduler, ScriptThread
from urscript.run.variables import UNDEFINED
from urscript.run.waits import Outside
from urscript.source import Source, as_bytes
from urscript.syntax.parser import parse
from urscript.values import size_of

if TYPE_CHECKING:
    from urscript.run.host import Host


_LONGEST_KEPT: Final = 4_000
"""Elements or characters of a global that can be read when the program has ended."""

_RELEASED_AT_ONCE: Final = 1_000_000
"""Values of such globals that are released in a cycle (1 to 2 ms)."""


def compile_program(
    text: str, *, catalogue: Catalogue = CB3_3_15, dialect: Dialect | None = None, name: str = "<program>"
) -> CompiledProgram:
    """Compile one program.

    Args:
        text: A `def` or `sec` program, or statements without a definition around them. One character a byte
            (latin-1); text with other characters is taken as UTF-8 bytes.
        catalogue: The builtins of the software version the program runs on.
        dialect: Options of the language; by default those of the catalogue's version.
        name: Name of the text in error messages.

    Raises:
        ScriptCompileError: The first error in the text, with line, column, wire_text and render().
    """
    dialect = dialect or dialect_for(catalogue.version)
    program, errors = resolve_source(Source(as_bytes(text), name), catalogue, dialect)
    if errors:
        raise errors[0]
    assert program is not None
    return compiled_program(program, catalogue, dialect)


def resolve_source(
    source: Source, catalogue: Catalogue, dialect: Dialect
) -> tuple[ResolvedProgram | None, list[ScriptCompileError]]:
    """Find every name of a text; return all errors, and what was found: None after an error of syntax."""
    try:
        return resolve(parse(source), source, catalogue, dialect)
    except ScriptSyntaxError as error:
        return None, [error]
    except RecursionError:
        return None, [_too_deep(source)]


def compiled_program(program: ResolvedProgram, catalogue: Catalogue, dialect: Dialect) -> CompiledProgram:
    """Compile a program without errors.

    Raises:
        ScriptCompileError: It is nested too deeply.
    """
    try:
        compiled = compile_resolved(program, catalogue, f"<urscript {program.name}>")
    except RecursionError:
        raise _too_deep(program.source) from None
    return CompiledProgram(
        name=program.name,
        kind=program.kind,
        source=program.source,
        dialect=dialect,
        catalogue=catalogue,
        compiled=compiled,
        builtins=frozenset(program.builtins),
        globals=frozenset(program.globals),
        declared_globals=tuple(program.declared_globals),
        depth=program.main.depth,
        living_scopes={name: pickle.dumps(scope) for name, scope in living_scopes(program).items()},
    )


def _too_deep(source: Source) -> ScriptSyntaxError:
    return ScriptSyntaxError("the program is nested too deeply", line=1, column=1, source=source)


@dataclass(frozen=True, slots=True)
class CompiledProgram:
    """A program ready to run, any number of times; a record that can be pickled.

    Attributes:
        name: The `def` name; of a one-line program the function it calls.
        kind: "def" (primary), "sec" (secondary), or "statement".
        declared_globals: Those that are declared with `global`, in the order of the text.
        depth: Calls inside one another that its functions allow, recursive ones aside.
        living_scopes: The names that statements of interpreter mode find, pickled, by the Python name of the
            function that calls `interpreter_mode`.
    """

    name: str
    kind: str
    source: Source = field(repr=False)
    dialect: Dialect = field(repr=False)
    catalogue: Catalogue = field(repr=False)
    compiled: CompiledCode = field(repr=False)
    builtins: frozenset[str]
    globals: frozenset[str]
    declared_globals: tuple[str, ...]
    depth: int
    living_scopes: Mapping[str, bytes] = field(repr=False)

    def start(self, host: Host, work: WorkBudget | None = None) -> RunningProgram:
        """A new run on `host`; it begins with its first `step`.

        Args:
            work: What it may do in a cycle; its owner renews it. Without one there is no such limit.
        """
        return RunningProgram(self, host, work)


class ProgramStatus(Enum):
    """State of a run."""

    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"


class RunningProgram:
    """One run of a program.

    Attributes:
        status: RUNNING until the main thread ends, `halt`, an error, or `kill`.
        error: The error of a FAILED run, with line, column and call stack.
    """

    def __init__(self, program: CompiledProgram, host: Host, work: WorkBudget | None = None) -> None:
        self.program = program
        self.status = ProgramStatus.RUNNING
        self.error: ScriptRuntimeError | None = None
        self._host = host
        self._in_step = False
        self._kill_wanted = False
        self._unreleased: list[Any] = []
        self._namespace: dict[str, Any] = {}
        meter = Meter(self._namespace, work or WorkBudget())
        self._namespace.update(runtime.base_namespace(program.dialect, program.catalogue.methods, meter))
        self._scheduler = Scheduler(self._namespace, meter, program.dialect, host.thread_ended)
        self._namespace.update(runtime.flow_namespace(self._scheduler, self._namespace, meter))
        bind = partial(runtime.builtin_namespace, catalogue=program.catalogue, host=host, meter=meter)
        self._namespace.update(bind(program.builtins))
        self._texts = {program.compiled.file_name: (program.compiled, program.source)}
        if "interpreter_mode" in program.builtins:
            mode = InterpreterMode(
                self._namespace,
                self._scheduler,
                meter,
                bind,
                self._texts,
                program.living_scopes,
                is_secondary=program.kind == "sec",
            )
            self._namespace["_interpret"] = mode.run
        self._namespace.update(program.compiled.constants)
        self._namespace.update(dict.fromkeys((f"g_{name}" for name in program.globals), UNDEFINED))
        exec(marshal.loads(program.compiled.code), self._namespace)
        self._main = self._scheduler.start(self._namespace["main"], program.name, None, program.depth)

    @property
    def threads(self) -> Sequence[ScriptThread]:
        """The unfinished threads in the order they run."""
        return [thread for thread in self._scheduler.threads if not thread.finished]

    @property
    def is_between(self) -> bool:
        """Whether it used up the units of this cycle: it goes on in the next one where it stopped."""
        return self._scheduler.is_between

    @property
    def waits_outside(self) -> Outside | None:
        """Who outside the box the program waits for, when all threads have had their turn.

        For a peer if one thread does; for the operator if one does and no thread can run.
        """
        if self._scheduler.is_between:
            return None
        waits = [thread.wait for thread in self._scheduler.threads]
        who = {wait.outside for wait in waits if wait is not None and wait.outside and not wait.ready()}
        if Outside.PEER in who:
            return Outside.PEER
        is_idle = all(wait is not None and not wait.ready() for wait in waits)
        return Outside.OPERATOR if who and is_idle else None

    def step(self) -> ProgramStatus:
        """Run one control cycle; after the end it does nothing."""
        if self.status is not ProgramStatus.RUNNING:
            return self.status
        self._in_step = True
        try:
            self._scheduler.step()
        except ProgramHalted:
            self._finish(ProgramStatus.FINISHED)
        except Exception as error:
            self._fail(_script_error(error, self._texts))
        else:
            if self._main.finished or self._kill_wanted:
                self._finish(ProgramStatus.FINISHED)
            elif self.program.kind == "sec" and not self.is_between:
                self.fail("a secondary program must end within one control cycle")
        finally:
            self._in_step = False
        return self.status

    def kill(self) -> None:
        """End the run: stopped from outside or replaced by another program.

        Called by a host function, within a cycle, it takes effect at the end of that cycle.
        """
        if self._in_step:
            self._kill_wanted = True
        elif self.status is ProgramStatus.RUNNING:
            self._finish(ProgramStatus.FINISHED)

    def fail(self, text: str) -> None:
        """End the run with an error, at the place where its main thread is."""
        if self.status is ProgramStatus.RUNNING:
            line, column = self.position(self._main)
            self._fail(ScriptRuntimeError(text).locate(self.program.source, line, column))

    @property
    def is_releasing(self) -> bool:
        """Whether the run has ended and still holds long values: to release all takes longer than a cycle."""
        return bool(self._unreleased)

    def release(self) -> None:
        """Release as many of them as a cycle has time for."""
        left = _RELEASED_AT_ONCE
        while self._unreleased and left > 0:
            left -= size_of(self._unreleased.pop())

    def forget(self) -> None:
        """Drop the values of all variables; after the end."""
        self._namespace.update(dict.fromkeys(self._namespace, UNDEFINED))

    def read_global(self, name: str) -> Any:
        """The value of a global variable; `variables.UNDEFINED` before the first assignment.

        Raises:
            KeyError: The program has no such variable.
        """
        return self._namespace[f"g_{name}"]

    def position(self, thread: ScriptThread) -> tuple[int, int]:
        """Line and column of a suspended thread, of the innermost call in the script."""
        compiled = self.program.compiled
        place = 1, 1
        body: Any = thread.body
        while body is not None and hasattr(body, "gi_frame"):
            frame = body.gi_frame
            if frame is not None and frame.f_code.co_filename == compiled.file_name:
                place = compiled.positions[frame.f_code.co_name].at(frame.f_lasti)
            body = body.gi_yieldfrom
        return place

    def _fail(self, error: ScriptRuntimeError) -> None:
        if error.stack:
            place = error.stack[-1]
            error.locate(error.source, place.line, place.column)
        # The traceback would keep every frame of the run alive as long as the error is referenced.
        self.error = error.with_traceback(None)
        self._finish(ProgramStatus.FAILED)

    def _finish(self, status: ProgramStatus) -> None:
        self.status = status
        fault = self._scheduler.kill_all()
        if fault is not None and self.error is None:
            self.status = ProgramStatus.FAILED
            self.error = _script_error(fault, self._texts)
        # Functions and their globals refer to each other; a box that runs with its garbage collector frozen
        # would keep every program it ever ran. The variables stay readable, but for those that hold much.
        for name, value in tuple(self._namespace.items()):
            if not name.startswith("g_"):
                del self._namespace[name]
            elif isinstance(value, (list, str)) and len(value) > _LONGEST_KEPT:
                self._namespace[name] = UNDEFINED
                self._unreleased.append(value)
        self._host.program_ended()


# --- places of errors in the script: compiled code carries lines and columns, see `compile.python_tree`


_Texts = Mapping[str, tuple[CompiledCode, Source]]
"""Code and text of a program and of what is linked into it, by pseudo file name."""


def _script_error(error: Exception, texts: _Texts) -> ScriptRuntimeError:
    """The run-time error of the program for `error`, with its place and call stack.

    Where static types are known, compiled code uses Python's operators; their exceptions are translated here.
    """
    stack, innermost, source = _stack(error.__traceback__, texts)
    if isinstance(error, ScriptRuntimeError):
        found = error
    elif innermost is not None and isinstance(error, IndexError):
        assert source is not None
        found = ScriptRuntimeError(_bad_index(innermost, stack[-1], source))
    elif innermost is not None and isinstance(error, ZeroDivisionError):
        found = ScriptRuntimeError("division by zero")
    elif isinstance(error, RecursionError):
        found = ScriptRuntimeError("calls are nested too deeply")
    else:
        found = ScriptRuntimeError(f"internal error of this box: {type(error).__name__}: {error}")
        found.__cause__ = error
    found.stack = tuple(stack)
    found.source = source
    return found


def _bad_index(frame: FrameType, place: StackEntry, source: Source) -> str:
    """The message for an IndexError of a subscript, which is always a variable with a constant index."""
    form = re.match(r"(\w+)\s*\[\s*(\d+)", source.line(place.line)[place.column - 1 :])
    if form is not None:
        names = f"v_{form[1]}", f"l_{form[1]}", f"g_{form[1]}"
        found = {**frame.f_globals, **frame.f_locals}
        variable = next((found[name] for name in names if name in found), None)
        try:
            variables.item(variable, int(form[2]))
        except ScriptRuntimeError as error:
            return error.message
    return "index is out of range"


def _stack(
    traceback: TracebackType | None, texts: _Texts
) -> tuple[list[StackEntry], FrameType | None, Source | None]:
    """The call stack in the script, outermost first, the innermost frame if it is in the script, its text."""
    stack: list[StackEntry] = []
    innermost = source = None
    while traceback is not None:
        innermost = traceback.tb_frame
        code = innermost.f_code
        if code.co_filename in texts:
            program, source = texts[code.co_filename]
            name = code.co_name
            line, column = program.positions[name].at(traceback.tb_lasti)
            stack.append(StackEntry(program.function_names.get(name, name), line, column))
        else:
            innermost = None
        traceback = traceback.tb_next
    return stack, innermost, source
