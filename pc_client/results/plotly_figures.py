"""Figures that a browser zooms and turns: the data and layout that plotly.js draws.

Of the library plotly only its script is used. A page holds it once, and asks nothing of the network.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pc_client.results.sheet import PLOTLY_MARK, Curve, Panel, Sheet, plotly_template

__all__ = ["plotly_figure", "plotly_script", "thinned"]

#: Points of a curve at most: a screen is hardly wider, and a long recording shall not make a large page.
_MOST_POINTS = 1500
#: Pixels for a point of print, on a page that is as wide as the figure.
_PIXELS = 1.33

_DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
_SYMBOLS = {"o": "circle", "s": "square", "^": "triangle-up", "D": "diamond"}
#: Where a legend stands: place on the panel from left to right, and which corner of the legend is there.
_LEGENDS: dict[str, tuple[float, dict[str, str]]] = {
    "above": (1.0, {"orientation": "h", "xanchor": "right", "yanchor": "bottom"}),
    "inside": (0.0, {"orientation": "h", "xanchor": "left", "yanchor": "top"}),
    "right": (1.01, {"orientation": "v", "xanchor": "left", "yanchor": "top"}),
}


_CENTRED = {"xanchor": "center", "yanchor": "middle"}


def plotly_script() -> str:
    """The text of plotly.js.

    Raises:
        ModuleNotFoundError: plotly is not installed (extra `report`).
    """
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def plotly_figure(sheet: Sheet) -> dict[str, Any]:
    """Data and layout of a sheet as `Plotly.newPlot` takes them."""
    layout: dict[str, Any] = {"template": plotly_template(_PIXELS * sheet.letters), "shapes": []}
    notes = [_note(sheet.title, 0.01, 1.0 - 0.25 / sheet.height, bold=True)]
    data = []
    for index, panel in enumerate(sheet.panels):
        number = str(index + 1) if index else ""
        left, bottom, width, height = panel.box
        if panel.in_space:
            layout["scene" + number] = _scene(panel)
            place = {"scene": "scene" + number}
        else:
            place = {"xaxis": "x" + number, "yaxis": "y" + number}
            layout["xaxis" + number], layout["yaxis" + number] = _axes(sheet.panels, index)
            layout["shapes"] += [
                {"xref": "x" + number, "yref": f"y{number} domain", "x0": begin, "x1": end}
                for begin, end in panel.shaded.tolist()
            ]
            notes += [
                _note(text, *point.tolist()) | {"xref": "x" + number, "yref": "y" + number, **_CENTRED}
                for point, text in panel.texts
            ]
        notes.append(_note(panel.title, left, bottom + height, bold=True))
        traces = [_trace(curve) | place | {"legend": "legend" + number} for curve in panel.curves]
        if panel.legend:
            across, corner = _LEGENDS[panel.legend]
            layout["legend" + number] = {
                **corner,
                "x": left + across * width,
                "y": bottom + height,
                "font": {"size": _PIXELS * (sheet.letters - 1.0)},
                "bgcolor": "rgba(0,0,0,0)",
                "groupclick": "toggleitem",
            }
        if panel.legend == "inside":  # groups stand beside each other
            for k, trace in enumerate(trace for trace in traces if trace["showlegend"]):
                trace["legendgroup"] = f"{number}/{k // panel.n_legend_rows}"
        data += traces
    if sheet.mark:
        notes.append(_note(sheet.mark, 0.992, 0.995, bold=True) | PLOTLY_MARK)
    return {"data": data, "layout": layout | {"annotations": [note for note in notes if note["text"]]}}


def thinned(points: NDArray[np.float64], most: int = _MOST_POINTS) -> NDArray[np.float64]:
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


def _trace(curve: Curve) -> dict[str, Any]:
    points = thinned(curve.points)
    in_space = points.shape[1] == 3
    trace: dict[str, Any] = {
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
        **{name: _packed(values) for name, values in zip("xyz", points.T, strict=False)},
    }
    step = float(points[1, 0] - points[0, 0]) if len(points) > 2 else 0.0
    if step > 0.0 and not in_space and np.abs(np.diff(points[:, 0], 2)).max() < 1e-6 * step:
        del trace["x"]  # a steady clock is two numbers
        trace |= {"x0": float(points[0, 0]), "dx": step}
    if not curve.label and not in_space:
        trace["hoverinfo"] = "skip"
    if curve.marker:
        trace["marker"] = {
            "symbol": _SYMBOLS[curve.marker],
            "size": _PIXELS * curve.size,
            "color": "white" if curve.hollow else curve.colour,
            "line": {"color": curve.colour, "width": 1.3},
        }
    if curve.filled:
        trace["fill"] = "tozeroy"
    if curve.stepped:
        trace["line"]["shape"] = "hv"
    return trace


def _packed(values: NDArray[np.float64]) -> dict[str, str]:
    """Numbers as plotly.js reads them from base64, nan too, in a third of the length of text."""
    return {"dtype": "f4", "bdata": b64encode(values.astype("<f4").tobytes()).decode()}


def _axes(panels: Sequence[Panel], index: int) -> tuple[dict[str, Any], dict[str, Any]]:
    panel, number = panels[index], str(index + 1) if index else ""
    left, bottom, width, height = panel.box
    x: dict[str, Any] = {"domain": [left, left + width], "anchor": "y" + number}
    y: dict[str, Any] = {"domain": [bottom, bottom + height], "anchor": "x" + number}
    for axis, label, between in zip((x, y), panel.labels, (panel.ranges[0], panel.upwards), strict=True):
        axis["title"] = {"text": escape(label)}
        axis["showticklabels"] = bool(label)
        if between != (None, None):
            axis["range"] = list(between)
    if panel.ticks is not None:
        x |= {"tickvals": list(panel.ticks), "ticktext": [escape(text) for text in panel.ticks.values()]}
    if panel.equal:
        y["scaleanchor"] = "x" + number
    for k, other in enumerate(panels[:index]):
        if other.ranges[0] == panel.ranges[0] != (None, None) and not other.in_space and not panel.equal:
            x["matches"] = f"x{k + 1 if k else ''}"
            break
    return x, y


def _scene(panel: Panel) -> dict[str, Any]:
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


def _note(text: str, x: float, y: float, *, bold: bool = False) -> dict[str, Any]:
    text = f"<b>{escape(text)}</b>" if bold and text else escape(text)
    return {"text": text, "x": x, "y": y, "xref": "paper", "yref": "paper"}
