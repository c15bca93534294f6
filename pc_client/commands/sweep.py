"""`ur-client sweep`: many experiments from one file, over the cores of this machine or a cluster."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pc_client.commands import options
from pc_client.commands.options import console, reach, say
from pc_client.errors import InterruptedByUserError, SweepError
from ur_hil.command_line import ExitCode

if TYPE_CHECKING:
    import polars as pl

    from pc_client.arm import Arm
    from pc_client.studies.sweep.case import Case, GivenRobot, Outcome, SimulatedArm
    from pc_client.studies.sweep.store import ResultStore

_MOST_SHOWN = 5
"""Settings and errors on the terminal; table and page have all."""


def sweep(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The sweep, .toml; see docs/sweeps.md.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results, instead of `output`.")
    ] = None,
    workers: options.WorkersOption = None,
    dask: options.DaskOption = None,
    format: Annotated[
        Literal["parquet", "csv"],
        typer.Option("--format", metavar="parquet|csv", help="Of the table's file."),
    ] = "parquet",
    yes: options.YesOption = False,
) -> None:
    """Run every combination of gains, arms and movements; a second call goes on where the first ended."""
    from pc_client.studies.sweep.case import GivenRobot
    from pc_client.studies.sweep.schedule import Sweep, in_turn, run_case, side_by_side
    from pc_client.studies.sweep.settings import read_config
    from pc_client.studies.sweep.store import ResultStore

    options.check_workers(workers, dask)
    plan = read_config(config)
    host, port_base = plan.file.robot, plan.file.port_base or 0
    if host is not None and (workers is not None or dask is not None):
        raise typer.BadParameter(f"robot = {host!r} is one robot: no --workers and no --dask")
    if (folder := out or plan.file.output) is None:
        raise SweepError(f"{config}: no folder for the results; give output = DIR, or --out DIR")
    store = ResultStore(Path(folder), plan.file.keep_recordings)
    arm: Arm | None = None
    arms: Sequence[SimulatedArm] | Sequence[GivenRobot] = plan.arms
    if host is not None:
        arm = reach(host, options.ports_of(port_base), plan.cell, yes=yes)
        serial = arm.report.info.serial
        arms = (GivenRobot(host, port_base, arm.model.name, serial, plan.cell, plan.file.reverse_port),)
    store.prepare()
    work = Sweep(plan, arms, store)
    n_left = plan.n_cases - store.n_settled
    say(f"{plan.n_cases} cases, {store.n_settled} of them done before; results in {store.path}")
    if arm is not None and work.waiting:
        _confirm(arm, work.waiting, n_left * plan.file.repeat)
    job = partial(run_case, keep_recordings=plan.file.keep_recordings)
    runner = nullcontext(in_turn(job)) if arm else side_by_side(job, workers=workers, dask=dask)
    try:
        with runner as run, closing(work.run(run)) as outcomes:
            _work(outcomes, plan.n_cases, store.n_settled, live=arm is None)
    except KeyboardInterrupt as interrupt:
        told = getattr(interrupt, "__notes__", ())
        doubts = "".join(f"; {note}" for note in told if not note.startswith("recorded"))  # that is gone
        raise InterruptedByUserError(
            f"interrupted{doubts}; {store.n_settled} of {plan.n_cases} cases are kept in {store.path}, "
            "the same command goes on from there"
        ) from interrupt
    finally:  # of what there is, whatever ended it
        path = store.write_table(format)
    say(f"table: {path}")
    table = store.table()
    _draw(store, config.stem, table)
    _show(table)
    if work.waiting and (n_left := plan.n_cases - store.n_settled):
        say(f"{n_left} cases have not begun: look at the arm, then give the same command again")
    if (table["status"] == "failed").any():
        raise typer.Exit(ExitCode.FAILED)


def _work(outcomes: Iterator[Outcome], n_cases: int, n_settled: int, *, live: bool) -> None:
    """Run the cases, and show how far it is.

    Args:
        live: True: the clock ticks. False: redrawn when a case is done; the thread that lets it tick would
            take the interpreter from a control loop in this process.
    """
    counts: Counter[str] = Counter()
    n_runs = 0
    bar = options.progress_bar(live=live)
    task = bar.add_task("running", total=n_cases, completed=n_settled)
    try:
        with bar:
            bar.refresh()
            for outcome in outcomes:
                counts[outcome.status] += 1
                n_runs += len(outcome.rows) if outcome.status == "done" else 0
                troubles = "".join(f", {counts[it]} {it}" for it in ("refused", "failed") if counts[it])
                bar.update(task, advance=1, description=f"running{troubles}")
                bar.refresh()
    finally:
        if counts:
            words = ", ".join(f"{counts[it]} {it}" for it in ("done", "refused", "failed") if counts[it])
            minutes = max(bar.tasks[0].elapsed or 0.0, 0.1) / 60.0
            say(f"{words} in {60.0 * minutes:.0f} s, {n_runs / minutes:.0f} runs a minute")


def _confirm(arm: Arm, waiting: Sequence[Case], n_runs: int) -> None:
    """Show all that an arm is going to do, and ask; typer.Abort if the answer is no."""
    from pc_client.experiment.experiment import Experiment
    from pc_client.studies.sweep.schedule import plan_case

    plans = [plan_case(case) for case in {case.movement: case for case in waiting}.values()]
    planned = tuple(planned for plan in plans for planned in plan.planned)
    arm.confirm(Experiment(plans[0].model, planned, n_runs // len(plans), Path()))


def _draw(store: ResultStore, name: str, table: pl.DataFrame) -> None:
    """Write the page with the plots; without matplotlib the table has to do."""
    try:
        from pc_client.studies.sweep.page import render_page

        with console.status("drawing"):
            page = render_page(name, table)
    except ModuleNotFoundError as error:
        say(
            f"no plots: they need {error.name}; run `pip install 'ur-hil[report]'` and give the command again"
        )
        return
    say(f"plots: {store.write('sweep.html', page.encode())}")


def _show(table: pl.DataFrame) -> None:
    """Say on the terminal what is best and what went wrong."""
    from pc_client.results.tables import to_rich
    from pc_client.studies.sweep.settings import RANKING, edge_of, rank_settings

    settings = rank_settings(table)
    console.print(to_rich(settings.head(_MOST_SHOWN), RANKING))
    if len(settings) > _MOST_SHOWN:
        say(f"{_MOST_SHOWN} of {len(settings)} settings; the table has all")
    best = settings.row(0, named=True)
    if best["complete"]:
        gain = best["gain_margin"]
        margin = "no feedback" if gain is None else f"gain margin {gain:.2f}"
        runs = f"{best['n_runs']} run{'s' * (best['n_runs'] != 1)}"
        say(f"best of {len(settings)}: {best['setting']}: {best['mean_snr_db']:.2f} dB, {runs}, {margin}")
        if edge := edge_of(table, settings):
            say(edge)
    else:
        say("no setting has all its cases done: there is no best one")
    for status in ("refused", "failed"):
        errors = table.filter(table["status"] == status)
        for row in errors.head(_MOST_SHOWN).to_dicts():
            say(f"{status}: {row['case']} ({row['movement']}): {row['error']}")
        if len(errors) > _MOST_SHOWN:
            say(f"{status}: {len(errors) - _MOST_SHOWN} more, see the table")
