"""Strokes, circular arcs run with a lognormal speed, and their vector sum: a human-like movement.

The direction of the velocity turns in proportion to the length already done (Eq. 3), so an isolated stroke is
an exact circular arc, and its position has a closed form, for every bending, the straight line included. A
movement is evaluated for all strokes and all times at once:

    p(t) = A_0 + sum_j D_j F_j sinc(d_j F_j / 2) [cos(d_j (F_j - 1) / 2) c_j + sin(d_j (F_j - 1) / 2) m_j]
    v(t) =       sum_j D_j Lambda_j              [cos(d_j (F_j - 1/2))   c_j + sin(d_j (F_j - 1/2))   m_j]

with A_0 the first target point, D_j the arc length, d_j the arc angle, c_j the chord direction and m_j the
normal in the plane of stroke j. Inner target points are virtual: where strokes overlap the path cuts the
corner. The last one is always reached.

Source: Eq. 1-4, carried to three dimensions by giving each stroke a plane of its own (as iDeLog3D does).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError
from pc_client.movements.lognormal import LiteralTiming, Lognormal, Timing, evaluate_lognormals
from pc_client.movements.trajectory import Motion, Similarity


def sinc(u: ArrayLike) -> Array:
    """sin(u) / u, and 1 at 0 (numpy's sinc has a factor pi in it)."""
    return np.sinc(np.asarray(u, dtype=np.float64) / math.pi)


@dataclass(frozen=True, slots=True)
class Stroke:
    """A stroke in space between two target points that its movement names.

    Attributes:
        arc_angle: how much the direction turns over the whole stroke, rad, in (-2 pi, 2 pi); 0 is a straight
            line.
        tilt: which plane the arc lies in: angle about the chord, rad, from the upright reference plane of
            `arc_frame`.
    """

    timing: Timing
    arc_angle: float = 0.0
    tilt: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.tilt):
            raise MovementError(f"stroke with tilt {self.tilt} rad: give a finite angle")
        _chord_ratio(self.arc_angle)

    def later(self, shift: float) -> Stroke:
        """The same stroke, timed by its parameters, this much (s) later."""
        timing = self.timing.lognormal
        return Stroke(Lognormal(timing.t0 + shift, timing.mu, timing.sigma), self.arc_angle, self.tilt)

    def length(self, a: ArrayLike, b: ArrayLike) -> float:
        """Arc length D (m) of the stroke when it runs from a to b, each (3,), m."""
        return float(np.linalg.norm(np.subtract(b, a))) / _chord_ratio(self.arc_angle)


def arc_frame(a: ArrayLike, b: ArrayLike, tilt: float) -> tuple[Array, Array]:
    """The two unit vectors that span the plane of an arc from a to b.

    Args:
        a: start of the arc, (3,), m.
        b: end of the arc, (3,), m, not the same point.
        tilt: angle about the chord, rad, of the plane. At 0 the second vector points as far upwards (+z) as
            it can; for a vertical chord, as far along +x.

    Returns:
        The chord direction c and the normal m in the plane, each (3,). A stroke with a positive turn swings
        from -m to +m.
    """
    delta = np.subtract(b, a).astype(np.float64)
    distance = float(np.linalg.norm(delta))
    if not (math.isfinite(distance) and distance > 1e-9):
        raise MovementError(
            f"a stroke from {np.asarray(a).tolist()} to {np.asarray(b).tolist()}: its "
            "two target points must be apart"
        )
    chord = delta / distance
    normal = _reference_normal(chord)
    return chord, math.cos(tilt) * normal + math.sin(tilt) * np.cross(chord, normal)


def tilt_of_normal(chord: Array, normal: Array) -> float:
    """The tilt (rad) at which `arc_frame` would give this normal to this chord direction, both (3,)."""
    reference = _reference_normal(chord)
    return math.atan2(float(np.cross(chord, reference) @ normal), float(reference @ normal))


def _reference_normal(chord: Array) -> Array:
    up = np.array([0.0, 0.0, 1.0]) if abs(chord[2]) < 1.0 - 1e-9 else np.array([1.0, 0.0, 0.0])
    normal: Array = up - (up @ chord) * chord
    return normal / float(np.linalg.norm(normal))


def _chord_ratio(arc_angle: float) -> float:
    """Chord over arc length of an arc that turns by `arc_angle` rad."""
    if not (math.isfinite(arc_angle) and abs(arc_angle) < 2.0 * math.pi):
        raise MovementError(
            f"stroke with arc_angle {arc_angle} rad: an arc between two points turns by less than 2 pi"
        )
    return float(sinc(0.5 * arc_angle))


