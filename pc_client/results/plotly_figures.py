"""Figures that a browser zooms and turns: the data and layout that plotly.js draws.

Of the library plotly only its script is used. A page holds it once, and asks nothing of the network.

plotly.js knows the panels of a sheet by a number behind the names of their parts, and the first by none: its
axes are `x` and `y`, its legend is `legend`, a scene in space is `scene`; those of the second panel are `x2`,
`y2`, `legend2` and `scene2`. A curve names the axes and the legend that it belongs to. In the layout the axes
are called `xaxis2` and `yaxis2`. Places on the sheet are shares of its width and height, from the lower left
corner.
"""

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from pc_client.arrays import Array
from pc_client.results import sheet as style
from pc_client.results.sheet import Curve, Panel, Sheet

Element = dict[str, Any]
"""A part of a figure as JSON."""

_MOST_POINTS = 1500
"""Points of a curve at most: a screen is hardly wider, and a long recording shall not make a large page."""

_PIXELS = 1.33
"""Pixels for a point of print, on a page that is as wide as the figure."""

_DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
_SYMBOLS = {"o": "circle", "s": "square", "^": "triangle-up", "D": "diamond"}

_LEGENDS: dict[str, tuple[float, dict[str, str]]] = {
    "above": (1.0, {"orientation": "h", "xanchor": "right", "yanchor": "bottom"}),
    "inside": (0.0, {"orientation": "h", "xanchor": "left", "yanchor": "top"}),
    "right": (1.01, {"orientation": "v", "xanchor": "left", "yanchor": "top"}),
}
"""Where a legend stands: place on the panel from left to right, and which corner of the legend is there."""

_MARK = {
    "xanchor": "right",
    "yanchor": "top",
    "bgcolor": style.MARK_FILL,
    "bordercolor": style.MARK_EDGE,
    "borderpad": 3,
    "font": {"size": 11},
}
"""How the mark of a sheet looks."""


def plotly_figure(sheet: Sheet) -> Element:
    """Data and layout of a sheet as `Plotly.newPlot` takes them."""
    curves: list[Element] = []
    layout: Element = {"template": _template(_PIXELS * sheet.letters), "shapes": []}
    notes = [_note(sheet.title, 0.01, 1.0 - 0.25 / sheet.height, bold=True)]
    for index, panel in enumerate(sheet.panels):
        number = _number(index)
        if panel.in_space:
            layout[f"scene{number}"] = _scene(panel)
        else:
            layout[f"xaxis{number}"], layout[f"yaxis{number}"] = _axes(sheet.panels, index)
            layout["shapes"] += [  # over the whole height of the panel
                {"xref": f"x{number}", "yref": f"y{number} domain", "x0": begin, "x1": end}
                for begin, end in panel.shaded.tolist()
            ]
            around = {"xref": f"x{number}", "yref": f"y{number}", "xanchor": "center", "yanchor": "middle"}
            notes += [_note(text, *point.tolist()) | around for point, text in panel.texts]
        left, bottom, _, height = panel.box
        notes.append(_note(panel.title, left, bottom + height, bold=True))
        if panel.legend:
            layout[f"legend{number}"] = _legend(panel, sheet.letters)
        curves += _curves(panel, number)
    if sheet.mark:
        notes.append(_note(sheet.mark, 0.992, 0.995, bold=True) | _MARK)
    layout["annotations"] = [note for note in notes if note["text"]]
    return {"data": curves, "layout": layout}


def _number(index: int) -> str:
    """What stands behind the names of the parts of a panel."""
    return str(index + 1) if index else ""


def _axes(panels: Sequence[Panel], index: int) -> tuple[Element, Element]:
    """The axes x and y of a panel in a plane."""
    panel, number = panels[index], _number(index)
    left, bottom, width, height = panel.box
    x: Element = {"domain": [left, left + width], "anchor": f"y{number}"}
    y: Element = {"domain": [bottom, bottom + height], "anchor": f"x{number}"}
    for axis, label, between in zip((x, y), panel.labels, (panel.ranges[0], panel.upwards), strict=True):
        axis["title"] = {"text": escape(label)}
        axis["showticklabels"] = bool(label)
        if between != (None, None):
            axis["range"] = list(between)
    if panel.ticks is not None:
        x |= {"tickvals": list(panel.ticks), "ticktext": [escape(text) for text in panel.ticks.values()]}
    if panel.equal:
        y["scaleanchor"] = f"x{number}"
    elif (first := _zoomed_with(panels, index)) is not None:
        x["matches"] = f"x{_number(first)}"
    return x, y


def _zoomed_with(panels: Sequence[Panel], index: int) -> int | None:
    """The first panel before this one with the same range of x, which is zoomed with it; None without."""
    span = panels[index].ranges[0]
    same = (k for k, other in enumerate(panels[:index]) if other.ranges[0] == span and not other.in_space)
    return None if span == (None, None) else next(same, None)


