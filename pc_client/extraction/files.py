"""Recordings from text files, as other people's recorders wrote them.

A line is a sample; columns are apart by commas, semicolons, tabs or blanks. A first line of names says which
column is x, y, z and t (others are passed over); without it the order is x, y, t or x, y, z, t. `START` and
`BREAK` lines, as Omniglot has them, stand between pen-down parts; without them all is one part. Empty lines
and lines that begin with # are skipped. Cells that are empty or nan make a sample that is left out.

The unit of time is taken, in this order, from the caller, from the header ("t_ms", "time [s]") or from the
typical step between samples: a recorder takes a sample every 0.5 ms to 0.5 s, so a step of .008 is in s, of 8
in ms, of 8000 in us. Files with START or BREAK are in s or ms.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import RecordingError
from pc_client.extraction.recording import PenPart, PenRecording, on_one_axis, ordered_part
from pc_client.input_files import FILE_KINDS

__all__ = ["TIME_UNITS", "parse_pen", "read_pen"]

#: Seconds of each unit of time.
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}

#: A recorder's longest step between samples, s.
_LONGEST_STEP_S = 0.5
#: A part that lasts longer, s, is a wrong unit or a broken clock.
_LONGEST_PART_S = 7200.0
#: More samples than this are refused: an extraction of as many takes minutes.
MOST_SAMPLES = 200_000
#: Farthest position and time, in the file's units, that a recorder writes; times in ns since 1970 are nearer.
_FARTHEST = 1e19
#: Gaps above this, s, are worth a remark.
_GAP_S = 0.5
#: Set between parts whose times overlap, s.
_BETWEEN_PARTS_S = 0.1

_SEPARATORS = ("\t", ";", ",")
_MARKS = {"START", "BREAK"}
_MISSING = {"", "nan", "na", "n/a", "none", "null", "inf", "+inf", "-inf", "infinity", "-infinity"}
_TIME_NAMES = {"t", "time", "timestamp", "times"}
_UNIT_NAMES = {
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
    "milliseconds": "ms",
    "µs": "us",
    "microseconds": "us",
    "nanoseconds": "ns",
}


@dataclass(frozen=True, slots=True)
class _Columns:
    """Where x, y[, z] and t stand in a line, how many columns it has, and the unit of t if it is given."""

    places: tuple[int, ...]
    time: int
    count: int
    unit: str | None


@dataclass(slots=True)
class _Table:
    """What a text holds: its parts, each a list of rows of x, y[, z], t, and remarks about them."""

    parts: list[list[list[float]]]
    columns: _Columns | None = None
    marked: bool = False


def read_pen(path: str | Path, time_unit: str | None = None) -> PenRecording:
    """Read one file.

    Args:
        path: a text file.
        time_unit: a key of `TIME_UNITS`; None: from the file.

    Raises:
        RecordingError: the file cannot be read or makes no sense; the message names file and line.
    """
    return parse_pen(FILE_KINDS["pen"].read_bytes(Path(path)), str(path), time_unit)


def parse_pen(content: bytes, name: str, time_unit: str | None = None) -> PenRecording:
    """A recording from the bytes of a text file.

    Args:
        content: the file.
        name: of the file, for messages.
        time_unit: a key of `TIME_UNITS`; None: from the file.

    Raises:
        RecordingError: naming file and line.
    """
    if time_unit is not None and time_unit not in TIME_UNITS:
        raise RecordingError(f"time unit {time_unit!r}: give one of {', '.join(TIME_UNITS)}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(f"{name}: no text file (byte {error.start} is not UTF-8)") from error
    table = _rows(text, name)
    arrays = [np.array(rows) for rows in table.parts if rows]
    if not arrays:
        raise RecordingError(f"{name}: no samples; give lines of x,y,t or x,y,z,t")
    unit = time_unit or (table.columns.unit if table.columns else None) or _unit_of(arrays, table.marked)
    return _recording(arrays, TIME_UNITS[unit], name)


def _rows(text: str, name: str) -> _Table:
    table = _Table([[]])
    n_samples = 0
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        cells = line.strip()
        if not cells or cells.startswith("#"):
            continue
        if cells.upper() in _MARKS:
            table.marked = True
            table.parts.append([])
            continue
        fields = _fields(cells)
        if table.columns is None:
            table.columns = _columns(fields, f"{name}, line {number}")
            if not _is_number(fields[table.columns.time]):
                continue
        elif len(fields) != table.columns.count:
            raise RecordingError(
                f"{name}, line {number}: {len(fields)} columns after lines of {table.columns.count}; "
                "give every sample the same columns"
            )
        n_samples += 1
        if n_samples > MOST_SAMPLES:
            raise RecordingError(f"{name}: more than {MOST_SAMPLES} samples; cut the recording")
        places = (*table.columns.places, table.columns.time)
        table.parts[-1].append([_number(fields[place], name, number) for place in places])
    return table


def _fields(cells: str) -> list[str]:
    separator = next((mark for mark in _SEPARATORS if mark in cells), None)  # None: any run of blanks
    return [field.strip().strip("\"'") for field in cells.split(separator)]


def _columns(fields: Sequence[str], where: str) -> _Columns:
    """What the first line says about the columns: by its names, or by their number."""
    if all(_is_number(field) for field in fields):
        if len(fields) not in (3, 4):
            raise RecordingError(f"{where}: {len(fields)} columns and no header; give x,y,t or x,y,z,t")
        return _Columns(tuple(range(len(fields) - 1)), len(fields) - 1, len(fields), None)
    names = [_name_and_unit(field) for field in fields]
    places = {name: index for index, (name, _) in reversed(list(enumerate(names)))}
    times = [index for index, (name, _) in enumerate(names) if name in _TIME_NAMES]
    if not times or "x" not in places or "y" not in places:
        given = ", ".join(fields)[:60]
        raise RecordingError(f'{where}: "{given}" is neither a sample nor a header with x, y and t')
    space = tuple(places[axis] for axis in ("x", "y", "z") if axis in places)
    return _Columns(space, times[0], len(fields), names[times[0]][1])


def _name_and_unit(field: str) -> tuple[str, str | None]:
    """Split a column's name: "Time [ms]", "t_ms" and "time (msec)" are (t or time, ms)."""
    words = [word for word in re.split(r"[\s_\[\]()/:.]+", field.lower()) if word]
    if not words:
        return "", None
    unit = next((_UNIT_NAMES.get(word, word) for word in words[1:]), None)
    return words[0], unit if unit in TIME_UNITS else None


