"""The page of a sweep: ranking, SNR over each axis that varies, a map over two gains, what is not done.

One file that needs no network and holds no date. Import it only where a page is made: it loads matplotlib.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pc_client.arrays import Array
from pc_client.control.controller import FIELDS
from pc_client.results.figures import COLOURS, figure, label_axes, show_legend
from pc_client.results.pages import picture, render
from pc_client.results.tables import to_html
from pc_client.studies.sweep.case import origin_of_rows
from pc_client.studies.sweep.settings import RANKING, edge_of, rank_settings, spans_grid, varying

_Rows = Sequence[Mapping[str, Any]]

_TEMPLATE = "studies/sweep/sweep.html.j2"
_MOST_SETTINGS = 25
"""Settings in the ranking; the table has all."""

_MOST_ERRORS = 50

_STYLES = (("s", "-"), ("^", "--"), ("o", ":"), ("D", "-."))
"""Markers and lines."""

_NOT_DONE = "#DDDDDD"
_MOST_TICKS = 10
"""Values of a grid that are written on its axis."""

_MOST_LEVEL = 4
"""Texts that have room beside each other; more are turned."""


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
            picture(_axis_figure(done, axis, connect=connect or axis == "repetition"), f"SNR over {axis}")
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


def _axis_figure(rows: _Rows, axis: str, *, connect: bool) -> Figure:
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
    with figure(3.2, origin_of_rows(rows).mark) as page:
        axes = page.add_subplot()
        for kind, colour in zip(_in_order(rows, "kind"), cycle(COLOURS)):
            for group, (marker, line) in zip(groups, cycle(_STYLES)):
                series = [r for r in rows if r["kind"] == kind and tuple(r[c] for c in splits) == group]
                if not series:
                    continue
                runs = np.array([(places[row[axis]], row["snr_db"]) for row in series])
                means = np.array([(x, runs[runs[:, 0] == x, 1].mean()) for x in np.unique(runs[:, 0])])
                text = ", ".join((kind, *map(str, group)))
                axes.plot(*runs.T, color=colour, ls="", marker=marker, ms=3.0, alpha=0.3)
                style = line if scale and connect else ""
                axes.plot(*means.T, color=colour, label=text, ls=style, marker=marker, ms=6.0)
        span = (None, None) if scale else (-0.6, len(values) - 0.4)
        label_axes(axes, f"SNR over {axis}: runs and means", axis, "SNR [dB]", span)
        if not scale or (connect and len(values) <= _MOST_TICKS):
            turned = len(values) > _MOST_LEVEL
            texts = [f"{value:g}" if scale else str(value) for value in places]
            way: dict[str, Any] = {"rotation": 20, "ha": "right"} if turned else {}
            axes.set_xticks(list(places.values()), texts, **way)
            axes.grid(axis="x", visible=False)
        show_legend(axes, "right")
    return page


def _map_figure(rows: _Rows, x: str, y: str) -> Figure:
    """The mean SNR over two numeric axes, one panel a fidelity, each with its own colours.

    Of all rows, done or not, a full grid becomes tiles, with a cross where not all cases could be run.
    Anything else becomes dots.
    """
    panels = _in_order(rows, "fidelity")
    xs, ys = _in_order(rows, x), _in_order(rows, y)
    with figure(4.2, origin_of_rows(rows).mark) as page:
        for i, (panel, axes) in enumerate(
            zip(panels, page.subplots(1, len(panels), squeeze=False)[0], strict=True)
        ):
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
