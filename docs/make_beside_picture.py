"""Draws docs/img/beside.png: figures of a real UR3, in motion and at rest, beside those of emulated arms.

`python -m docs.make_beside_picture` runs the motions on six boxes, prints the tables of docs/beside.md and
draws. The recorded side is the table of figures in tests/ur_emulator/recorded_arm.py.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pc_client.results.figures import BLUE, GRID_GREY, REFERENCE_GREY, TEXT, figure, image_bytes

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "tests" / "ur_emulator"))

from real_arm_figures import moving, resting  # noqa: E402
from recorded_arm import MOTIONS, MOVING, NOISE, STANDING, STANDING_CURRENT, record  # noqa: E402

SEEDS = range(1, 7)
SHARE = 1 / 3
JOINTS = ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3")
SHOWN = {"base": "90°", "three": "three joints", "line": "line"}
# By its name: what a figure is multiplied by, title, unit.
FIGURES = {
    "behind": (1, "behind", "ms"),
    "scatter": (1, "scatter", "mrad"),
    "largest": (1, "largest", "mrad"),
    "speed_noise": (1, "speed noise", "mrad/s"),
    "current": (1, "current", "A"),
    "current_noise": (1e3, "current noise", "mA"),
    "target_current": (1, "target_current", "A"),
}
AT_REST = {
    "noise": ("at rest: noise of an angle", "µrad", NOISE),
    "standing": ("target − actual", "µrad", STANDING),
    "standing_current": ("actual − target current", "A", STANDING_CURRENT),
}
# One row a joint of a motion, from above.
ROWS = {key: -i for i, key in enumerate(MOVING)}
_REAL: dict[str, Any] = {"color": TEXT, "marker": "|", "ms": 11, "mew": 2, "ls": "", "zorder": 3}
_OURS: dict[str, Any] = {"color": BLUE, "marker": "o", "ms": 4, "alpha": 0.55, "ls": "", "mew": 0}


def draw_moving(axes: Axes, name: str, ours: dict[tuple[str, int], Sequence[float]]) -> None:
    factor, title, unit = FIGURES[name]
    for key, row in ROWS.items():
        real = factor * getattr(MOVING[key], name)
        axes.barh(row, 2 * SHARE * real, left=(1 - SHARE) * real, height=0.62, color=GRID_GREY, lw=0)
        axes.plot([real], [row], **_REAL)
        axes.plot(factor * np.array(ours[key]), [row] * len(ours[key]), **_OURS)
    axes.set(title=title, xlabel=unit, ylim=(min(ROWS.values()) - 0.6, 0.6))
    axes.set_yticks(list(ROWS.values()), [""] * len(ROWS))
    axes.axvline(0, color=REFERENCE_GREY, lw=0.7)
    axes.grid(visible=False, axis="y")


def draw_resting(axes: Axes, name: str, ours: Sequence[Sequence[float]]) -> None:
    title, unit, recorded = AT_REST[name]
    for joint in range(6):
        axes.plot([ours[joint]], [-joint - 0.16], **_OURS)
        axes.plot([[row[joint] for row in recorded.values()]], [-joint + 0.16], **_REAL)
    axes.set(title=title, xlabel=unit, ylim=(-5.6, 0.6))
    axes.set_yticks([-joint for joint in range(6)], [""] * 6)
    axes.axvline(0, color=REFERENCE_GREY, lw=0.7)
    axes.grid(visible=False, axis="y")


def print_tables(ours: dict[tuple[str, int], list[Any]], still: list[list[Any]]) -> None:
    """Rows of Markdown, real / emulated, the mean of the boxes."""
    for (motion, joint), real in MOVING.items():
        cells = [f"{SHOWN[motion]}: {JOINTS[joint]}"]
        for name, (factor, *_) in FIGURES.items():
            of_boxes = [factor * getattr(it, name) for it in ours[motion, joint]]
            digits = 2 if factor == 1 else 0
            spread = f"{min(of_boxes):.{digits}f} to {max(of_boxes):.{digits}f}"
            mean = fmean(of_boxes)
            within = abs(mean - factor * getattr(real, name)) <= SHARE * abs(factor * getattr(real, name))
            cells.append(
                f"{factor * getattr(real, name):.{digits}f} / {mean:.{digits}f} ({spread})"
                + "*" * (not within)
            )
        print("| " + " | ".join(cells) + " |")
    for name, (title, _, recorded) in AT_REST.items():
        values = [getattr(it, name) for of_joint in still for it in of_joint]
        real = [value for row in recorded.values() for value in row]
        print(title, "real", min(real), max(real), np.sqrt(np.mean(np.square(real))))
        print(title, "ours", min(values), max(values), np.sqrt(np.mean(np.square(values))))
    late = {key: fmean(it.speed_behind for it in of_boxes) for key, of_boxes in ours.items()}
    print("speed behind", {key: (MOVING[key].speed_behind, round(value, 2)) for key, value in late.items()})
    print("greatest speed at rest", max(it.speed for of_joint in still for it in of_joint))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "img" / "beside.png")
    out = parser.parse_args().out
    records = {motion: [record(seed, motion) for seed in SEEDS] for motion in MOTIONS}
    ours = {key: [moving(one, key[1]) for one in records[key[0]]] for key in MOVING}
    still = [
        [resting(one, joint) for of_motion in records.values() for one in of_motion] for joint in range(6)
    ]
    print_tables(ours, still)
    with figure(7.4, letters=8.5, layout=None) as page:
        for i, name in enumerate(FIGURES):
            axes = page.add_axes((0.12 + 0.126 * i, 0.46, 0.111, 0.49))
            draw_moving(axes, name, {key: [getattr(it, name) for it in ours[key]] for key in ours})
            if i == 0:
                axes.set_yticks(list(ROWS.values()), [f"{SHOWN[m]}: {JOINTS[j]}" for m, j in ROWS])
        for i, name in enumerate(AT_REST):
            axes = page.add_axes((0.12 + 0.296 * i, 0.065, 0.28, 0.26))
            draw_resting(axes, name, [[getattr(it, name) for it in of_joint] for of_joint in still])
            if i == 0:
                axes.set_yticks([-joint for joint in range(6)], JOINTS)
                axes.set_xlim(0.0, None)
        page.legend(
            handles=[
                axes.plot([], [], label="real arm", **_REAL)[0],
                axes.barh([0], [0], color=GRID_GREY, label="a third about it"),
                axes.plot([], [], label="six emulated arms", **_OURS)[0],
            ],
            loc="lower left",
            bbox_to_anchor=(0.1, 0.365),
            ncols=3,
        )
    out.write_bytes(image_bytes(page))


if __name__ == "__main__":
    main()
