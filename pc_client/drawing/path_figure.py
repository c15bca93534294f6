"""The four paths of a drawing side by side: human, reconstructed, planned, executed."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pc_client.drawing.judgement import Signal
from pc_client.drawing.shown import AIR, COLOURS, Shown, pen_is_down

__all__ = ["fill_paths"]

#: Virtual targets farther outside than this share of the drawing's size are left out of the picture.
_FAR = 0.45


def fill_paths(figure: Figure, shown: Shown) -> None:
    """The four paths side by side."""
    half = _half_width(shown)
    # A path in space is shown from where it is widest.
    across, up = ("x [mm]", "y [mm]") if shown.drawing.flat else ("widest [mm]", "second widest [mm]")
    titles = {
        "human": "human",
        "reconstructed": f"reconstructed, {shown.drawing.extraction.n_strokes} strokes",
        "planned": "planned, with lifts",
        "executed": "executed",
    }
    for column, (name, title) in enumerate(titles.items()):
        axes = figure.add_axes((0.055 + 0.238 * column, 0.13, 0.222, 0.72))
        if name == "reconstructed":
            _draw_targets(axes, shown, half)
        if name in ("planned", "executed"):
            axes.plot(*_air(shown, executed=name == "executed").T, color=AIR, lw=1.0, ls=(0, (4, 2.5)))
        if name != "human":
            for part in shown.parts["human"]:
                axes.plot(*shown.on_page(part.p).T, color="#D9D9D9", lw=5.0, solid_capstyle="round", zorder=1)
        for part in shown.parts[name]:
            axes.plot(*shown.on_page(part.p).T, color=COLOURS[name], lw=2.0, solid_capstyle="round")
        for mark in shown.drawing.marks:
            if mark.trajectory is None:
                axes.plot(*shown.on_page(mark.first[None]).T, "o", ms=5.0, color=COLOURS[name])
        if name == "human":
            for part in shown.parts[name]:
                _draw_start(axes, shown, part)
            _draw_numbers(axes, shown)
        axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel=across)
        if name == "reconstructed":
            axes.set_xlabel(f"{across}    {_targets_text(shown, half)}")
        axes.set_title(title, color=COLOURS[name], loc="center")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        if column == 0:
            axes.set_ylabel(up)
        else:
            axes.tick_params(labelleft=False)


def _half_width(shown: Shown) -> float:
    """Half the width (mm) of a square page that holds the drawing and the near virtual targets."""
    paths = [shown.on_page(part.p) for parts in shown.parts.values() for part in parts]
    paths.append(shown.on_page(shown.drawing.drawn))
    reach = float(np.abs(np.vstack(paths)).max())
    targets = np.abs(shown.on_page(_targets(shown))).max(axis=1)
    near = targets[targets <= (1.0 + _FAR) * reach]
    return 1.1 * max(reach, float(near.max(initial=0.0)))


def _targets(shown: Shown) -> NDArray[np.float64]:
    return np.vstack([part.trajectory.target_points for part in shown.drawing.extraction.parts])


def _draw_targets(axes: Axes, shown: Shown, half: float) -> None:
    for part in shown.drawing.extraction.parts:
        points = shown.on_page(part.trajectory.target_points)
        axes.plot(*points.T, color="#9FB8CC", lw=0.7, zorder=1.5)
        axes.plot(
            *points.T,
            ls="none",
            marker="o",
            ms=3.6,
            mfc="white",
            mec=COLOURS["reconstructed"],
            mew=0.9,
            zorder=3,
        )


def _targets_text(shown: Shown, half: float) -> str:
    """What the circles are, and how many the page does not show."""
    outside = int(np.count_nonzero(np.abs(shown.on_page(_targets(shown))).max(axis=1) > half))
    return "○ virtual targets" + (f", {outside} outside" if outside else "")


def _draw_numbers(axes: Axes, shown: Shown) -> None:
    """The order of the marks, where there are several, beside their begins."""
    begins = dict(
        zip(shown.moving, (part.p[: 1 + len(part.p) // 8] for part in shown.parts["human"]), strict=True)
    )
    for index, mark in enumerate(shown.drawing.marks if len(shown.drawing.marks) > 1 else ()):
        path = shown.on_page(begins.get(index, mark.first[None]))
        away = path[0] - path[-1]
        length = float(np.linalg.norm(away))
        x, y = (11.0 * away / length).tolist() if length > 0.0 else (11.0, 0.0)
        label = axes.annotate(
            str(index + 1),
            path[0],
            (x, y),
            textcoords="offset points",
            ha="center",
            va="center",
            weight="bold",
        )
        label.set_path_effects([withStroke(linewidth=3.0, foreground="white")])


def _draw_start(axes: Axes, shown: Shown, part: Signal) -> None:
    """A dot where a part begins and an arrow where it goes."""
    p = shown.on_page(part.p)
    colour = COLOURS["human"]
    axes.plot(*p[0], "o", ms=6.0, color=colour)
    middle = len(p) // 2
    ahead = min(middle + max(1, len(p) // 20), len(p) - 1)
    axes.annotate(
        "",
        p[ahead],
        p[middle],
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.5, "mutation_scale": 15},
    )


def _air(shown: Shown, *, executed: bool) -> NDArray[np.float64]:
    """The whole path on the page, with gaps (nan) where the pen is down; (n, 2), mm."""
    joined = shown.drawing.joined
    if executed:
        t, p = shown.execution.t, shown.execution.p
    else:
        t = np.linspace(0.0, joined.trajectory.duration, 1500)
        p = joined.trajectory.evaluate(t).p
    page = shown.on_page(shown.drawing.points_back(p))
    page[pen_is_down(t, joined.pen_down)] = np.nan
    return page
