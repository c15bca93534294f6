"""`ur-client sweep`: many experiments from one file, over the cores of this machine or a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pc_client.commands.before_motion import reach
from pc_client.commands.options import (
    DaskOption,
    WorkersOption,
    YesOption,
    check_workers,
    console,
    ports_of,
    say,
)
from pc_client.errors import ClientError, SweepError

if TYPE_CHECKING:
    from rich.table import Table

    from pc_client.api.arm import Arm
    from pc_client.sweep.case import Case, GivenRobot, SimulatedArm
    from pc_client.sweep.config import SweepConfig
    from pc_client.sweep.folder import SweepFolder
    from pc_client.sweep.ranking import Setting
    from pc_client.sweep.result_store import ResultStore
    from pc_client.sweep.schedule import Outcomes

_MOST_SHOWN = 5
"""Settings and errors on the terminal; table and page have all."""


def sweep(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The sweep, .toml; see docs/sweeps.md.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results, instead of `output`.")
    ] = None,
    workers: WorkersOption = None,
    dask: DaskOption = None,
    format: Annotated[
        str | None,
        typer.Option(
            "--format", metavar="parquet|csv", help="Of the table; parquet where pyarrow is there, else csv."
        ),
    ] = None,
    yes: YesOption = False,
) -> None:
    """Run every combination of gains, arms and movements; a second call goes on where the first ended."""
    from pc_client.sweep.case import GivenRobot, all_cases
    from pc_client.sweep.config import read_config
    from pc_client.sweep.folder import SweepFolder
    from pc_client.sweep.result_store import ResultStore
    from pc_client.sweep.run_case import run_case
    from pc_client.sweep.schedule import run_in_turn, run_side_by_side
    from pc_client.sweep.table import table_content, table_format

    check_workers(workers, dask)
    plan = read_config(config)
    if plan.host is not None and (workers is not None or dask is not None):
        raise typer.BadParameter(f"robot = {plan.host!r} is one robot: no --workers and no --dask")
    folder = SweepFolder(_folder_of(plan, out))
    written_as = table_format(format)
    arm: Arm | None = None
    arms: Sequence[SimulatedArm] | Sequence[GivenRobot] = plan.arms
    if plan.host is not None:
        arm = reach(plan.host, ports_of(plan.port_base), plan.cell, yes=yes)
        serial = arm.report.info.serial
        arms = (GivenRobot(plan.host, plan.port_base, arm.model.name, serial, plan.cell, plan.reverse_port),)
    cases = all_cases(plan.movements, arms, plan.controllers, plan.repeat)
    folder.prepare()
    store = ResultStore(cases, folder, plan.keep_recordings)
    waiting = store.waiting()
    say(f"{len(store)} cases, {store.n_settled} of them done before; results in {folder.path}")
    if arm is None:
        outcomes = run_side_by_side(waiting, plan.keep_recordings, run_case, workers=workers, dask=dask)
    else:
        if waiting:
            _confirm(arm, waiting)
        outcomes = run_in_turn(waiting, plan.keep_recordings, run_case)
    try:
        _work(store, outcomes, live=arm is None)
    except KeyboardInterrupt as interrupt:
        doubts = "".join(f"; {note}" for note in getattr(interrupt, "__notes__", ()))
        raise ClientError(
            f"interrupted{doubts}; {store.n_settled} of {len(store)} cases are kept in {folder.path}, "
            "the same command goes on from there"
        ) from interrupt
    finally:  # of what there is, whatever ended it
        table = store.rows()
        path = folder.write(f"sweep.{written_as}", table_content(table, written_as))
    say(f"table: {path}")
    _draw(folder, config.stem, table)
    _show(table)
    if left := len(store.waiting()):
        say(f"{left} cases have not begun: look at the arm, then give the same command again")
    if left or any(row["status"] == "failed" for row in table):
        raise typer.Exit(1)


def _work(store: ResultStore, outcomes: Outcomes, *, live: bool) -> None:
    """Settle case by case, and show how far it is."""
    from pc_client.sweep.progress import SweepProgress

    with closing(outcomes), SweepProgress(console, len(store), store.n_settled, live=live) as progress:
        for case, outcome in outcomes:
            store.settle(case, outcome)
            progress.finished(outcome)


def _folder_of(plan: SweepConfig, out: Path | None) -> Path:
    """Where the results go.

    Raises:
        SweepError: it was not confirmed.
    """
    folder = out or plan.output
    if folder is None:
        raise SweepError(f"{plan.source}: no folder for the results; give output = DIR, or --out DIR")
    return folder


def _confirm(arm: Arm, cases: Sequence[Case]) -> None:
    """Show all that an arm is going to do, and ask.

    Raises:
        typer.Abort: the answer is no.
    """
    from pc_client.experiment.prepare import Experiment
    from pc_client.sweep.run_case import plan_case

    by_movement = {case.movement: case for case in cases}
    plans = [plan_case(case) for case in by_movement.values()]
    runs = sum(case.repeat for case in cases) // len(plans)
    planned = tuple(planned for plan in plans for planned in plan.planned)
    arm.confirm(Experiment(plans[0].model, planned, runs, Path()))


def _draw(folder: SweepFolder, name: str, table: Sequence[dict[str, object]]) -> None:
    """Write the page with the plots; without matplotlib the table has to do."""
    from pc_client.sweep.page import render_page

    try:
        with console.status("drawing"):
            page = render_page(name, table)
    except ModuleNotFoundError as error:
        say(
            f"no plots: they need {error.name}; run `pip install 'ur-hil[report]'` and give the command again"
        )
        return
    say(f"plots: {folder.write('sweep.html', page.encode())}")


def _show(table: Sequence[dict[str, object]]) -> None:
    """Say on the terminal what is best and what went wrong."""
    from pc_client.sweep.ranking import rank_settings

    settings = rank_settings(table)
    console.print(_ranking_table(settings[:_MOST_SHOWN]))
    complete = [setting for setting in settings if setting.complete]
    if complete:
        best = complete[0]
        margin = "no feedback" if best.gain_margin is None else f"gain margin {best.gain_margin:.2f}"
        say(f"best of {len(settings)}: {best.name}: {best.mean_snr_db:.2f} dB, {best.n_runs} runs, {margin}")
    else:
        say("no setting has all its cases done: there is no best one")
    for status in ("refused", "failed"):
        errors = [row for row in table if row["status"] == status]
        for row in errors[:_MOST_SHOWN]:
            say(f"{status}: {row['case']} ({row['movement']}): {row['error']}")
        if len(errors) > _MOST_SHOWN:
            say(f"{status}: {len(errors) - _MOST_SHOWN} more, see the table")


def _ranking_table(settings: Sequence[Setting]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in settings[0].values:
        table.add_column(heading, overflow="fold")
    for heading in ("mean SNR\n[dB]", "gain\nmargin", "max error\n[mm]", "runs", "refused", "failed"):
        table.add_column(escape(heading), justify="right")
    for setting in settings:
        figures = (setting.mean_snr_db, setting.gain_margin, setting.max_position_error_mm)
        counts = (setting.n_runs, setting.n_refused, setting.n_failed)
        texts = ("" if figure is None else f"{figure:.2f}" for figure in figures)
        table.add_row(*setting.texts().values(), *texts, *map(str, counts))
    return table
