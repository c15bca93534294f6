"""`ur-client movements`: look at the movement library, make new movements."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from pc_client.commands.options import console, say

app = typer.Typer(help="The movement library.", rich_markup_mode=None)


@app.command("list")
def list_movements() -> None:
    """List the movements that come with the package."""
    from pc_client.movements.description import describe
    from pc_client.movements.files import library_names, load_movement

    headings = ("name", "kind", "points", "duration [s]", "path [m]", "top speed [m/s]")
    table = Table(*map(escape, headings))  # rich would take a unit in brackets for a style
    for name in library_names():
        figures = describe(load_movement(name))
        table.add_row(
            name,
            figures["kind"],
            str(figures["n_target_points"]),
            f"{figures['duration_s']:.2f}",
            f"{figures['path_length_m']:.3f}",
            f"{figures['peak_speed_m_s']:.3f}",
        )
    console.print(table)


@app.command("show")
def show(
    movement: Annotated[str, typer.Argument(metavar="NAME|FILE")],
    as_json: Annotated[bool, typer.Option("--json", help="Figures of the movement only, as JSON.")] = False,
) -> None:
    """Show the figures of a movement, and how a UR3 would do it."""
    from pc_client.movements.description import describe
    from pc_client.movements.files import load_movement
    from pc_client.planning.plan import plan_movement
    from pc_client.planning.plan_text import plan_text

    loaded = load_movement(movement)
    figures = describe(loaded)
    if as_json:
        typer.echo(json.dumps(figures, indent=2))
        return
    for key, value in figures.items():
        if key != "strokes":
            say(f"{key:28} {_text(value)}")
    say(plan_text(plan_movement(loaded)))


@app.command("kinds")
def kinds() -> None:
    """List the generators of movements."""
    from pc_client.movements.twins import GENERATORS

    table = Table("kind", "movement", "strokes last as long as lognormal's")
    for name, generator in GENERATORS.items():
        table.add_row(name, generator.says, "yes" if generator.same_strokes else "only the whole")
    console.print(table)


@app.command("generate")
def generate(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Movement file to write, .toml.")],
    kind: Annotated[
        str, typer.Option("--kind", help="Generator: lognormal, uniform and others; `kinds` lists them.")
    ] = "lognormal",
    targets: Annotated[int, typer.Option("--targets", min=2, max=50, help="Number of target points.")] = 4,
    seed: Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same movement.")] = 0,
) -> None:
    """Make a random movement in the UR3's workspace, check that the arm can do it, and save it."""
    from pc_client.movements.files import save_movement
    from pc_client.movements.generate import generate_movement
    from pc_client.planning.plan import plan_movement
    from pc_client.planning.plan_text import plan_text

    movement = generate_movement(kind, targets, seed, name=out.stem)
    plan = plan_movement(movement)
    save_movement(movement, out)
    say(plan_text(plan))
    say(f"saved: {out}")


@app.command("duplicate")
def duplicate(
    movement: Annotated[str, typer.Argument(metavar="NAME|FILE", help="A lognormal movement.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Movement file to write, .toml.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same duplicate.")] = 0,
    share: Annotated[
        float,
        typer.Option("--share", min=0.0, max=1.0, help="Share of the published human variability."),
    ] = 1.0,
) -> None:
    """Vary a movement as people vary when they repeat one, check that the arm can do it, and save it."""
    from pc_client.movements.files import load_movement, save_movement
    from pc_client.movements.variability import duplicate as vary
    from pc_client.planning.plan import plan_movement
    from pc_client.planning.plan_text import plan_text

    varied = vary(load_movement(movement), seed, name=out.stem, share=share)
    plan = plan_movement(varied)
    save_movement(varied, out)
    say(plan_text(plan))
    say(f"saved: {out}")


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(_text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    return str(value)
