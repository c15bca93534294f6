"""A movement brought along as (x, y, z, t) samples: a natural cubic spline through them.

Samples are taken as they are: nothing is smoothed and nothing is resampled here.
"""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from pc_client.errors import MovementError
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.stroke import Motion

__all__ = ["MIN_SAMPLES", "SampledLaw", "parse_samples", "write_samples"]

#: Fewest samples of a movement: a cubic has four coefficients.
MIN_SAMPLES = 4

_COLUMNS = ("x", "y", "z", "t")
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")


@dataclass(frozen=True, slots=True, eq=False)
class SampledLaw:
    """The natural cubic spline through samples.

    Attributes:
        t: times, (n,), s, increasing; shifted so that the first is 0.
        points: (n, 3), m.
    """

    t: NDArray[np.float64]
    points: NDArray[np.float64]
    _spline: CubicSpline = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        t, points = read_only(self.t), read_only(self.points)
        if t.ndim != 1 or points.shape != (len(t), 3):
            raise MovementError(
                f"samples with t {t.shape} and points {points.shape}: give n times and n points of x, y, z"
            )
        if len(t) < MIN_SAMPLES:
            raise MovementError(f"{len(t)} samples: a movement needs at least {MIN_SAMPLES}")
        for index, row in enumerate(np.column_stack((points, t)).tolist()):
            if not all(map(math.isfinite, row)):
                raise MovementError(f"sample {index} is x, y, z, t = {row}: give finite numbers")
        stalled = np.flatnonzero(np.diff(t) <= 0.0)
        if len(stalled):
            index = int(stalled[0]) + 1
            raise MovementError(
                f"sample {index} is at t = {t[index]} s after {t[index - 1]} s: times must increase"
            )
        t = read_only(t - t[0])
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "_spline", CubicSpline(t, points, bc_type="natural"))

    @property
    def duration(self) -> float:
        """Time of the last sample, s."""
        return float(self.t[-1])

    @property
    def target_points(self) -> NDArray[np.float64]:
        """Samples name no targets: the first and the last point, (2, 3), m."""
        return read_only(self.points[[0, -1]])

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        return Motion(self._spline(times), self._spline(times, 1), self._spline(times, 2))

    def transformed(self, similarity: Similarity) -> SampledLaw:
        """The samples moved, scaled and rotated."""
        return SampledLaw(self.t, similarity.points(self.points))

    def stretched(self, factor: float) -> SampledLaw:
        """The samples `factor` times as slow."""
        return SampledLaw(self.t * factor, self.points)


def parse_samples(text: str, source: str) -> SampledLaw:
    """Samples from text: one a line, columns x, y, z (m) and t (s).

    Columns are separated by commas, semicolons, tabs or blanks. A first line of the names x, y, z, t may give
    another order; without it the order is x, y, z, t. Empty lines and lines that begin with # are skipped.

    Args:
        text: the file's content.
        source: the file's name, for messages.

    Raises:
        MovementError: naming the line.
    """
    order = list(range(4))
    rows: list[list[float]] = []
    lines: list[int] = []
    header_allowed = True
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.strip().lstrip("\ufeff")
        if not cells or cells.startswith("#"):
            continue
        fields = _SEPARATOR.split(cells)
        names = [name.strip('"').lower() for name in fields]
        if header_allowed and sorted(names) == sorted(_COLUMNS):
            order = [names.index(name) for name in _COLUMNS]
            header_allowed = False
            continue
        header_allowed = False
        if len(fields) != len(_COLUMNS):
            raise MovementError(
                f"{source}, line {number}: {len(fields)} columns; give four: x, y, z in m and t in s"
            )
        row = [
            _parse_number(fields[column], source, number, name)
            for column, name in zip(order, _COLUMNS, strict=True)
        ]
        if rows and row[3] <= rows[-1][3]:
            raise MovementError(
                f"{source}, line {number}: t = {row[3]:g} s after t = {rows[-1][3]:g} s in line {lines[-1]}; "
                "times must increase"
            )
        rows.append(row)
        lines.append(number)
    if len(rows) < MIN_SAMPLES:
        raise MovementError(f"{source}: {len(rows)} samples; a movement needs at least {MIN_SAMPLES}")
    values = np.array(rows)
    return SampledLaw(values[:, 3], values[:, :3])


def write_samples(path: Path, t: NDArray[np.float64], points: NDArray[np.float64]) -> None:
    """Write times (n,), s, and points (n, 3), m, as CSV with the columns x, y, z, t, to the last digit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    writer.writerows([*point, time] for point, time in zip(points.tolist(), t.tolist(), strict=True))
    path.write_text(text.getvalue(), encoding="utf-8")


def _parse_number(text: str, source: str, line: int, column: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MovementError(f'{source}, line {line}: {column} is "{text}"; give a finite number')
    return value
