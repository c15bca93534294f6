"""The page of a sweep: ranking, SNR over each axis that varies, a map over two gains, what is not done.

One file that needs no network and holds no date. Import it only where a page is made: it loads matplotlib.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any, Literal

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pc_client.arrays import Array
from pc_client.control.controller import FIELDS
from pc_client.results.matplotlib_figures import draw, figure
from pc_client.results.pages import picture, render
from pc_client.results.sheet import COLOURS, Curve, Panel, Sheet
from pc_client.results.tables import to_html
from pc_client.studies.sweep.case import origin_of_rows
from pc_client.studies.sweep.settings import RANKING, edge_of, rank_settings, spans_grid, varying

_Rows = Sequence[Mapping[str, Any]]

_TEMPLATE = "studies/sweep/sweep.html.j2"
_MOST_SETTINGS = 25
"""Settings in the ranking; the table has all."""

_MOST_ERRORS = 50

_STYLES: tuple[tuple[Literal["s", "^", "o", "D"], Literal["-", "--", ":", "-."]], ...] = (
    ("s", "-"),
    ("^", "--"),
    ("o", ":"),
    ("D", "-."),
)
_NOT_DONE = "#DDDDDD"
_MOST_TICKS = 10
"""Values of a grid that are written on its axis."""


def render_page(name: str, table: pl.DataFrame) -> str:
    """Return the text of `sweep.html`: the name of the sweep, and its table of at least one row.

    Raises:
        ModuleNotFoundError: jinja2 is not installed (extra `report`).
    """
    rows = table.to_dicts()
    axes = varying(table)
    done = [row for row in rows if row["status"] == "done" and row["snr_db"] is not None]
    pair = map_axes(table)
    map_figure = None
    if pair and done:
        map_figure = picture(_map_figure(rows, *pair), "Mean SNR over two settings of the controller")
    settings = rank_settings(table)
    connect = spans_grid(table)
    # Repetitions are no axis of the sweep, but a controller may learn from one to the next.
    plotted = [axis for axis in (*axes, "repetition") if len({row[axis] for row in done}) > 1]
    return render(
        _TEMPLATE,
        title=name[0].upper() + name[1:] if "sweep" in name.lower() else f"Sweep {name}",
        axes={axis: len({row[axis] for row in rows}) for axis in axes},
        n_runs=sum(row["status"] == "done" for row in rows),
        n_cases=len({row["case"] for row in rows}),
        origin=origin_of_rows(rows),
        settings=to_html(settings.head(_MOST_SETTINGS), RANKING),
        n_settings=len(settings),
        n_shown=min(len(settings), _MOST_SETTINGS),
        edge=edge_of(table, settings),
        map_figure=map_figure,
        axis_figures=[
            picture(
                draw(_axis_sheet(done, axis, connect=connect or axis == "repetition")), f"SNR over {axis}"
            )
            for axis in plotted
        ],
        not_done=[row for row in rows if row["status"] != "done"][:_MOST_ERRORS],
        n_not_done=sum(row["status"] != "done" for row in rows),
    )


def map_axes(table: pl.DataFrame) -> tuple[str, str] | None:
    """The axes of the map: both gains if they vary, else the controller's first two numbers that do."""
    numbers = [axis for axis in varying(table) if axis in FIELDS and FIELDS[axis].kind is float]
    numbers.sort(key=lambda axis: axis not in ("gain_p", "gain_i"))
    return (numbers[0], numbers[1]) if len(numbers) > 1 else None


def _axis_sheet(rows: _Rows, axis: str, *, connect: bool) -> Sheet:
    """The SNR of all runs that are done over an axis that varies.

    The means are by kind of movement, controller and fidelity. Lines join the means of numbers if `connect`:
    random samples differ in more than this axis.
    """
    values = _in_order(rows, axis)
    # Numbers stand on a scale, other values at equal distances; so do seeds: there is no more or less of one.
    scale = axis != "seed" and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    places = dict(zip(values, values if scale else range(len(values)), strict=True))
    splits = [c for c in ("controller", "fidelity") if c != axis and len(_in_order(rows, c)) > 1]
    groups = list(dict.fromkeys(tuple(row[c] for c in splits) for row in rows))
    curves = []
    for kind, colour in zip(_in_order(rows, "kind"), cycle(COLOURS)):
        for group, (marker, line) in zip(groups, cycle(_STYLES)):
            series = [r for r in rows if r["kind"] == kind and tuple(r[c] for c in splits) == group]
            if not series:
                continue
            runs = np.array([(places[row[axis]], row["snr_db"]) for row in series])
            means = np.array([(x, runs[runs[:, 0] == x, 1].mean()) for x in np.unique(runs[:, 0])])
            width, label = float(scale and connect), ", ".join((kind, *map(str, group)))
            curves += [
                Curve(runs, colour, width=0.0, marker=marker, size=3.0, opacity=0.3),
                Curve(means, colour, label, width, line, marker, 6.0),
            ]
    ticks = None
    if not scale:
        ticks = {place: str(value) for value, place in places.items()}
    elif connect and len(values) <= _MOST_TICKS:
        ticks = {place: f"{value:g}" for value, place in places.items()}
    panel = Panel(
        (0.06, 0.27, 0.73, 0.61),
        curves,
        f"SNR over {axis}: runs and means",
        (axis, "SNR [dB]"),
        ((None, None) if scale else (-0.6, len(values) - 0.4), (None, None)),
        "right",
        ticks=ticks,
    )
    return Sheet(3.2, [panel], origin_of_rows(rows).mark)


