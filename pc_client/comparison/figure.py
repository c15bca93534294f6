"""What a comparison shows: the speed of every generator beside the others, and its path."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pc_client.analysis.run import MeasuredRun
from pc_client.comparison.movement_set import MovementSet
from pc_client.comparison.signals import executed_signal, planned_signal
from pc_client.movements.twins import GENERATORS
from pc_client.results.sheet import BLUE, REFERENCE_GREY, Curve, Panel, Sheet, boxes, cube_around

__all__ = ["comparison_sheet"]

_COLUMNS = 2
_PANEL_HEIGHT = 1.75
_WIDTH = 12.0


def comparison_sheet(one: MovementSet, runs: Mapping[str, MeasuredRun] | None = None) -> Sheet:
    """The movements of one seed.

    Args:
        one: the movements.
        runs: their recordings by name, or None.
    """
    n_rows = -(-len(one) // _COLUMNS)
    height = _PANEL_HEIGHT * n_rows + 0.75
    grid = boxes(
        (_WIDTH, height),
        (2.5, 1.0) * _COLUMNS,
        (1.0,) * n_rows,
        margins=(0.6, 0.15, 0.65, 0.5),
        gaps=(0.25, 0.4),
    )
    plans = {movement.name: planned_signal(movement) for movement in one.values()}
    top = 1.08e3 * max(float(plan.speed.max()) for plan in plans.values())
    cube = cube_around(np.vstack([1e3 * plan.motion.p for plan in plans.values()]))
    panels = []
    for index, (kind, movement) in enumerate(one.items()):
        row, column = divmod(index, _COLUMNS)
        plan, run = plans[movement.name], (runs or {}).get(movement.name)
        speeds = [Curve(np.c_[plan.t, 1e3 * plan.speed], REFERENCE_GREY, width=2.6)]
        paths = [Curve(1e3 * plan.motion.p, REFERENCE_GREY, width=2.4, opacity=0.7)]
        if run is not None:
            done = executed_signal(run, movement.duration)
            speeds.append(Curve(np.c_[done.t, 1e3 * done.speed], BLUE))
            paths.append(Curve(1e3 * run.track.p_actual[run.track.movement], BLUE, width=0.9))
        paths.append(
            Curve(1e3 * movement.target_points, "#000000", width=0.0, marker="o", size=3.5, hollow=True)
        )
        panels += [
            Panel(
                grid[row][2 * column],
                speeds,
                f"{kind}: {GENERATORS[kind].says}",
                ("time [s]" if index + _COLUMNS >= len(plans) else "", "" if column else "mm/s"),
                ((0.0, movement.duration), (0.0, top)),
            ),
            Panel(grid[row][2 * column + 1], paths, ranges=cube, view=(24.0, -40.0), zoom=1.3),
        ]
    executed = "; blue: as executed, filtered" if runs else ""
    return Sheet(
        height,
        panels,
        next(iter(runs.values())).provenance.origin.mark if runs else "",
        f"TCP speed and path, grey: as planned{executed}. Same time, same target points (all but duplicate)",
        _WIDTH,
    )
