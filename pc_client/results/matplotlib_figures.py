"""Figures that do not move, by matplotlib: import it only where one is drawn.

A figure stays in the one theme because it is made and written inside `figure` and `svg_text`. The same data
give the same bytes. Every figure of data that are not known to be of a real arm says so.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from pc_client.arrays import Array
from pc_client.results import sheet as style
from pc_client.results.sheet import Curve, Panel, Sheet

_DPI = 110
_FEW_GROUPS = 6
"""So many groups of bars have room on a figure at least, and their names beside each other."""


@contextmanager
def figure(
    height: float,
    mark: str = "",
    *,
    width: float = style.WIDTH,
    title: str = "",
    letters: float = style.LETTERS,
) -> Iterator[Figure]:
    """Give an empty figure in the theme, to be filled inside the block; arguments as of `Sheet`."""
    with mpl.rc_context(_style(letters)):
        page = Figure(figsize=(width, height))
        yield page
        if title:
            page.text(0.1 / width, 1.0 - 0.1 / height, title, va="top", fontsize=letters + 1, weight="bold")
        if mark:
            box = {"boxstyle": "round,pad=0.3", "fc": style.MARK_FILL, "ec": style.MARK_EDGE, "lw": 0.8}
            place = (0.992, 1.0 - 0.08 / height)
            page.text(*place, mark, ha="right", va="top", fontsize=8.5, weight="bold", bbox=box)


def svg_text(page: Figure) -> str:
    """A figure as SVG text, without date or program."""
    text = io.StringIO()
    with mpl.rc_context(_style()):
        FigureCanvasSVG(page)
        page.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()


def image_bytes(page: Figure, kind: Literal["png", "webp"] = "png") -> bytes:
    """A figure as the bytes of an image file; WebP takes a third of PNG."""
    data = io.BytesIO()
    with mpl.rc_context(_style()):
        FigureCanvasAgg(page)
        page.savefig(data, format=kind, dpi=_DPI, metadata={"Software": None} if kind == "png" else None)
    return data.getvalue()


def draw(sheet: Sheet) -> Figure:
    """Draw a sheet; the axes of the figure are the panels in their order."""
    with figure(
        sheet.height, sheet.mark, width=sheet.width, title=sheet.title, letters=sheet.letters
    ) as page:
        for panel in sheet.panels:
            axes: Any = page.add_axes(panel.box, projection="3d" if panel.in_space else None)
            for curve in panel.curves:
                _draw_curve(axes, curve)
            axes.set_title(panel.title)
            if panel.in_space:
                _draw_space(axes, panel)
            else:
                _draw_plane(axes, panel)
            outline = [withStroke(linewidth=2.5, foreground="white")]
            for point, text in panel.texts:
                if panel.in_space:
                    axes.text(*point, f"  {text}", path_effects=outline)
                else:
                    axes.text(*point, text, ha="center", va="center", path_effects=outline)
            if panel.legend == "above":
                axes.legend(ncols=panel.columns, loc="lower right", bbox_to_anchor=(1.0, 0.99))
            elif panel.legend == "right":
                axes.legend(loc="upper left", bbox_to_anchor=(1.01, 0.98))
            elif panel.legend == "inside":
                axes.legend(ncols=panel.columns, loc="upper left")
    return page


def _draw_curve(axes: Any, curve: Curve) -> None:
    axes.plot(
        *curve.points.T,
        color=curve.colour,
        label=curve.label or None,
        lw=curve.width,
        ls=curve.style if curve.width else "",
        marker=curve.marker,
        ms=curve.size,
        mfc="white" if curve.hollow else curve.colour,
        alpha=curve.opacity,
        drawstyle="steps-post" if curve.stepped else "default",
    )
    if curve.filled:
        axes.fill_between(*curve.points.T, color=curve.colour, alpha=0.28 * curve.opacity, lw=0)


def _draw_plane(axes: Any, panel: Panel) -> None:
    for begin, end in panel.shaded:
        axes.axvspan(begin, end, color=style.SHADE, lw=0, zorder=0)
    x = panel.ranges[0]
    for between, limit in ((x, axes.set_xlim), (panel.upwards, axes.set_ylim)):
        if between != (None, None):
            limit(*between)
    axes.set(xlabel=panel.labels[0], ylabel=panel.labels[1])
    axes.tick_params(labelbottom=bool(panel.labels[0]), labelleft=bool(panel.labels[1]))
    if panel.equal:
        axes.set_aspect("equal", adjustable="box" if None not in x else "datalim")
    # So many ticks that their texts do not meet, at some 7 an inch of height.
    axes.yaxis.set_major_locator(MaxNLocator(3 if axes.bbox.height < 1.2 * mpl.rcParams["figure.dpi"] else 6))
    if panel.slower != 1.0:
        second = axes.secondary_yaxis(
            "right", functions=(lambda v: v / panel.slower, lambda v: v * panel.slower)
        )
        second.yaxis.set_major_locator(MaxNLocator(3))
        second.spines["right"].set_visible(True)
    if panel.ticks is not None:
        turned = len(panel.ticks) > 4
        axes.set_xticks(
            list(panel.ticks),
            list(panel.ticks.values()),
            rotation=20 if turned else 0,
            ha="right" if turned else "center",
        )
        axes.grid(axis="x", visible=False)


def _draw_space(axes: Any, panel: Panel) -> None:
    shape = panel.shape
    axes.set(xlim=panel.ranges[0], ylim=panel.ranges[1], zlim=panel.ranges[2])
    # matplotlib keeps the diagonal of the box; here its longest edge is kept.
    axes.set_box_aspect(tuple(shape), zoom=0.55 * panel.zoom * float(np.linalg.norm(shape)))
    axes.view_init(*panel.view)
    if not any(panel.labels):
        axes.set(xticklabels=(), yticklabels=(), zticklabels=())
        return
    axes.set(xlabel=panel.labels[0], ylabel=panel.labels[1])
    axes.zaxis.set_rotate_label(False)
    axes.set_zlabel(panel.labels[2], rotation=90)
    axes.tick_params(labelsize=mpl.rcParams["font.size"] - 2.0, pad=-1)
    for axis, length in zip((axes.xaxis, axes.yaxis, axes.zaxis), shape, strict=True):
        axis.set_major_locator(MaxNLocator(4 if length > 0.6 else 2))


@dataclass(frozen=True, slots=True, eq=False)
class Bars:
    """One bar for each name.

    Attributes:
        levels: (n,) their heights; nan where there is none.
        runs: single values of each, as circles on the bars; none where empty.
    """

    label: str
    colour: str
    levels: Array
    runs: Sequence[Sequence[float]] = ()


def bars_of_levels(
    names: Sequence[str], series: Sequence[Bars], mark: str, *, title: str, floors: Array | None = None
) -> Figure:
    """Draw groups of bars beside each other, in dB.

    Args:
        series: the bars of a group, from left to right.
        floors: (n,) a level for each group, as a line over its bars; nan where there is none.
    """
    series = [bars for bars in series if not np.isnan(bars.levels).all()]
    x = np.arange(len(names))
    width = 0.84 / len(series)
    with figure(3.6, mark) as page:
        axes = page.add_axes((0.06, 0.19, 0.925, 0.64))
        for i, bars in enumerate(series):
            places = x + width * (i - 0.5 * (len(series) - 1))
            axes.bar(places, bars.levels, 0.92 * width, color=bars.colour, label=bars.label)
            for place, levels in zip(places, bars.runs, strict=False):
                axes.plot([place] * len(levels), levels, "o", ms=3.2, mfc="white", mec="black", mew=0.8)
        if floors is not None and not np.isnan(floors).all():
            axes.hlines(
                floors, x - 0.44, x + 0.44, color=style.RED, lw=1.4, label="noise floor of the encoders"
            )
        few = len(names) <= _FEW_GROUPS
        axes.set_xticks(x, names, rotation=0 if few else 20, ha="center" if few else "right")
        shown = max(len(names), _FEW_GROUPS)  # a single bar is no wider than one of several
        axes.set_xlim(-0.6, shown - 0.4)
        axes.set_ylabel("SNR [dB]")
        axes.set_title(title, pad=20.0)
        axes.grid(axis="x", visible=False)
        # At the left, where it is seen on a narrow screen, too.
        axes.legend(ncols=5, loc="lower left", bbox_to_anchor=(-0.005, 0.99))
    return page


def _style(letters: float = style.LETTERS) -> dict[str, Any]:
    """Parameters of matplotlib (`matplotlib.rc_context`) with letters of a size [points]."""
    return {
        "font.family": "DejaVu Sans",  # comes with matplotlib, so every machine draws the same letters
        "font.size": letters,
        "text.parse_math": False,  # a name with two dollar signs is a name
        "axes.titlesize": letters + 0.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.labelsize": letters,
        "xtick.labelsize": letters - 0.5,
        "ytick.labelsize": letters - 0.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": style.GRID_GREY,
        "grid.linewidth": 0.6,
        "axes.axisbelow": True,
        "axes.edgecolor": style.AXIS_GREY,
        "xtick.color": "#333333",
        "ytick.color": "#333333",
        "legend.frameon": False,
        "legend.fontsize": letters - 1.0,
        "legend.borderaxespad": 0.2,
        "legend.columnspacing": 1.2,
        "legend.handlelength": 1.5,
        "lines.solid_joinstyle": "round",
        "svg.hashsalt": "ur-hil",  # the same data give the same file
        "svg.fonttype": "path",
        "path.simplify": True,
        "path.simplify_threshold": 0.2,
    }
