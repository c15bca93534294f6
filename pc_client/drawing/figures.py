"""The pictures of a drawing: paths side by side, speeds one under the other, the movement in space.

All of them are in one frame and one time: millimetres on the sheet, x to the right and y up as the person saw
it, and seconds of the hand. Each of the four signals has its colour on the whole page. Loads matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from pc_client.analysis.figures import BLUE, GREEN, RED, svg_figure
from pc_client.drawing.drawing import Drawing, spatial
from pc_client.drawing.execution import Execution
from pc_client.drawing.judgement import Signal, Verdict, signals

__all__ = ["COLOURS", "FIGURES", "Shown", "draw"]

#: Colour of each signal; names as of `judgement.signals`.
COLOURS = {"human": "#3A3A3A", "reconstructed": BLUE, "planned": GREEN, "executed": RED}
_AIR, _BELL, _SHEET, _PEN_DOWN = "#A8A8A8", "#8DB9DC", "#F3E9D2", "#F4F1EA"
#: Virtual targets farther outside than this share of the drawing's size are left out of the picture.
_FAR = 0.45
#: Bells that are this many times as high as the speed itself, since they cancel, are cut off.
_TALL = 1.5

_LARGER = {
    "font.size": 11.0,
    "axes.labelsize": 11.0,
    "axes.titlesize": 12.0,
    "legend.fontsize": 10.0,
    "xtick.labelsize": 10.0,
    "ytick.labelsize": 10.0,
}


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What the pictures of a drawing are made of.

    Attributes:
        drawing: the drawing.
        execution: the run that is shown.
        verdict: its figures.
        parts: the four signals, each with the parts that move.
    """

    drawing: Drawing
    execution: Execution
    verdict: Verdict
    parts: dict[str, tuple[Signal, ...]]

    @classmethod
    def of(cls, drawing: Drawing, execution: Execution, verdict: Verdict) -> Shown:
        """Take the signals of a drawing and a run."""
        return cls(drawing, execution, verdict, signals(drawing, execution))

    @property
    def unit(self) -> float:
        """Millimetres on the sheet per unit of the recording."""
        return 1e3 * self.drawing.placement.similarity.scale

    @property
    def moving(self) -> list[int]:
        """Indices of the marks that move."""
        return [index for index, mark in enumerate(self.drawing.marks) if mark.law is not None]

    def on_page(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) in the recording's frame, on the page: (n, 2), mm, from the middle of the drawing."""
        drawn = np.vstack([spatial(part.p) for part in self.drawing.extraction.parts])
        middle = 0.5 * (drawn.min(axis=0) + drawn.max(axis=0))
        if self.drawing.flat:
            axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 if self.drawing.placement.y_up else -1.0, 0.0]])
        else:
            axes = np.linalg.svd(drawn - drawn.mean(axis=0), full_matrices=False)[2][:2]
        page: NDArray[np.float64] = self.unit * (p - middle) @ axes.T
        return page

    def since_pen_down(self, t: NDArray[np.float64], mark: int) -> NDArray[np.float64]:
        """Times of the recording that belong to a mark, as s of the hand since the pen first came down."""
        joined = self.drawing.joined
        since: NDArray[np.float64] = t + joined.shifts[mark] - joined.pen_down[0, 0]
        return since


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
            axes.plot(*_air(shown, executed=name == "executed").T, color=_AIR, lw=1.0, ls=(0, (4, 2.5)))
        if name != "human":
            for part in shown.parts["human"]:
                axes.plot(*shown.on_page(part.p).T, color="#D9D9D9", lw=5.0, solid_capstyle="round", zorder=1)
        for part in shown.parts[name]:
            axes.plot(*shown.on_page(part.p).T, color=COLOURS[name], lw=2.0, solid_capstyle="round")
        for mark in shown.drawing.marks:
            if mark.law is None:
                axes.plot(*shown.on_page(mark.first[None]).T, "o", ms=5.0, color=COLOURS[name])
        if name == "human":
            for part in shown.parts[name]:
                _draw_start(axes, shown, part)
            _draw_numbers(axes, shown)
        axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xlabel=across)
        axes.set_title(title, color=COLOURS[name], loc="center")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        if column == 0:
            axes.set_ylabel(up)
        else:
            axes.tick_params(labelleft=False)


