"""The movement of a drawing in the base frame, with its lifts, and the height of the pen over the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from pc_client.drawing.shown import AIR, COLOURS, Shown, pen_is_down, shade_pen_down

__all__ = ["fill_space"]

_SHEET, _SHEET_EDGE = "#F3E9D2", "#C9B37E"


def fill_space(figure: Figure, shown: Shown) -> None:
    """The movement in the base frame, with its lifts; and the height of the pen over the sheet."""
    _draw_space(figure.add_axes((0.0, 0.04, 0.5, 0.9), projection="3d"), shown)
    axes = figure.add_axes((0.585, 0.14, 0.395, 0.72))
    shade_pen_down(axes, shown)
    start = float(shown.drawing.joined.pen_down[0, 0])
    placement, trajectory = shown.drawing.placement, shown.drawing.joined.trajectory
    out = placement.lift / float(np.linalg.norm(placement.lift))
    sheet = float(placement.similarity.shift @ out)
    t = np.linspace(0.0, trajectory.duration, 1500)
    if shown.drawing.flat:
        planned, done = trajectory.evaluate(t).p @ out - sheet, shown.execution.p @ out - sheet
        axes.set_title("height of the pen over the sheet")
    else:
        planned, done = trajectory.evaluate(t).p[:, 2], shown.execution.p[:, 2]
        axes.set_title("height of the pen, z of the base frame")
    axes.plot(t - start, 1e3 * planned, color=COLOURS["planned"], lw=4.0, alpha=0.45, label="planned")
    axes.plot(shown.execution.t - start, 1e3 * done, color=COLOURS["executed"], lw=1.4, label="executed")
    axes.set(
        xlim=(-start, trajectory.duration - start),
        xlabel="time of the hand [s]; shaded: pen down",
        ylabel="mm",
    )
    axes.set_ylim(top=axes.get_ylim()[1] * 1.16)
    axes.legend(loc="upper right", ncols=2, borderaxespad=0.2)


def _draw_space(axes: Any, shown: Shown) -> None:
    joined = shown.drawing.joined
    t = np.linspace(0.0, joined.trajectory.duration, 2500)
    p = 1e3 * joined.trajectory.evaluate(t).p
    down = pen_is_down(t, joined.pen_down)
    done = 1e3 * shown.execution.p
    corners = [p, done]
    if shown.drawing.flat:
        sheet = _sheet(shown)
        axes.add_collection3d(Poly3DCollection([sheet], facecolor=_SHEET, edgecolor=_SHEET_EDGE, alpha=0.45))
        corners.append(sheet)
    air = np.where(down[:, None], np.nan, p)
    axes.plot(*air.T, color=AIR, lw=1.4, ls=(0, (4, 2)))
    line = np.where(down[:, None], p, np.nan)
    axes.plot(*line.T, color=COLOURS["planned"], lw=3.6, alpha=0.45)
    axes.plot(*done.T, color=COLOURS["executed"], lw=1.1)
    for mark in shown.drawing.marks:
        if mark.trajectory is None:
            point = 1e3 * shown.drawing.placement.similarity.points(mark.first[None])
            axes.plot(*point.T, "o", color=COLOURS["planned"], ms=5)
    axes.plot(*p[:1].T, "o", mfc="white", mec="black", ms=6)
    axes.text(*p[0], "  begin", fontsize=10)
    _equal_axes(axes, np.vstack(corners))
    axes.set_title("path of the TCP in the base frame; dashed: pen lifted", loc="center", y=1.02)
    away = {"vertical": (18.0, -152.0), "horizontal": (32.0, -152.0), "inclined": (24.0, -152.0)}
    axes.view_init(*away.get(shown.drawing.placement.plane, (24.0, -60.0)))


def _sheet(shown: Shown) -> NDArray[np.float64]:
    """Corners of the sheet, (4, 3), mm, base frame: around what is drawn, with a margin."""
    drawn = shown.drawing.drawn
    margin = 0.12 * float(np.ptp(drawn, axis=0).max())
    low, high = drawn.min(axis=0) - margin, drawn.max(axis=0) + margin
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    flat = np.array([(x, y, 0.0) for x, y in corners])
    return 1e3 * shown.drawing.placement.similarity.points(flat)


def _equal_axes(axes: Any, points: NDArray[np.float64]) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.55 * np.maximum(high - low, 0.35 * float((high - low).max()))
    limits: Sequence[tuple[float, float]] = [
        (float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True)
    ]
    axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    # matplotlib keeps the diagonal of the box; here its longest edge is kept.
    axes.set_box_aspect(tuple(half / half.max()), zoom=0.66 * float(np.linalg.norm(half / half.max())))
    axes.set(xlabel="x [mm]", ylabel="y [mm]")
    axes.zaxis.set_rotate_label(False)
    axes.set_zlabel("z [mm]", rotation=90)
    axes.tick_params(labelsize=9.0, pad=1)
    for axis, width in zip((axes.xaxis, axes.yaxis, axes.zaxis), half / half.max(), strict=True):
        axis.set_major_locator(MaxNLocator(4 if width > 0.6 else 2))
