"""What a drawing shows: its paths, its movement in space, its speed profiles.

All pictures are made of `Shown`: one frame and one time, millimetres on the sheet, x to the right and y up as
the person saw it, and seconds of the hand. Each of the four signals has its colour on the whole page. Letters
are larger than elsewhere: these figures are shown to audiences. Loads matplotlib.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from pc_client.arrays import Array
from pc_client.results.figures import (
    AXIS_GREY,
    BLUE,
    GREEN,
    HOLLOW,
    OUTLINE,
    RED,
    SKY,
    figure,
    label_axes,
    shade,
    show_legend,
    space_axes,
)
from pc_client.studies.drawing.drawing import Drawing
from pc_client.studies.drawing.judgement import Execution, signals
from pc_client.studies.signals import Trace

#: Colour of each signal; names as of `judgement.signals`.
COLOURS = {"human": "#3A3A3A", "reconstructed": BLUE, "planned": GREEN, "executed": RED}
#: Colours of what the pen does in the air, of the person's signal behind others, of the sheet.
_AIR, _FAINT, _PAPER_EDGE = "#A8A8A8", "#BDBDBD", "#C9B37E"
#: The figures are shown to audiences: letters [points] for a width [inches].
_LETTERS, _SHEET_WIDTH = 11.0, 12.0


@dataclass(frozen=True, eq=False)
class Shown:
    """What the pictures of a drawing and a run are made of."""

    drawing: Drawing
    execution: Execution

    @cached_property
    def parts(self) -> dict[str, tuple[Trace, ...]]:
        """The four signals, each with the parts that move."""
        return signals(self.drawing, self.execution)

    def moving(self, name: str) -> Iterator[tuple[int, Trace]]:
        """The parts of a signal, each with the index of its mark."""
        return zip(self.drawing.moving, self.parts[name], strict=True)

    @property
    def unit(self) -> float:
        """Millimetres on the sheet per unit of the recording."""
        return 1e3 * self.drawing.placement.similarity.scale

    @property
    def mark(self) -> str:
        """What the data are, as it stands on every figure."""
        return self.execution.run.provenance.origin.mark

    @property
    def dots(self) -> list[Array]:
        """The marks that do not move, (1, 3) each, in the recording's frame."""
        return [mark.first[None] for mark in self.drawing.marks if mark.trajectory is None]

    @property
    def start(self) -> float:
        """When the pen first comes down, s of the hand since the movement began."""
        return float(self.drawing.joined.pen_down[0, 0])

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the movement, s of the hand since the pen first came down."""
        return -self.start, self.drawing.joined.trajectory.duration - self.start

    @property
    def pen_down(self) -> Array:
        """(n_marks, 2): when the pen comes down and goes up, s of the hand since it first came down."""
        times = self.drawing.joined.pen_down - self.start
        return np.column_stack((times[:, 0], np.maximum(times[:, 1], times[:, 0] + 0.012)))

    def whole(self, *, executed: bool) -> Trace:
        """All of the movement, lifts too: base frame, s of the hand since it began."""
        if executed:
            return self.execution.whole
        t = np.linspace(0.0, self.drawing.joined.trajectory.duration, 1500)
        return Trace(t, *self.drawing.joined.trajectory.evaluate(t)[:2])

    def on_page(self, p: Array) -> Array:
        """Points (n, 3) in the recording's frame, on the page: (n, 2), mm, from the middle of the drawing."""
        drawn = self.drawing.drawn
        middle = 0.5 * (drawn.min(axis=0) + drawn.max(axis=0))
        if self.drawing.flat:
            axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 if self.drawing.placement.y_up else -1.0, 0.0]])
        else:
            axes = np.linalg.svd(drawn - drawn.mean(axis=0), full_matrices=False)[2][:2]
        values: Array = self.unit * (p - middle) @ axes.T
        return values

    def since_pen_down(self, t: Array, mark: int) -> Array:
        """Times of the recording that belong to a mark, as s of the hand since the pen first came down."""
        joined = self.drawing.joined
        values: Array = t + joined.shifts[mark] - joined.pen_down[0, 0]
        return values


def _pen_is_down(t: Array, pen_down: Array) -> NDArray[np.bool_]:
    """Whether the pen is down at times (n,), by the times (n_marks, 2) when it comes down and goes up."""
    down: NDArray[np.bool_] = np.any((t[:, None] >= pen_down[:, 0]) & (t[:, None] <= pen_down[:, 1]), axis=1)
    return down


