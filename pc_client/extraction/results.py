"""What an extraction leaves behind: a row of figures for each recording, a row of numbers for each stroke.

`extraction.json` is a list of rows, one for each recording that could be read, in the order they were given.
`strokes.csv` holds every stroke as the theory writes it, so that the movement can be had back from it alone.
A stroke runs from (x0, y0, z0) to (x1, y1, z1), in the unit of the recording, turning by `arc_angle` in the
plane that `tilt` chooses (see `pc_client.movements.stroke.arc_frame`); length is D.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import NamedTuple, get_type_hints

from pc_client.extraction.extract import Extraction
from pc_client.results.tables import Column

__all__ = ["COLUMNS", "STROKE_COLUMNS", "Row", "StrokeRow", "row_of", "stroke_rows", "to_json"]

COLUMNS = (
    Column("file", align="left", kind=str),
    Column("snr_v_db", "SNR_v", "dB", ".2f", missing="-"),
    Column("snr_t_db", "SNR_t", "dB", ".2f", missing="-"),
    Column("n_strokes", "strokes", kind=int),
    Column("n_speed_peaks", "speed peaks", kind=int),
    Column("lognormality", "lognormality", "dB", ".2f", missing="-"),
)
"""The table for the terminal; lognormality is SNR_v per stroke."""


@dataclass(frozen=True, slots=True)
class Row:
    """Figures of one recording, as in extraction.json; None where an SNR is not defined (nothing moves)."""

    file: str
    snr_v_db: float | None
    snr_t_db: float | None
    n_strokes: int
    n_speed_peaks: int

    @property
    def strokes_per_peak(self) -> float | None:
        """Strokes over speed peaks, or None without a peak."""
        return self.n_strokes / self.n_speed_peaks if self.n_speed_peaks else None


class StrokeRow(NamedTuple):
    """One stroke in strokes.csv; part and stroke count from 1, t0 is in s, angles are in rad."""

    file: str
    part: int
    stroke: int
    t0: float
    mu: float
    sigma: float
    length: float
    arc_angle: float
    tilt: float
    x0: float
    y0: float
    z0: float
    x1: float
    y1: float
    z1: float


STROKE_COLUMNS = tuple(Column(name, kind=kind) for name, kind in get_type_hints(StrokeRow).items())
"""The columns of strokes.csv."""


def row_of(extraction: Extraction) -> Row:
    """The figures of an extraction."""
    return Row(
        extraction.name,
        extraction.snr_v_db,
        extraction.snr_t_db,
        extraction.n_strokes,
        extraction.n_speed_peaks,
    )


def stroke_rows(extraction: Extraction) -> Iterator[StrokeRow]:
    """All strokes of an extraction, in their order."""
    for number, part in enumerate(extraction.parts, start=1):
        points, lengths = part.trajectory.target_points.tolist(), part.trajectory.lengths.tolist()
        for index, stroke in enumerate(part.trajectory.strokes):
            speed = stroke.timing.lognormal
            timing = (speed.t0, speed.mu, speed.sigma)
            shape = (lengths[index], stroke.arc_angle, stroke.tilt)
            ends = (*points[index], *points[index + 1])
            yield StrokeRow(extraction.name, number, index + 1, *timing, *shape, *ends)


def to_json(rows: Iterable[Row]) -> str:
    """The text of extraction.json: one line for each recording."""
    lines = (json.dumps(asdict(row), allow_nan=False, ensure_ascii=False) for row in rows)
    return "[\n" + ",\n".join(lines) + "\n]\n"
