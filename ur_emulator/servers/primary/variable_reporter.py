"""The global variables of the running program as messages of the primary port: names once, values on change.

Variables declared with `global` are reported, in the order of the text, as in PolyScope's variables tab. They
are not read while no client is connected. Values never change in place (see `urscript.values`), so one that
is the same object is the same value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import Any

from protocol.errors import LocalProtocolError
from protocol.primary.framing import NO_TIME
from protocol.primary.program import (
    GlobalVariablesSetup,
    GlobalVariablesUpdate,
    encode_program_state,
    encode_values,
)
from protocol.primary.values import MAX_NESTING, TypedValue, ValueType, encode_value, value_codes
from protocol.ur_types import SoftwareVersion
from urscript import Matrix, Pose, RunningProgram, ScriptThread
from urscript.run.variables import UNDEFINED

# Names or values in one package [bytes]: clients hold packages of up to 4096 bytes, or of 2000.
MAX_BODY = 1900
# A value that would not fit into a client's package goes as none.
MAX_VALUE = 4000
# Variables that are reported at all (the index has 16 bits), and looked at in one update: an update must not
# cost a cycle.
MAX_VARIABLES = 10_000
PER_UPDATE = 500

_NONE = TypedValue(ValueType.NONE)


def typed_value(value: Any, depth: int = 0) -> TypedValue:
    """Return a value of a script as it goes on the wire.

    Strings are constant strings, as in the document's example; threads are the numbers of their handles;
    what has no type there (a handle of remote procedures, lists nested too deeply) is none.
    """
    kind = _KINDS.get(type(value))
    if kind is not None:
        return TypedValue(kind, value)
    if depth < MAX_NESTING:
        if isinstance(value, list):
            return TypedValue(ValueType.LIST, tuple(typed_value(item, depth + 1) for item in value))
        if isinstance(value, Matrix):
            return TypedValue(ValueType.MATRIX, tuple(tuple(map(typed_value, row)) for row in value.rows))
    if isinstance(value, ScriptThread):
        return TypedValue(ValueType.INT, value.thread_id)
    return _NONE


_KINDS: dict[type, ValueType] = {
    bool: ValueType.BOOL,
    int: ValueType.INT,
    float: ValueType.FLOAT,
    str: ValueType.CONST_STRING,
    Pose: ValueType.POSE,
}


class VariableReporter:
    """What one port has sent of the variables of one run."""

    def __init__(self, version: SoftwareVersion) -> None:
        self._version = version
        self._none = encode_value(_NONE, version)
        self._codes = value_codes(version)
        self._read: Callable[[str], Any] | None = None
        self._names: tuple[str, ...] = ()
        self._seen: list[Any] = []
        self._sent: list[bytes] = []
        self._next = 0

    @property
    def is_empty(self) -> bool:
        """True when there is no program, or it has no variables."""
        return not self._names

    def begin(self, run: RunningProgram) -> None:
        """Turn to the variables of a run; nothing is known of their values."""
        self._read = run.read_global
        self._names = run.program.declared_globals[:MAX_VARIABLES]
        self._seen = [UNDEFINED] * len(self._names)
        self._sent = [self._none] * len(self._names)
        self._next = 0

    def end(self) -> None:
        """Forget the run."""
        self._read, self._names, self._seen, self._sent = None, (), [], []

    def names(self, timestamp: int) -> list[bytes]:
        """Return the packages with all names."""
        packages: list[bytes] = []
        for start, part in _parcels(0, [name.encode("latin-1", "replace") for name in self._names]):
            names = tuple(name.decode("latin-1") for name in part)
            message = GlobalVariablesSetup(timestamp=timestamp, start_index=start, names=names)
            packages.append(encode_program_state(message, self._version))
        return packages

    def values(self, timestamp: int) -> list[bytes]:
        """Return the packages with all values as they were sent last; without variables the empty one.

        Source of the empty one: capture of a simulator without a program.
        """
        if self.is_empty:
            return [encode_program_state(GlobalVariablesUpdate(timestamp=NO_TIME), self._version)]
        return self._packages(timestamp, 0, self._sent)

    def changes(self, timestamp: int, *, at_once: bool = False) -> list[bytes]:
        """Return the packages with what has changed since it was sent.

        Args:
            timestamp: microseconds since controller start.
            at_once: read all variables; otherwise a part of a long list.
        """
        read, names, seen, sent = self._read, self._names, self._seen, self._sent
        if read is None or not names:
            return []
        begin, end = (0, len(names)) if at_once else (self._next, min(len(names), self._next + PER_UPDATE))
        self._next = 0 if end == len(names) else end
        changed = []
        for i in range(begin, end):
            value = read(names[i])
            if value is not seen[i]:
                seen[i] = value
                data = self._encode(value)
                if data != sent[i]:
                    sent[i] = data
                    changed.append(i)
        packages: list[bytes] = []
        for _, run in groupby(enumerate(changed), lambda pair: pair[1] - pair[0]):
            indices = [i for _, i in run]
            packages += self._packages(timestamp, indices[0], [sent[i] for i in indices])
        return packages

    def _encode(self, value: Any) -> bytes:
        typed = typed_value(value)
        if typed.type not in self._codes:
            return self._none
        try:
            data = encode_value(typed, self._version)
        except LocalProtocolError:
            return self._none
        return data if len(data) <= MAX_VALUE else self._none

    def _packages(self, timestamp: int, start: int, values: Sequence[bytes]) -> list[bytes]:
        return [encode_values(timestamp, first, part) for first, part in _parcels(start, values)]


def _parcels(start: int, items: Iterable[bytes]) -> list[tuple[int, list[bytes]]]:
    """Divide items among packages: index of the first and the items of each."""
    parcels: list[tuple[int, list[bytes]]] = []
    size = MAX_BODY
    for i, item in enumerate(items, start):
        size += len(item) + 1
        if size > MAX_BODY:
            parcels.append((i, []))
            size = len(item) + 1
        parcels[-1][1].append(item)
    return parcels
