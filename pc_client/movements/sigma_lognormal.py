"""A human-like movement: the vector sum of lognormal strokes that overlap in time.

Everything is closed form and evaluated for all strokes and all times at once:

    p(t) = A_0 + sum_j D_j F_j sinc(d_j F_j / 2) [cos(d_j (F_j - 1) / 2) c_j + sin(d_j (F_j - 1) / 2) m_j]
    v(t) =       sum_j D_j Lambda_j              [cos(d_j (F_j - 1/2))   c_j + sin(d_j (F_j - 1/2))   m_j]

with A_0 the first target point, D_j the arc length, d_j the arc angle, c_j the chord direction and m_j the
normal in the plane of stroke j. Inner target points are virtual: where strokes overlap the path cuts the
corner. The last one is always reached.

Source: Eq. 1-4, carried to three dimensions by giving each stroke a plane of its own (as iDeLog3D does).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from pc_client.errors import MovementError
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.lognormal import evaluate_lognormals
from pc_client.movements.stroke import Motion, PlanarStroke, Stroke, arc_frame, sinc, tilt_of_normal

__all__ = ["SigmaLognormal", "planar_sum"]


@dataclass(frozen=True, slots=True)
class SigmaLognormal:
    """Strokes between consecutive target points.

    Attributes:
        target_points: (n, 3), m.
        strokes: the n - 1 strokes.
        duration: end of the movement, s; it begins at 0.
    """

    target_points: NDArray[np.float64]
    strokes: tuple[Stroke, ...]
    duration: float
    _columns: NDArray[np.float64] = field(init=False, repr=False, compare=False)
    _chords: NDArray[np.float64] = field(init=False, repr=False, compare=False)
    _normals: NDArray[np.float64] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        targets = read_only(self.target_points)
        if (
            targets.ndim != 2
            or targets.shape[1] != 3
            or len(targets) != len(self.strokes) + 1
            or len(targets) < 2
        ):
            raise MovementError(
                f"{len(self.strokes)} strokes with target points of shape {targets.shape}: "
                "give n >= 2 target points of x, y, z and n - 1 strokes"
            )
        frames = [
            arc_frame(a, b, s.tilt) for a, b, s in zip(targets[:-1], targets[1:], self.strokes, strict=True)
        ]
        lognormals = [stroke.timing.lognormal for stroke in self.strokes]
        lengths = [s.length(a, b) for a, b, s in zip(targets[:-1], targets[1:], self.strokes, strict=True)]
        columns = [
            [b.t0, b.mu, b.sigma, d, s.arc_angle]
            for b, d, s in zip(lognormals, lengths, self.strokes, strict=True)
        ]
        object.__setattr__(self, "target_points", targets)
        object.__setattr__(self, "strokes", tuple(self.strokes))
        object.__setattr__(self, "_columns", read_only(np.transpose(columns)))
        object.__setattr__(self, "_chords", read_only([c for c, _ in frames]))
        object.__setattr__(self, "_normals", read_only([m for _, m in frames]))

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Arc lengths D of the strokes, m."""
        lengths: NDArray[np.float64] = self._columns[3]
        return lengths

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))[:, None]
        t0, mu, sigma, length, arc_angle = self._columns
        lognormal = evaluate_lognormals(times, t0, mu, sigma)
        chord = length * lognormal.done * sinc(0.5 * arc_angle * lognormal.done)
        half_angle = 0.5 * arc_angle * (lognormal.done - 1.0)
        angle = arc_angle * (lognormal.done - 0.5)
        cos, sin = np.cos(angle), np.sin(angle)
        speed = length * lognormal.rate
        along, across = length * lognormal.rate_change, length * arc_angle * lognormal.rate**2
        c, m = self._chords, self._normals
        return Motion(
            self.target_points[0] + (chord * np.cos(half_angle)) @ c + (chord * np.sin(half_angle)) @ m,
            (speed * cos) @ c + (speed * sin) @ m,
            (along * cos - across * sin) @ c + (along * sin + across * cos) @ m,
        )

    def stroke_speeds(self, t: ArrayLike) -> NDArray[np.float64]:
        """Speed of every stroke alone, D_j Lambda_j, (n, n_strokes), m/s."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))[:, None]
        t0, mu, sigma, length, _ = self._columns
        speeds: NDArray[np.float64] = length * evaluate_lognormals(times, t0, mu, sigma).rate
        return speeds

    def speed_minima(self) -> NDArray[np.float64]:
        """Times (s) of the speed minimum between the peaks of consecutive strokes, (n_strokes - 1,).

        Where strokes overlap so much that there is no minimum between the two peaks, the end of that interval
        with the lower speed.
        """
        modes = [stroke.timing.lognormal.mode for stroke in self.strokes]
        return np.array([self._speed_minimum(min(a, b), max(a, b)) for a, b in pairwise(modes)])

    def transformed(self, similarity: Similarity) -> SigmaLognormal:
        """The movement moved, scaled and rotated; its timing, so the shape of its speed, is untouched."""
        normals = self._normals @ similarity.R.T
        chords = self._chords @ similarity.R.T
        strokes = tuple(
            Stroke(stroke.timing, stroke.arc_angle, tilt_of_normal(chord, normal))
            for stroke, chord, normal in zip(self.strokes, chords, normals, strict=True)
        )
        return SigmaLognormal(similarity.points(self.target_points), strokes, self.duration)

    def stretched(self, factor: float) -> SigmaLognormal:
        """`factor` times as slow: t0 -> factor t0, mu -> mu + ln factor, sigma and angles kept."""
        strokes = tuple(Stroke(s.timing.stretched(factor), s.arc_angle, s.tilt) for s in self.strokes)
        return SigmaLognormal(self.target_points, strokes, self.duration * factor)

    def _speed_minimum(self, begin: float, end: float) -> float:
        grid = np.linspace(begin, end, 401)
        motion = self.evaluate(grid)
        least = int(np.argmin(np.einsum("ij,ij->i", motion.v, motion.v)))
        if least in (0, len(grid) - 1):
            return float(grid[least])

        def slope(t: float) -> float:
            at = self.evaluate(t)
            return float(at.v[0] @ at.a[0])

        low, high = float(grid[least - 1]), float(grid[least + 1])
        if slope(low) >= 0.0 or slope(high) <= 0.0:
            return float(grid[least])
        return float(brentq(slope, low, high, xtol=1e-12))


def planar_sum(strokes: Sequence[PlanarStroke], t: ArrayLike, start: Sequence[float] = (0.0, 0.0)) -> Motion:
    """The movement in the plane: position, velocity and acceleration at the times t (n,), s; each (n, 2).

    Args:
        strokes: at least one.
        t: times, s.
        start: where the first stroke begins, (2,), m.

    Source: Eq. 1 and 3, with one D.
    """
    if not strokes:
        raise MovementError("a movement of no strokes: give at least one")
    motions = [stroke.evaluate(t) for stroke in strokes]
    return Motion(
        np.asarray(start, dtype=np.float64) + np.sum([motion.p for motion in motions], axis=0),
        np.sum([motion.v for motion in motions], axis=0),
        np.sum([motion.a for motion in motions], axis=0),
    )
