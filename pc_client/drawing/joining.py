"""All marks of a drawing in one movement, with the pen lifted between them.

Strokes of marks and of lifts add up alike, so all stand in one chain of target points:

    lowered pen   one stroke from above the start of the first mark
    mark 1        its own strokes
    pen-up move   two strokes over a via point above the sheet, to the start of mark 2, overlapping in time
    mark 2 ...
    lifted pen    one stroke to above the end of the last mark

Each mark keeps its strokes, shape and timing. Only the gaps between marks may become longer: where a tail
of a mark's strokes would reach into its neighbour, or where a pen-up move needs more time. Strokes of lifts
lie in the gaps but for `TAIL` of their length at either end; `TAIL` of the drawing's size is also what a mark
may move while its neighbour is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from pc_client.drawing.marks import Mark
from pc_client.movements.geometry import read_only
from pc_client.movements.lognormal import Lognormal
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.stroke import Stroke
from pc_client.movements.timing import TwoSidedTiming

__all__ = ["TAIL", "Joined", "join", "least_gaps"]

#: Share of a lift's length outside its gap, and of the drawing's size that a mark moves beside its
#: neighbours.
TAIL = 1e-3
#: Share of the drawing's size that may be left to do before the movement begins and after it ends.
_REST = 1e-4
#: Least time, s of the hand, to lower the pen at the start and to lift it at the end.
_LOWERING_S = 0.4
#: Least time, s of the hand, between two marks.
_LEAST_GAP_S = 0.1
#: Of each of the two strokes of a pen-up move, as a share of the gap: they overlap in its middle.
_PEN_UP_SHARE = 0.7
#: Sigma of the lognormals of lifts; people show .1 to .35 in reaches.
_LIFT_SIGMA = 0.15

_COVERAGE = -float(ndtri(TAIL))


@dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """Marks and lifts in one movement.

    Attributes:
        trajectory: all strokes; the movement begins at 0 at rest, the pen lifted.
        gaps: (n_marks + 1,), s: before the first mark, between the marks, after the last.
        shifts: (n_marks,), s: time of the movement less time of the recording, for each mark.
        pen_down: (n_marks, 2), s: when in the movement the pen comes down and goes up.
    """

    trajectory: SigmaLognormal
    gaps: NDArray[np.float64]
    shifts: NDArray[np.float64]
    pen_down: NDArray[np.float64]

    def gap_intervals(self) -> list[tuple[float, float]]:
        """Start and end (s) of each gap."""
        edges = [0.0, *self.pen_down.ravel().tolist(), self.trajectory.duration]
        return list(zip(edges[::2], edges[1::2], strict=True))


def least_gaps(marks: Sequence[Mark], size: float) -> NDArray[np.float64]:
    """The gaps that the recording has, or longer where strokes need it; (n_marks + 1,), s.

    Args:
        marks: in order of time.
        size: of the drawing, in the unit of the marks: tails are judged by it.
    """
    first, last = marks[0], marks[-1]
    between = [
        max(b.begin - a.end, a.lag(TAIL * size), b.lead(TAIL * size), _LEAST_GAP_S)
        for a, b in pairwise(marks)
    ]
    before, after = first.lead(_REST * size), last.lag(_REST * size)
    return np.array([max(before, _LOWERING_S), *between, max(after, _LOWERING_S)])


def join(marks: Sequence[Mark], gaps: NDArray[np.float64], lift: NDArray[np.float64]) -> Joined:
    """Join marks, in the frame of the arm, with the pen lifted between them.

    Args:
        marks: in order of time, m, on the recording's time axis.
        gaps: (n_marks + 1,), s.
        lift: from the sheet to the lifted pen, (3,), m.
    """
    downs = np.empty((len(marks), 2))
    now = 0.0
    for row, (gap, mark) in enumerate(zip(gaps[:-1], marks, strict=True)):
        downs[row] = now + gap, now + gap + mark.end - mark.begin
        now = float(downs[row, 1])
    shifts = downs[:, 0] - np.array([mark.begin for mark in marks])

    targets, strokes = [marks[0].first + lift], [_lift_stroke(0.0, float(gaps[0]))]
    for row, mark in enumerate(marks):
        targets.append(mark.first)
        if mark.trajectory is not None:
            targets += list(mark.trajectory.target_points[1:])
            strokes += [_later(stroke, float(shifts[row])) for stroke in mark.trajectory.strokes]
        up, gap = float(downs[row, 1]), float(gaps[row + 1])
        if row + 1 < len(marks):
            targets.append(0.5 * (mark.last + marks[row + 1].first) + lift / _pen_up_height())
            share = _PEN_UP_SHARE * gap
            strokes += [_lift_stroke(up, share), _lift_stroke(up + gap - share, share)]
        else:
            targets.append(mark.last + lift)
            strokes.append(_lift_stroke(up, gap))
    trajectory = SigmaLognormal(np.array(targets), tuple(strokes), now + float(gaps[-1]))
    return Joined(trajectory, read_only(gaps), read_only(shifts), read_only(downs))


def _lift_stroke(start: float, duration: float) -> Stroke:
    return Stroke(TwoSidedTiming(start, duration, _LIFT_SIGMA, _COVERAGE))


def _later(stroke: Stroke, shift: float) -> Stroke:
    lognormal = stroke.timing.lognormal
    return Stroke(
        Lognormal(lognormal.t0 + shift, lognormal.mu, lognormal.sigma), stroke.arc_angle, stroke.tilt
    )


@lru_cache(maxsize=1)
def _pen_up_height() -> float:
    """Height of a pen-up move over that of its via point: its two strokes cut the corner there."""
    t = np.linspace(0.0, 1.0, 20001)
    up = _lift_stroke(0.0, _PEN_UP_SHARE).timing.lognormal.evaluate(t).done
    down = _lift_stroke(1.0 - _PEN_UP_SHARE, _PEN_UP_SHARE).timing.lognormal.evaluate(t).done
    return float((up - down).max())
