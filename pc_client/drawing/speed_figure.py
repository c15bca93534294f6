"""The four speed profiles of a drawing: one under the other, overlaid, and their differences."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pc_client.drawing.shown import AIR, COLOURS, Shown, shade_pen_down

__all__ = ["fill_speeds"]

#: Strokes that are this many times as high as the speed itself, since they cancel, are cut off.
_TALL = 1.5

_STROKE = "#8DB9DC"


def fill_speeds(figure: Figure, shown: Shown) -> None:
    """The four speed profiles one under the other, then overlaid, then differences from the person's."""
    heights = (1.0, 1.0, 1.0, 1.0, 1.55, 0.75)
    grid = figure.add_gridspec(
        len(heights), 1, height_ratios=heights, left=0.075, right=0.925, top=0.955, bottom=0.06, hspace=0.16
    )
    rows = [figure.add_subplot(grid[row]) for row in range(len(heights))]
    start = float(shown.drawing.joined.pen_down[0, 0])
    span = (-start, shown.drawing.joined.trajectory.duration - start)
    top = _top_speed(shown)
    for axes, name in zip(rows, COLOURS, strict=False):
        shade_pen_down(axes, shown)
        if name == "reconstructed":
            _draw_strokes(axes, shown)
        if name in ("planned", "executed"):
            t, speed = _whole_speed(shown, executed=name == "executed")
            axes.plot(t, speed, color=AIR, lw=1.1)
        _draw_speed(axes, shown, name, 1.8)
        axes.set(xlim=span, ylim=(0.0, 1.27 * top))
        axes.text(
            0.995,
            0.96,
            name,
            transform=axes.transAxes,
            ha="right",
            va="top",
            weight="bold",
            color=COLOURS[name],
        )
    shade_pen_down(rows[4], shown)
    for name, width in zip(COLOURS, (4.5, 2.0, 1.4, 1.2), strict=True):
        _draw_speed(rows[4], shown, name, width, faint=name == "human", dashed=name == "planned")
    rows[4].set(xlim=span, ylim=(0.0, 1.22 * _top_speed(shown, lognormals=False)))
    rows[4].legend(loc="upper right", ncols=4, borderaxespad=0.2, columnspacing=1.2, handlelength=1.6)
    shade_pen_down(rows[5], shown)
    for name in ("reconstructed", "executed"):
        for index, mine, human in zip(shown.moving, shown.parts[name], shown.parts["human"], strict=True):
            difference = shown.unit * (mine.speed - human.speed)
            rows[5].plot(shown.since_pen_down(human.t, index), difference, color=COLOURS[name], lw=1.3)
    rows[5].axhline(0.0, color="#666666", lw=0.7)
    rows[5].set_xlim(span)
    rows[5].set_xlabel("time of the hand since the pen came down [s]; shaded: pen down")
    rows[5].set_ylabel("difference")
    rows[4].set_ylabel("overlaid")
    for axes in rows[:5]:
        axes.tick_params(labelbottom=False)
        axes.yaxis.set_major_locator(MaxNLocator(3))
        if shown.drawing.factor > 1.0:
            _arm_axis(axes, shown.drawing.factor)
    figure.text(0.012, 0.5, "speed on the sheet [mm per s of the hand]", rotation=90, va="center", ha="left")
    if shown.drawing.factor > 1.0:
        figure.text(0.988, 0.5, "speed of the arm [mm/s]", rotation=270, va="center", ha="right")


def _draw_strokes(axes: Axes, shown: Shown) -> None:
    for index, part in zip(shown.moving, shown.drawing.extraction.parts, strict=True):
        mark, nearly = shown.drawing.marks[index], 1e-3 * float(np.ptp(part.p, axis=0).max())
        t = np.arange(mark.begin - mark.lead(nearly), mark.end + mark.lag(nearly), 0.002)
        for lognormal in shown.unit * part.trajectory.stroke_speeds(t).T:
            visible = lognormal > 1e-3 * lognormal.max()
            at = shown.since_pen_down(t[visible], index)
            axes.fill_between(at, lognormal[visible], color=_STROKE, alpha=0.28, lw=0)
            axes.plot(at, lognormal[visible], color=_STROKE, lw=0.8)


def _draw_speed(
    axes: Axes, shown: Shown, name: str, width: float, *, faint: bool = False, dashed: bool = False
) -> None:
    for count, (index, part) in enumerate(zip(shown.moving, shown.parts[name], strict=True)):
        axes.plot(
            shown.since_pen_down(part.t, index),
            shown.unit * part.speed,
            color="#BDBDBD" if faint else COLOURS[name],
            lw=width,
            ls=(0, (4, 2)) if dashed else "-",
            label=name if count == 0 else None,
        )


def _top_speed(shown: Shown, *, lognormals: bool = True) -> float:
    """Highest speed (mm per s of the hand) of any signal and, unless far higher, of any single stroke."""
    top = max(float(part.speed.max()) for parts in shown.parts.values() for part in parts)
    highest = max(
        float(part.trajectory.stroke_speeds(part.t).max()) for part in shown.drawing.extraction.parts
    )
    return shown.unit * (max(top, min(highest, _TALL * top)) if lognormals else top)


def _whole_speed(shown: Shown, *, executed: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Time since the pen came down and speed (mm per s of the hand) of the movement with its lifts."""
    joined = shown.drawing.joined
    if executed:
        t, v = shown.execution.t, shown.execution.v
    else:
        t = np.linspace(0.0, joined.trajectory.duration, 1500)
        v = joined.trajectory.evaluate(t).v
    return t - joined.pen_down[0, 0], 1e3 * np.linalg.norm(v, axis=1)


def _arm_axis(axes: Axes, factor: float) -> None:
    def to_arm(v: Any) -> Any:
        return v / factor

    def to_hand(v: Any) -> Any:
        return v * factor

    arm = axes.secondary_yaxis("right", functions=(to_arm, to_hand))
    arm.yaxis.set_major_locator(MaxNLocator(3))
    arm.spines["right"].set_visible(True)
    arm.spines["right"].set_color("#666666")
