"""Recorded movements of a pen or a hand in files, folders and archives, as other recorders wrote them.

A line is a sample; columns are separated by commas, semicolons, tabs or blanks. A first line of names says
which column is x, y, z and t (others are ignored); without it the order is x, y, t or x, y, z, t. `START` and
`BREAK` lines, as Omniglot has them, separate pen-down parts; without them all is one part. Empty lines and
lines that begin with # are skipped. Samples with cells that are empty or nan are left out.

The unit of time is taken, in this order, from the caller, from the header ("t_ms", "time [s]") or from the
typical step between samples: a recorder takes a sample every 0.5 ms to 0.5 s, so a step of .008 is in s, of 8
in ms, of 8000 in us. Files with START or BREAK are in s or ms. In memory times are seconds, and all parts of
a recording share one time axis that begins at 0; units of length are those of the recording.
"""

import io
import math
import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import RecordingError
from pc_client.files import FILE_KINDS
from ur_hil.input_files import MIB


@dataclass(frozen=True, slots=True, eq=False)
class PenPart:
    """What was recorded between pen-down and pen-up.

    Attributes:
        t: times of the samples, (n,), s, rising; not at equal distances.
        p: positions, (n, 2) or (n, 3), in the unit of the recording.
    """

    t: Array
    p: Array

    def __post_init__(self) -> None:
        t, p = read_only(self.t), read_only(self.p)
        if t.ndim != 1 or len(t) == 0 or p.shape not in ((len(t), 2), (len(t), 3)):
            raise RecordingError(
                f"a part with times {t.shape} and positions {p.shape}: give n >= 1 times and n points of "
                "x, y or x, y, z"
            )
        if not (np.isfinite(t).all() and np.isfinite(p).all()):
            raise RecordingError("a part with NaN or infinity in it: give finite numbers, see ordered_part")
        if np.any(np.diff(t) <= 0.0):
            raise RecordingError("a part whose times do not rise: put it in order first, see ordered_part")
        set_fields(self, t=t, p=p)

    @property
    def duration(self) -> float:
        """From the first sample to the last, s."""
        return float(self.t[-1] - self.t[0])

    @property
    def extent(self) -> float:
        """Diagonal of the box around the samples, in the unit of the recording."""
        return float(np.linalg.norm(np.ptp(self.p, axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class PenRecording:
    """A whole recording.

    Attributes:
        parts: in order of time, on one time axis that begins at 0; none is empty.
        remarks: what had to be mended or left out, one sentence each.
    """

    name: str
    parts: tuple[PenPart, ...]
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len({part.p.shape[1] for part in self.parts}) > 1:
            raise RecordingError(f"{self.name}: some parts are flat and others in space; give one kind")


def ordered_part(t: ArrayLike, p: ArrayLike) -> tuple[PenPart | None, tuple[str, ...]]:
    """Make a part of samples as a recorder left them: times (n,), s, and positions (n, 2) or (n, 3).

    Samples that are not numbers are left out. Samples with the same time stamp are replaced by their mean. A
    sample earlier than one before it is left out: a clock that was set back looks like a mixed-up order, and
    only leaving out keeps every position that is used at the time that was written beside it.

    Returns:
        The part, or None when no sample is left, and remarks on what was done.
    """
    times, points = np.asarray(t, dtype=np.float64), np.asarray(p, dtype=np.float64)
    finite = np.isfinite(times) & np.isfinite(points).all(axis=1)
    counted = {"that are not numbers left out": int(np.sum(~finite))}
    times, points = times[finite], points[finite]
    part = None
    if len(times):
        ahead = times >= np.maximum.accumulate(times)
        counted["with time running backwards left out"] = int(np.sum(~ahead))
        unique, inverse, counts = np.unique(times[ahead], return_inverse=True, return_counts=True)
        counted["with a repeated time stamp merged by their mean"] = len(inverse) - len(unique)
        sums = np.zeros((len(unique), points.shape[1]))
        np.add.at(sums, inverse, points[ahead])
        part = PenPart(unique, sums / counts[:, None])
    remarks = (f"{n} sample{'s' if n != 1 else ''} {what}" for what, n in counted.items() if n)
    return part, tuple(remarks)


def on_one_axis(name: str, parts: Iterable[PenPart], remarks: Iterable[str] = ()) -> PenRecording:
    """Join parts to a recording whose time begins at 0."""
    kept = tuple(parts)
    start = min((part.t[0] for part in kept), default=0.0)
    return PenRecording(name, tuple(PenPart(part.t - start, part.p) for part in kept), tuple(remarks))


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


class _Columns(NamedTuple):
    """Where x, y[, z], t stand in a line, how many columns it has, and the unit of t if it is given."""

    places: tuple[int, ...]
    n_columns: int
    unit: str | None = None


def parse_pen(content: bytes, name: str, time_unit: str | None = None) -> PenRecording:
    """A recording from the bytes of a text file.

    Args:
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
    parts: list[list[list[float]]] = [[]]  # rows of x, y[, z], t
    columns = None
    n_samples = 0
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        cells = line.strip()
        if not cells or cells.startswith("#"):
            continue
        if cells.upper() in _MARKS:
            parts.append([])
            continue
        where = f"{name}, line {number}"
        separator = next((mark for mark in _SEPARATORS if mark in cells), None)  # None: any run of blanks
        fields = [field.strip().strip("\"'") for field in cells.split(separator)]
        if columns is None:
            columns = _columns(fields, where)
            if not _is_number(fields[columns.places[-1]]):
                continue
        elif len(fields) != columns.n_columns:
            raise RecordingError(
                f"{where}: {len(fields)} columns after lines of {columns.n_columns}; "
                "give every sample the same columns"
            )
        n_samples += 1
        if n_samples > MOST_SAMPLES:
            raise RecordingError(f"{name}: more than {MOST_SAMPLES} samples; cut the recording")
        parts[-1].append([_number(fields[place], where) for place in columns.places])
    arrays = [np.array(rows) for rows in parts if rows]
    if columns is None or not arrays:
        raise RecordingError(f"{name}: no samples; give lines of x,y,t or x,y,z,t")
    unit = time_unit or columns.unit or _unit_of(arrays, is_marked=len(parts) > 1)
    return _recording(arrays, TIME_UNITS[unit], name)


def _columns(fields: Sequence[str], where: str) -> _Columns:
    """What the first line says about the columns: by its names, or by their number."""
    if all(_is_number(field) for field in fields):
        if len(fields) not in (3, 4):
            raise RecordingError(f"{where}: {len(fields)} columns and no header; give x,y,t or x,y,z,t")
        return _Columns(tuple(range(len(fields))), len(fields))
    names = [_name_and_unit(field) for field in fields]
    places = {name: index for index, (name, _) in reversed(list(enumerate(names)))}
    time = next((index for index, (name, _) in enumerate(names) if name in _TIME_NAMES), None)
    if time is None or "x" not in places or "y" not in places:
        given = ", ".join(fields)[:60]
        raise RecordingError(f'{where}: "{given}" is neither a sample nor a header with x, y and t')
    space = [places[axis] for axis in ("x", "y", "z") if axis in places]
    return _Columns((*space, time), len(fields), names[time][1])


def _name_and_unit(field: str) -> tuple[str, str | None]:
    """Split a column's name: "Time [ms]", "t_ms" and "time (msec)" are (t or time, ms)."""
    name, *words = [word for word in re.split(r"[\s_\[\]()/:.]+", field.lower()) if word] or [""]
    unit = _UNIT_NAMES.get(words[0], words[0]) if words else None
    return name, unit if unit in TIME_UNITS else None


def _is_number(field: str) -> bool:
    if field.lower() in _MISSING:
        return True
    try:
        float(field)
    except ValueError:
        return False
    return True


def _number(field: str, where: str) -> float:
    if field.lower() in _MISSING:
        return math.nan
    if not _is_number(field):
        raise RecordingError(f'{where}: "{field[:40]}" is not a number')
    value = float(field)
    if abs(value) > _FARTHEST:
        raise RecordingError(f'{where}: "{field[:40]}" is more than {_FARTHEST:g}')
    return value


def _unit_of(parts: Sequence[Array], *, is_marked: bool) -> str:
    with np.errstate(invalid="ignore"):
        steps = np.concatenate([np.diff(part[:, -1]) for part in parts])
        steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if len(steps) == 0:
        return "s"
    step = float(np.median(steps))
    units = ("s", "ms") if is_marked else tuple(TIME_UNITS)
    return next((unit for unit in units if step * TIME_UNITS[unit] < _LONGEST_STEP_S), units[-1])


def _recording(arrays: Sequence[Array], second: float, name: str) -> PenRecording:
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


#: Files that are taken for recordings in a folder or an archive; a file that is named itself is always.
_SUFFIXES = (".csv", ".tsv", ".txt")

MOST_MEMBERS = 100_000
"""Files in one archive: three times those of Omniglot."""

_MOST_UNPACKED = 1024 * MIB
"""What the recordings of one archive say they are unpacked [bytes]; Omniglot's have some 200 MiB."""

_BROKEN_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, EOFError, KeyError, NotImplementedError, RuntimeError, ValueError,
)  # fmt: skip
"""What `zipfile` raises about an archive that is damaged, locked, or of a later form."""


@dataclass(frozen=True, slots=True)
class PenSource:
    """One recording before it is read.

    Attributes:
        name: as the user gave it, or its path in the folder or archive that the user gave.
        path: file on the disk.
        member: path inside, where `path` is an archive.
    """

    name: str
    path: Path
    member: str | None = None


def pen_sources(paths: Sequence[str | Path]) -> list[PenSource]:
    """All recordings in files, folders and .zip archives, in their order.

    Raises:
        RecordingError: a folder or an archive that cannot be opened, or holds no recording. Files are only
            looked at when they are read.
    """
    return [source for path in paths for source in _sources(path)]


def contents(sources: Iterable[PenSource]) -> Iterator[tuple[PenSource, bytes | RecordingError]]:
    """Read recordings one after the other: each with its bytes, or with what is wrong with it.

    An archive is opened once for all of its recordings that follow each other.
    """
    with ExitStack() as opened:
        archive: zipfile.ZipFile | None = None
        for source in sources:
            try:
                if source.member is None:
                    yield source, FILE_KINDS["pen"].read_bytes(source.path)
                    continue
                if archive is None or archive.filename != str(source.path):
                    opened.close()
                    archive = opened.enter_context(zipfile.ZipFile(source.path))
                yield source, _unpack(archive, source.member)
            except RecordingError as error:
                yield source, error
            except OSError as error:
                yield source, RecordingError(f"{source.name}: cannot be read ({error.strerror or error})")
            except _BROKEN_ARCHIVE as error:
                yield source, RecordingError(f"{source.name}: cannot be unpacked ({error})")


def read_recording(given: str | Path, time_unit: str | None = None) -> PenRecording:
    """The one recording in a file, or at `ARCHIVE.zip:PATH`; the unit of time is as of `parse_pen`.

    Raises:
        RecordingError: it cannot be read, or is a folder or an archive of many.
    """
    text = str(given)
    archive, inside, member = text.partition(".zip:")
    if inside:
        source = PenSource(member, Path(f"{archive}.zip"), member)
    elif Path(text).is_dir() or text.lower().endswith(".zip"):
        raise RecordingError(f"{text} holds many recordings: name one, a file or ARCHIVE.zip:PATH")
    else:
        source = PenSource(text, Path(text))
    ((_, content),) = contents([source])
    if isinstance(content, RecordingError):
        raise content
    return parse_pen(content, source.name, time_unit)


def _unpack(archive: zipfile.ZipFile, member: str) -> bytes:
    """One file of an archive, unpacked no further than its limit, whatever the archive says of its size.

    Raises:
        RecordingError: it is longer, or packed by a method that cannot be unpacked piece by piece.
    """
    info = archive.getinfo(member)
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise RecordingError(
            f"{member}: cannot be unpacked (method {info.compress_type}); pack it by deflate"
        )
    most = FILE_KINDS["pen"].most_bytes
    with archive.open(info) as packed:
        content = packed.read(most + 1)
    if len(content) > most:
        raise RecordingError(f"{member}: longer than {most / MIB:g} MiB unpacked; give a shorter file")
    return content


def _sources(given: str | Path) -> Iterator[PenSource]:
    path = Path(given)
    if path.is_dir():
        inside = sorted(
            file for file in path.rglob("*") if file.suffix.lower() in _SUFFIXES and file.is_file()
        )
        if not inside:
            raise RecordingError(f"{given}: no {', '.join(_SUFFIXES)} file in this folder")
        yield from (PenSource(str(file), file) for file in inside)
    elif path.suffix.lower() == ".zip":
        yield from (PenSource(member, path, member) for member in _members(path))
    else:
        yield PenSource(str(given), path)


def _members(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            files = archive.infolist()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from error
    except _BROKEN_ARCHIVE as error:
        raise RecordingError(f"{path}: no .zip archive ({error})") from error
    unpacked = sum(file.file_size for file in files)
    if len(files) > MOST_MEMBERS or unpacked > _MOST_UNPACKED:
        raise RecordingError(
            f"{path}: {len(files)} files of {unpacked / MIB:.0f} MiB in all; allowed are {MOST_MEMBERS} "
            f"files of {_MOST_UNPACKED / MIB:.0f} MiB: unpack what is needed"
        )
    # macOS packs a shadow of every file beside it.
    members = sorted(
        name
        for name in dict.fromkeys(file.filename for file in files)
        if PurePosixPath(name).suffix.lower() in _SUFFIXES and "__MACOSX" not in PurePosixPath(name).parts
    )
    if not members:
        raise RecordingError(f"{path}: no {', '.join(_SUFFIXES)} file in this archive")
    return members
