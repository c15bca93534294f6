"""Draws the pictures of docs/movements.md: speed over time and path of every pair of a set of the library.

`python -m docs.make_movement_pictures` writes docs/img/movements.png (set `paper`) and movements_arcs.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pc_client.kinematics.arms import UR3_BOX
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.results.matplotlib_figures import draw, image_bytes
from pc_client.results.sheet import BLUE, PAPER_GREY, RED, Box, Curve, Panel, Range, Sheet, boxes

_IMAGES = Path(__file__).parent / "img"
_TOP = 0.30


def _library_sheet(set_name: str) -> Sheet:
    """The five pairs of a set."""
    names = library_names(set_name)
    size = (13.0, 15.0)
    grid = boxes(size, (1.9, 1.0), [1] * 5, margins=(0.7, 0.5, 0.8, 0.6), gaps=(0.4, 0.45))
    pairs = [
        (load_movement(human), load_movement(robot))
        for human, robot in zip(names[5:], names[:5], strict=True)
    ]
    span = (0.0, 1.02 * max(human.duration for human, _ in pairs))
    panels = []
    for (left, right), pair in zip(grid, pairs, strict=True):
        text = "time [s]; grey: single strokes; dotted: boundaries of strokes" if pair is pairs[-1] else ""
        panels += [
            _speeds(left, *pair, span, text),
            _paths(right, *pair, "" if pair is not pairs[0] else "Path in the recommended box, base frame"),
        ]
    title = (
        f"The ten movements of the set {set_name}: human-like and robot-like twins, same target points, "
        "same stroke durations"
    )
    return Sheet(size[1], panels, "", title, size[0])


def _speeds(box: Box, human: Movement, robot: Movement, span: Range, label: str) -> Panel:
    t = np.linspace(0.0, human.duration, 1200)
    curves = [
        Curve(np.array([[boundary, 0.0], [boundary, _TOP]]), PAPER_GREY, width=0.8, style=":")
        for boundary in np.cumsum(human.stroke_durations)[:-1]
    ]
    if isinstance(human.trajectory, SigmaLognormal):
        curves += [Curve(np.c_[t, v], PAPER_GREY) for v in human.trajectory.stroke_speeds(t).T]
    curves += [
        Curve(np.c_[t, movement.speed(t)], colour, movement.name, 1.8)
        for movement, colour in ((robot, BLUE), (human, RED))
    ]
    return Panel(box, curves, "", (label, "TCP speed [m/s]"), (span, (0.0, _TOP)), "above")


def _paths(box: Box, human: Movement, robot: Movement, title: str) -> Panel:
    t = np.linspace(0.0, human.duration, 600)
    targets = 1e3 * human.target_points
    curves = [
        *(Curve(1e3 * m.sample(t).p, colour, width=1.5) for m, colour in ((robot, BLUE), (human, RED))),
        Curve(targets, "#000000", width=0.0, marker="o", size=3.8),
    ]
    ranges = [(1e3 * low, 1e3 * high) for low, high in zip(UR3_BOX.low, UR3_BOX.high, strict=True)]
    labels = ("x [mm]", "y [mm]", "z [mm]")
    return Panel(
        box, curves, title, labels, ranges, texts=[(targets[0], "start")], view=(24.0, -35.0), zoom=1.6
    )


if __name__ == "__main__":
    for set_name, name in (("paper", "movements.png"), ("arcs", "movements_arcs.png")):
        (_IMAGES / name).write_bytes(image_bytes(draw(_library_sheet(set_name))))
