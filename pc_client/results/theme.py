"""Colours, letters and sizes that all figures have in common; loads no plotting library.

The colours are those of Okabe and Ito, which colour-blind readers can distinguish. The reference is the thick
grey line in every figure, so that a figure can be read without its legend.
"""

from __future__ import annotations

from typing import Any

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


def colour_of(index: int) -> str:
    """The colour of a series by its number; the seventh has that of the first."""
    return COLOURS[index % len(COLOURS)]


def matplotlib_style(letters: float = LETTERS) -> dict[str, Any]:
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
        "lines.solid_joinstyle": "round",
        "svg.hashsalt": "ur-hil",  # the same data give the same file
        "svg.fonttype": "path",
        "path.simplify": True,
        "path.simplify_threshold": 0.2,
    }


def plotly_template(letters: float) -> dict[str, Any]:
    """The template (`layout.template`) of plotly.js with letters of a size [pixels]."""
    axis = {
        "gridcolor": GRID_GREY,
        "linecolor": AXIS_GREY,
        "showline": True,
        "ticks": "outside",
        "ticklen": 4,
        "zeroline": False,
        "hoverformat": ".4~g",
        "tickfont": {"size": letters - 1},
        "title": {"font": {"size": letters}, "standoff": 4},
    }
    in_space = {
        "gridcolor": "#D0D0D0",
        "backgroundcolor": "#F7F7F7",
        "showbackground": True,
        "hoverformat": ".1f",
        "tickfont": {"size": letters - 2},
        "title": {"font": {"size": letters - 1}},
        "showspikes": False,
    }
    layout = {
        "autosize": True,
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0, "autoexpand": False},
        "font": {"family": "DejaVu Sans, Verdana, sans-serif", "size": letters, "color": TEXT},
        "plot_bgcolor": "white",
        "hovermode": "x",
        "hoverlabel": {"namelength": -1, "font": {"size": letters - 1}},
        "xaxis": axis,
        "yaxis": axis,
        "scene": {
            "xaxis": in_space,
            "yaxis": in_space,
            "zaxis": in_space,
            "aspectmode": "manual",
        },
        "shapedefaults": {"y0": 0, "y1": 1, "fillcolor": SHADE, "line": {"width": 0}, "layer": "below"},
        "annotationdefaults": {"showarrow": False, "xanchor": "left", "yanchor": "bottom"},
    }
    return {"layout": layout}


#: The mark of a figure, as an annotation of plotly.js.
PLOTLY_MARK = {
    "xanchor": "right",
    "yanchor": "top",
    "bgcolor": MARK_FILL,
    "bordercolor": MARK_EDGE,
    "borderpad": 3,
    "font": {"size": 11},
}
