"""The marks of a drawing: what the pen left between coming down and going up, as strokes.

A mark is a part of the recording. Its strokes are taken whole: where the part begins in full motion they
begin before the pen is down, and where it ends so they end after the pen is up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import bisect

from pc_client.errors import MovementError
from pc_client.extraction.extract import Extraction
from pc_client.extraction.recording import PenPart
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.sigma_lognormal import SigmaLognormal

__all__ = ["Mark", "marks_of"]

#: Deviation at which a speed profile is over for every purpose: 1e-9 of its length is left.
_OVER = 6.0
#: Accuracy of times of tails, s.
_TIME_ACCURACY = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """One part of a drawing.

    Attributes:
        begin: when the pen comes down, s.
        end: when it goes up, s; of a dot maybe the same time.
        first: where the strokes begin, (3,): a virtual point; of a dot the dot.
        last: where they end, (3,), likewise.
        trajectory: the strokes on the same time axis, or None for a dot.
    """

    begin: float
    end: float
    first: NDArray[np.float64]
    last: NDArray[np.float64]
    trajectory: SigmaLognormal | None

    def transformed(self, similarity: Similarity) -> Mark:
        """Moved, scaled and rotated; the time is untouched."""
        first, last = similarity.points(np.vstack((self.first, self.last)))
        trajectory = None if self.trajectory is None else self.trajectory.transformed(similarity)
        return Mark(self.begin, self.end, read_only(first), read_only(last), trajectory)

    def length_before(self, lead: float) -> float:
        """Path length that the strokes have done `lead` s before the pen comes down."""
        return self._length(self.begin - lead, done=True)

    def length_after(self, lag: float) -> float:
        """Path length that the strokes have still to do `lag` s after the pen went up."""
        return self._length(self.end + lag, done=False)

    def lead(self, tolerance: float) -> float:
        """How long (s) before the pen comes down the strokes have done no more than a path length."""
        if self.trajectory is None or self.length_before(0.0) <= tolerance:
            return 0.0
        begin = min(s.timing.lognormal.time_at_deviation(-_OVER) for s in self.trajectory.strokes)
        most = self.begin - begin
        if self.length_before(most) > tolerance:
            return most
        return float(bisect(lambda u: self.length_before(u) - tolerance, 0.0, most, xtol=_TIME_ACCURACY))

    def lag(self, tolerance: float) -> float:
        """How long (s) after the pen went up the strokes have still to do more than a path length."""
        if self.trajectory is None or self.length_after(0.0) <= tolerance:
            return 0.0
        end = max(s.timing.lognormal.time_at_deviation(_OVER) for s in self.trajectory.strokes)
        most = end - self.end
        if self.length_after(most) > tolerance:
            return most
        return float(bisect(lambda u: self.length_after(u) - tolerance, 0.0, most, xtol=_TIME_ACCURACY))

    def path(self, tolerance: float, n: int = 801) -> NDArray[np.float64]:
        """The whole path of the strokes, up to a path length at both ends, and its end points; (m, 3)."""
        ends = np.vstack((self.first, self.last))
        if self.trajectory is None:
            return ends
        t = np.linspace(self.begin - self.lead(tolerance), self.end + self.lag(tolerance), n)
        return np.vstack((ends, self.trajectory.evaluate(t).p))

    def _length(self, t: float, *, done: bool) -> float:
        if self.trajectory is None:
            return 0.0
        shares = [float(stroke.timing.lognormal.evaluate(t).done) for stroke in self.trajectory.strokes]
        return math.fsum(
            length * (share if done else 1.0 - share)
            for length, share in zip(self.trajectory.lengths.tolist(), shares, strict=True)
        )


def marks_of(extraction: Extraction) -> tuple[Mark, ...]:
    """The marks of a drawing in order of time, in the recording's frame, unit and time.

    Raises:
        MovementError: nothing in it moves.
    """
    if not extraction.parts:
        raise MovementError(
            f"{extraction.name}: holds no movement, only dots; give a drawing with a line in it"
        )
    marks = [
        Mark(
            float(part.t[0]),
            float(part.t[-1]),
            part.trajectory.target_points[0],
            part.trajectory.target_points[-1],
            part.trajectory,
        )
        for part in extraction.parts
    ]
    marks += [_dot(part) for part in extraction.still]
    return tuple(sorted(marks, key=lambda mark: mark.begin))


def _dot(part: PenPart) -> Mark:
    point = np.zeros(3)
    point[: part.p.shape[1]] = part.p.mean(axis=0)
    return Mark(float(part.t[0]), float(part.t[-1]), read_only(point), read_only(point), None)
