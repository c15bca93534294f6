"""Interpreter mode: the statements that wait for the program, how far it is, and their log.

The port appends what was compiled, the main thread of the program takes it; numbers are those that clients
read. Source: script manual 5.11; also of the log: a line `e: <id_e> c: <id_a> : <statement>` for each
acknowledged line, with the id of the last one that had begun and its own; the names of its files, and what
moves them. Chosen: ids begin anew at the start of each program; the first line of a file.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from protocol.interpreter import MAX_ID, TOO_MANY
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import RefusedError
from urscript.compile.interpreter_mode import NO_NAMES, CompiledStatements

_CURRENT: Final = "interpreter.log"
_BEFORE: Final = "interpreter.0.log"
_SAVED: Final = "interpreter.saved.log"
_FIRST_LINE: Final = "interpreter log\n"
# Characters that a file keeps; the oldest go.
_MOST: Final = 1 << 18


class InterpreterLog:
    """The log as the files of a controller hold it: `files` has the text of each that there is."""

    def __init__(self) -> None:
        self.files: dict[str, str] = {}

    def add(self, last_executed: int, number: int, statements: str) -> None:
        """Append a line that was acknowledged."""
        self._append(_CURRENT, f"e: {last_executed} c: {number} : {statements}\n")

    def move(self) -> None:
        """All was cleared: the file takes the place of the one before."""
        if _CURRENT in self.files:
            self.files[_BEFORE] = self.files.pop(_CURRENT)

    def save(self) -> None:
        """The mode ended without clearing: the file is appended to what is saved."""
        if _CURRENT in self.files:
            self._append(_SAVED, self.files.pop(_CURRENT).removeprefix(_FIRST_LINE))

    def _append(self, name: str, text: str) -> None:
        self.files[name] = (self.files.get(name, _FIRST_LINE) + text)[-_MOST:]


# Until a line that calls one of these has ended, no further line is compiled: its names may be gone then.
_CHANGE_NAMES = frozenset({"clear_interpreter", "end_interpreter"})


class InterpreterQueue:
    """The statements of the primary program; the `urscript.run.host.StatementQueue` of its main thread.

    Attributes:
        run: number of the program, from 1.
        epoch: changes with everything that makes compiled lines useless.
        n_cleanups: how often the mode began by dropping the lines that waited.
        scope: the names at the call of `interpreter_mode`, pickled; empty while the mode is off.
        added: the names that the lines so far have added, pickled.
        last_executed: id of the last line that began to run; 0 for none, here and below.
        last_interpreted: id of the last line that was compiled.
        last_cleared: id of the last line that was cleared.
        is_ending: the mode ends when the present line has ended; programs set it, and the next.
        is_clearing: all is cleared when the present line has ended.
        clears_on_end: all is cleared when the mode ends.
    """

    def __init__(self) -> None:
        self.run = self.epoch = self.n_cleanups = 0
        self.log = InterpreterLog()
        self._n_lines = self._n_bytes = 0
        self.program_started()

    def program_started(self) -> None:
        """Begin anew: no line was interpreted."""
        self.run += 1
        self.last_executed = self.last_interpreted = 0
        self.program_ended()

    def program_ended(self) -> None:
        """Leave the mode; ids stay readable."""
        self.last_cleared = self.last_interpreted
        self._forget()
        self._turn_off()

    @property
    def is_on(self) -> bool:
        """True while the program is in interpreter mode."""
        return bool(self.scope)

    @property
    def takes_lines(self) -> bool:
        """True while lines can be compiled: the names that they find are known."""
        return self.is_on and not (self.is_ending or self.is_clearing or self._held_by)

    @property
    def n_ready(self) -> int:
        """Lines that were compiled and have not begun."""
        return len(self._ready)

    # --- what clients do

    def append(self, statements: CompiledStatements, epoch: int) -> int:
        """Take a compiled line; return its id, 0 if the names have changed since it was compiled.

        RefusedError if too much was interpreted already.
        """
        if epoch != self.epoch or not self.takes_lines:
            return 0
        size = len(statements.compiled.code)
        if (
            self._n_lines >= BUDGETS.interpreter_lines
            or self._n_bytes + size > BUDGETS.program_code
            or statements.n_added > BUDGETS.interpreter_names
        ):
            raise RefusedError(TOO_MANY)
        self._n_lines += 1
        self._n_bytes += size
        self.added = statements.added
        self.last_interpreted = number = self.last_interpreted % MAX_ID + 1
        self._ready.append((number, statements))
        if statements.builtins & _CHANGE_NAMES:
            self._held_by = number
        self.log.add(self.last_executed, number, statements.source.text)
        return number

    def skip(self) -> None:
        """Drop what has not begun."""
        if any(number == self._held_by for number, _ in self._ready):
            self._held_by = 0
        self._ready.clear()

    # --- what the main thread does

    def enter(self, scope: bytes, *, clear_queue: bool, clear_on_end: bool) -> InterpreterQueue:
        """Begin with the mode; return itself."""
        self.n_cleanups += clear_queue
        self.clears_on_end = clear_on_end
        self.scope = scope
        self.epoch += 1
        return self

    def take(self) -> CompiledStatements | None:
        """Begin with the next line; the one before has ended."""
        if self._held_by == self.last_executed:
            self._held_by = 0
        if not self._ready:
            return None
        self.last_executed, statements = self._ready.popleft()
        return statements

    def is_ready(self) -> bool:
        """Return whether the main thread can go on."""
        return bool(self._ready) or self.is_ending or self.is_clearing

    def cleared(self) -> None:
        """All that was interpreted has gone."""
        self.last_cleared = self.last_interpreted
        self.log.move()
        self._forget()

    def leave(self) -> None:
        """The mode has ended; what it keeps belongs to the program until its end."""
        if self.clears_on_end or self.is_clearing:
            self.cleared()
        else:
            self.log.save()
        self._turn_off()

    def _forget(self) -> None:
        self.added = NO_NAMES
        self._n_lines = self._n_bytes = 0
        self._empty()

    def _turn_off(self) -> None:
        self.scope = b""
        self.is_ending = False
        self.clears_on_end = True
        self._empty()

    def _empty(self) -> None:
        self._ready: deque[tuple[int, CompiledStatements]] = deque()
        self._held_by = 0
        self.is_clearing = False
        self.epoch += 1
