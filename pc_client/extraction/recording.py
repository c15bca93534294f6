"""A recorded movement of a pen or a hand: what came out of a file, checked and put in order of time.

Units of length are those of the recording (pixels, millimetres, metres): nothing in the extraction depends on
them. Times are seconds, and all parts of a recording share one time axis that begins at 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import RecordingError
from pc_client.movements.geometry import read_only

__all__ = ["PenPart", "PenRecording", "ordered_part"]


@dataclass(frozen=True, slots=True, eq=False)
class PenPart:
    """What was recorded between pen-down and pen-up.

    Attributes:
        t: times of the samples, (n,), s, rising; not at equal distances.
        p: positions, (n, 2) or (n, 3), in the unit of the recording.
    """

    t: NDArray[np.float64]
    p: NDArray[np.float64]

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
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "p", p)

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
        name: of the file, for messages and tables.
        parts: in order of time, on one time axis that begins at 0; none is empty.
        remarks: what had to be mended or left out, one sentence each.
    """

    name: str
    parts: tuple[PenPart, ...]
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len({part.p.shape[1] for part in self.parts}) > 1:
            raise RecordingError(f"{self.name}: some parts are flat and others in space; give one kind")

    @property
    def n_samples(self) -> int:
        """Samples of all parts."""
        return sum(len(part.t) for part in self.parts)


def ordered_part(t: ArrayLike, p: ArrayLike) -> tuple[PenPart | None, tuple[str, ...]]:
    """Make a part of samples as a recorder left them.

    Samples that are not numbers are left out. Samples with the same time stamp are replaced by their mean. A
    sample earlier than one before it is left out: a clock that was set back looks like a mixed-up order, and
    only leaving out keeps every position that is used at the time that was written beside it.

    Args:
        t: times, (n,), s.
        p: positions, (n, 2) or (n, 3).

    Returns:
        The part, or None when no sample is left, and remarks on what was done.
    """
    times, points = np.asarray(t, dtype=np.float64), np.asarray(p, dtype=np.float64)
    remarks = []
    finite = np.isfinite(times) & np.isfinite(points).all(axis=1)
    if not finite.all():
        remarks.append(_counted(int(np.count_nonzero(~finite)), "that are not numbers left out"))
        times, points = times[finite], points[finite]
    if len(times) == 0:
        return None, tuple(remarks)
    latest = np.maximum.accumulate(times)
    late = times < latest
    if late.any():
        remarks.append(_counted(int(np.count_nonzero(late)), "with time running backwards left out"))
        times, points = times[~late], points[~late]
    unique, inverse, counts = np.unique(times, return_inverse=True, return_counts=True)
    if len(unique) < len(times):
        remarks.append(_counted(len(times) - len(unique), "with a repeated time stamp merged by their mean"))
        sums = np.zeros((len(unique), points.shape[1]))
        np.add.at(sums, inverse, points)
        times, points = unique, sums / counts[:, None]
    return PenPart(times, points), tuple(remarks)


def on_one_axis(name: str, parts: Iterable[PenPart], remarks: Iterable[str] = ()) -> PenRecording:
    """Join parts to a recording whose time begins at 0."""
    kept = tuple(parts)
    start = min((part.t[0] for part in kept), default=0.0)
    return PenRecording(name, tuple(PenPart(part.t - start, part.p) for part in kept), tuple(remarks))


def _counted(count: int, what: str) -> str:
    return f"{count} sample{'s' if count != 1 else ''} {what}"