def _map_figure(rows: _Rows, x: str, y: str) -> Figure:
    """The mean SNR over two numeric axes, one panel a fidelity, each with its own colours.

    Of all rows, done or not, a full grid becomes tiles, with a cross where not all cases could be run.
    Anything else becomes dots.
    """
    panels = _in_order(rows, "fidelity")
    xs, ys = _in_order(rows, x), _in_order(rows, y)
    with figure(4.2, origin_of_rows(rows).mark) as page:
        grid = page.add_gridspec(1, len(panels), left=0.06, right=0.95, bottom=0.14, top=0.86, wspace=0.2)
        for i, panel in enumerate(panels):
            axes = page.add_subplot(grid[0, i])
            points = _means([row for row in rows if row["fidelity"] == panel], x, y)
            levels = [mean for mean in points.values() if mean is not None] or [0.0]
            colours = {"vmin": min(levels), "vmax": max(max(levels), min(levels) + 1e-3), "cmap": "viridis"}
            if len(points) == len(xs) * len(ys):
                shown = _draw_tiles(axes, points, xs, ys, colours)
            else:
                shown = _draw_dots(axes, points, colours)
            axes.set_xlabel(x)
            axes.set_ylabel(y if i == 0 else "")
            axes.set_title("mean SNR [dB]" + (f", {panel}" if panel is not None else ""))
            page.colorbar(shown, ax=axes, fraction=0.05, pad=0.02)
    return page


def _draw_tiles(
    axes: Axes,
    points: Mapping[tuple[Any, Any], float | None],
    xs: list[Any],
    ys: list[Any],
    colours: dict[str, Any],
) -> Any:
    values = np.array([[points[a, b] for a in xs] for b in ys], dtype=np.float64)  # nan for None
    tiles = axes.pcolormesh(np.arange(len(xs) + 1), np.arange(len(ys) + 1), values, **colours)
    axes.set_facecolor(_NOT_DONE)
    middle = 0.5 * (colours["vmin"] + colours["vmax"])
    for i, j in np.ndindex(values.shape):
        known = np.isfinite(values[i, j])
        axes.text(
            j + 0.5,
            i + 0.5,
            f"{values[i, j]:.2f}" if known else "×",
            ha="center",
            va="center",
            fontsize=8.5,
            color="white" if known and values[i, j] < middle else "black",
        )
    axes.set_xticks(np.arange(len(xs)) + 0.5, [f"{value:g}" for value in xs])
    axes.set_yticks(np.arange(len(ys)) + 0.5, [f"{value:g}" for value in ys])
    axes.grid(visible=False)
    return tiles


def _draw_dots(axes: Axes, points: Mapping[tuple[Any, Any], float | None], colours: dict[str, Any]) -> Any:
    known = {point: mean for point, mean in points.items() if mean is not None}
    unknown = np.array([point for point, mean in points.items() if mean is None]).reshape(-1, 2)
    axes.plot(*unknown.T, "x", color="#888888", ms=5)
    where: Array = np.array(list(known)).reshape(-1, 2)
    levels = list(known.values())
    return axes.scatter(
        where[:, 0], where[:, 1], c=levels, s=42, edgecolors="black", linewidths=0.4, **colours
    )


def _means(rows: _Rows, x: str, y: str) -> dict[tuple[Any, Any], float | None]:
    """Mean SNR at each point; None where a case is not done: the mean of the rest is over something else."""
    points: dict[tuple[Any, Any], list[float | None]] = {}
    for row in rows:
        points.setdefault((row[x], row[y]), []).append(row.get("snr_db"))
    return {
        point: None if None in levels else float(np.mean([level for level in levels if level is not None]))
        for point, levels in points.items()
    }


def _in_order(rows: _Rows, column: str) -> list[Any]:
    """The values of a column: numbers rising, others as they come."""
    values = list(dict.fromkeys(row[column] for row in rows))
    return sorted(values) if all(isinstance(value, int | float) for value in values) else values
