"""Conformance tests written in URScript: files of programs ("chunks") with what is expected beside them.

Chunks stand apart by a line `---`. Expectations are comments, so a chunk is a program as it is:

    #> text            the next text that textmsg shows (all texts, in order)
    #! 3:5 text        an error at line 3 of the chunk, column 5, with exactly this text, `...` for anything;
                       several lines: all compile errors in order; at run time there is only one
    #~ wire text       what the first error puts into the runtime-exception message
    #log text          what the first error writes into the controller's log
    #@ name name       the builtins with an effect that were called, in order
    #interpret line    the next line of interpreter mode; it ends after the last one
    #discard text      why the next line is discarded that cannot be compiled
    #< 1 2 3           a frame of integers that the peer of socket "s" sends (also makes it accept)
    #software 5.11     the software version, 3.15 if not given
    #ref 1.1 comment   the row of the language notes that the chunk shows (see `reference_rows.txt`)

A chunk without `#!` must compile and end by itself. Every chunk runs twice: as compiled, and with every static type
unknown, so that the shortcuts of the compiler cannot mean anything else than the operators they stand for.

The words around a rule say what it rests on: D documented by the maker, O observed, I inferred, U unknown
and chosen here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from urscript.catalogue import Catalogue, catalogue_for
from urscript.check.checking import check_program
from urscript.compile.inference import StaticTypes, Type
from urscript.compile.interpreter_mode import NO_NAMES, CompiledStatements, compile_statements
from urscript.errors import ScriptCompileError, ScriptError
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import FakeSocket, RecordingHost
from urscript.run.host import EnterMode, HostFunction
from urscript.run.threads import ScriptThread

MAX_CYCLES = 2_000


class InterpretingHost(RecordingHost):
    """A recording host that has lines for interpreter mode; it is their queue too.

    Attributes:
        discarded: Errors of lines that could not be compiled, in order.
    """

    def __init__(self, catalogue: Catalogue, lines: list[str], **options: Any) -> None:
        super().__init__(catalogue=catalogue, **options)
        self.discarded: list[ScriptError] = []
        self._lines = list(lines)
        self._number = 0
        self._scope = b""
        self._kept = NO_NAMES
        self.is_ending = self.is_clearing = False
        self.clears_on_end = True

    def builtins(self) -> Mapping[str, HostFunction]:
        """All builtins, those of interpreter mode with their effect."""
        offered = {**super().builtins(), "end_interpreter": self._end, "clear_interpreter": self._clear}
        return {**offered, "interpreter_mode": self._mode} if self._lines else offered

    def _mode(self, thread: ScriptThread, clear_queue_on_enter: bool, clear_on_end: bool) -> EnterMode:
        self.clears_on_end = clear_on_end
        return self.enter

    def _end(self, thread: ScriptThread) -> None:
        self.is_ending = True

    def _clear(self, thread: ScriptThread) -> None:
        self.is_clearing = True

    def enter(self, scope: bytes) -> InterpretingHost:
        """Begin the mode."""
        self._scope = scope
        return self

    def take(self) -> CompiledStatements | None:
        """The next line that can be compiled; one after the last ends the mode."""
        self.is_ending = not self._lines
        while self._lines:
            self._number += 1
            line = self._lines.pop(0)
            try:
                made = compile_statements(line, self._number, self._scope, self._kept, self._catalogue)
            except ScriptCompileError as error:
                self.discarded.append(error)
                continue
            self._kept = made.added
            return made
        return None

    def is_ready(self) -> bool:
        """Always."""
        return True

    def cleared(self) -> None:
        """Forget the names."""
        self._kept = NO_NAMES
        self.is_clearing = False

    def leave(self) -> None:
        """End the mode."""
        self.is_ending = False
        if self.clears_on_end or self.is_clearing:
            self.cleared()


@dataclass(eq=False)
class Chunk:
    """One program and what is expected of it."""

    file: str
    first_line: int
    text: str
    messages: list[str] = field(default_factory=list)
    errors: list[tuple[int, int, str]] = field(default_factory=list)
    wire_text: str | None = None
    log_text: str | None = None
    rows: list[str] = field(default_factory=list)
    calls: list[str] | None = None
    frames: list[list[int]] | None = None
    lines: list[str] = field(default_factory=list)
    discarded: list[str] = field(default_factory=list)
    software: str = "3.15"

    def __str__(self) -> str:
        return f"{self.file}:{self.first_line}"


def load_chunks(*files: Path) -> list[Chunk]:
    """All chunks of the given files."""
    return [chunk for file in files for chunk in _split(file)]


def _split(file: Path) -> list[Chunk]:
    chunks = []
    lines: list[str] = []
    first = 1
    text = file.read_bytes().decode("latin-1")
    for number, line in enumerate([*text.split("\n"), "---"], start=1):
        if line.rstrip() != "---":
            lines.append(line)
            continue
        if any(part.strip() for part in lines):
            chunks.append(_expectations(Chunk(file.name, first, "\n".join(lines))))
        lines, first = [], number + 1
    return chunks


def _expectations(chunk: Chunk) -> Chunk:
    for line in chunk.text.split("\n"):
        mark = re.search(r"#(>|!|~|@|<|log|ref|software|interpret|discard)(?: (.*))?$", line.rstrip("\r"))
        if mark is None:
            continue
        kind, rest = mark[1], mark[2] or ""
        lists = {">": chunk.messages, "ref": chunk.rows, "interpret": chunk.lines, "discard": chunk.discarded}
        if kind in lists:
            lists[kind].append(rest)
        elif kind == "!":
            place = re.match(r"(\d+):(\d+) (.+)", rest)
            assert place, f"{chunk}: write '#! line:column text', not {line!r}"
            chunk.errors.append((int(place[1]), int(place[2]), place[3]))
        elif kind == "~":
            chunk.wire_text = rest
        elif kind == "log":
            chunk.log_text = rest
        elif kind == "@":
            chunk.calls = rest.split()
        elif kind == "<":
            chunk.frames = [*(chunk.frames or []), [int(word) for word in rest.split()]]
        else:
            chunk.software = rest
    return chunk


def run_chunk(chunk: Chunk) -> list[ScriptError]:
    """Compile and run a chunk; asserts everything it expects and returns the errors it met."""
    catalogue = catalogue_for(chunk.software)
    sockets = {} if chunk.frames is None else {"s": FakeSocket(chunk.frames, closed=True)}
    host = InterpretingHost(catalogue, chunk.lines, sockets=sockets)
    raised: list[ScriptError] = []
    try:
        program = compile_program(chunk.text, catalogue=catalogue)
    except ScriptCompileError as error:
        raised.append(error)
    errors: list[ScriptError]
    if raised:
        errors = list(check_program(chunk.text, catalogue=catalogue)[0])
        assert str(raised[0]) == str(errors[0]), f"{chunk}: {raised[0]} is not the first of {errors}"
    else:
        running = host.run(program, MAX_CYCLES)
        assert running.status is not ProgramStatus.RUNNING, f"{chunk}: still running"
        assert not running.threads, f"{chunk}: left a thread behind"
        assert host.ended_programs == 1, f"{chunk}: program_ended called {host.ended_programs} times"
        errors = [running.error] if running.error is not None else []
    found = [(error.line, error.column, error.message) for error in errors]
    assert len(found) == len(chunk.errors), f"{chunk}: expected {chunk.errors}, got {found}"
    for (line, column, message), (want_line, want_column, text) in zip(found, chunk.errors, strict=True):
        assert (line, column) == (want_line, want_column), f"{chunk}: {message} at {line}:{column}"
        assert matches(text, message), f"{chunk}: got {message!r}, expected {text!r}"
    if chunk.wire_text is not None:
        assert errors[0].wire_text == chunk.wire_text
    if chunk.log_text is not None:
        assert errors[0].log_text == chunk.log_text
    assert host.messages == chunk.messages, f"{chunk}: {host.messages}"
    found_reasons = [error.message for error in host.discarded]
    assert len(found_reasons) == len(chunk.discarded), f"{chunk}: {found_reasons}"
    for reason, want in zip(found_reasons, chunk.discarded, strict=True):
        assert matches(want, reason), f"{chunk}: got {reason!r}, expected {want!r}"
    errors += host.discarded
    if chunk.calls is not None:
        assert host.names_called() == chunk.calls
    return errors + raised


def matches(expected: str, text: str) -> bool:
    """Whether `text` is what is expected, where `...` stands for anything."""
    return re.fullmatch(".*".join(map(re.escape, expected.split("..."))), text, re.DOTALL) is not None


@contextmanager
def unknown_types() -> Iterator[None]:
    """The compiler takes no static type for evident and leaves every operation to run time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StaticTypes, "of", lambda *_: Type.ANY)
        patch.setattr(StaticTypes, "variable", lambda *_: Type.ANY)
        yield
