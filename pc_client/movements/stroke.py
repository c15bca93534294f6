"""The path of a stroke: circular arcs in the plane and in space, run with a lognormal speed.

The direction of the velocity turns in proportion to the length already done (Eq. 3), so an isolated stroke is
an exact circular arc, and its position has a closed form. All forms used here hold for every bending, the
straight line included. `sigma_lognormal.py` adds several strokes up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import MovementError
from pc_client.movements.timing import Timing

__all__ = ["Motion", "PlanarStroke", "Stroke", "arc_frame", "lift_strokes", "sinc", "tilt_of_normal"]


class Motion(NamedTuple):
    """Position (m), velocity (m/s) and acceleration (m/s^2), each (n, 2) or (n, 3)."""

    p: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]


def sinc(u: ArrayLike) -> NDArray[np.float64]:
    """sin(u) / u, and 1 at 0 (numpy's sinc has a factor pi in it)."""
    value: NDArray[np.float64] = np.sinc(np.asarray(u, dtype=np.float64) / math.pi)
    return value


@dataclass(frozen=True, slots=True)
class PlanarStroke:
    """A stroke in the plane, in the variables of the paper.

    Attributes:
        timing: when.
        length: D, arc length of the stroke, m.
        theta_start: direction of the velocity at the start, rad.
        theta_end: direction of the velocity at the end, rad.
    """

    timing: Timing
    length: float
    theta_start: float
    theta_end: float

    @classmethod
    def between(
        cls, a: Sequence[float], b: Sequence[float], timing: Timing, arc_angle: float = 0.0
    ) -> PlanarStroke:
        """The stroke from a to b, each (2,), m, that turns by `arc_angle` rad (positive: left)."""
        dx, dy = float(b[0]) - float(a[0]), float(b[1]) - float(a[1])
        chord_direction = math.atan2(dy, dx)
        length = math.hypot(dx, dy) / _chord_ratio(arc_angle)
        return cls(timing, length, chord_direction - 0.5 * arc_angle, chord_direction + 0.5 * arc_angle)

    def evaluate(self, t: ArrayLike) -> Motion:
        """Displacement from the start, velocity and acceleration at the times t (n,), s; each (n, 2)."""
        lognormal = self.timing.lognormal.evaluate(np.atleast_1d(np.asarray(t, dtype=np.float64)))
        d = self.theta_end - self.theta_start
        half = 0.5 * d * lognormal.done
        along = self.theta_start + half
        phi = self.theta_start + d * lognormal.done
        chord = self.length * lognormal.done * sinc(half)
        tangent = np.column_stack((np.cos(phi), np.sin(phi)))
        normal = np.column_stack((-np.sin(phi), np.cos(phi)))
        return Motion(
            chord[:, None] * np.column_stack((np.cos(along), np.sin(along))),
            self.length * lognormal.rate[:, None] * tangent,
            self.length
            * (lognormal.rate_change[:, None] * tangent + d * (lognormal.rate**2)[:, None] * normal),
        )


@dataclass(frozen=True, slots=True)
class Stroke:
    """A stroke in space between two target points that its movement names.

    Attributes:
        timing: when.
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

    def length(self, a: ArrayLike, b: ArrayLike) -> float:
        """Arc length D (m) of the stroke when it runs from a to b, each (3,), m."""
        return float(np.linalg.norm(np.subtract(b, a))) / _chord_ratio(self.arc_angle)


def arc_frame(a: ArrayLike, b: ArrayLike, tilt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def tilt_of_normal(chord: NDArray[np.float64], normal: NDArray[np.float64]) -> float:
    """The tilt (rad) at which `arc_frame` would give this normal to this chord direction, both (3,)."""
    reference = _reference_normal(chord)
    return math.atan2(float(np.cross(chord, reference) @ normal), float(reference @ normal))


def lift_strokes(planar: Sequence[PlanarStroke]) -> tuple[Stroke, ...]:
    """The paper's 2.5-D scheme: the speed profile of strokes designed in a plane, on straight lines in space.

    Each stroke keeps its timing; its length becomes the distance of the two 3-D target points it is given,
    its bending is lost, as in the paper. Where strokes overlap their velocities add up as vectors, so
    corners are rounded and the movement can be executed; where they do not, the path is the polyline itself.

    Source: section II.B, last paragraph.
    """
    return tuple(Stroke(stroke.timing) for stroke in planar)


def _reference_normal(chord: NDArray[np.float64]) -> NDArray[np.float64]:
    up = np.array([0.0, 0.0, 1.0]) if abs(chord[2]) < 1.0 - 1e-9 else np.array([1.0, 0.0, 0.0])
    normal: NDArray[np.float64] = up - (up @ chord) * chord
    return normal / float(np.linalg.norm(normal))


def _chord_ratio(arc_angle: float) -> float:
    """Chord over arc length of an arc that turns by `arc_angle` rad."""
    if not (math.isfinite(arc_angle) and abs(arc_angle) < 2.0 * math.pi):
        raise MovementError(
            f"stroke with arc_angle {arc_angle} rad: an arc between two points turns by less than 2 pi"
        )
    return float(sinc(0.5 * arc_angle))
