"""The running program as messages of the primary port: its global variables, and where its threads stand.

Variables declared with `global` are reported, in the order of the text, as in PolyScope's variables tab:
names once, values on change. They are not read while no client is connected. Values never change in place
(see `urscript.values`), so one that is the same object is the same value.

A `$ 12 "Move"` line is only noted by the thread that passes it; clients get a message in each cycle in which
a thread has passed on. `"breakAfter"` and `"noBreak"` behind the text mean nothing to the box.
"""

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import accumulate, groupby, islice
from typing import Any

from protocol.errors import LocalProtocolError
from protocol.primary import values
from protocol.primary.framing import NO_TIME
from protocol.primary.messages import ProgramLabelMessage, ProgramThreadsMessage, RobotMessage, ThreadLabel
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
# Packages that are sent together: each send takes as long as encoding one.
_AT_ONCE = 8
# Updates are so many microseconds apart; for clients that come, values are looked at no more often.
_UPDATE_PERIOD = 100_000

_NONE = values.TypedValue(values.ValueType.NONE)


def size_of(value: Any, most: int) -> tuple[int, int]:
    """Return at least how many bytes a value takes on the wire, and how many elements are encoded for it.

    Counting ends at `most` bytes; so it takes no longer than encoding a value that fits.
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


def typed_value(value: Any, depth: int = 0) -> values.TypedValue:
    """Return a value of a script as it goes on the wire.

    Strings are constant strings, as in the document's example; threads are the numbers of their handles;
    what has no type there (a handle of remote procedures, lists nested too deeply) is none.
    """
    kind = _KINDS.get(type(value))
    if kind is not None:
        return values.TypedValue(kind, value)
    if depth < values.MAX_NESTING:
        if isinstance(value, list):
            return values.TypedValue(
                values.ValueType.LIST, tuple(typed_value(item, depth + 1) for item in value)
            )
        if isinstance(value, Matrix):
            return values.TypedValue(
                values.ValueType.MATRIX, tuple(tuple(map(typed_value, row)) for row in value.rows)
            )
    if isinstance(value, ScriptThread):
        return values.TypedValue(values.ValueType.INT, value.thread_id)
    return _NONE


_KINDS: dict[type, values.ValueType] = {
    bool: values.ValueType.BOOL,
    int: values.ValueType.INT,
    float: values.ValueType.FLOAT,
    str: values.ValueType.CONST_STRING,
    Pose: values.ValueType.POSE,
}


class VariableReporter:
    """What one port has sent of the variables of one run."""

    def __init__(self, version: SoftwareVersion) -> None:
        self._version = version
        self._none = values.encode_value(_NONE, version)
        self._codes = values.value_codes(version)
        self._forget(None)

    def _forget(self, run: RunningProgram | None) -> None:
        self._run = run
        self._names: tuple[str, ...] = ()
        self._seen: list[Any] = []
        self._sent: list[bytes] = []
        self._next = 0
        self._room = BUDGETS.variable_bytes
        self._looked_at = -_UPDATE_PERIOD
        # For clients that come: the names, in packages; names and values, and the cycle that they are of.
        self._name_parcels: list[tuple[int, list[bytes]]] = []
        self._greeting: list[bytes] = []
        self._greeted_at = -1

    def begin(self, run: RunningProgram | None) -> None:
        """Turn to the variables of a run, or to none; of another run nothing is known."""
        if run is self._run:
            return
        self._forget(run)
        if run is not None:
            names = run.program.declared_globals[: BUDGETS.variables_reported]
            sizes = accumulate(len(name) + 1 for name in names)
            self._names = names[: sum(size <= BUDGETS.variable_name_bytes for size in sizes)]
            self._seen = [UNDEFINED] * len(self._names)
            self._sent = [self._none] * len(self._names)
            self._name_parcels = _parcels(0, [name.encode("latin-1", "replace") for name in self._names])

    def names(self, timestamp: int) -> list[bytes]:
        """Return the packages with all names."""
        return [values.encode_names(timestamp, start, part) for start, part in self._name_parcels]

    def greeting(self, timestamp: int, *, is_first: bool) -> list[bytes]:
        """Return all names, and all values as they were sent last, encoded once a cycle.

        Without variables it is the empty update. Source: capture of a simulator without a program.
        `is_first`: nobody else listens, so the values have not been looked at for long.
        """
        if is_first and timestamp - self._looked_at >= _UPDATE_PERIOD:
            self.changes(timestamp, at_once=True)
        if timestamp != self._greeted_at:
            self._greeted_at = timestamp
            if self._names:
                packages = [*self.names(timestamp), *self._packages(timestamp, 0, self._sent)]
            else:
                nothing = values.GlobalVariablesUpdate(timestamp=NO_TIME)
                packages = [values.encode_program_state(nothing, self._version)]
            self._greeting = [b"".join(packages[i : i + _AT_ONCE]) for i in range(0, len(packages), _AT_ONCE)]
        return self._greeting

    def changes(self, timestamp: int, *, at_once: bool = False) -> list[bytes]:
        """Return the packages with what has changed since it was sent; `at_once`: look at all variables.

        The elements that are encoded are bounded; the next update goes on where this one ends.
        """
        run, names, seen, sent = self._run, self._names, self._seen, self._sent
        if run is None or not names:
            return []
        self._looked_at = timestamp
        first = 0 if at_once else self._next
        end = len(names) if at_once else min(len(names), first + BUDGETS.variables_per_update)
        elements = BUDGETS.variable_elements_per_update
        changed = []
        for i in range(first, end):
            value = run.read_global(names[i])
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
        if changed:
            self._greeted_at = -1
        packages: list[bytes] = []
        for _, group in groupby(enumerate(changed), lambda pair: pair[1] - pair[0]):
            indices = [i for _, i in group]
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
            data = values.encode_value(typed, self._version)
        except LocalProtocolError:
            return self._none, elements
        return (data if len(data) <= most else self._none), elements

    def _packages(self, timestamp: int, start: int, items: Sequence[bytes]) -> list[bytes]:
        return [values.encode_values(timestamp, first, part) for first, part in _parcels(start, items)]


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


# Characters of a label or a name, and threads, that a message names: clients hold packages of 4096 bytes.
MAX_TEXT = 60
MAX_THREADS = 30

_LABEL = re.compile(r'\s*(-?\d{1,9})\s*"([^"]*)"')


@lru_cache(maxsize=1024)
def parse_label(line: str) -> tuple[int, str] | None:
    """Return number and text of a label line, given without its `$`; None for one that is malformed."""
    found = _LABEL.match(line)
    return (int(found[1]), found[2][:MAX_TEXT]) if found else None


class LabelReporter:
    """What one port has sent of the positions of the threads of one run."""

    def __init__(self, version: SoftwareVersion) -> None:
        self._tells_of_threads = ProgramThreadsMessage.SINCE.covers(version)
        self._run: RunningProgram | None = None
        self._sent: tuple[ThreadLabel, ...] = ()

    def begin(self, run: RunningProgram | None) -> None:
        """Turn to a run, or to none; one without labels is not watched."""
        self._run = run if run is not None and "$" in run.program.source.text else None
        self._sent = ()

    def message(self, timestamp: int) -> RobotMessage | None:
        """Return the message of this cycle, or None if nothing has changed."""
        if self._run is None:
            return None
        found = (
            ThreadLabel(label_id=label[0], text=label[1], thread_name=thread.name[:MAX_TEXT])
            for thread in self._run.threads[: None if self._tells_of_threads else 1]
            if thread.label and (label := parse_label(thread.label)) is not None
        )
        labels = tuple(islice(found, MAX_THREADS))
        if labels == self._sent:
            return None
        self._sent = labels
        if self._tells_of_threads:
            return ProgramThreadsMessage(timestamp=timestamp, threads=labels)
        if not labels:
            return None
        return ProgramLabelMessage(timestamp=timestamp, label_id=labels[0].label_id, text=labels[0].text)
