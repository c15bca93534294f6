"""Inputs of the machine as plain values that JSON can hold, and back; check sums of what a cycle gives.

A record is written as `{"@": its name, field: value, ...}`. A program is written as its text and compiled
again when it is read; no code is read from a file.
"""

from __future__ import annotations

import marshal
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, Final
from zlib import crc32

from ur_emulator.errors import EmulatorError
from ur_emulator.machine.commands import client_writes, grippers, power, programs, safety, surroundings
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.controller.io import network
from ur_emulator.machine.controller.safety import boundaries, inputs, safety_state
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.machine import Answer, Input, Machine
from urscript import CompiledProgram, compile_program
from urscript.catalogue import Catalogue
from urscript.compile.interpreter_mode import CompiledStatements, compile_statements
from urscript.errors import ScriptError

_ROOMS = (
    client_writes,
    grippers,
    power,
    programs,
    safety,
    surroundings,
    network,
    boundaries,
    inputs,
    safety_state,
)
# All classes whose objects an input may consist of, by name.
RECORDS: Final[Mapping[str, type[Any]]] = {
    name: value
    for room in _ROOMS
    for name, value in vars(room).items()
    if isinstance(value, type)
    and (is_dataclass(value) or issubclass(value, Enum) or hasattr(value, "_fields"))
}


class RecordError(EmulatorError):
    """A value cannot be written as a record, or a record cannot be read."""


def to_plain(value: Any) -> Any:
    """Return an input, or a part of one, as a value for JSON; RecordError if it is no record."""
    kind = type(value)
    if value is None or kind in (bool, int, float, str):
        return value
    if kind is tuple:
        return [to_plain(item) for item in value]
    match value:
        case list():
            return {"@": "list", "items": [to_plain(item) for item in value]}
        case bytes():
            return {"@": "bytes", "latin": value.decode("latin-1")}
        case CompiledProgram():
            return {"@": "program", "name": value.source.name, "text": value.source.text}
        case CompiledStatements():
            return {
                "@": "statements",
                "name": value.source.name,
                "text": value.source.text,
                "entry": value.entry,
            }
        case Mapping():
            return {"@": "map", "items": [[to_plain(key), to_plain(item)] for key, item in value.items()]}
    name = kind.__name__
    if RECORDS.get(name) is not kind:
        raise RecordError(f"{name} is no record of the machine: {str(value)[:80]}")
    if isinstance(value, Enum):
        return {"@": name, "value": to_plain(value.value)}
    return {"@": name, **{field: to_plain(getattr(value, field)) for field in _fields_of(kind)}}


def to_input(plain: Any, machine: Machine, catalogue: Catalogue) -> Input:
    """Return what `to_plain` has written; RecordError if it is not that.

    `machine` has been through all inputs before this one: the names that a line of interpreter mode finds are
    there.
    """
    try:
        found: Input = _from_plain(plain, machine, catalogue)
        if not isinstance(found, Command | network.Arrival):
            raise TypeError("it is no command, and nothing that arrives")
        return found
    except (LookupError, TypeError, ValueError, AttributeError, EmulatorError, ScriptError) as error:
        raise RecordError(f"no input: {str(plain)[:80]} ({error})") from None


def _fields_of(kind: type[Any]) -> tuple[str, ...]:
    if is_dataclass(kind):
        return tuple(field.name for field in fields(kind) if field.init)
    return tuple(kind._fields)


def _from_plain(plain: Any, machine: Machine, catalogue: Catalogue) -> Any:
    if isinstance(plain, list):
        return tuple(_from_plain(item, machine, catalogue) for item in plain)
    if not isinstance(plain, dict):
        return plain
    match plain:
        case {"@": "list", "items": list(items)}:
            return [_from_plain(item, machine, catalogue) for item in items]
        case {"@": "bytes", "latin": str(text)}:
            return text.encode("latin-1")
        case {"@": "program", "name": str(name), "text": str(text)}:
            return compile_program(text, catalogue=catalogue, name=name)
        case {"@": "statements", "text": str(text), "entry": str(entry)}:
            queue = machine.controller.state.interpreter
            number = int(entry[1:].partition("_")[0])
            return compile_statements(text, number, queue.scope, queue.added, catalogue)
        case {"@": "map", "items": list(items)}:
            return {
                _from_plain(key, machine, catalogue): _from_plain(item, machine, catalogue)
                for key, item in items
            }
    kind = RECORDS[plain["@"]]
    values = {key: _from_plain(item, machine, catalogue) for key, item in plain.items() if key != "@"}
    return kind(values["value"]) if issubclass(kind, Enum) else kind(**values)


# Beside the fields of the snapshot.
EXTRA: Final = ("wrench at the flange", "events", "requests", "outcomes")
FIELDS: Final = (*Snapshot._fields, *EXTRA)
_SPACE, _SUPPLY = Snapshot._fields.index("space"), Snapshot._fields.index("supply")
# The first two, the cycle and its time, are in each line of a journal.
_SAID: Final = 2


class Digest:
    """Check sums of the answers of one machine, cycle by cycle."""

    def __init__(self) -> None:
        self._values: list[Any] = [None] * len(FIELDS)
        self._sums = [0] * len(FIELDS)

    def changes(self, answer: Answer) -> bytes:
        """Return number and check sum, three bytes, of each field that is not as in the cycle before."""
        values, sums, changed = self._values, self._sums, bytearray()
        snapshot = answer.snapshot
        now = [*snapshot, snapshot.space.wrench_at_flange, answer.events, answer.requests, answer.outcomes]
        now[_SPACE] = now[_SUPPLY] = None  # they follow from the others
        for index in range(_SAID, len(now)):
            value = now[index]
            if value is not values[index]:
                values[index] = value
                found = _check_sum(value)
                if found != sums[index]:
                    sums[index] = found
                    changed += bytes((index, found >> 8, found & 0xFF))
        return bytes(changed)


def _check_sum(value: Any) -> int:
    try:
        data = marshal.dumps(value, 2)  # the version that writes the same for equal values
    except ValueError:  # a record
        data = repr(value).encode()
    return crc32(data) & 0xFFFF