@dataclass(frozen=True, slots=True)
class SigmaLognormal:
    """Strokes between consecutive target points.

    Attributes:
        target_points: (n, 3), m.
        strokes: the n - 1 strokes.
        duration: end of the movement, s; it begins at 0.
    """

    target_points: Array
    strokes: tuple[Stroke, ...]
    duration: float
    _columns: Array = field(init=False, repr=False, compare=False)
    _chords: Array = field(init=False, repr=False, compare=False)
    _normals: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        targets = read_only(self.target_points)
        if targets.shape != (len(self.strokes) + 1, 3) or not self.strokes:
            raise MovementError(
                f"{len(self.strokes)} strokes with target points of shape {targets.shape}: "
                "give n >= 2 target points of x, y, z and n - 1 strokes"
            )
        legs = list(zip(targets[:-1], targets[1:], self.strokes, strict=True))
        frames = [arc_frame(a, b, stroke.tilt) for a, b, stroke in legs]
        columns = []
        for a, b, stroke in legs:
            timing = stroke.timing.lognormal
            columns.append([timing.t0, timing.mu, timing.sigma, stroke.length(a, b), stroke.arc_angle])
        chords, normals = (read_only(vectors) for vectors in zip(*frames, strict=True))
        set_fields(self, target_points=targets, strokes=tuple(self.strokes), _chords=chords, _normals=normals)
        set_fields(self, _columns=read_only(np.transpose(columns)))

    @property
    def lengths(self) -> Array:
        """Arc lengths D of the strokes, m."""
        lengths: Array = self._columns[3]
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

    def stroke_speeds(self, t: ArrayLike) -> Array:
        """Speed of every stroke alone, D_j Lambda_j, (n, n_strokes), m/s."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))[:, None]
        t0, mu, sigma, length, _ = self._columns
        speeds: Array = length * evaluate_lognormals(times, t0, mu, sigma).rate
        return speeds

    def speed_minima(self) -> Array:
        """Times (s) of the speed minimum between the peaks of consecutive strokes, (n_strokes - 1,).

        Where strokes overlap so much that there is no minimum between the two peaks, the end of that interval
        with the lower speed.
        """
        modes = [stroke.timing.lognormal.mode for stroke in self.strokes]
        return np.array([self._speed_minimum(min(a, b), max(a, b)) for a, b in pairwise(modes)])

    def transformed(self, similarity: Similarity) -> SigmaLognormal:
        """Moved, scaled and rotated; the timing, so the shape of the speed, is untouched."""
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


#: Lead of the command before the window of its stroke, in windows. Eq. 9 needs k = (lead + 1) / (lead + 1/2),
#: and the paper states neither. At 1, k is 4/3, sigma .0668, the skewness .20 and the kurtosis 3.07: "close
#: to zero but positive" and "around 3". A stroke of .1 s then has mu = -1.89, which a hand's mu (-2.2 to
#: -1.6) allows; a lead of 1/2 gives -2.29, a lead of 2 gives -1.38.
LEAD = 1.0


def literal_strokes(target_points: ArrayLike, durations: ArrayLike) -> SigmaLognormal:
    """Straight strokes by Eq. 6 to 9 between target points, one after the other.

    The window of a stroke begins where the one before ends, the first at 0; its peak is in the middle, and
    all of its length is done at its end. So the movement all but rests at every target point and reaches it.
    This is the paper's 2.5-D scheme: strokes are designed in a plane, and their speed profiles are run on the
    straight lines between points in space; a bending in the plane is lost.

    Args:
        target_points: (n, 3), m.
        durations: windows of the strokes, (n - 1,), s.

    Source: section II.B, last paragraph.
    """
    legs, windows = leg_lengths(target_points), np.asarray(durations, dtype=np.float64)
    if windows.shape != legs.shape:
        raise MovementError(
            f"{windows.size} stroke durations for {len(legs) + 1} target points: give {len(legs)}"
        )
    edges = np.round(np.concatenate(([0.0], np.cumsum(windows))), 9).tolist()
    strokes = tuple(
        Stroke(LiteralTiming(begin, window, LEAD * window))
        for begin, window in zip(edges[:-1], windows.tolist(), strict=True)
    )
    return SigmaLognormal(np.asarray(target_points, dtype=np.float64), strokes, edges[-1])


def leg_lengths(target_points: ArrayLike) -> Array:
    """Distances (n - 1,), m, between consecutive target points (n, 3), m."""
    lengths: Array = np.linalg.norm(np.diff(np.asarray(target_points, dtype=np.float64), axis=0), axis=1)
    return lengths
