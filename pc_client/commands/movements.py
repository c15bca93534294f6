"""`ur-client movements`: look at the movement library, make new movements."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pc_client.commands.options import SetOption, console, say
from ur_hil.command_line import examples

if TYPE_CHECKING:
    from pc_client.arrays import Array
    from pc_client.movements.movement import Movement

app = typer.Typer(help="The movement library.", rich_markup_mode=None)


_CornersOption = Annotated[
    Literal["stop", "blend"],
    typer.Option(
        "--corners",
        metavar="stop|blend",
        help="Robot-like: come to rest at inner target points, or round them, 30 mm before and after.",
    ),
]


@app.command("list", epilog=examples("ur-client movements list --set arcs"))
def list_movements(set_name: SetOption = None) -> None:
    """List the movements that come with the package."""
    from pc_client.movements.description import outline
    from pc_client.movements.library_sets import LIBRARY_SETS, library_names
    from pc_client.movements.movement import load_movement
    from pc_client.results.tables import Column, frame_of, to_rich

    columns = (
        Column("name", align="left", kind=str),
        Column("kind", align="left", kind=str),
        Column("n_target_points", "points", kind=int),
        Column("duration_s", "duration", "s", ".2f"),
        Column("path_length_m", "path", "m", ".3f"),
        Column("peak_speed_m_s", "top speed", "m/s", ".3f"),
    )
    sets = [set_name] if set_name is not None else LIBRARY_SETS
    names = [name for chosen in sets for name in library_names(chosen)]
    rows = [{**outline(load_movement(name)), "name": name} for name in names]
    console.print(to_rich(frame_of(rows, columns), columns))


@app.command("show", epilog=examples("ur-client movements show lognorm_4_1 --json"))
def show(
    movement: Annotated[str, typer.Argument(metavar="NAME|FILE")],
    as_json: Annotated[bool, typer.Option("--json", help="Figures of the movement only, as JSON.")] = False,
) -> None:
    """Show the figures of a movement, and how a UR3 would do it."""
    from pc_client.movements.description import describe
    from pc_client.movements.movement import load_movement
    from pc_client.planning.approach import plan_text
    from pc_client.planning.plan import plan_movement

    loaded = load_movement(movement)
    figures = describe(loaded)
    if as_json:
        typer.echo(json.dumps(figures, indent=2))
        return
    for key, value in figures.items():
        if key != "strokes":
            say(f"{key:28} {_text(value)}")
    say(plan_text(plan_movement(loaded)))


@app.command("kinds", epilog=examples("ur-client movements kinds"))
def kinds() -> None:
    """List the generators of movements."""
    from pc_client.movements.generate import GENERATORS
    from pc_client.results.tables import Column, frame_of, to_rich

    columns = [
        Column(name, align="left", kind=str)
        for name in ("kind", "movement", "target points", "stroke durations")
    ]
    rows = [
        {
            "kind": name,
            "movement": generator.says,
            "target points": "the same" if generator.same_targets else "own, but the first",
            "stroke durations": "the same" if generator.same_strokes else "only their sum",
        }
        for name, generator in GENERATORS.items()
    ]
    title = "beside the lognormal movement of the same seed"
    console.print(to_rich(frame_of(rows, columns), columns, title=title))


@app.command(
    "generate", epilog=examples("ur-client movements generate --kind lognormal --seed 3 --out mine.toml")
)
def generate(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Movement file to write, .toml.")],
    kind: Annotated[
        str, typer.Option("--kind", help="Generator: lognormal, uniform and others; `kinds` lists them.")
    ] = "lognormal",
    targets: Annotated[int, typer.Option("--targets", min=2, max=50, help="Number of target points.")] = 4,
    seed: Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same movement.")] = 0,
    corners: _CornersOption = "stop",
) -> None:
    """Make a random movement in the UR3's workspace, check that the arm can do it, and save it."""
    from pc_client.movements.generate import generate_movement

    _check_and_save(generate_movement(kind, targets, seed, name=out.stem, corners=corners), out)


@app.command("new", epilog=examples("ur-client movements new --targets targets.csv --out mine.toml"))
def new(
    targets: Annotated[
        Path,
        typer.Option(
            "--targets",
            metavar="FILE.csv",
            help="Your target points: columns x, y, z in m, base frame; and optionally t in s.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Movement file to write, .toml.")],
    style: Annotated[
        Literal["human", "robot"],
        typer.Option(
            "--style",
            metavar="human|robot",
            help="Straight lognormal strokes (sigma .067, at rest at each point), or constant speeds.",
        ),
    ] = "human",
    durations: Annotated[
        str | None,
        typer.Option(
            "--durations",
            metavar="A,B,...",
            help="Durations of the strokes in s, if the file has no t; by default for .25 m/s at most.",
        ),
    ] = None,
    corners: _CornersOption = "stop",
) -> None:
    """Make a movement through your own target points, check that the arm can do it, and save it."""
    from pc_client.movements.movement import Movement, load_targets

    points, times = load_targets(targets)
    if durations is not None:
        if times is not None:
            raise typer.BadParameter(f"--durations, but {targets} has a column t: give only one of them")
        times = _numbers(durations)
    _check_and_save(Movement.through(points, style, times, name=out.stem, corners=corners), out)


@app.command(
    "duplicate", epilog=examples("ur-client movements duplicate lognorm_4_1 --seed 3 --out other.toml")
)
def duplicate(
    movement: Annotated[str, typer.Argument(metavar="NAME|FILE", help="A lognormal movement.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Movement file to write, .toml.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same duplicate.")] = 0,
    share: Annotated[
        float, typer.Option("--share", min=0.0, max=1.0, help="Share of the published human variability.")
    ] = 1.0,
) -> None:
    """Vary a movement as people vary when they repeat one, check that the arm can do it, and save it.

    Only the first target point stays: strokes of other lengths and directions lead to others.
    """
    from pc_client.movements.movement import load_movement
    from pc_client.movements.variability import duplicate as vary

    _check_and_save(vary(load_movement(movement), seed, name=out.stem, share=share), out)


def _check_and_save(movement: Movement, out: Path) -> None:
    """Plan a movement for a UR3, save it and say what it would do; what cannot be planned is not saved."""
    from pc_client.planning.approach import plan_text
    from pc_client.planning.plan import plan_movement

    plan = plan_movement(movement)
    movement.save(out)
    say(plan_text(plan))
    say(f"saved: {out}")


def _numbers(words: str) -> Array:
    import numpy as np

    try:
        return np.array([float(word) for word in words.split(",")])
    except ValueError as error:
        raise typer.BadParameter(f"--durations {words}: give times in s, separated by commas") from error


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(_text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    return str(value)