def fill_speeds(figure: Figure, shown: Shown) -> None:
    """The four speed profiles one under the other, then overlaid, then differences from the person's."""
    heights = (1.0, 1.0, 1.0, 1.0, 1.55, 0.75)
    grid = figure.add_gridspec(
        len(heights), 1, height_ratios=heights, left=0.075, right=0.925, top=0.955, bottom=0.06, hspace=0.16
    )
    rows = [figure.add_subplot(grid[row]) for row in range(len(heights))]
    start = float(shown.drawing.joined.pen_down[0, 0])
    span = (-start, shown.drawing.joined.law.duration - start)
    top = _top_speed(shown)
    for axes, name in zip(rows, COLOURS, strict=False):
        _shade_pen_down(axes, shown)
        if name == "reconstructed":
            _draw_bells(axes, shown)
        if name in ("planned", "executed"):
            t, speed = _whole_speed(shown, executed=name == "executed")
            axes.plot(t, speed, color=_AIR, lw=1.1)
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
    _shade_pen_down(rows[4], shown)
    for name, width in zip(COLOURS, (4.5, 2.0, 1.4, 1.2), strict=True):
        _draw_speed(rows[4], shown, name, width, faint=name == "human", dashed=name == "planned")
    rows[4].set(xlim=span, ylim=(0.0, 1.22 * _top_speed(shown, bells=False)))
    rows[4].legend(loc="upper right", ncols=4, borderaxespad=0.2, columnspacing=1.2, handlelength=1.6)
    _shade_pen_down(rows[5], shown)
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


def fill_space(figure: Figure, shown: Shown) -> None:
    """The movement in the base frame, with its lifts; and the height of the pen over the sheet."""
    _draw_space(figure.add_axes((0.0, 0.04, 0.5, 0.9), projection="3d"), shown)
    axes = figure.add_axes((0.585, 0.14, 0.395, 0.72))
    _shade_pen_down(axes, shown)
    start = float(shown.drawing.joined.pen_down[0, 0])
    placement, law = shown.drawing.placement, shown.drawing.joined.law
    out = placement.lift / float(np.linalg.norm(placement.lift))
    sheet = float(placement.similarity.shift @ out)
    t = np.linspace(0.0, law.duration, 1500)
    if shown.drawing.flat:
        planned, done = law.evaluate(t).p @ out - sheet, shown.execution.p @ out - sheet
        axes.set_title("height of the pen over the sheet")
    else:
        planned, done = law.evaluate(t).p[:, 2], shown.execution.p[:, 2]
        axes.set_title("height of the pen, z of the base frame")
    axes.plot(t - start, 1e3 * planned, color=COLOURS["planned"], lw=4.0, alpha=0.45, label="planned")
    axes.plot(shown.execution.t - start, 1e3 * done, color=COLOURS["executed"], lw=1.4, label="executed")
    axes.set(
        xlim=(-start, law.duration - start), xlabel="time of the hand [s]; shaded: pen down", ylabel="mm"
    )
    axes.set_ylim(top=axes.get_ylim()[1] * 1.16)
    axes.legend(loc="upper right", ncols=2, borderaxespad=0.2)


#: What a drawing has pictures of: name, size in inches, who fills it, and what a reader sees.
FIGURES: tuple[tuple[str, tuple[float, float], Callable[[Figure, Shown], None], str], ...] = (
    ("paths", (12.0, 3.6), fill_paths, "Paths: human, reconstructed with virtual targets, planned, executed"),
    ("speeds", (12.0, 9.6), fill_speeds, "Speed profiles one under the other, overlaid, and differences"),
    ("space", (12.0, 4.7), fill_space, "The movement in space, and the height of the pen"),
)


def draw(shown: Shown) -> dict[str, str]:
    """All pictures of a drawing as SVG texts by name."""
    pictures = {}
    for name, size, fill, _ in FIGURES:
        with _talk_figure(size, shown.execution.run.provenance.simulated) as (figure, page):
            fill(figure, shown)
        pictures[name] = page.getvalue()
    return pictures


@contextmanager
def _talk_figure(size: tuple[float, float], simulated: bool) -> Iterator[tuple[Figure, Any]]:
    """The report's style with letters that the last row of a lecture hall can read."""
    with svg_figure(*size, simulated) as (figure, page), mpl.rc_context(_LARGER):
        yield figure, page


def _half_width(shown: Shown) -> float:
    """Half the width (mm) of a square page that holds the drawing and the near virtual targets."""
    paths = [shown.on_page(part.p) for parts in shown.parts.values() for part in parts]
    reach = float(np.abs(np.vstack(paths)).max())
    targets = np.abs(shown.on_page(_targets(shown))).max(axis=1)
    near = targets[targets <= (1.0 + _FAR) * reach]
    return 1.1 * max(reach, float(near.max(initial=0.0)))


