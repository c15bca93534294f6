"""The plots of a sweep, as SVG text: SNR over each axis that varies, and a map over two gains.

Loads matplotlib; import it only where a plot is drawn. Style and colours are those of the report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pc_client.analysis.figures import BLUE, GREEN, ORANGE, PURPLE, RED, SKY, svg_figure

Rows = Sequence[Mapping[str, Any]]

_COLOURS = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY)
_NOT_DONE = "#DDDDDD"
_WIDTH = 11.0


def draw_axis(rows: Rows, axis: str) -> str:
    """Draw the SNR of all runs over one axis, and its mean for each kind of movement.

    Args:
        rows: runs that are done.
        axis: a column that varies.

    Returns:
        SVG text.
    """
    values = _in_order(rows, axis)
    numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    positions = dict(zip(values, values if numeric else range(len(values)), strict=True))
    kinds = _in_order(rows, "kind")
    with svg_figure(_WIDTH, 3.2, _simulated(rows)) as (figure, page):
        axes = figure.add_axes((0.06, 0.2 if numeric else 0.27, 0.925, 0.66 if numeric else 0.59))
        for i, kind in enumerate(kinds):
            of_kind = [row for row in rows if row["kind"] == kind]
            _draw_kind(axes, of_kind, axis, positions, kind, _COLOURS[i % len(_COLOURS)])
        if not numeric:
            axes.set_xticks(list(positions.values()), [str(value) for value in values])
            if len(values) > 4:
                axes.tick_params(axis="x", rotation=20)
            axes.set_xlim(-0.6, len(values) - 0.4)
        axes.yaxis.set_major_locator(MaxNLocator(6))
        axes.set_xlabel(axis)
        axes.set_ylabel("SNR [dB]")
        axes.set_title(f"SNR of the TCP speed over {axis}: all runs, and the mean of each kind")
        axes.legend(ncols=3, loc="lower right", bbox_to_anchor=(0.9, 1.0), borderaxespad=0.2)
    return page.getvalue()


def draw_map(rows: Rows, x: str, y: str) -> str:
    """Draw the mean SNR over two numeric axes, one panel a fidelity, all in the same colours.

    A full grid becomes tiles, with a cross where nothing could be run; anything else becomes dots.

    Args:
        rows: all of the table, done or not.
        x: column across.
        y: column upwards.

    Returns:
        SVG text.
    """
    panels = _in_order(rows, "fidelity")
    means = {panel: _means([r for r in rows if r["fidelity"] == panel], x, y) for panel in panels}
    levels = [mean for points in means.values() for mean in points.values() if mean is not None]
    low, high = (min(levels), max(levels)) if levels else (0.0, 1.0)
    colours = {"vmin": low, "vmax": max(high, low + 1e-3), "cmap": "viridis"}
    with svg_figure(_WIDTH, 4.2, _simulated(rows)) as (figure, page):
        grid = figure.add_gridspec(1, len(panels), left=0.06, right=0.9, bottom=0.14, top=0.86, wspace=0.18)
        for i, panel in enumerate(panels):
            axes = figure.add_subplot(grid[0, i])
            xs, ys = _in_order(rows, x), _in_order(rows, y)
            points = means[panel]
            if len(points) == len(xs) * len(ys):
                shown = _draw_tiles(axes, points, xs, ys, colours)
            else:
                shown = _draw_dots(axes, points, colours)
            axes.set_xlabel(x)
            axes.set_ylabel(y if i == 0 else "")
            axes.set_title("mean SNR [dB]" + (f", {panel}" if panel is not None else ""))
        bar = figure.colorbar(shown, cax=figure.add_axes((0.915, 0.14, 0.014, 0.72)))
        bar.set_label("mean SNR [dB]")
    return page.getvalue()


def _draw_kind(
    axes: Axes, rows: Rows, axis: str, positions: Mapping[Any, float], kind: str, colour: str
) -> None:
    axes.plot(
        [positions[r[axis]] for r in rows], [r["snr_db"] for r in rows], "o", ms=3, color=colour, alpha=0.35
    )
    values = [value for value in positions if any(row[axis] == value for row in rows)]
    means = [np.mean([row["snr_db"] for row in rows if row[axis] == value]) for value in values]
    # Many values are samples, or movements: a line between them would say nothing.
    line = "-" if 1 < len(values) <= 12 and axis != "movement" else ""
    axes.plot([positions[v] for v in values], means, marker="s", ms=5.5, ls=line, color=colour, label=kind)


def _draw_tiles(
    axes: Axes,
    points: Mapping[tuple[Any, Any], float | None],
    xs: list[Any],
    ys: list[Any],
    colours: dict[str, Any],
) -> Any:
    values = np.array([[_nan_for_none(points[a, b]) for a in xs] for b in ys])
    tiles = axes.pcolormesh(np.arange(len(xs) + 1), np.arange(len(ys) + 1), values, **colours)
    axes.set_facecolor(_NOT_DONE)
    middle = 0.5 * (colours["vmin"] + colours["vmax"])
    for i, j in np.ndindex(values.shape):
        known = np.isfinite(values[i, j])
        axes.text(
            j + 0.5,
            i + 0.5,
            f"{values[i, j]:.1f}" if known else "×",
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
    where: NDArray[np.float64] = np.array(list(known)).reshape(-1, 2)
    levels = list(known.values())
    return axes.scatter(
        where[:, 0], where[:, 1], c=levels, s=42, edgecolors="black", linewidths=0.4, **colours
    )


def _means(rows: Rows, x: str, y: str) -> dict[tuple[Any, Any], float | None]:
    """Mean SNR at each point; None where a case is not done: the mean of the rest is over something else."""
    points: dict[tuple[Any, Any], list[float | None]] = {}
    for row in rows:
        points.setdefault((row[x], row[y]), []).append(row.get("snr_db"))
    return {
        point: None if None in levels else float(np.mean([level for level in levels if level is not None]))
        for point, levels in points.items()
    }


def _nan_for_none(value: float | None) -> float:
    return np.nan if value is None else value


def _in_order(rows: Rows, column: str) -> list[Any]:
    """The values of a column: numbers rising, others as they come."""
    values = list(dict.fromkeys(row[column] for row in rows))
    return sorted(values) if all(isinstance(value, int | float) for value in values) else values


def _simulated(rows: Rows) -> bool:
    return any(row["fidelity"] is not None for row in rows)
