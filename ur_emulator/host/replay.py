"""Replay: a bare machine, without sockets and clock, is fed with the inputs of a journal.

Each cycle must give what it gave when the journal was kept, bit for bit.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ur_emulator.host.box import Choice
from ur_emulator.host.box_options import BoxOptions
from ur_emulator.host.journal import FILES, FORMAT, JournalError, versions
from ur_emulator.host.runtime.barrier import describe_error
from ur_emulator.machine.machine import Answer, Machine
from ur_emulator.machine.records import FIELDS, Digest, RecordError, to_input
from urscript.catalogue import Catalogue


@dataclass(frozen=True, slots=True)
class Difference:
    """Where a replay gave something else: the cycle, and the names of the fields."""

    tick: int
    fields: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Replay:
    """What a replay has found.

    Attributes:
        cycles: how many were the same.
        robot_time: of them [s].
        real_time: that it took [s].
        difference: the first one; None if there is none.
        end: why it ended before the end of the journal, "" if it did not.
        notes: other versions than those that the journal was made with, and an error that was met again.
    """

    cycles: int
    robot_time: float
    real_time: float
    difference: Difference | None
    end: str
    notes: tuple[str, ...]

    def __str__(self) -> str:
        """One line: identical, or where it differs."""
        done = f"{self.cycles} cycles, {self.robot_time:.3f} s of the robot in {self.real_time:.2f} s"
        if self.difference is not None:
            where = f"cycle {self.difference.tick} differs in {', '.join(self.difference.fields)}"
            return f"{where}, after {done} that are identical"
        return f"identical: {done}" + (f"; it ends there: {self.end}" if self.end else "")


def replay(path: Path, until: float | None = None) -> Replay:
    """Feed a bare machine with the inputs of a journal, and compare what each cycle gives.

    Args:
        until: time of the robot [s] after which the rest is left.

    Raises:
        JournalError: the file is no journal.
    """
    lines = _lines(path)
    header = next(lines, {})
    if header.get("journal") != FORMAT:
        raise JournalError(f"{path} given: it is no journal of format {FORMAT}")
    machine, catalogue = _machine(header, path)
    digest = Digest()
    first = machine.controller.snapshot.timestamp
    begin, cycles, difference, end = time.perf_counter(), 0, None, ""
    notes = [
        f"made with {name} {was}, replayed with {now}"
        for name, was in header.get("made_with", {}).items()
        if (now := versions().get(name, "none")) != was
    ]
    for line in lines:
        if "t" not in line or "unknown" in line:
            end = line.get("unknown") or f"the journal has a gap of {line.get('lost')} cycles"
            break
        try:
            inputs = [to_input(one, machine, catalogue) for one in line.get("i", ())]
        except RecordError as error:
            end = str(error)
            break
        try:
            answer = machine.tick(inputs)
        except Exception as error:
            if "error" not in line:
                raise
            notes.append(f"cycle {line['t']} ends with an error, as it did then: {describe_error(error)}")
            cycles += 1
            break
        changes = digest.changes(answer)
        if "error" in line or answer.snapshot.tick != line["t"] or changes.hex() != line.get("d", ""):
            difference = Difference(line["t"], _differing(answer, changes, line))
            break
        cycles += 1
        if until is not None and answer.snapshot.timestamp >= until:
            break
    return Replay(
        cycles,
        machine.controller.snapshot.timestamp - first,
        time.perf_counter() - begin,
        difference,
        end,
        tuple(notes),
    )


def _machine(header: dict[str, Any], path: Path) -> tuple[Machine, Catalogue]:
    """Return the box of a journal, with the files that it names, and the builtins of its software."""
    box = dict(header["box"])
    with TemporaryDirectory(prefix="ur-replay-") as folder:
        for number, (name, text) in enumerate(header["files"].items()):
            copy = Path(folder, f"{number}-{Path(name).name}")
            copy.write_text(text, encoding="utf-8")
            for option in FILES:
                if box[option] is not None:
                    words = str(box[option]).split(",")
                    box[option] = ",".join(str(copy) if word == name else word for word in words)
        try:
            options = BoxOptions(**box)
        except TypeError:
            raise JournalError(
                f"{path} given: its first line names other options than this box has"
            ) from None
        choice = Choice.of(options)
        return choice.make_machine(options), choice.identity.software.catalogue


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of a journal; a last one that was cut off is left out."""
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                if not line.endswith("\n"):
                    return
                try:
                    found = json.loads(line)
                except ValueError:
                    found = None
                if not isinstance(found, dict):
                    raise JournalError(f"{path}, line {number}: it is no line of a journal")
                yield found
    except (OSError, UnicodeDecodeError) as error:
        raise JournalError(f"{path} given: {getattr(error, 'strerror', None) or 'it is no text'}") from None


def _differing(answer: Answer, changes: bytes, line: dict[str, Any]) -> tuple[str, ...]:
    if "error" in line:
        return ("the error that has ended it",)
    if answer.snapshot.tick != line["t"]:
        return ("tick",)
    now, then = (
        {data[at]: data[at + 1 : at + 3] for at in range(0, len(data), 3)}
        for data in (changes, bytes.fromhex(line.get("d", "")))
    )
    return tuple(FIELDS[index] for index in sorted(now | then) if now.get(index) != then.get(index))
