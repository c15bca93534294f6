"""The pictures of a drawing as SVG texts, in the report's style with larger letters. Loads matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from pc_client.analysis.figures import svg_figure
from pc_client.drawing.path_figure import fill_paths
from pc_client.drawing.shown import Shown
from pc_client.drawing.space_figure import fill_space
from pc_client.drawing.speed_figure import fill_speeds

__all__ = ["FIGURES", "draw"]

_LARGER = {
    "font.size": 11.0,
    "axes.labelsize": 11.0,
    "axes.titlesize": 12.0,
    "legend.fontsize": 10.0,
    "xtick.labelsize": 10.0,
    "ytick.labelsize": 10.0,
}

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
        with _talk_figure(size, shown.execution.run.provenance.origin.mark) as (figure, page):
            fill(figure, shown)
        pictures[name] = page.getvalue()
    return pictures


@contextmanager
def _talk_figure(size: tuple[float, float], mark: str) -> Iterator[tuple[Figure, Any]]:
    """The report's style with letters that the last row of a lecture hall can read."""
    with svg_figure(*size, mark) as (figure, page), mpl.rc_context(_LARGER):
        yield figure, page
