"""The four speed profiles of a drawing: one under the other, overlaid, and their differences."""

from __future__ import annotations

import numpy as np

from pc_client.drawing.shown import AIR, COLOURS, LETTERS, SHEET_WIDTH, Shown
from pc_client.results.panels import Curve, Panel, Sheet, boxes
from pc_client.results.theme import AXIS_GREY, SKY

__all__ = ["speeds_sheet"]

#: Lognormals that are this many times as high as the speed itself, since they cancel, are cut off.
_TALL = 1.5
_FAINT = "#BDBDBD"


def speeds_sheet(shown: Shown) -> Sheet:
    """The four speed profiles one under the other, then overlaid, then differences from the person's."""
    parts, factor = shown.drawing.extraction.parts, shown.drawing.factor
    top = shown.unit * max(float(part.speed.max()) for own in shown.parts.values() for part in own)
    highest = shown.unit * max(float(part.trajectory.stroke_speeds(part.t).max()) for part in parts)
    overlaid = [
        curve
        for name, width in zip(COLOURS, (4.5, 2.0, 1.4, 1.2), strict=True)
        for curve in _speeds(shown, name, width, _FAINT if name == "human" else COLOURS[name])
    ]
    rows: list[tuple[str, list[Curve], float | None]] = [
        (name, _profile(shown, name), 1.1 * max(top, min(highest, _TALL * top))) for name in COLOURS
    ]
    rows += [("overlaid", overlaid, 1.22 * top), ("difference", _differences(shown), None)]
    heights = (1.0, 1.0, 1.0, 1.0, 1.55, 0.75)
    height = 9.6
    margins = (0.85, 0.75, 0.5, 0.6)
    places = boxes((SHEET_WIDTH, height), (1,), heights, margins=margins, gaps=(0.0, 0.2))
    panels = [
        Panel(
            box,
            curves,
            "",
            ("time of the hand since the pen came down [s]; shaded: pen down" if upper is None else "", name),
            (shown.span, (None if upper is None else 0.0, upper)),
            "inside" if name == "overlaid" else "",
            columns=4,
            shaded=shown.pen_down,
            slower=factor if factor > 1.0 and upper is not None else 1.0,
        )
        for (box,), (name, curves, upper) in zip(places, rows, strict=True)
    ]
    title = "speed on the sheet [mm per s of the hand]" + (
        "; right: of the arm [mm/s]" if factor > 1.0 else ""
    )
    return Sheet(height, panels, shown.mark, title, SHEET_WIDTH, LETTERS)


def _profile(shown: Shown, name: str) -> list[Curve]:
    """One signal, with its strokes or with the movement of the arm while the pen is up."""
    curves = []
    if name == "reconstructed":
        for index, part in zip(shown.moving, shown.drawing.extraction.parts, strict=True):
            mark, nearly = shown.drawing.marks[index], 1e-3 * float(np.ptp(part.p, axis=0).max())
            t = np.arange(mark.begin - mark.lead(nearly), mark.end + mark.lag(nearly), 0.002)
            at = shown.since_pen_down(t, index)
            for stroke in shown.unit * part.trajectory.stroke_speeds(t).T:
                visible = stroke > 1e-3 * stroke.max()
                curves.append(Curve(np.c_[at, stroke][visible], SKY, width=0.8, filled=True))
    if name in ("planned", "executed"):
        t, _, v = shown.whole(executed=name == "executed")
        curves.append(Curve(np.c_[t - shown.start, 1e3 * np.linalg.norm(v, axis=1)], AIR, width=1.1))
    return curves + _speeds(shown, name, 1.8, COLOURS[name])


def _speeds(shown: Shown, name: str, width: float, colour: str) -> list[Curve]:
    parts = zip(shown.moving, shown.parts[name], strict=True)
    return [
        Curve(
            np.c_[shown.since_pen_down(part.t, index), shown.unit * part.speed],
            colour,
            "" if count else name,
            width,
            "--" if name == "planned" and width < 1.8 else "-",
        )
        for count, (index, part) in enumerate(parts)
    ]


def _differences(shown: Shown) -> list[Curve]:
    curves = [Curve(np.array([[at, 0.0] for at in shown.span]), AXIS_GREY, width=0.7)]
    for name in ("reconstructed", "executed"):
        for index, own, human in zip(shown.moving, shown.parts[name], shown.parts["human"], strict=True):
            t = shown.since_pen_down(human.t, index)
            curves.append(Curve(np.c_[t, shown.unit * (own.speed - human.speed)], COLOURS[name], "", 1.3))
    return curves