def _is_number(field: str) -> bool:
    if field.lower() in _MISSING:
        return True
    try:
        float(field)
    except ValueError:
        return False
    return True


def _number(field: str, name: str, line: int) -> float:
    if field.lower() in _MISSING:
        return math.nan
    try:
        value = float(field)
    except ValueError:
        raise RecordingError(f'{name}, line {line}: "{field[:40]}" is not a number') from None
    if abs(value) > _FARTHEST:
        raise RecordingError(f'{name}, line {line}: "{field[:40]}" is more than {_FARTHEST:g}')
    return value


def _unit_of(parts: Sequence[NDArray[np.float64]], marked: bool) -> str:
    with np.errstate(invalid="ignore"):
        steps = np.concatenate([np.diff(part[:, -1]) for part in parts])
        steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if len(steps) == 0:
        return "s"
    step = float(np.median(steps))
    units = ("s", "ms") if marked else tuple(TIME_UNITS)
    return next((unit for unit in units if step * TIME_UNITS[unit] < _LONGEST_STEP_S), units[-1])


def _recording(arrays: Sequence[NDArray[np.float64]], second: float, name: str) -> PenRecording:
    parts: list[PenPart] = []
    remarks: list[str] = []
    shifted = 0
    for number, rows in enumerate(arrays, start=1):
        part, mended = ordered_part(rows[:, -1] * second, rows[:, :-1])
        where = f"part {number}: " if len(arrays) > 1 else ""
        remarks += [where + remark for remark in mended]
        if part is None:
            continue
        if part.duration > _LONGEST_PART_S:
            raise RecordingError(
                f"{name}: a part lasts {part.duration:.3g} s, more than {_LONGEST_PART_S:.0f} s; "
                "give the time unit, or cut the recording"
            )
        gap = float(np.diff(part.t).max(initial=0.0))
        if gap > _GAP_S:
            remarks.append(f"{where}a gap of {gap:.2f} s bridged by a straight line")
        if parts and part.t[0] <= parts[-1].t[-1]:
            part = PenPart(part.t - part.t[0] + parts[-1].t[-1] + _BETWEEN_PARTS_S, part.p)
            shifted += 1
        parts.append(part)
    if not parts:
        raise RecordingError(f"{name}: no sample with numbers for all columns; give x,y,t or x,y,z,t")
    if shifted:
        remarks.append(
            f"{shifted} of {len(parts)} parts began before the last ended; set {_BETWEEN_PARTS_S} s behind"
        )
    return on_one_axis(name, parts, remarks)
