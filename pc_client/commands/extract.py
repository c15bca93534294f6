"""`ur-client extract`: from recorded movements of a pen or a hand to Sigma-Lognormal strokes."""

from __future__ import annotations

import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pc_client.commands.options import (
    DaskOption,
    TimeUnitOption,
    WorkersOption,
    check_workers,
    console,
    say,
)
from pc_client.errors import ClientError, RecordingError, one_line, printable
from pc_client.file_names import as_file_name

if TYPE_CHECKING:
    from rich.table import Table

    from pc_client.extraction.batch import Outcome
    from pc_client.extraction.extract import ExtractOptions
    from pc_client.extraction.results import Row
    from pc_client.extraction.sources import PenSource

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
    time_unit: TimeUnitOption = "auto",
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
        str,
        typer.Option(
            "--figures", metavar="few|all|none", help=f"Pictures: of the first {_FEW_FIGURES}, all or none."
        ),
    ] = "few",
    workers: WorkersOption = None,
    dask: DaskOption = None,
) -> None:
    """Find the strokes of recorded movements, and say how well they reconstruct them."""
    from pc_client.extraction.extract import ExtractOptions
    from pc_client.extraction.files import TIME_UNITS
    from pc_client.extraction.results import to_csv, to_json

    if time_unit != "auto" and time_unit not in TIME_UNITS:
        raise typer.BadParameter(f"no time unit {time_unit!r}: give auto or one of {', '.join(TIME_UNITS)}")
    if figures not in ("few", "all", "none"):
        raise typer.BadParameter(f"no figures {figures!r}: give few, all or none")
    check_workers(workers, dask)
    if figures != "none":
        import matplotlib  # noqa: F401  # when it is missing, say so before the work is done
    sources, unusable = _look_up(files)
    n_pictures = {"few": _FEW_FIGURES, "all": len(sources), "none": 0}[figures]
    options = ExtractOptions() if strokes_per_peak is None else ExtractOptions.strict(strokes_per_peak)
    unit = None if time_unit == "auto" else time_unit
    outcomes = _run(sources, options, unit, n_pictures, workers, dask)
    rows = [outcome.row for outcome in outcomes if outcome.row is not None]
    contents = {
        "extraction.json": to_json(rows).encode(),
        "strokes.csv": to_csv(stroke for outcome in outcomes for stroke in outcome.strokes).encode(),
    }
    if figures != "none" and rows:
        from pc_client.extraction.figures import draw_overview

        contents |= _pictures(outcomes)
        contents["overview.png"] = draw_overview(rows)
    _write(out, contents)
    _show(outcomes, rows)
    errors = [*unusable, *(outcome.error for outcome in outcomes if outcome.error is not None)]
    for error in errors:
        print(f"ur-client: {one_line(error)}", file=sys.stderr)
    say(f"{len(rows)} of {len(rows) + len(errors)} recordings; results in {out}")
    if errors:
        raise typer.Exit(1)


def _look_up(files: Sequence[str]) -> tuple[list[PenSource], list[str]]:
    """The recordings that are meant, and what is wrong with folders and archives that cannot be opened."""
    from pc_client.extraction.sources import pen_sources

    sources, unusable = [], []
    for file in files:
        try:
            sources += pen_sources([file])
        except RecordingError as error:
            unusable.append(str(error))
    return sources, unusable


def _run(
    sources: Sequence[PenSource],
    options: ExtractOptions,
    time_unit: str | None,
    n_pictures: int,
    workers: int | None,
    dask: str | None,
) -> list[Outcome]:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from pc_client.executors import open_executor, usable_cores
    from pc_client.extraction.batch import extract_sources

    if not sources:
        return []
    if dask is None:
        # One process more than there are recordings would only cost its start.
        workers = min(workers or usable_cores(), len(sources))
    bar = Progress(
        TextColumn("extracting"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    with bar, open_executor(workers, dask) as executor:
        task = bar.add_task("extracting", total=len(sources))
        return extract_sources(
            sources, executor, options, time_unit, n_pictures, lambda outcome: bar.advance(task)
        )


def _pictures(outcomes: Sequence[Outcome]) -> dict[str, bytes]:
    """Pictures by file name: the place in the batch makes names differ that are equal in their last part."""
    digits = len(str(len(outcomes)))
    return {
        f"figures/{number:0{digits}}_{as_file_name(outcome.name, 'recording')}.png": outcome.picture
        for number, outcome in enumerate(outcomes, start=1)
        if outcome.picture is not None
    }


def _write(out: Path, contents: dict[str, bytes]) -> None:
    for name, content in contents.items():
        path = out / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        except OSError as error:
            raise ClientError(f"{path}: cannot be written ({error.strerror or error})") from error


def _show(outcomes: Sequence[Outcome], rows: Sequence[Row]) -> None:
    if not rows:
        return
    if len(rows) <= _MOST_ROWS:
        console.print(_table(rows))
        for outcome in outcomes:
            for remark in outcome.remarks:
                say(f"{outcome.name}: {remark}")
    v = [row.snr_v_db for row in rows if row.snr_v_db is not None]
    t = [row.snr_t_db for row in rows if row.snr_t_db is not None]
    if len(v) > 1:
        peaks = sum(row.n_speed_peaks for row in rows)
        ratio = f"{sum(row.n_strokes for row in rows) / peaks:.2f}" if peaks else "-"
        above = 100.0 * sum(value > 15.0 for value in v) / len(v)
        say(
            f"mean SNR_v {statistics.mean(v):.2f} dB (least {min(v):.1f}, above 15 dB: {above:.1f} %), "
            f"mean SNR_t {statistics.mean(t):.2f} dB (least {min(t):.1f}), {ratio} strokes per speed peak"
        )


def _table(rows: Sequence[Row]) -> Table:
    from rich.markup import escape
    from rich.table import Table

    headings = ("file", "SNR_v [dB]", "SNR_t [dB]", "strokes", "speed peaks", "lognormality [dB]")
    table = Table(*map(escape, headings))  # rich would take a unit in brackets for a style
    for row in rows:
        table.add_row(
            escape(printable(row.file)),
            _decibels(row.snr_v_db),
            _decibels(row.snr_t_db),
            str(row.n_strokes),
            str(row.n_speed_peaks),
            _decibels(row.lognormality),
        )
    return table


def _decibels(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
