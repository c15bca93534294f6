"""Figures, by matplotlib: import it only where one is drawn.

A figure stays in the one theme because it is made and written inside `figure` and `svg_text`; matplotlib's
constrained layout places its axes. The same data give the same bytes. Every figure of data that
are not known to be of a real arm says so. The colours are those of Okabe and Ito, which colour-blind readers
can distinguish; the reference is the thick grey line in every figure.
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

BLUE, ORANGE, GREEN, RED, PURPLE, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9"
#: In the order in which series get them; the first two differ in lightness as well.
COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY)
REFERENCE_GREY, PAPER_GREY, AXIS_GREY, GRID_GREY = "#9A9A9A", "#B8B8B8", "#666666", "#E4E4E4"
TEXT, _MARK_FILL, _MARK_EDGE = "#1C1C1C", "#FFF3CD", "#B8860B"
_SHADE = "#F4F1EA"

#: Letters of a figure that is eleven inches wide [points].
_LETTERS = 9.0
#: Inches of such a figure.
WIDTH = 11.0

HOLLOW: dict[str, Any] = {"ls": "", "marker": "o", "mfc": "white", "ms": 5.0}
"""Of single points: circles."""

OUTLINE = [withStroke(linewidth=2.5, foreground="white")]
"""Of texts that stand on curves."""

_MARK_ROOM = 0.3
"""At the top of a figure without a title [inches]."""

_DPI = 110
_FEW_GROUPS = 6
"""So many groups of bars have room on a figure at least, and their names beside each other."""


def colour_of(index: int) -> str:
    """The colour of a series by its number; the seventh has that of the first."""
    return COLOURS[index % len(COLOURS)]


@contextmanager
def figure(
    height: float,
    mark: str = "",
    *,
    width: float = WIDTH,
    title: str = "",
    letters: float = _LETTERS,
    layout: Literal["constrained"] | None = "constrained",
) -> Iterator[Figure]:
    """Give an empty figure in the theme, to be filled inside the block.

    Args:
        height: as the width in inches; letters in points.
        mark: what the data are, written on it; empty for those of a real arm, or none at all.
        layout: None: the caller places the axes.
    """
    with mpl.rc_context(_style(letters)):
        page = Figure(figsize=(width, height), layout=layout)
        if title:
            page.suptitle(title, x=0.01, ha="left", fontsize=letters + 1, weight="bold")
        elif mark and layout is not None:
            page.set_layout_engine(layout, rect=(0.0, 0.0, 1.0, 1.0 - _MARK_ROOM / height))
        if mark:
            box = {"boxstyle": "round,pad=0.3", "fc": _MARK_FILL, "ec": _MARK_EDGE, "lw": 0.8}
            place = (0.992, 1.0 - 0.08 / height)
            page.text(*place, mark, ha="right", va="top", fontsize=8.5, weight="bold", bbox=box)
        yield page


def svg_text(page: Figure) -> str:
    """A figure as SVG text, without date or program."""
    text = io.StringIO()
    with mpl.rc_context(_style()):
        FigureCanvasSVG(page)
        page.draw_without_rendering()
        page.set_layout_engine("none")  # a second layout would begin at the first, and differ by a hair
        page.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()


def image_bytes(page: Figure) -> bytes:
    """A figure as the bytes of a PNG file."""
    data = io.BytesIO()
    with mpl.rc_context(_style()):
        FigureCanvasAgg(page)
        page.savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def label_axes(
    axes: Any,
    title: str = "",
    x: str = "",
    y: str = "",
    span: tuple[float | None, float | None] = (None, None),
    bottom: float | None = None,
    top: float | None = None,
) -> None:
    """Write title and labels of axes whose curves are drawn; an axis without a label has no numbers either.

    Args:
        span: ends of the x axis; None: as the curves need it. `bottom` and `top` are those of the y axis.
    """
    axes.set(title=title, xlabel=x, ylabel=y)
    if span != (None, None):  # setting none ends the scaling by the curves, too
        axes.set_xlim(*span)
    if (bottom, top) != (None, None):
        axes.set_ylim(bottom, top)
    axes.tick_params(labelbottom=bool(x), labelleft=bool(y))
    axes.yaxis.set_major_locator(MaxNLocator(5))


def show_legend(axes: Any, where: Literal["above", "inside", "right"], columns: int = 6) -> None:
    """Show a legend; one inside stands at the top, for which the y axis gets room."""
    if where == "above":
        axes.legend(ncols=columns, loc="lower right", bbox_to_anchor=(1.0, 0.99))
    elif where == "right":
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 0.98))
    else:
        n_rows = -(-len(axes.get_legend_handles_labels()[0]) // columns)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.16 * n_rows * (high - low))
        axes.legend(ncols=columns, loc="upper left")


def shade(axes: Any, spans: Array) -> None:
    """Shade the background between begins and ends (n, 2) on x."""
    for begin, end in spans:
        axes.axvspan(begin, end, color=_SHADE, lw=0, zorder=0)


def space_axes(
    axes: Any,
    points: Array,
    labels: Sequence[str] = (),
    *,
    least: float = 1.0,
    margin: float = 0.0,
    zoom: float = 1.0,
    view: tuple[float, float] = (30.0, -60.0),
) -> None:
    """Give axes in space one scale, with room for points (n, 3) and a margin as a share.

    Args:
        labels: of the three axes; without, they have no numbers either.
        least: length of the shortest axis as a share of the longest; 1 is a cube.
        zoom: 1: the longest edge fills a square.
        view: elevation and azimuth [degrees].
    """
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    longest = max(1e-9, float((high - low).max()))
    edges = (1.0 + margin) * np.maximum(high - low, least * longest)
    middle = 0.5 * (low + high)
    ends = np.stack((middle - 0.5 * edges, middle + 0.5 * edges), axis=1)
    axes.set(xlim=ends[0], ylim=ends[1], zlim=ends[2])
    shape = edges / edges.max()
    # matplotlib keeps the diagonal of the box; here its longest edge is kept.
    axes.set_box_aspect(tuple(shape), zoom=0.55 * zoom * float(np.linalg.norm(shape)))
    axes.view_init(*view)
    if not labels:
        axes.set(xticklabels=(), yticklabels=(), zticklabels=())
        return
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.zaxis.set_rotate_label(False)
    axes.set_zlabel(labels[2], rotation=90)
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
        axes = page.add_subplot()
        for i, bars in enumerate(series):
            places = x + width * (i - 0.5 * (len(series) - 1))
            axes.bar(places, bars.levels, 0.92 * width, color=bars.colour, label=bars.label)
            for place, levels in zip(places, bars.runs, strict=False):
                axes.plot([place] * len(levels), levels, "o", ms=3.2, mfc="white", mec="black", mew=0.8)
        if floors is not None and not np.isnan(floors).all():
            axes.hlines(floors, x - 0.44, x + 0.44, color=RED, lw=1.4, label="noise floor of the encoders")
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


def _style(letters: float = _LETTERS) -> dict[str, Any]:
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
        "grid.color": GRID_GREY,
        "grid.linewidth": 0.6,
        "axes.axisbelow": True,
        "axes.edgecolor": AXIS_GREY,
        "xtick.color": "#333333",
        "ytick.color": "#333333",
        "legend.frameon": False,
        "legend.fontsize": letters - 1.0,
        "legend.borderaxespad": 0.2,
        "legend.columnspacing": 1.2,
        "legend.handlelength": 1.5,
        "figure.constrained_layout.w_pad": 0.08,
        "lines.linewidth": 1.0,
        "lines.solid_joinstyle": "round",
        "svg.hashsalt": "ur-hil",  # the same data give the same file
        "svg.fonttype": "path",
        "path.simplify": True,
        "path.simplify_threshold": 0.2,
    }