#: What a drawing has pictures of, and what a reader sees.
FIGURES = {
    "paths": "Paths: human, reconstructed with virtual targets, planned, executed",
    "speeds": "Speed profiles one under the other, overlaid, and differences",
    "space": "The movement in space, and the height of the pen",
}

#: Virtual targets farther outside than this share of the drawing's size are left out of the picture.
_FAR = 0.45
#: From where a plane is seen: elevation and azimuth [degrees].
_VIEWS = {"vertical": (18.0, -152.0), "horizontal": (32.0, -152.0), "inclined": (24.0, -152.0)}


def figures_of(shown: Shown) -> dict[str, Figure]:
    """The figures of a drawing by name, as `FIGURES` names them."""
    return {"paths": _paths_figure(shown), "speeds": _speeds_figure(shown), "space": _space_figure(shown)}


def _paths_figure(shown: Shown) -> Figure:
    """The four paths side by side: human, reconstructed, planned, executed."""
    half = _half_width(shown)
    # A path in space is shown from where it is widest.
    across, up = ("x [mm]", "y [mm]") if shown.drawing.flat else ("widest [mm]", "second widest [mm]")
    n_outside = int(np.count_nonzero(_targets(shown) > half))
    outside = f"; targets outside: {n_outside}" if n_outside else ""
    titles = {
        "human": "human",
        "reconstructed": f"reconstructed, {shown.drawing.extraction.n_strokes} strokes",
        "planned": "planned, with lifts",
        "executed": "executed",
    }
    with figure(3.75, shown.mark, width=_SHEET_WIDTH, letters=_LETTERS) as page:
        for axes, (name, title) in zip(page.subplots(1, 4), titles.items(), strict=True):
            _draw_paths(axes, shown, name, half)
            x = across + outside if name == "reconstructed" else across
            label_axes(axes, title, x, up if name == "human" else "", (-half, half), -half, half)
            axes.set_aspect("equal", adjustable="box")
    return page


def _draw_paths(axes: Axes, shown: Shown, name: str, half: float) -> None:
    """One of the four paths, over that of the person."""
    colour = COLOURS[name]
    if name in ("planned", "executed"):
        axes.plot(*_air(shown, executed=name == "executed").T, color=_AIR, ls="--")
    if name != "human":
        for part in shown.parts["human"]:
            axes.plot(*shown.on_page(part.p).T, color=_FAINT, lw=5.0)
    for part in shown.parts[name]:
        p = shown.on_page(part.p)
        axes.plot(*p.T, color=colour, lw=2.0)
        if name == "human":
            axes.plot(*p[0], "o", color=colour, ms=5.0)
            axes.plot(*_arrow(p, half).T, color=colour, lw=2.0)
    if name == "reconstructed":
        for extracted in shown.drawing.extraction.parts:
            targets = shown.on_page(extracted.trajectory.target_points)
            axes.plot(*targets.T, color=SKY, lw=0.7)
            axes.plot(*targets.T, color=colour, **(HOLLOW | {"ms": 3.6}))
    for dot in shown.dots:
        axes.plot(*shown.on_page(dot).T, "o", color=colour, ms=5.0)
    if name == "human":
        _write_numbers(axes, shown, half)


