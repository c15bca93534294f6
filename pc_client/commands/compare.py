"""`ur-client compare`: how human-like every generator of movements is, planned and executed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pc_client.commands.experiment import execute, read_runs
from pc_client.commands.options import OutOption, RunSettings, console, say, takes_run_settings

if TYPE_CHECKING:
    from pc_client.analysis.run import MeasuredRun
    from pc_client.studies.comparison import Comparison, MovementSet


@takes_run_settings
def compare(
    out: OutOption,
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
    settings: RunSettings,
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
    from pc_client.results.matplotlib_figures import draw, svg_text
    from pc_client.results.pages import write_files
    from pc_client.results.tables import to_json
    from pc_client.studies.comparison import comparison_sheet

    texts = {
        "compare.json": to_json(table.to_json()),
        "compare.md": table.to_markdown(),
        "compare.svg": svg_text(draw(comparison_sheet(one, runs))),
    }
    return write_files(out, texts)
