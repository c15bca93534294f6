"""`ur-client experiment`, `run` and `compare`: movements on a robot; recordings and tables in a folder."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pc_client.commands import options
from pc_client.commands.options import console, progress_bar, reach, say, show_report
from pc_client.errors import LOG, RECORDED, InterruptedByUserError

if TYPE_CHECKING:
    from pc_client.analysis.run import MeasuredRun
    from pc_client.planning.plan import Motion
    from pc_client.studies.comparison import Comparison, MovementSet


@options.takes_run_settings
def experiment(
    robot: options.RobotOption,
    out: options.OutOption,
    movements: Annotated[
        str | None, typer.Option("--movements", metavar="A,B,...", help="Names or files instead of a set.")
    ] = None,
    set_name: options.SetOption = None,
    repeat: options.RepeatOption = 3,
    *,
    settings: options.RunSettings,
) -> None:
    """Run the paper's experiment: ten movements, three times each, Table I and a report."""
    from pc_client.movements.library_sets import DEFAULT_SET, library_names

    if movements and set_name is not None:
        raise typer.BadParameter("--movements and --set each say what to run: give only one")
    if movements:
        chosen = [name.strip() for name in movements.split(",") if name.strip()]
    else:
        chosen = library_names(set_name if set_name is not None else DEFAULT_SET)
    _run(chosen, robot, out, repeat, settings)


@options.takes_run_settings
def run(
    file: Annotated[str, typer.Argument(metavar="FILE", help="Movement file, or a name of the library.")],
    robot: options.RobotOption,
    out: options.OutOption,
    repeat: options.RepeatOption = 1,
    *,
    settings: options.RunSettings,
) -> None:
    """Run one movement."""
    _run([file], robot, out, repeat, settings)


def _run(movements: Sequence[str], robot: str, out: Path, repeat: int, settings: options.RunSettings) -> None:
    from pc_client.movements.movement import load_motion

    execute([load_motion(name) for name in movements], robot, out, repeat, settings)
    show_report(out)


def execute(
    movements: Sequence[Motion], robot: str, out: Path, repeat: int, settings: options.RunSettings
) -> None:
    """Plan movements, ask where a real arm would move, run them, and say how it went.

    A dry run shows the plan and the question, on a simulated arm too, and ends the command there.

    Raises:
        ClientError: a check failed, the robot stopped or the user interrupted; the arm rests.
        typer.Exit: it was a dry run.
    """
    from pc_client.arm import QUESTION, plan
    from pc_client.experiment.experiment import Experiment, check_folder
    from pc_client.results.pages import require_report_libraries

    require_report_libraries()
    with console.status("planning"):
        arm = reach(robot, settings.ports, settings.cell, settings.reverse_port, yes=settings.yes)
        plans = [plan(movement, arm) for movement in movements]
    if settings.dry_run:
        wanted = Experiment(arm.model, tuple(plans), repeat, out, settings.overwrite)
        check_folder(wanted)
        say(arm.describe(wanted, settings.controller))
        say(f"{QUESTION}\ndry run: not asked, nothing moved")
        raise typer.Exit
    try:
        with _shown(repeat * len(plans)):
            report = arm.experiment(plans, repeat, settings.controller, out, overwrite=settings.overwrite)
    except KeyboardInterrupt as interrupt:
        told = getattr(interrupt, "__notes__", [])
        if not told or told[0].startswith("recorded"):  # no doubt of the driver
            told = ["the arm rests", *told]
        said = "; ".join(("interrupted", *told, f"recordings finished so far are in {out}"))
        raise InterruptedByUserError(said) from interrupt
    robot_time = sum(stream.robot_time for stream in report.streams)
    wall_time = sum(stream.wall_time for stream in report.streams)
    late = sum(stream.late_frames for stream in report.streams)
    lost = sum(stream.lost_frames for stream in report.streams)
    say(
        f"{robot_time:.1f} s of robot time in {wall_time:.1f} s "
        f"({robot_time / max(wall_time, 1e-9):.1f} x real time), "
        f"loop delay {report.delay.delay * 1e3:.1f} ms, {late} late and {lost} lost frames"
    )
    for remark in report.remarks:
        say(remark)


@contextmanager
def _shown(n_runs: int) -> Iterator[None]:
    """Show the log of an experiment: steps beside a bar, which begins after the question, the rest above."""
    bar = progress_bar(live=False)
    task = bar.add_task("", total=n_runs)

    def show(record: logging.LogRecord) -> bool:
        if record.levelno > logging.DEBUG:
            bar.start()
            say(record.getMessage())
        elif record.msg == RECORDED:
            bar.advance(task)
        else:
            bar.update(task, description=record.getMessage())
        bar.refresh()
        return False  # nobody else shows it

    LOG.addFilter(show)
    LOG.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        LOG.removeFilter(show)
        LOG.setLevel(logging.NOTSET)
        bar.stop()


def read_runs(folder: Path) -> list[MeasuredRun]:
    """Read and measure all recordings of a folder, by their file names; RecordingError if one cannot be."""
    from rich.progress import track

    from pc_client.analysis.run import analyse_run
    from pc_client.recording.recording import load_recording

    files = track(sorted(folder.glob("*.mcap")), description="reading", console=console, transient=True)
    return [analyse_run(load_recording(path)) for path in files]


@options.takes_run_settings
def compare(
    out: options.OutOption,
    robot: Annotated[
        str | None,
        typer.Option("--robot", metavar="HOST", help="Control box to execute on; planned only without."),
    ] = None,
    targets: Annotated[int, typer.Option("--targets", min=2, max=50, help="Number of target points.")] = 4,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the first set of target points.")] = 1,
    sets: Annotated[
        int,
        typer.Option(
            "--sets", min=1, max=99, help="Sets of target points, seeds in a row; the table has means."
        ),
    ] = 1,
    *,
    settings: options.RunSettings,
) -> None:
    """Compare all generators of movements: smoothness, power law, peaks; planned and executed."""
    from pc_client.studies.comparison import build_comparison, make_sets, save_sets

    with console.status("making movements"):
        made = make_sets(targets, seed, sets)
    movements = [movement for one in made for movement in one.values()]
    runs = None
    if robot is not None:
        execute(movements, robot, out, 1, settings)
        runs = {run.provenance.movement: run for run in read_runs(out)}
    save_sets(made, out / "movements")
    with console.status("measuring"):
        table = build_comparison(made, runs)
    console.print(table.to_rich())
    for path in _write(table, made[0], runs, out):
        say(str(path))


def _write(
    table: Comparison, one: MovementSet, runs: Mapping[str, MeasuredRun] | None, out: Path
) -> tuple[Path, ...]:
    """Write table and pictures; returns the files."""
    from pc_client.results.figures import svg_text
    from pc_client.results.pages import write_files
    from pc_client.results.tables import to_json
    from pc_client.studies.comparison import comparison_figure

    texts = {
        "compare.json": to_json(table.to_json()),
        "compare.md": table.to_markdown(),
        "compare.svg": svg_text(comparison_figure(one, runs)),
    }
    return write_files(out, texts)
