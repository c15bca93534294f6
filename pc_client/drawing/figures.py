"""What a drawing shows: its paths, its movement in space, its speed profiles.

Each of the four signals has its colour on the whole page. Letters are larger than elsewhere: these figures
are shown to audiences.
"""

from __future__ import annotations

import numpy as np

from pc_client.drawing.shown import AIR, COLOURS, LETTERS, SHEET_WIDTH, Array, Shown, pen_is_down
from pc_client.drawing.speed_figure import speeds_sheet
from pc_client.results.panels import Box, Curve, Panel, Sheet, boxes, cube_around
from pc_client.results.theme import SKY

__all__ = ["FIGURES", "sheets_of"]

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
_FAINT, _PAPER_EDGE = "#D9D9D9", "#C9B37E"


def sheets_of(shown: Shown) -> dict[str, Sheet]:
    """The figures of a drawing by name, as `FIGURES` names them."""
    return {"paths": _paths_sheet(shown), "speeds": speeds_sheet(shown), "space": _space_sheet(shown)}


def _paths_sheet(shown: Shown) -> Sheet:
    """The four paths side by side: human, reconstructed, planned, executed."""
    half = _half_width(shown)
    # A path in space is shown from where it is widest.
    across, up = ("x [mm]", "y [mm]") if shown.drawing.flat else ("widest [mm]", "second widest [mm]")
    targets = np.abs(shown.on_page(_targets(shown))).max(axis=1)
    outside = f"; targets outside: {n}" if (n := int(np.count_nonzero(targets > half))) else ""
    titles = {
        "human": ("human", across),
        "reconstructed": (
            f"reconstructed, {shown.drawing.extraction.n_strokes} strokes",
            f"{across}{outside}",
        ),
        "planned": ("planned, with lifts", across),
        "executed": ("executed", across),
    }
    height = 3.75
    places = boxes((SHEET_WIDTH, height), [1] * 4, [1], margins=(0.7, 0.2, 0.6, 0.6), gaps=(0.3, 0.0))[0]
    page = ((-half, half), (-half, half))
    panels = [
        Panel(
            box,
            _paths(shown, name, half),
            title,
            (label, "" if index else up),
            page,
            equal=True,
            texts=_numbers(shown, half) if name == "human" else (),
        )
        for index, (box, (name, (title, label))) in enumerate(zip(places, titles.items(), strict=True))
    ]
    return Sheet(height, panels, shown.mark, "", SHEET_WIDTH, LETTERS)


def _paths(shown: Shown, name: str, half: float) -> list[Curve]:
    """One of the four paths, over that of the person."""
    curves, colour = [], COLOURS[name]
    if name in ("planned", "executed"):
        curves.append(Curve(_air(shown, executed=name == "executed"), AIR, style="--"))
    if name != "human":
        curves += [Curve(shown.on_page(part.p), _FAINT, width=5.0) for part in shown.parts["human"]]
    for part in shown.parts[name]:
        p = shown.on_page(part.p)
        curves.append(Curve(p, colour, width=2.0))
        if name == "human":
            curves += [Curve(p[:1], colour, width=0.0, marker="o"), Curve(_arrow(p, half), colour, width=2.0)]
    if name == "reconstructed":
        for extracted in shown.drawing.extraction.parts:
            targets = shown.on_page(extracted.trajectory.target_points)
            curves += [
                Curve(targets, SKY, width=0.7),
                Curve(targets, colour, width=0.0, marker="o", size=3.6, hollow=True),
            ]
    curves += [Curve(shown.on_page(dot), colour, width=0.0, marker="o") for dot in shown.dots]
    return curves


