"""The results of an extraction: a row of figures for each recording, a row of numbers for each stroke.

`extraction.json` is a list of rows, one for each recording that could be read, in the order they were given.
`strokes.csv` holds every stroke as the theory writes it, so that the movement can be rebuilt from it alone.
A stroke runs from (x0, y0, z0) to (x1, y1, z1), in the unit of the recording, turning by `arc_angle` [rad] in
the plane that `tilt` [rad] chooses (see `pc_client.movements.stroke.arc_frame`); length is D, t0 is in s.
Parts and strokes count from 1.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from pc_client.extraction.extract import Extraction
from pc_client.results.tables import Column, frame_of

if TYPE_CHECKING:
    import polars as pl

__all__ = ["COLUMNS", "STROKE_COLUMNS", "Row", "figures_of", "strokes_of", "table_of", "to_json"]

Row = Mapping[str, Any]
"""Values by column name."""

_FIGURES = (
    Column("file", align="left", kind=str),
    Column("snr_v_db", "SNR_v", "dB", ".2f", missing="-", text="missing: nothing moves"),
    Column("snr_t_db", "SNR_t", "dB", ".2f", missing="-", text="likewise"),
    Column("n_strokes", "strokes", kind=int),
    Column("n_speed_peaks", "speed peaks", kind=int),
)
"""The keys of extraction.json."""

COLUMNS = (
    *_FIGURES,
    Column("lognormality", "lognormality", "dB", ".2f", missing="-", text="SNR_v per stroke"),
)
"""The table for the terminal."""

STROKE_COLUMNS = (
    Column("file", kind=str),
    Column("part", kind=int),
    Column("stroke", kind=int),
    *map(Column, ("t0", "mu", "sigma", "length", "arc_angle", "tilt", "x0", "y0", "z0", "x1", "y1", "z1")),
)
"""The columns of strokes.csv."""


def figures_of(extraction: Extraction) -> Row:
    """The figures of an extraction."""
    figures = {column.name: getattr(extraction, column.name) for column in _FIGURES[1:]}
    return {"file": extraction.name, **figures}


def strokes_of(extraction: Extraction) -> Iterator[Row]:
    """All strokes of an extraction, in their order."""
    names = [column.name for column in STROKE_COLUMNS]
    for number, part in enumerate(extraction.parts, start=1):
        points, lengths = part.trajectory.target_points.tolist(), part.trajectory.lengths.tolist()
        for index, stroke in enumerate(part.trajectory.strokes):
            speed = stroke.timing.lognormal
            timing = (speed.t0, speed.mu, speed.sigma)
            shape = (lengths[index], stroke.arc_angle, stroke.tilt)
            ends = (*points[index], *points[index + 1])
            yield dict(zip(names, (extraction.name, number, index + 1, *timing, *shape, *ends), strict=True))


def table_of(rows: Iterable[Row]) -> pl.DataFrame:
    """The figures of a batch, with `lognormality` and `strokes_per_peak`."""
    import polars as pl

    strokes, peaks = pl.col("n_strokes"), pl.col("n_speed_peaks")
    return frame_of(rows, _FIGURES).with_columns(
        lognormality=pl.col("snr_v_db") / strokes, strokes_per_peak=pl.when(peaks > 0).then(strokes / peaks)
    )


def to_json(rows: Iterable[Row]) -> str:
    """The text of extraction.json: one line for each recording."""
    lines = (json.dumps(row, allow_nan=False, ensure_ascii=False) for row in rows)
    return "[\n" + ",\n".join(lines) + "\n]\n"
