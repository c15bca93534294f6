"""What a figure shows: curves in panels on a sheet, and the colours and letters that all figures share.

`matplotlib_figures.draw` makes a matplotlib figure of a sheet, `plotly_figures.plotly_figure` one that a
browser zooms; this module loads neither library. The colours are those of Okabe and Ito, which colour-blind
readers can distinguish. The reference is the thick grey line in every figure, so that a figure can be read
without its legend.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Literal

import numpy as np

from pc_client.arrays import Array

BLUE, ORANGE, GREEN, RED, PURPLE, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9"
#: In the order in which series get them; the first two differ in lightness as well.
COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY)
REFERENCE_GREY, PAPER_GREY, AXIS_GREY, GRID_GREY = "#9A9A9A", "#B8B8B8", "#666666", "#E4E4E4"
TEXT, MARK_FILL, MARK_EDGE = "#1C1C1C", "#FFF3CD", "#B8860B"
#: Background of times in which a pen is down.
SHADE = "#F4F1EA"

#: Letters of a figure that is eleven inches wide [points].
LETTERS = 9.0
#: Inches of such a figure.
WIDTH = 11.0

#: Left, bottom, width and height of a panel, as shares of the sheet.
Box = tuple[float, float, float, float]
#: Lower and upper end of an axis; None: as the curves need it.
Range = tuple[float | None, float | None]


def colour_of(index: int) -> str:
    """The colour of a series by its number; the seventh has that of the first."""
    return COLOURS[index % len(COLOURS)]


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A line, or single points.

    Attributes:
        points: (n, 2) or, in space, (n, 3), in the units of the axes; nan interrupts the line.
        colour: as "#RRGGBB".
        label: in the legend; none where empty.
        width: of the line [points]; 0: no line.
        marker: of the points, as matplotlib names it; none where empty.
        size: of the markers [points].
        hollow: whether markers are white inside.
        filled: whether the area between the line and zero is filled.
        stepped: whether a value holds until the next point.
    """

    points: Array
    colour: str
    label: str = ""
    width: float = 1.0
    style: Literal["-", "--", ":", "-."] = "-"
    marker: Literal["", "o", "s", "^", "D"] = ""
    size: float = 5.0
    hollow: bool = False
    opacity: float = 1.0
    filled: bool = False
    stepped: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Curves in one pair of axes, or in space.

    Attributes:
        box: its place on the sheet.
        labels: of its axes, with units; an axis without one has no numbers either.
        ranges: of its axes; panels of a sheet with the same range of x are zoomed together.
        legend: where it stands; "inside": at the top, for which the axis gets room.
        texts: around points (2,), in space at the right of points (3,).
        shaded: (n, 2) begins and ends on x.
        ticks: texts by place on x, where they are not numbers.
        slower: a second scale of y at the right is so many times smaller, where 1 none; figures that are
            zoomed have none.
        equal: whether x and y have the same scale; in space they always have.
        view: of a panel in space: elevation and azimuth [degrees].
        zoom: of a panel in space, 1: its longest edge fills a square.
    """

    box: Box
    curves: Sequence[Curve]
    title: str = ""
    labels: Sequence[str] = ("", "")
    ranges: Sequence[Range] = ((None, None), (None, None))
    legend: Literal["", "above", "inside", "right"] = ""
    columns: int = 6
    texts: Sequence[tuple[Array, str]] = ()
    shaded: Array = field(default_factory=lambda: np.empty((0, 2)))
    ticks: Mapping[float, str] | None = None
    slower: float = 1.0
    equal: bool = False
    view: tuple[float, float] = (30.0, -60.0)
    zoom: float = 1.0

    @property
    def in_space(self) -> bool:
        """Whether the curves have three coordinates."""
        return int(self.curves[0].points.shape[1]) == 3

    @property
    def shape(self) -> Array:
        """Edges (3,) of a panel in space, relative to the longest."""
        lengths = np.array([high - low for low, high in self.ranges if low is not None and high is not None])
        shape: Array = lengths / lengths.max()
        return shape

    @property
    def n_legend_rows(self) -> int:
        """Rows of a legend inside."""
        return -(-sum(bool(curve.label) for curve in self.curves) // self.columns)

    @property
    def upwards(self) -> Range:
        """The range of y, with room for a legend inside."""
        low, high = self.ranges[1]
        if self.legend != "inside" or high is not None:
            return low, high
        values = np.concatenate([curve.points[:, 1] for curve in self.curves])
        top = float(np.nanmax(values))
        span = max(1e-9, top - (float(np.nanmin(values)) if low is None else low))
        bottom = top - 1.05 * span if low is None else low
        return bottom, top + (0.05 + 0.16 * self.n_legend_rows) * span


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A figure; sizes are in inches, letters in points.

    Attributes:
        mark: what the data are, written on it; empty for those of a real arm, or none at all.
    """

    height: float
    panels: Sequence[Panel]
    mark: str = ""
    title: str = ""
    width: float = WIDTH
    letters: float = LETTERS


def boxes(
    size: tuple[float, float],
    widths: Sequence[float],
    heights: Sequence[float],
    *,
    margins: tuple[float, float, float, float],
    gaps: tuple[float, float],
) -> list[list[Box]]:
    """The boxes of a grid of panels, row by row from the top; sizes in inches.

    Args:
        size: width and height of the sheet.
        widths: of the columns, relative to each other; heights of the rows likewise.
        margins: left, right, top and bottom.
        gaps: between columns and between rows.
    """
    left, right, top, bottom = margins
    shares_x = np.array(widths) * (size[0] - left - right - gaps[0] * (len(widths) - 1)) / sum(widths)
    shares_y = np.array(heights) * (size[1] - top - bottom - gaps[1] * (len(heights) - 1)) / sum(heights)
    lefts = accumulate(shares_x[:-1] + gaps[0], initial=left)
    tops = accumulate(shares_y[:-1] + gaps[1], initial=top)
    columns = [(x / size[0], w / size[0]) for x, w in zip(lefts, shares_x, strict=True)]
    rows = [(1.0 - (y + h) / size[1], h / size[1]) for y, h in zip(tops, shares_y, strict=True)]
    return [[(float(x), float(y), float(w), float(h)) for x, w in columns] for y, h in rows]


def cube_around(points: Array, *, least: float = 1.0, margin: float = 0.0) -> list[Range]:
    """Ranges (lower, upper) of axes around points (n, dim), and a margin as a share.

    `least` is the length of the shortest axis as a share of the longest; 1 is a cube.
    """
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    longest = max(1e-9, float((high - low).max()))
    half = 0.5 * (1.0 + margin) * np.maximum(high - low, least * longest)
    middle = 0.5 * (low + high)
    return [(float(m - h), float(m + h)) for m, h in zip(middle, half, strict=True)]
