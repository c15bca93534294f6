"""What the pictures of a drawing are made of, in one frame and one time.

Millimetres on the sheet, x to the right and y up as the person saw it, and seconds of the hand. Each of the
four signals has its colour on the whole page.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.drawing.drawing import Drawing
from pc_client.drawing.execution import Execution
from pc_client.drawing.judgement import Signal, Verdict, signals
from pc_client.results.theme import BLUE, GREEN, RED

__all__ = ["AIR", "COLOURS", "LETTERS", "SHEET_WIDTH", "Array", "Shown", "pen_is_down"]

Array = NDArray[np.float64]

#: Colour of each signal; names as of `judgement.signals`.
COLOURS = {"human": "#3A3A3A", "reconstructed": BLUE, "planned": GREEN, "executed": RED}
#: Colour of what the pen does in the air.
AIR = "#A8A8A8"
#: The figures are shown to audiences: letters [points] for a width [inches].
LETTERS, SHEET_WIDTH = 11.0, 12.0


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

    @property
    def mark(self) -> str:
        """What the data are, as it stands on every figure."""
        return self.execution.run.provenance.origin.mark

    @property
    def dots(self) -> list[Array]:
        """The marks that do not move, (1, 3) each, in the recording's frame."""
        return [mark.first[None] for mark in self.drawing.marks if mark.trajectory is None]

    @property
    def start(self) -> float:
        """When the pen first comes down, s of the hand since the movement began."""
        return float(self.drawing.joined.pen_down[0, 0])

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the movement, s of the hand since the pen first came down."""
        return -self.start, self.drawing.joined.trajectory.duration - self.start

    @property
    def pen_down(self) -> Array:
        """(n_marks, 2): when the pen comes down and goes up, s of the hand since it first came down."""
        times = self.drawing.joined.pen_down - self.start
        return np.column_stack((times[:, 0], np.maximum(times[:, 1], times[:, 0] + 0.012)))

    def whole(self, *, executed: bool) -> tuple[Array, Array, Array]:
        """Times (n,), positions, velocities (n, 3) of all, lifts too: base frame, s of the hand."""
        if executed:
            return self.execution.t, self.execution.p, self.execution.v
        t = np.linspace(0.0, self.drawing.joined.trajectory.duration, 1500)
        motion = self.drawing.joined.trajectory.evaluate(t)
        return t, motion.p, motion.v

    def on_page(self, p: Array) -> Array:
        """Points (n, 3) in the recording's frame, on the page: (n, 2), mm, from the middle of the drawing."""
        drawn = self.drawing.drawn
        middle = 0.5 * (drawn.min(axis=0) + drawn.max(axis=0))
        if self.drawing.flat:
            axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0 if self.drawing.placement.y_up else -1.0, 0.0]])
        else:
            axes = np.linalg.svd(drawn - drawn.mean(axis=0), full_matrices=False)[2][:2]
        page: Array = self.unit * (p - middle) @ axes.T
        return page

    def since_pen_down(self, t: Array, mark: int) -> Array:
        """Times of the recording that belong to a mark, as s of the hand since the pen first came down."""
        joined = self.drawing.joined
        since: Array = t + joined.shifts[mark] - joined.pen_down[0, 0]
        return since


def pen_is_down(t: Array, pen_down: Array) -> NDArray[np.bool_]:
    """Whether the pen is down at times (n,), by the times (n_marks, 2) when it comes down and goes up."""
    down: NDArray[np.bool_] = np.any((t[:, None] >= pen_down[:, 0]) & (t[:, None] <= pen_down[:, 1]), axis=1)
    return down
