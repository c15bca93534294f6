"""Draws the pictures of docs/movements.md: speed over time and path of every pair of a set of the library.

`python -m docs.make_movement_pictures` writes docs/img/movements.png (set `paper`) and movements_arcs.png.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pc_client.kinematics.arms import UR3_BOX
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.results.figures import (
    BLUE,
    OUTLINE,
    PAPER_GREY,
    RED,
    figure,
    image_bytes,
    label_axes,
    show_legend,
    space_axes,
)

_IMAGES = Path(__file__).parent / "img"
_TOP = 0.30


def _library_figure(set_name: str) -> Figure:
    """The five pairs of a set."""
    names = library_names(set_name)
    pairs = [
        (load_movement(human), load_movement(robot))
        for human, robot in zip(names[5:], names[:5], strict=True)
    ]
    longest = 1.02 * max(human.duration for human, _ in pairs)
    title = (
        f"The ten movements of the set {set_name}: human-like and robot-like twins, same target points, "
        "same stroke durations"
    )
    with figure(15.0, width=13.0, title=title) as page:
        grid = page.add_gridspec(5, 2, width_ratios=(1.9, 1.0))
        for row, (human, robot) in enumerate(pairs):
            speeds, paths = page.add_subplot(grid[row, 0]), page.add_subplot(grid[row, 1], projection="3d")
            _draw_speeds(speeds, human, robot)
            text = "time [s]; grey: single strokes; dotted: boundaries of strokes" if row == 4 else ""
            label_axes(speeds, "", text, "TCP speed [m/s]", (0.0, longest), 0.0, _TOP)
            show_legend(speeds, "above")
            _draw_paths(paths, human, robot)
            if row == 0:
                paths.set_title("Path in the recommended box, base frame")
    return page


def _draw_speeds(axes: Axes, human: Movement, robot: Movement) -> None:
    t = np.linspace(0.0, human.duration, 1200)
    for boundary in np.cumsum(human.stroke_durations)[:-1]:
        axes.axvline(boundary, color=PAPER_GREY, lw=0.8, ls=":")
    if isinstance(human.trajectory, SigmaLognormal):
        axes.plot(t, human.trajectory.stroke_speeds(t), color=PAPER_GREY)
    for movement, colour in ((robot, BLUE), (human, RED)):
        axes.plot(t, movement.speed(t), color=colour, label=movement.name, lw=1.8)


def _draw_paths(axes: Any, human: Movement, robot: Movement) -> None:
    t = np.linspace(0.0, human.duration, 600)
    targets = 1e3 * human.target_points
    for movement, colour in ((robot, BLUE), (human, RED)):
        axes.plot(*(1e3 * movement.sample(t).p).T, color=colour, lw=1.5)
    axes.plot(*targets.T, "o", color="black", ms=3.8)
    axes.text(*targets[0], "  start", path_effects=OUTLINE)
    box = 1e3 * np.array((UR3_BOX.low, UR3_BOX.high))
    space_axes(axes, box, ("x [mm]", "y [mm]", "z [mm]"), least=0.0, view=(24.0, -35.0), zoom=1.6)


if __name__ == "__main__":
    for set_name, name in (("paper", "movements.png"), ("arcs", "movements_arcs.png")):
        (_IMAGES / name).write_bytes(image_bytes(_library_figure(set_name)))