def _arrow(p: Array, half: float) -> Array:
    """The head (3, 2) of an arrow in the middle of a path (n, 2)."""
    middle = len(p) // 2
    ahead = p[min(middle + max(1, len(p) // 20), len(p) - 1)]
    along = ahead - p[middle]
    along = 0.07 * half * along / max(1e-9, float(np.linalg.norm(along)))
    aside = 0.5 * np.array([-along[1], along[0]])
    return np.array([ahead - along + aside, ahead, ahead - along - aside])


def _numbers(shown: Shown, half: float) -> list[tuple[Array, str]]:
    """The order of the marks, where there are several, beside their starts."""
    marks = shown.drawing.marks
    begins = dict(
        zip(shown.moving, (part.p[: 1 + len(part.p) // 8] for part in shown.parts["human"]), strict=True)
    )
    numbers = []
    for index, mark in enumerate(marks if len(marks) > 1 else ()):
        path = shown.on_page(begins.get(index, mark.first[None]))
        away = path[0] - path[-1]
        length = float(np.linalg.norm(away))
        numbers.append((path[0] + (0.11 * half * away / length if length else 0.0), str(index + 1)))
    return numbers


def _half_width(shown: Shown) -> float:
    """Half the width (mm) of a square page that holds the drawing and the near virtual targets."""
    paths = [shown.on_page(part.p) for parts in shown.parts.values() for part in parts]
    reach = float(np.abs(np.vstack([*paths, shown.on_page(shown.drawing.drawn)])).max())
    targets = np.abs(shown.on_page(_targets(shown))).max(axis=1)
    near = targets[targets <= (1.0 + _FAR) * reach]
    return 1.1 * max(reach, float(near.max(initial=0.0)))


def _targets(shown: Shown) -> Array:
    return np.vstack([part.trajectory.target_points for part in shown.drawing.extraction.parts])


def _air(shown: Shown, *, executed: bool) -> Array:
    """The whole path on the page, with gaps (nan) where the pen is down; (n, 2), mm."""
    t, p, _ = shown.whole(executed=executed)
    page = shown.on_page(shown.drawing.points_back(p))
    page[pen_is_down(t, shown.drawing.joined.pen_down)] = np.nan
    return page


def _space_sheet(shown: Shown) -> Sheet:
    """The movement in the base frame, with its lifts; and the height of the pen over the sheet."""
    height = 4.7
    left, right = boxes(
        (SHEET_WIDTH, height), (1.0, 0.85), (1,), margins=(0.3, 0.2, 0.55, 0.65), gaps=(1.1, 0.0)
    )[0]
    return Sheet(height, (_space(left, shown), _height(right, shown)), shown.mark, "", SHEET_WIDTH, LETTERS)


def _space(box: Box, shown: Shown) -> Panel:
    t, p, _ = shown.whole(executed=False)
    p, done = 1e3 * p, 1e3 * shown.execution.p
    down = pen_is_down(t, shown.drawing.joined.pen_down)[:, None]
    similarity = shown.drawing.placement.similarity
    curves = [
        Curve(np.where(down, np.nan, p), AIR, "pen lifted", 1.4, "--"),
        Curve(np.where(down, p, np.nan), COLOURS["planned"], "planned", 3.6, opacity=0.5),
        Curve(done, COLOURS["executed"], "executed", 1.1),
        *(
            Curve(1e3 * similarity.points(dot), COLOURS["planned"], width=0.0, marker="o")
            for dot in shown.dots
        ),
        Curve(p[:1], "#000000", width=0.0, marker="o", hollow=True),
    ]
    if shown.drawing.flat:
        curves.append(Curve(_sheet(shown), _PAPER_EDGE))
    return Panel(
        box,
        curves,
        "",
        ("x [mm]", "y [mm]", "z [mm]"),
        cube_around(np.vstack([curve.points for curve in curves]), least=0.35, margin=0.1),
        "above",
        texts=((p[0], "begin"),),
        zoom=1.3,
        view=_VIEWS.get(shown.drawing.placement.plane, (24.0, -60.0)),
    )


def _sheet(shown: Shown) -> Array:
    """Outline of the sheet, (5, 3), mm, base frame: around what is drawn, with a margin."""
    drawn = shown.drawing.drawn
    margin = 0.12 * float(np.ptp(drawn, axis=0).max())
    (x0, y0), (x1, y1) = drawn.min(axis=0)[:2] - margin, drawn.max(axis=0)[:2] + margin
    flat = np.array([(x, y, 0.0) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))])
    return 1e3 * shown.drawing.placement.similarity.points(flat)


def _height(box: Box, shown: Shown) -> Panel:
    placement = shown.drawing.placement
    if shown.drawing.flat:
        out = placement.lift / float(np.linalg.norm(placement.lift))
        zero, title = float(placement.similarity.shift @ out), "height of the pen over the sheet"
    else:
        out, zero, title = np.array([0.0, 0.0, 1.0]), 0.0, "height of the pen, z of the base frame"
    curves = []
    for name, width, opacity in (("planned", 4.0, 0.5), ("executed", 1.4, 1.0)):
        t, p, _ = shown.whole(executed=name == "executed")
        curves.append(
            Curve(np.c_[t - shown.start, 1e3 * (p @ out - zero)], COLOURS[name], name, width, opacity=opacity)
        )
    return Panel(
        box,
        curves,
        title,
        ("time of the hand [s]; shaded: pen down", "mm"),
        (shown.span, (None, None)),
        "inside",
        shaded=shown.pen_down,
    )
