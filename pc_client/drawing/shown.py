"""What the pictures of a drawing are made of, in one frame and one time.

Millimetres on the sheet, x to the right and y up as the person saw it, and seconds of the hand. Each of the
four signals has its colour on the whole page.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pc_client.analysis.figures import BLUE, GREEN, RED
from pc_client.drawing.drawing import Drawing
from pc_client.drawing.execution import Execution
from pc_client.drawing.judgement import Signal, Verdict, signals

__all__ = ["AIR", "COLOURS", "Shown", "pen_is_down", "shade_pen_down"]

#: Colour of each signal; names as of `judgement.signals`.
COLOURS = {"human": "#3A3A3A", "reconstructed": BLUE, "planned": GREEN, "executed": RED}
#: Colour of what the pen does in the air.
AIR = "#A8A8A8"

_PEN_DOWN = "#F4F1EA"


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What the pictures of a drawing are made of.

    Attributes:
        drawing: the drawing.
        execution: the run that is shown.
        verdict: its figures.
        parts: the four signals, each with the parts that move.
    """

    drawing: Drawing
    execution: Execution
    verdict: Verdict
    parts: dict[str, tuple[Signal, ...]]

    @classmethod
    def of(cls, drawing: Drawing, execution: Execution, verdict: Verdict) -> Shown:
        """Take the signals of a drawing and a run."""
        return cls(drawing, execution, verdict, signals(drawing, execution))

    @property
    def unit(self) -> float:
        """Millimetres on the sheet per unit of the recording."""
        return 1e3 * self.drawing.placement.similarity.scale

    @property
    def moving(self) -> list[int]:
        """Indices of the marks that move."""
        return [index for index, mark in enumerate(self.drawing.marks) if mark.trajectory is not None]

    def on_page(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) in the recording's frame, on the page: (n, 2), mm, from the middle of the drawing."""
        drawn = self.drawing.drawn
        middle = 0.5 * (drawn.min(axis=0) + drawn.max(axis=0))
        if self.drawing.flat:
            axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 if self.drawing.placement.y_up else -1.0, 0.0]])
        else:
            axes = np.linalg.svd(drawn - drawn.mean(axis=0), full_matrices=False)[2][:2]
        page: NDArray[np.float64] = self.unit * (p - middle) @ axes.T
        return page

    def since_pen_down(self, t: NDArray[np.float64], mark: int) -> NDArray[np.float64]:
        """Times of the recording that belong to a mark, as s of the hand since the pen first came down."""
        joined = self.drawing.joined
        since: NDArray[np.float64] = t + joined.shifts[mark] - joined.pen_down[0, 0]
        return since


def pen_is_down(t: NDArray[np.float64], pen_down: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the pen is down at times (n,), by the times (n_marks, 2) when it comes down and goes up."""
    down: NDArray[np.bool_] = np.any((t[:, None] >= pen_down[:, 0]) & (t[:, None] <= pen_down[:, 1]), axis=1)
    return down


def shade_pen_down(axes: Axes, shown: Shown) -> None:
    """Shade the times when the pen is down; the axes show s of the hand since it first came down."""
    joined = shown.drawing.joined
    for begin, end in joined.pen_down - joined.pen_down[0, 0]:
        axes.axvspan(begin, max(end, begin + 0.012), color=_PEN_DOWN, lw=0, zorder=0)
