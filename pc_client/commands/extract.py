"""`ur-client extract`: from recorded movements of a pen or a hand to Sigma-Lognormal strokes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pc_client.commands import options
from pc_client.commands.options import console, progress_bar, say
from pc_client.errors import RecordingError, one_line
from pc_client.files import as_file_name
from ur_hil.command_line import ExitCode

if TYPE_CHECKING:
    from pc_client.studies.extraction.batch import ExtractionOutcome, Row
    from pc_client.studies.extraction.extract import ExtractOptions
    from pc_client.studies.extraction.pen import PenSource

_FEW_FIGURES = 6
_MOST_ROWS = 30
"""Recordings in the table on the terminal; of more only the summary is shown, extraction.json has all."""


def extract(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...", help="Recordings (.txt, .csv, .tsv), folders of them, .zip archives of them."
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the figures and the strokes.")
    ],
    time_unit: options.TimeUnitOption = "auto",
    strokes_per_peak: Annotated[
        float | None,
        typer.Option(
            "--strokes-per-peak",
            min=0.1,
            max=10.0,
            help="Most strokes per peak of the speed; 1.2 by default, more where these are too few.",
        ),
    ] = None,
    figures: Annotated[
        Literal["few", "all", "none"],
        typer.Option(
            "--figures", metavar="few|all|none", help=f"Pictures: of the first {_FEW_FIGURES}, all or none."
        ),
    ] = "few",
    workers: options.WorkersOption = None,
    dask: options.DaskOption = None,
) -> None:
    """Find the strokes of recorded movements, and say how well they reconstruct them."""
    from pc_client.results.pages import write_files
    from pc_client.results.tables import frame_of, to_csv
    from pc_client.studies.extraction.batch import STROKE_COLUMNS, table_of, to_json
    from pc_client.studies.extraction.extract import ExtractOptions

    options.check_workers(workers, dask)
    if figures != "none":
        import matplotlib  # noqa: F401  # when it is missing, say so before the work is done
    sources, unusable = _look_up(files)
    n_pictures = {"few": _FEW_FIGURES, "all": len(sources), "none": 0}[figures]
    limits = ExtractOptions() if strokes_per_peak is None else ExtractOptions.strict(strokes_per_peak)
    unit = None if time_unit == "auto" else time_unit
    outcomes = _run(sources, limits, unit, n_pictures, workers, dask)
    rows = [outcome.row for outcome in outcomes if outcome.row is not None]
    strokes = [stroke for outcome in outcomes for stroke in outcome.strokes]
    contents: dict[str, str | bytes] = {
        "extraction.json": to_json(rows),
        "strokes.csv": to_csv(frame_of(strokes, STROKE_COLUMNS)),
    }
    if figures != "none" and rows:
        from pc_client.studies.extraction.figures import draw_overview

        contents |= _pictures(outcomes)
        contents["overview.png"] = draw_overview(table_of(rows))
    write_files(out, contents)
    _show(outcomes, rows)
    errors = [*unusable, *(outcome.error for outcome in outcomes if outcome.error is not None)]
    for error in errors:
        print(f"ur-client: {one_line(error)}", file=sys.stderr)
    say(f"{len(rows)} of {len(rows) + len(errors)} recordings; results in {out}")
    if errors:
        raise typer.Exit(ExitCode.FAILED)


def _look_up(files: Sequence[str]) -> tuple[list[PenSource], list[str]]:
    """The recordings that are meant, and what is wrong with folders and archives that cannot be opened."""
    from pc_client.studies.extraction.pen import pen_sources

    sources, unusable = [], []
    for file in files:
        try:
            sources += pen_sources([file])
        except RecordingError as error:
            unusable.append(str(error))
    return sources, unusable


def _run(
    sources: Sequence[PenSource],
    limits: ExtractOptions,
    time_unit: str | None,
    n_pictures: int,
    workers: int | None,
    dask: str | None,
) -> list[ExtractionOutcome]:
    from pc_client.studies.executors import open_executor, usable_cores
    from pc_client.studies.extraction.batch import extract_many

    if not sources:
        return []
    if dask is None:
        # One process more than there are recordings would only cost its start.
        workers = min(workers or usable_cores(), len(sources))
    with progress_bar(remaining=True) as bar, open_executor(workers, dask) as executor:
        task = bar.add_task("extracting", total=len(sources))
        return extract_many(
            sources, executor, limits, time_unit, n_pictures, lambda outcome: bar.advance(task)
        )


def _pictures(outcomes: Sequence[ExtractionOutcome]) -> dict[str, bytes]:
    """Pictures by file name: the place in the batch makes names differ that are equal in their last part."""
    digits = len(str(len(outcomes)))
    return {
        f"figures/{number:0{digits}}_{as_file_name(outcome.name, 'recording')}.png": outcome.picture
        for number, outcome in enumerate(outcomes, start=1)
        if outcome.picture is not None
    }


def _show(outcomes: Sequence[ExtractionOutcome], rows: Sequence[Row]) -> None:
    if not rows:
        return
    import polars as pl

    from pc_client.results.tables import to_rich
    from pc_client.studies.extraction.batch import COLUMNS, table_of

    frame = table_of(rows)
    if len(frame) <= _MOST_ROWS:
        console.print(to_rich(frame, COLUMNS))
        for outcome in outcomes:
            for remark in outcome.remarks:
                say(f"{outcome.name}: {remark}")
    moving = frame.drop_nulls("snr_v_db")
    if len(moving) > 1:
        v, t = pl.col("snr_v_db"), pl.col("snr_t_db")
        figures = moving.select(
            v=v.mean(),
            least_v=v.min(),
            above=100.0 * (v > 15.0).mean(),
            t=t.mean(),
            least_t=t.min(),
            ratio=pl.col("n_strokes").sum() / pl.col("n_speed_peaks").sum(),
        )
        text = (
            "mean SNR_v {v:.2f} dB (least {least_v:.1f}, above 15 dB: {above:.1f} %), "
            "mean SNR_t {t:.2f} dB (least {least_t:.1f}), {ratio:.2f} strokes per speed peak"
        )
        say(text.format(**figures.row(0, named=True)))