def _arrow(p: Array, half: float) -> Array:
    """The head (3, 2) of an arrow in the middle of a path (n, 2)."""
    middle = len(p) // 2
    ahead = p[min(middle + max(1, len(p) // 20), len(p) - 1)]
    along = ahead - p[middle]
    along = 0.07 * half * along / max(1e-9, float(np.linalg.norm(along)))
    aside = 0.5 * np.array([-along[1], along[0]])
    return np.array([ahead - along + aside, ahead, ahead - along - aside])


def _write_numbers(axes: Axes, shown: Shown, half: float) -> None:
    """The order of the marks, where there are several, beside their starts."""
    marks = shown.drawing.marks
    begins = {index: part.p[: 1 + len(part.p) // 8] for index, part in shown.moving("human")}
    for index, mark in enumerate(marks if len(marks) > 1 else ()):
        path = shown.on_page(begins.get(index, mark.first[None]))
        away = path[0] - path[-1]
        length = float(np.linalg.norm(away))
        place = path[0] + (0.11 * half * away / length if length else 0.0)
        axes.text(place[0], place[1], str(index + 1), ha="center", va="center", path_effects=OUTLINE)


def _half_width(shown: Shown) -> float:
    """Half the width (mm) of a square page that holds the drawing and the near virtual targets."""
    paths = [shown.on_page(part.p) for parts in shown.parts.values() for part in parts]
    reach = float(np.abs(np.vstack([*paths, shown.on_page(shown.drawing.drawn)])).max())
    targets = _targets(shown)
    near = targets[targets <= (1.0 + _FAR) * reach]
    return 1.1 * max(reach, float(near.max(initial=0.0)))


def _targets(shown: Shown) -> Array:
    """How far each virtual target is from the middle of the page, by its larger coordinate, (n,), mm."""
    targets = np.vstack([part.trajectory.target_points for part in shown.drawing.extraction.parts])
    farthest: Array = np.abs(shown.on_page(targets)).max(axis=1)
    return farthest


def _air(shown: Shown, *, executed: bool) -> Array:
    """The whole path on the page, with gaps (nan) where the pen is down; (n, 2), mm."""
    whole = shown.whole(executed=executed)
    page = shown.on_page(shown.drawing.points_back(whole.p))
    page[_pen_is_down(whole.t, shown.drawing.joined.pen_down)] = np.nan
    return page


def _space_figure(shown: Shown) -> Figure:
    """The movement in the base frame, with its lifts; and the height of the pen over the sheet."""
    with figure(4.7, shown.mark, width=_SHEET_WIDTH, letters=_LETTERS) as page:
        grid = page.add_gridspec(1, 2, width_ratios=(1.0, 0.85))
        _draw_space(page.add_subplot(grid[0], projection="3d"), shown)
        _draw_height(page.add_subplot(grid[1]), shown)
    return page


def _draw_space(axes: Any, shown: Shown) -> None:
    plan = shown.whole(executed=False)
    p, done = 1e3 * plan.p, 1e3 * shown.execution.whole.p
    down = _pen_is_down(plan.t, shown.drawing.joined.pen_down)[:, None]
    dots = [1e3 * shown.drawing.placement.similarity.points(dot) for dot in shown.dots]
    edge = _sheet(shown) if shown.drawing.flat else np.empty((0, 3))
    axes.plot(*np.where(down, np.nan, p).T, color=_AIR, label="pen lifted", lw=1.4, ls="--")
    axes.plot(*np.where(down, p, np.nan).T, color=COLOURS["planned"], label="planned", lw=3.6, alpha=0.5)
    axes.plot(*done.T, color=COLOURS["executed"], label="executed", lw=1.1)
    for dot in dots:
        axes.plot(*dot.T, "o", color=COLOURS["planned"], ms=5.0)
    axes.plot(*p[:1].T, color="black", **HOLLOW)
    axes.text(*p[0], "  begin", path_effects=OUTLINE)
    axes.plot(*edge.T, color=_PAPER_EDGE)
    view = _VIEWS.get(shown.drawing.placement.plane, (24.0, -60.0))
    labels = ("x [mm]", "y [mm]", "z [mm]")
    space_axes(axes, np.vstack([p, done, *dots, edge]), labels, least=0.35, margin=0.1, zoom=1.3, view=view)
    show_legend(axes, "above")


def _sheet(shown: Shown) -> Array:
    """Outline of the sheet, (5, 3), mm, base frame: around what is drawn, with a margin."""
    drawn = shown.drawing.drawn
    margin = 0.12 * float(np.ptp(drawn, axis=0).max())
    (x0, y0), (x1, y1) = drawn.min(axis=0)[:2] - margin, drawn.max(axis=0)[:2] + margin
    flat = np.array([(x, y, 0.0) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))])
    return 1e3 * shown.drawing.placement.similarity.points(flat)


def _draw_height(axes: Axes, shown: Shown) -> None:
    placement = shown.drawing.placement
    if shown.drawing.flat:
        out = placement.lift / float(np.linalg.norm(placement.lift))
        zero, title = float(placement.similarity.shift @ out), "height of the pen over the sheet"
    else:
        out, zero, title = np.array([0.0, 0.0, 1.0]), 0.0, "height of the pen, z of the base frame"
    for name, width, opacity in (("planned", 4.0, 0.5), ("executed", 1.4, 1.0)):
        whole = shown.whole(executed=name == "executed")
        height = 1e3 * (whole.p @ out - zero)
        axes.plot(whole.t - shown.start, height, color=COLOURS[name], label=name, lw=width, alpha=opacity)
    shade(axes, shown.pen_down)
    label_axes(axes, title, "time of the hand [s]; shaded: pen down", "mm", shown.span)
    show_legend(axes, "inside")


#: Lognormals that are this many times as high as the speed itself, since they cancel, are cut off.
_TALL = 1.5


def _speeds_figure(shown: Shown) -> Figure:
    """The four speed profiles one under the other, then overlaid, then differences from the person's."""
    parts, factor = shown.drawing.extraction.parts, shown.drawing.factor
    top = shown.unit * max(float(part.speed.max()) for own in shown.parts.values() for part in own)
    highest = shown.unit * max(float(part.trajectory.stroke_speeds(part.t).max()) for part in parts)
    title = "speed on the sheet [mm per s of the hand]"
    title += "; right: of the arm [mm/s]" if factor > 1.0 else ""
    with figure(9.6, shown.mark, width=_SHEET_WIDTH, title=title, letters=_LETTERS) as page:
        *single, overlaid, difference = page.subplots(6, 1, height_ratios=(1.0, 1.0, 1.0, 1.0, 1.55, 0.75))
        for axes, name in zip(single, COLOURS, strict=True):
            _draw_profile(axes, shown, name)
            label_axes(axes, "", "", name, shown.span, 0.0, 1.1 * max(top, min(highest, _TALL * top)))
        for name, width in zip(COLOURS, (4.5, 2.0, 1.4, 1.2), strict=True):
            _draw_speeds(overlaid, shown, name, width, _FAINT if name == "human" else COLOURS[name])
        label_axes(overlaid, "", "", "overlaid", shown.span, 0.0, 1.22 * top)
        overlaid.legend(ncols=4, loc="upper left")
        _draw_differences(difference, shown)
        x = "time of the hand since the pen came down [s]; shaded: pen down"
        label_axes(difference, "", x, "difference", shown.span)
        for axes in (*single, overlaid, difference):
            shade(axes, shown.pen_down)
            if factor > 1.0 and axes is not difference:
                arm = axes.secondary_yaxis("right", functions=(lambda v: v / factor, lambda v: v * factor))
                arm.yaxis.set_major_locator(MaxNLocator(3))
                arm.spines["right"].set_visible(True)
    return page


def _draw_profile(axes: Axes, shown: Shown, name: str) -> None:
    """One signal, with its strokes or with the movement of the arm while the pen is up."""
    if name == "reconstructed":
        for index, part in zip(shown.drawing.moving, shown.drawing.extraction.parts, strict=True):
            mark, nearly = shown.drawing.marks[index], 1e-3 * float(np.ptp(part.p, axis=0).max())
            t = np.arange(mark.begin - mark.lead(nearly), mark.end + mark.lag(nearly), 0.002)
            at = shown.since_pen_down(t, index)
            for stroke in shown.unit * part.trajectory.stroke_speeds(t).T:
                visible = stroke > 1e-3 * stroke.max()
                axes.plot(at[visible], stroke[visible], color=SKY, lw=0.8)
                axes.fill_between(at[visible], stroke[visible], color=SKY, alpha=0.28, lw=0)
    if name in ("planned", "executed"):
        whole = shown.whole(executed=name == "executed")
        axes.plot(whole.t - shown.start, 1e3 * whole.speed, color=_AIR, lw=1.1)
    _draw_speeds(axes, shown, name, 1.8, COLOURS[name])


def _draw_speeds(axes: Axes, shown: Shown, name: str, width: float, colour: str) -> None:
    style = "--" if name == "planned" and width < 1.8 else "-"
    for count, (index, part) in enumerate(shown.moving(name)):
        t, text = shown.since_pen_down(part.t, index), None if count else name
        axes.plot(t, shown.unit * part.speed, color=colour, label=text, lw=width, ls=style)


def _draw_differences(axes: Axes, shown: Shown) -> None:
    axes.axhline(0.0, color=AXIS_GREY, lw=0.7)
    for name in ("reconstructed", "executed"):
        for (index, own), human in zip(shown.moving(name), shown.parts["human"], strict=True):
            t = shown.since_pen_down(human.t, index)
            axes.plot(t, shown.unit * (own.speed - human.speed), color=COLOURS[name], lw=1.3)
