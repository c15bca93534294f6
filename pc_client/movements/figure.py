"""A picture of a set of the library: speed over time and path of every pair, human-like beside robot-like.

`python -m pc_client.movements.figure docs/img/movements.png` writes that of the set `paper`; a second word
names another set. Needs matplotlib (extra `report`).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from pc_client.movements.files import DEFAULT_SET, library_names, load_movement
from pc_client.movements.geometry import UR3_BOX
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal

__all__ = ["draw_library"]

_HUMAN, _ROBOT, _FAINT = "#c2410c", "#1d4ed8", "#a8a29e"


def draw_library(path: Path, set_name: str = DEFAULT_SET) -> None:
    """Draw the five pairs of a set into a picture file (the suffix names the format)."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    names = library_names(set_name)
    pairs = [
        (load_movement(human), load_movement(robot))
        for human, robot in zip(names[5:], names[:5], strict=True)
    ]
    end = 1.02 * max(human.duration for human, _ in pairs)
    figure = plt.figure(figsize=(13.0, 3.0 * len(pairs)), layout="constrained")
    figure.suptitle(
        f"The ten movements of the set {set_name}: human-like and robot-like twins, same target points, "
        "same stroke durations"
    )
    grid = figure.add_gridspec(len(pairs), 2, width_ratios=(1.9, 1.0))
    for row, (human, robot) in enumerate(pairs):
        axes = figure.add_subplot(grid[row, 0])
        axes.set(xlim=(0.0, end), ylim=(0.0, 0.30), ylabel="TCP speed (m/s)")
        _draw_speeds(axes, human, robot)
        _draw_paths(figure.add_subplot(grid[row, 1], projection="3d"), human, robot, first=row == 0)
    axes.set_xlabel("time (s); grey: single strokes; dotted: boundaries of strokes")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_speeds(axes: Any, human: Movement, robot: Movement) -> None:
    t = np.linspace(0.0, human.duration, 1200)
    if isinstance(human.trajectory, SigmaLognormal):
        axes.plot(t, human.trajectory.stroke_speeds(t), color=_FAINT, linewidth=1.0, zorder=1)
    axes.plot(t, robot.speed(t), color=_ROBOT, linewidth=1.8, label=robot.name)
    axes.plot(t, human.speed(t), color=_HUMAN, linewidth=1.8, label=human.name)
    for boundary in np.cumsum(human.stroke_durations)[:-1]:
        axes.axvline(boundary, color=_FAINT, linewidth=0.8, linestyle=":")
    axes.legend(loc="upper right", frameon=False, ncols=2)
    axes.spines[["top", "right"]].set_visible(False)


def _draw_paths(axes: Any, human: Movement, robot: Movement, *, first: bool) -> None:
    t = np.linspace(0.0, human.duration, 600)
    for movement, colour in ((robot, _ROBOT), (human, _HUMAN)):
        axes.plot(*(1e3 * movement.sample(t).p.T), color=colour, linewidth=1.5)
    targets = 1e3 * human.target_points
    axes.scatter(*targets.T, color="black", s=14, depthshade=False)
    axes.text(*targets[0], " start", fontsize=8)
    low, high = 1e3 * np.array(UR3_BOX.low), 1e3 * np.array(UR3_BOX.high)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(tuple(UR3_BOX.size))
    axes.set(xticks=(300, 400), yticks=(-200, -100, 0, 100, 200), zticks=(150, 250, 350))
    axes.tick_params(labelsize=7, pad=-1)
    axes.view_init(elev=24.0, azim=-35.0)
    if first:
        axes.set_title("path in the recommended box (mm, base frame)", fontsize=9)


if __name__ == "__main__":
    draw_library(Path(sys.argv[1] if len(sys.argv) > 1 else "movements.png"), *sys.argv[2:3])
