"""Many recordings at once, in any `concurrent.futures.Executor`, and their results as rows.

    with open_executor() as executor:
        outcomes = extract_many(pen_sources(["drawings.zip", "mine.csv"]), executor)

Files are read here and their bytes handed to the jobs, so a worker on another machine needs no disk of ours.
A recording that cannot be used has an outcome that says so; it does not stop the others.

`strokes.csv` holds every stroke as the theory writes it, so that the movement can be rebuilt from it alone.
A stroke runs from (x0, y0, z0) to (x1, y1, z1), in the unit of the recording, turning by `arc_angle` [rad] in
the plane that `tilt` [rad] chooses (see `sigma_lognormal.arc_frame`); length is D, t0 is in s. Parts and
strokes count from 1.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pc_client.errors import ClientError, RecordingError
from pc_client.results.tables import Column, frame_of
from pc_client.studies.extraction.extract import Extraction, ExtractOptions, extract
from pc_client.studies.extraction.pen import PenSource, contents, parse_pen
from ur_hil.input_files import MIB

if TYPE_CHECKING:
    import polars as pl

Row = Mapping[str, Any]
"""Values by column name."""

_FIGURES = (
    Column("file", align="left", kind=str),
    Column("snr_v_db", "SNR_v", "dB", ".2f", "right", "-", text="missing: nothing moves"),
    Column("snr_t_db", "SNR_t", "dB", ".2f", "right", "-", text="likewise"),
    Column(
        "raw_snr_v_db",
        "raw SNR_v",
        "dB",
        ".2f",
        "right",
        "-",
        "raw\nSNR_v",
        text="of the samples as they are",
    ),
    Column("raw_snr_t_db", "raw SNR_t", "dB", ".2f", "right", "-", "raw\nSNR_t", text="likewise"),
    Column("n_strokes", "strokes", kind=int),
    Column("n_speed_peaks", "speed peaks", narrow="speed\npeaks", kind=int),
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


_IN_FLIGHT = 128
"""Jobs handed over and not yet done; enough for many workers."""

_BYTES_IN_FLIGHT = 16 * MIB
"""No further job is handed over while those that are not done hold more [bytes]."""


@dataclass(frozen=True, slots=True)
class ExtractionOutcome:
    """The result of one recording.

    Attributes:
        row: its figures (`figures_of`), or None when it could not be used.
        remarks: what was mended, and what to know about the strokes.
        picture: a PNG file's bytes, where one was wanted and something moves.
        error: one line, when it could not be used.
    """

    name: str
    row: Row | None = None
    strokes: tuple[Row, ...] = ()
    remarks: tuple[str, ...] = ()
    picture: bytes | None = None
    error: str | None = None


def extract_many(
    sources: Sequence[PenSource],
    executor: Executor,
    options: ExtractOptions | None = None,
    time_unit: str | None = None,
    n_pictures: int = 0,
    on_outcome: Callable[[ExtractionOutcome], None] = lambda outcome: None,
) -> list[ExtractionOutcome]:
    """Extract recordings; returns an outcome for each, in the order of the sources.

    Args:
        sources: what to extract from, as `pen.pen_sources` finds it in files, folders and .zip archives.
        time_unit: a key of `pen.TIME_UNITS`, or None: from each file.
        n_pictures: how many of the first recordings get a picture.
        on_outcome: called with every outcome as it comes in, in any order.

    Raises:
        ClientError: the executor broke down.
    """
    outcomes: dict[int, ExtractionOutcome] = {}
    running: dict[Future[ExtractionOutcome], tuple[int, int]] = {}  # index, bytes

    def keep(index: int, outcome: ExtractionOutcome) -> None:
        outcomes[index] = outcome
        on_outcome(outcome)

    def wait_for_some() -> None:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            index, _ = running.pop(future)
            keep(index, _result(future, sources[index].name))

    for index, (source, content) in enumerate(contents(sources)):
        if isinstance(content, RecordingError):
            keep(index, ExtractionOutcome(source.name, error=str(content)))
            continue
        arguments = (source.name, content, options or ExtractOptions(), time_unit, index < n_pictures)
        running[executor.submit(_extract_one, *arguments)] = (index, len(content))
        while len(running) >= _IN_FLIGHT or sum(n for _, n in running.values()) > _BYTES_IN_FLIGHT:
            wait_for_some()
    while running:
        wait_for_some()
    return [outcomes[index] for index in range(len(sources))]


def _extract_one(
    name: str, content: bytes, options: ExtractOptions, time_unit: str | None, with_picture: bool
) -> ExtractionOutcome:
    """The job of a worker: read a recording, extract its strokes, and draw where that is wanted."""
    try:
        extraction = extract(parse_pen(content, name, time_unit), options)
    except ClientError as error:
        return ExtractionOutcome(name, error=str(error))
    picture = None
    if with_picture and extraction.parts:
        from pc_client.studies.extraction.figures import draw_extraction

        picture = draw_extraction(extraction)
    strokes = tuple(strokes_of(extraction))
    return ExtractionOutcome(name, figures_of(extraction), strokes, extraction.remarks, picture)


def _result(future: Future[ExtractionOutcome], name: str) -> ExtractionOutcome:
    try:
        return future.result()
    except BrokenExecutor as error:
        raise ClientError(f"a worker ended while it extracted {name} ({error}); try fewer workers") from error
    except Exception as error:  # a fault of ours in one recording must not cost the others of the batch
        why = f"{name}: the extraction failed ({type(error).__name__}: {error})"
        return ExtractionOutcome(name, error=why)