def _targets(shown: Shown) -> NDArray[np.float64]:
    return np.vstack([part.law.target_points for part in shown.drawing.extraction.parts])


def _draw_targets(axes: Axes, shown: Shown, half: float) -> None:
    for part in shown.drawing.extraction.parts:
        points = shown.on_page(part.law.target_points)
        axes.plot(*points.T, color="#9FB8CC", lw=0.7, zorder=1.5)
        axes.plot(*points.T, ls="none", marker="o", ms=3.6, mfc="white", mec=BLUE, mew=0.9, zorder=3)
    outside = int(np.count_nonzero(np.abs(shown.on_page(_targets(shown))).max(axis=1) > half))
    text = "○ virtual targets" + (f", {outside} outside" if outside else "")
    axes.text(
        0.03,
        0.03,
        text,
        transform=axes.transAxes,
        fontsize=9,
        color="#355C7D",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
        zorder=4,
    )


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
        t = np.linspace(0.0, joined.law.duration, 1500)
        p = joined.law.evaluate(t).p
    page = shown.on_page(shown.drawing.points_back(p))
    page[_pen_is_down(t, joined.pen_down)] = np.nan
    return page


def _pen_is_down(t: NDArray[np.float64], pen_down: NDArray[np.float64]) -> NDArray[np.bool_]:
    down: NDArray[np.bool_] = np.any((t[:, None] >= pen_down[:, 0]) & (t[:, None] <= pen_down[:, 1]), axis=1)
    return down


def _shade_pen_down(axes: Axes, shown: Shown) -> None:
    joined = shown.drawing.joined
    for begin, end in joined.pen_down - joined.pen_down[0, 0]:
        axes.axvspan(begin, max(end, begin + 0.012), color=_PEN_DOWN, lw=0, zorder=0)


def _draw_bells(axes: Axes, shown: Shown) -> None:
    for index, part in zip(shown.moving, shown.drawing.extraction.parts, strict=True):
        mark, nearly = shown.drawing.marks[index], 1e-3 * float(np.ptp(part.p, axis=0).max())
        t = np.arange(mark.begin - mark.lead(nearly), mark.end + mark.lag(nearly), 0.002)
        for bell in shown.unit * part.law.stroke_speeds(t).T:
            visible = bell > 1e-3 * bell.max()
            at = shown.since_pen_down(t[visible], index)
            axes.fill_between(at, bell[visible], color=_BELL, alpha=0.28, lw=0)
            axes.plot(at, bell[visible], color=_BELL, lw=0.8)


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


def _top_speed(shown: Shown, *, bells: bool = True) -> float:
    """Highest speed (mm per s of the hand) of any signal and, unless it would dwarf them, of any bell."""
    top = max(float(part.speed.max()) for parts in shown.parts.values() for part in parts)
    highest = max(float(part.law.stroke_speeds(part.t).max()) for part in shown.drawing.extraction.parts)
    return shown.unit * (max(top, min(highest, _TALL * top)) if bells else top)


def _whole_speed(shown: Shown, *, executed: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Time since the pen came down and speed (mm per s of the hand) of the movement with its lifts."""
    joined = shown.drawing.joined
    if executed:
        t, v = shown.execution.t, shown.execution.v
    else:
        t = np.linspace(0.0, joined.law.duration, 1500)
        v = joined.law.evaluate(t).v
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


def _draw_space(axes: Any, shown: Shown) -> None:
    joined = shown.drawing.joined
    t = np.linspace(0.0, joined.law.duration, 2500)
    p = 1e3 * joined.law.evaluate(t).p
    down = _pen_is_down(t, joined.pen_down)
    done = 1e3 * shown.execution.p
    corners = [p, done]
    if shown.drawing.flat:
        sheet = _sheet(shown)
        axes.add_collection3d(Poly3DCollection([sheet], facecolor=_SHEET, edgecolor="#C9B37E", alpha=0.45))
        corners.append(sheet)
    air = np.where(down[:, None], np.nan, p)
    axes.plot(*air.T, color=_AIR, lw=1.4, ls=(0, (4, 2)))
    line = np.where(down[:, None], p, np.nan)
    axes.plot(*line.T, color=COLOURS["planned"], lw=3.6, alpha=0.45)
    axes.plot(*done.T, color=COLOURS["executed"], lw=1.1)
    for mark in shown.drawing.marks:
        if mark.law is None:
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
    drawn = np.vstack([spatial(part.p) for part in shown.drawing.extraction.parts])
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
