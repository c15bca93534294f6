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
from ur_emulator.budgets import BUDGETS
from urscript import Matrix, Pose, RunningProgram, ScriptThread
from urscript.run.variables import UNDEFINED

# Names or values in one package [bytes]: clients hold packages of up to 4096 bytes, or of 2000.
MAX_BODY = 1900
# A value that would not fit into a client's package goes as none.
MAX_VALUE = 4000
# Characters that take as long as another element.
_CHARACTERS = 512

_NONE = TypedValue(ValueType.NONE)


def size_of(value: Any, most: int) -> tuple[int, int]:
    """Return at least how many bytes a value takes on the wire, and how many elements are encoded for it.

    Args:
        value: of a script.
        most: the bytes at which counting ends; so it takes no longer than encoding a value that fits.
    """
    if isinstance(value, str):
        return len(value) + 3, 1 + len(value) // _CHARACTERS
    if isinstance(value, Matrix):
        rows, columns = value.shape
        return 5 * rows * columns + 5, rows * columns
    if not isinstance(value, list):
        return 1, 1
    size, elements = len(value), 1
    for item in value if size <= most else ():
        item_size, item_elements = size_of(item, most - size)
        size, elements = size + item_size, elements + item_elements
        if size > most:
            break
    return size, elements


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
        self._room = 0

    @property
    def is_empty(self) -> bool:
        """True when there is no program, or it has no variables."""
        return not self._names

    def begin(self, run: RunningProgram) -> None:
        """Turn to the variables of a run; nothing is known of their values."""
        self._read = run.read_global
        self._names = run.program.declared_globals[: BUDGETS.variables_reported]
        self._seen = [UNDEFINED] * len(self._names)
        self._sent = [self._none] * len(self._names)
        self._next = 0
        self._room = BUDGETS.variable_bytes

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

        The elements that are encoded are bounded; the next update goes on where this one ends.

        Args:
            timestamp: microseconds since controller start.
            at_once: look at all variables; otherwise at a part of a long list.
        """
        read, names, seen, sent = self._read, self._names, self._seen, self._sent
        if read is None or not names:
            return []
        first = 0 if at_once else self._next
        end = len(names) if at_once else min(len(names), first + BUDGETS.variables_per_update)
        elements = BUDGETS.variable_elements_per_update
        changed = []
        for i in range(first, end):
            value = read(names[i])
            if value is not seen[i]:
                if elements <= 0:
                    end = i
                    break
                seen[i] = value
                data, cost = self._encode(value, len(sent[i]))
                elements -= cost
                if data != sent[i]:
                    self._room += len(sent[i]) - len(data)
                    sent[i] = data
                    changed.append(i)
        self._next = 0 if end == len(names) else end
        packages: list[bytes] = []
        for _, run in groupby(enumerate(changed), lambda pair: pair[1] - pair[0]):
            indices = [i for _, i in run]
            packages += self._packages(timestamp, indices[0], [sent[i] for i in indices])
        return packages

    def _encode(self, value: Any, replaced: int) -> tuple[bytes, int]:
        """Encode a value in the place of one of `replaced` bytes; return it, and the elements it cost."""
        most = min(MAX_VALUE, self._room + replaced)
        size, elements = size_of(value, most)
        if size > most:
            return self._none, elements
        typed = typed_value(value)
        if typed.type not in self._codes:
            return self._none, elements
        try:
            data = encode_value(typed, self._version)
        except LocalProtocolError:
            return self._none, elements
        return (data if len(data) <= most else self._none), elements

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
