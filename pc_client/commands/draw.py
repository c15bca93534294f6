"""`ur-client draw`: people's drawings as strokes, on the arm, and on one page that compares the two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pc_client.commands import options
from pc_client.commands.experiment import execute, read_runs
from pc_client.commands.options import console, progress_bar, reach, say
from pc_client.errors import MovementError
from pc_client.files import as_file_name

if TYPE_CHECKING:
    from pc_client.studies.drawing.drawing import Drawing
    from pc_client.studies.drawing.placement import PlacementOptions
    from pc_client.studies.drawing.table import Entry
    from pc_client.studies.extraction.pen import PenRecording


@options.takes_run_settings
def draw(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...", help="Recordings of drawings; one inside an archive is ARCHIVE.zip:PATH."
        ),
    ],
    robot: options.RobotOption,
    out: options.OutOption,
    repeat: options.RepeatOption = 1,
    plane: Annotated[
        str,
        typer.Option(
            "--plane",
            metavar="vertical|horizontal|inclined",
            help="The sheet: a board before the robot, a table, or a desk square to the tool.",
        ),
    ] = "vertical",
    size: Annotated[
        str,
        typer.Option(
            "--size", metavar="MM|max", help="Longest side of the drawing; never larger than the workspace."
        ),
    ] = "100",
    rotate: Annotated[
        str,
        typer.Option(
            "--rotate",
            metavar="DEG|auto",
            help="Turn of the drawing on the sheet, positive to the left; auto: as allows the largest size.",
        ),
    ] = "0",
    lift: Annotated[
        float, typer.Option("--lift", metavar="MM", help="How far the pen is lifted between parts.")
    ] = 30.0,
    y: Annotated[
        Literal["auto", "up", "down"],
        typer.Option(
            "--y",
            metavar="auto|up|down",
            help="Where the recording's y points; auto: down, as pixels are counted, unless one is below 0.",
        ),
    ] = "auto",
    slower: Annotated[
        float,
        typer.Option(
            "--slower",
            metavar="X",
            min=1.0,
            help="Times slower than the arm's limits ask: room for what a controller adds.",
        ),
    ] = 1.0,
    time_unit: options.TimeUnitOption = "auto",
    save: Annotated[
        Path | None,
        typer.Option("--save", metavar="FILE", help="Write the movement as a .toml for `ur-client run`."),
    ] = None,
    *,
    settings: options.RunSettings,
) -> None:
    """Draw what people drew: extract strokes, fit them into the workspace, execute, compare."""
    from pc_client.studies.extraction.pen import read_recording

    if save is not None and len(files) > 1:
        raise typer.BadParameter("--save is for one drawing: give one FILE")
    placement = _placement(plane, size, rotate, lift, y)
    import matplotlib  # noqa: F401  # complains before the work is done

    recordings = [read_recording(file, None if time_unit == "auto" else time_unit) for file in files]
    drawings = _make(recordings, placement, slower, robot, settings)
    if save is not None:
        drawings[0].movement.save(save)
        say(f"movement: {save}")
    for drawing in drawings:
        say(_summary(drawing))
    movements = [drawing.movement for drawing in drawings]
    execute(movements, robot, out, repeat, settings)
    _report(_judge(drawings, out), out)


def _placement(plane: str, size: str, rotate: str, lift: float, y: str) -> PlacementOptions:
    from pc_client.studies.drawing.placement import PlacementOptions

    try:
        return PlacementOptions(
            plane=plane,
            y_up=None if y == "auto" else y == "up",
            rotation=None if rotate == "auto" else math.radians(_number(rotate, "--rotate", "auto")),
            size=None if size == "max" else 1e-3 * _number(size, "--size", "max"),
            lift=1e-3 * lift,
        )
    except MovementError as error:
        raise typer.BadParameter(str(error)) from error


def _number(text: str, option: str, word: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise typer.BadParameter(f"{option} {text!r}: give a number or {word}") from error


def _make(
    recordings: Sequence[PenRecording],
    placement: PlacementOptions,
    slower: float,
    robot: str,
    settings: options.RunSettings,
) -> list[Drawing]:
    """Extract the strokes of recordings and make them ready for the arm that answers."""
    from pc_client.studies.drawing.drawing import make_drawing
    from pc_client.studies.extraction.extract import extract

    model = reach(robot, settings.ports, settings.cell).model
    placement = replace(placement, box=model.description.working_box)
    drawings = []
    with progress_bar() as bar:
        task = bar.add_task("", total=2 * len(recordings))
        for recording, name in zip(recordings, _names(recordings), strict=True):
            bar.update(task, description=f"{name}: strokes")
            extraction = extract(recording)
            bar.update(task, advance=1, description=f"{name}: pace for the arm")
            drawings.append(make_drawing(extraction, name, model, placement, slower))
            bar.advance(task)
    return drawings


def _names(recordings: Sequence[PenRecording]) -> list[str]:
    """Names of movements, each its own and fit for file names."""
    names: list[str] = []
    for recording in recordings:
        stem = as_file_name(recording.name, "drawing")
        name, number = stem, 2
        while name in names:
            name, number = f"{stem}_{number}", number + 1
        names.append(name)
    return names


def _summary(drawing: Drawing) -> str:
    extraction, placement = drawing.extraction, drawing.placement
    later = float(drawing.delays.max())
    place = f"on the {placement.plane} sheet" if drawing.flat else "in space"
    return (
        f"{drawing.movement.name}: {len(drawing.marks)} marks, {extraction.n_strokes} strokes, "
        f"SNR_v {extraction.snr_v_db:.1f} dB; {1e3 * placement.similarity.scale:.3f} mm a unit "
        f"{place}, turned by {math.degrees(placement.rotation):.1f} deg, "
        f"{drawing.factor:.3f} times slower than the hand, {drawing.movement.duration:.1f} s"
        + (f"; later marks up to {later:.2f} s of the hand late" if later > 0.005 else "")
    )


def _judge(drawings: Sequence[Drawing], out: Path) -> list[Entry]:
    """Read the recordings of the runs and compute all figures."""
    from pc_client.studies.drawing.judgement import executed, judge
    from pc_client.studies.drawing.table import Entry

    runs = sorted(read_runs(out), key=lambda run: run.provenance.repetition)
    entries = []
    for drawing in drawings:
        own = [run for run in runs if run.provenance.movement == drawing.movement.name]
        executions = tuple(executed(drawing, run) for run in own)
        entries.append(Entry(drawing, executions, judge(drawing, executions)))
    return entries


def _report(entries: Sequence[Entry], out: Path) -> None:
    """Write page, tables and pictures, and show the tables."""
    from rich.progress import track

    from pc_client.results.figures import svg_text
    from pc_client.results.pages import write_files
    from pc_client.results.tables import to_json
    from pc_client.studies.drawing.figures import Shown, figures_of
    from pc_client.studies.drawing.table import drawing_rich, drawings_json, drawings_markdown, render_page

    figures = {
        entry.name: figures_of(Shown(entry.drawing, entry.executions[-1]))
        for entry in track(entries, description="drawing", console=console, transient=True)
    }
    texts = {
        "draw.json": to_json(drawings_json(entries)),
        "draw.md": drawings_markdown(entries),
        "report.html": render_page(entries, figures),
    }
    for name, own in figures.items():
        texts |= {f"figures/{name}_{kind}.svg": svg_text(one) for kind, one in own.items()}
    write_files(out, texts)
    for entry in entries:
        console.print(drawing_rich(entry))
    say(f"report: {out / 'report.html'}")
