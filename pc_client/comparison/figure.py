"""One page of pictures: the speed of every generator beside the others, and its path. Loads matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pc_client.analysis.figures import BLUE, REFERENCE_GREY, svg_figure
from pc_client.analysis.run import MeasuredRun
from pc_client.comparison.movement_set import MovementSet
from pc_client.comparison.signals import executed_signal, planned_signal
from pc_client.movements.movement import Movement
from pc_client.movements.twins import GENERATORS

__all__ = ["draw_comparison", "fill_page"]

_COLUMNS = 2
_PANEL_HEIGHT = 1.75


def draw_comparison(one: MovementSet, runs: Mapping[str, MeasuredRun] | None = None) -> str:
    """Draw the movements of one seed.

    Args:
        one: the movements.
        runs: their recordings by name, or None.

    Returns:
        SVG text.
    """
    mark = next(iter(runs.values())).provenance.origin.mark if runs else ""
    rows = -(-len(one.movements) // _COLUMNS)
    with svg_figure(12.0, _PANEL_HEIGHT * rows + 0.75, mark) as (figure, page):
        fill_page(figure, one, runs)
    return page.getvalue()


def fill_page(figure: Figure, one: MovementSet, runs: Mapping[str, MeasuredRun] | None = None) -> None:
    """Draw the movements of one seed into a figure; arguments as of `draw_comparison`."""
    rows = -(-len(one.movements) // _COLUMNS)
    height = figure.get_figheight()
    grid = figure.add_gridspec(
        rows,
        2 * _COLUMNS,
        width_ratios=(2.5, 1.0) * _COLUMNS,
        left=0.05,
        right=0.985,
        top=1.0 - 0.65 / height,
        bottom=0.5 / height,
        hspace=0.42,
        wspace=0.12,
    )
    executed = "; blue: as executed, filtered" if runs else ""
    figure.text(
        0.05,
        1.0 - 0.28 / height,
        f"TCP speed and path, grey: as planned{executed}. Same time, same target points (all but duplicate)",
        fontsize=10,
        weight="bold",
    )
    top = 1.08e3 * max(float(planned_signal(movement).speed.max()) for movement in one.movements.values())
    view = _view(one)
    for index, (kind, movement) in enumerate(one.movements.items()):
        row, column = divmod(index, _COLUMNS)
        run = (runs or {}).get(movement.name)
        axes = figure.add_subplot(grid[row, 2 * column])
        _draw_speed(axes, kind, movement, run, top)
        if row + 1 == rows:
            axes.set_xlabel("time [s]")
        else:
            axes.tick_params(labelbottom=False)
        if column == 0:
            axes.set_ylabel("mm/s")
        _draw_path(figure.add_subplot(grid[row, 2 * column + 1], projection="3d"), movement, run, view)


def _draw_speed(axes: Axes, kind: str, movement: Movement, run: MeasuredRun | None, top: float) -> None:
    plan = planned_signal(movement)
    axes.plot(plan.t, 1e3 * plan.speed, color=REFERENCE_GREY, lw=2.6)
    if run is not None:
        done = executed_signal(run, movement.duration)
        axes.plot(done.t, 1e3 * done.speed, color=BLUE, lw=1.0)
    axes.set(xlim=(0.0, movement.duration), ylim=(0.0, top))
    axes.set_title(f"{kind}: {GENERATORS[kind].says}", fontsize=8.5, pad=3.0)


def _draw_path(
    axes: Any, movement: Movement, run: MeasuredRun | None, view: tuple[np.ndarray, float]
) -> None:
    p = 1e3 * planned_signal(movement).motion.p
    axes.plot(*p.T, color=REFERENCE_GREY, lw=2.4, alpha=0.7)
    if run is not None:
        axes.plot(*(1e3 * run.track.p_actual[run.track.movement]).T, color=BLUE, lw=0.9)
    targets = 1e3 * movement.target_points
    axes.plot(*targets.T, ls="none", marker="o", ms=3.5, mfc="white", mec="black", mew=0.9)
    middle, half = view
    limits = [(float(m - half), float(m + half)) for m in middle]
    axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    axes.set_box_aspect((1, 1, 1), zoom=1.3)
    axes.set(xticklabels=(), yticklabels=(), zticklabels=())
    axes.view_init(elev=24.0, azim=-40.0)


def _view(one: MovementSet) -> tuple[np.ndarray, float]:
    """Middle (3,) and half edge (mm) of the cube that holds all paths."""
    paths = np.vstack([1e3 * planned_signal(movement).motion.p for movement in one.movements.values()])
    low, high = paths.min(axis=0), paths.max(axis=0)
    return 0.5 * (low + high), 0.5 * float((high - low).max())