def _scene(panel: Panel) -> Element:
    """The axes of a panel in space, and the eye that looks at them."""
    left, bottom, width, height = panel.box
    up, around = np.radians(panel.view)
    away = 1.6 * float(np.linalg.norm(panel.shape)) / panel.zoom
    eye = away * np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    # What is looked at lies left of the middle, where the numbers of the axes need the more room.
    middle = 0.1 * np.array([np.sin(around), -np.cos(around), 0.0])
    labels = panel.labels if any(panel.labels) else ("", "", "")
    return {
        "domain": {"x": [left, left + width], "y": [bottom, bottom + height]},
        "camera": {
            name: dict(zip("xyz", np.round(values, 4).tolist(), strict=True))
            for name, values in (("eye", eye), ("center", middle))
        },
        "aspectratio": dict(zip("xyz", panel.shape.tolist(), strict=True)),
        "annotations": [
            dict(zip("xyz", point.tolist(), strict=True))
            | {"text": escape(text), "xshift": 9, "showarrow": False}
            for point, text in panel.texts
        ],
        **{
            f"{name}axis": {
                "title": {"text": label},
                "range": list(between),
                "showticklabels": bool(label),
                "nticks": 5 if edge > 0.6 else 3,
            }
            for name, label, between, edge in zip("xyz", labels, panel.ranges, panel.shape, strict=True)
        },
    }


def _note(text: str, x: float, y: float, *, bold: bool = False) -> Element:
    """A text at a place on the sheet."""
    text = f"<b>{escape(text)}</b>" if bold and text else escape(text)
    return {"text": text, "x": x, "y": y, "xref": "paper", "yref": "paper"}


def _legend(panel: Panel, letters: float) -> Element:
    left, bottom, width, height = panel.box
    across, corner = _LEGENDS[panel.legend]
    return {
        **corner,
        "x": left + across * width,
        "y": bottom + height,
        "font": {"size": _PIXELS * (letters - 1.0)},
        "bgcolor": "rgba(0,0,0,0)",
        "groupclick": "toggleitem",
    }


def _curves(panel: Panel, number: str) -> list[Element]:
    """The curves of a panel, with the axes and the legend that they belong to."""
    axes = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
    place = {"scene": f"scene{number}"} if panel.in_space else axes
    curves = [_curve(curve) | place | {"legend": f"legend{number}"} for curve in panel.curves]
    if panel.legend == "inside":  # its rows are groups, which stand beside each other
        for k, curve in enumerate(curve for curve in curves if curve["showlegend"]):
            curve["legendgroup"] = f"{number}/{k // panel.n_legend_rows}"
    return curves


def _curve(curve: Curve) -> Element:
    points = thinned(curve.points)
    in_space = points.shape[1] == 3
    drawn: Element = {
        "type": "scatter3d" if in_space else "scatter",
        "mode": "+".join(["lines"] * bool(curve.width) + ["markers"] * bool(curve.marker)),
        "name": escape(curve.label),
        "showlegend": bool(curve.label),
        "opacity": curve.opacity,
        # A line in space is drawn at half of its width.
        "line": {
            "color": curve.colour,
            "width": (2.0 if in_space else 1.0) * _PIXELS * curve.width,
            "dash": _DASHES[curve.style],
        },
        **_coordinates(points),
    }
    if not curve.label and not in_space:
        drawn["hoverinfo"] = "skip"
    if curve.marker:
        drawn["marker"] = {
            "symbol": _SYMBOLS[curve.marker],
            "size": _PIXELS * curve.size,
            "color": "white" if curve.hollow else curve.colour,
            "line": {"color": curve.colour, "width": 1.3},
        }
    if curve.filled:
        drawn["fill"] = "tozeroy"
    if curve.stepped:
        drawn["line"]["shape"] = "hv"
    return drawn


def _coordinates(points: Array) -> Element:
    """Points (n, dim) by coordinate; a steady x in a plane, such as a clock, is two numbers.

    Other numbers are packed as plotly.js reads them from base64, nan too, in a third of the length of text.
    """
    packed: Element = {
        name: {"dtype": "f4", "bdata": b64encode(values.astype("<f4").tobytes()).decode()}
        for name, values in zip("xyz", points.T, strict=False)
    }
    step = float(points[1, 0] - points[0, 0]) if len(points) > 2 else 0.0
    is_steady = step > 0.0 and np.abs(np.diff(points[:, 0], 2)).max() < 1e-6 * step
    if is_steady and points.shape[1] == 2:
        del packed["x"]
        packed |= {"x0": float(points[0, 0]), "dx": step}
    return packed


def thinned(points: Array, most: int = _MOST_POINTS) -> Array:
    """At most so many points (n, dim) of a curve: of each stretch those that are extreme in a coordinate.

    No peak is lost: first and last point stay, and of every coordinate the smallest and the largest value of
    each stretch.
    """
    n, dim = points.shape
    if n <= most:
        return points
    keep = {0, n - 1}
    for stretch in np.array_split(np.arange(n), max(1, (most - 2) // (2 * dim))):
        for sign in (1.0, -1.0):
            values = sign * points[stretch]
            keep.update(stretch[np.where(np.isnan(values), np.inf, values).argmin(axis=0)].tolist())
    return points[sorted(keep)]


def _template(letters: float) -> Element:
    """The template (`layout.template`) of plotly.js with letters of a size [pixels]."""
    axis = {
        "gridcolor": style.GRID_GREY,
        "linecolor": style.AXIS_GREY,
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
        "font": {"family": "DejaVu Sans, Verdana, sans-serif", "size": letters, "color": style.TEXT},
        "plot_bgcolor": "white",
        "hovermode": "x",
        "hoverlabel": {"namelength": -1, "font": {"size": letters - 1}},
        "xaxis": axis,
        "yaxis": axis,
        "scene": {"xaxis": in_space, "yaxis": in_space, "zaxis": in_space, "aspectmode": "manual"},
        "shapedefaults": {"y0": 0, "y1": 1, "fillcolor": style.SHADE, "line": {"width": 0}, "layer": "below"},
        "annotationdefaults": {"showarrow": False, "xanchor": "left", "yanchor": "bottom"},
    }
    return {"layout": layout}
