"""The journal of a box: the inputs of each cycle, and check sums of what the cycle gave.

A journal is a file of lines in JSON. The first says which box it is; each other one is a cycle: its number
`t`, its inputs `i` if there were any, and `d`, the check sums that have changed (`machine.records.Digest`).
It is only appended to, and can be read after its process was killed (`host.replay`).
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields
from importlib.metadata import PackageNotFoundError, version
from os import fspath
from pathlib import Path
from platform import python_version
from queue import Full, Queue
from typing import IO, Any, Final

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import EmulatorError
from ur_emulator.host.box_options import BoxOptions
from ur_emulator.host.pacing import Pace
from ur_emulator.machine.machine import Answer, Input
from ur_emulator.machine.records import Digest, RecordError, to_plain

FORMAT: Final = 1
# What a box computes with: other versions may give other figures.
_COMPUTES: Final = ("ur-hil", "mujoco", "numpy", "lark")
# Options that say where a box is served, not what it is.
_OUTSIDE: Final = frozenset(
    {"host", "port_base", "programs", "control_port", "control_token", "generation", "journal"}
)
# Options that may name files, whose text goes into the journal.
FILES: Final = ("robot", "fidelity", "tool", "scene")


class JournalError(EmulatorError):
    """A journal cannot be written, or read."""


class Journal:
    """Writes the journal of one box, in a thread of its own: a slow disk delays no cycle."""

    def __init__(self, path: Path, options: BoxOptions, report: Callable[[str], None]) -> None:
        """Open the file and write the first line; an existing file is renamed to `FILE.old` first.

        In lockstep a cycle waits when too many others are not written yet; in real time it is lost.

        Args:
            report: writes into the log of the box that cycles were lost.

        Raises:
            JournalError: the file cannot be written.
        """
        try:
            if path.is_file():  # perhaps of a box that has failed and was started again
                path.replace(f"{path}.old")
            self._file: IO[str] = path.open("w", encoding="utf-8")
            self._file.write(json.dumps(_header(options), default=fspath) + "\n")
            self._file.flush()
        except OSError as error:
            raise JournalError(f"journal {path} given: {error.strerror}") from None
        self._path = path
        self._report = report
        self._waits = options.pace == Pace.LOCKSTEP
        # Number, inputs and answer of each cycle; without inputs: so many cycles are lost. None is the end.
        self._cycles: Queue[tuple[int, Sequence[Input] | None, Answer | None] | None]
        self._cycles = Queue(BUDGETS.journal_cycles)
        self._tick = self._lost = 0
        self._digest = Digest()
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def write(self, inputs: Sequence[Input], answer: Answer | None) -> None:
        """Take a cycle, in the thread of the loop; one that an error has ended has no answer."""
        self._tick = self._tick + 1 if answer is None else answer.snapshot.tick
        try:
            if self._lost:
                self._cycles.put((self._lost, None, None), block=self._waits)
                self._lost = 0
            self._cycles.put((self._tick, inputs, answer), block=self._waits)
        except Full:
            if not self._lost:
                self._report(f"the journal {self._path} has a gap: cycles come faster than they are written")
            self._lost += 1

    def close(self) -> None:
        """Write what waits, and close the file; harmless if that was done."""
        self._cycles.put(None)
        self._thread.join()
        with suppress(OSError):  # of what a full disk did not take, which is said already
            self._file.close()

    def _run(self) -> None:
        can_write = True
        while (cycle := self._cycles.get()) is not None:
            try:
                if can_write:
                    self._file.write(self._line(*cycle) + "\n")
                    if self._cycles.empty():
                        self._file.flush()
            except Exception as error:  # of the disk, or ours
                self._report(f"the journal {self._path} ends here: {error}")
                can_write = False  # the rest is taken all the same: nobody waits for it

    def _line(self, number: int, inputs: Sequence[Input] | None, answer: Answer | None) -> str:
        if inputs is None:
            return json.dumps({"lost": number})
        line: dict[str, Any] = {"t": number}
        if inputs:
            try:
                line["i"] = [to_plain(one) for one in inputs]
            except RecordError as error:
                line["unknown"] = str(error)
        if answer is None:
            line["error"] = True
        elif changes := self._digest.changes(answer):
            line["d"] = changes.hex()
        return json.dumps(line, separators=(",", ":"))


def _header(options: BoxOptions) -> dict[str, Any]:
    """Return what says which box this is; JournalError if that cannot be written down."""
    if options.generation is not None:
        raise JournalError("a box of a generation of one's own keeps no journal")
    names = [field.name for field in fields(options) if field.name not in _OUTSIDE]
    box = {name: getattr(options, name) for name in names} | {"services": list(options.services)}
    files = {
        word: Path(word).read_text(encoding="utf-8")
        for name in FILES
        for word in str(box[name]).split(",")
        if word.endswith((".toml", ".xml"))
    }
    return {"journal": FORMAT, "box": box, "files": files, "made_with": versions()}


def versions() -> dict[str, str]:
    """Return the versions of what a box computes with."""
    found = {"python": python_version()}
    for name in _COMPUTES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found
