"""A movement brought along as (x, y, z, t) samples: a natural cubic spline through them.

Samples are taken as they are: nothing is smoothed and nothing is resampled here.
"""

from __future__ import annotations

import csv
import io
import math
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from pc_client.errors import MovementError
from pc_client.movements.columns import parse_rows
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.stroke import Motion

__all__ = ["MIN_SAMPLES", "SampledLaw", "parse_samples", "write_samples"]

#: Fewest samples of a movement: a cubic has four coefficients.
MIN_SAMPLES = 4

_COLUMNS = ("x", "y", "z", "t")


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
        spline = None
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"), suppress(ValueError):
            spline = CubicSpline(t, points, bc_type="natural")
        if spline is None or not np.isfinite(spline.c).all():
            raise MovementError(
                f"samples up to {np.abs(points).max():g} away with times from {np.diff(t).min():g} s apart: "
                "the speed between them is no number; give metres and seconds"
            )
        object.__setattr__(self, "_spline", spline)

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

    Without a first line of names the order is x, y, z, t; the form is that of `columns`.

    Args:
        text: the file's content.
        source: the file's name, for messages.

    Raises:
        MovementError: naming the line.
    """
    rows = parse_rows(text, source, [_COLUMNS], "four: x, y, z in m and t in s").values
    if len(rows) < MIN_SAMPLES:
        raise MovementError(f"{source}: {len(rows)} samples; a movement needs at least {MIN_SAMPLES}")
    return SampledLaw(rows[:, 3], rows[:, :3])


def write_samples(path: Path, t: NDArray[np.float64], points: NDArray[np.float64]) -> None:
    """Write times (n,), s, and points (n, 3), m, as CSV with the columns x, y, z, t, to the last digit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    writer.writerows([*point, time] for point, time in zip(points.tolist(), t.tolist(), strict=True))
    path.write_text(text.getvalue(), encoding="utf-8")
