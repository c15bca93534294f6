"""A robot-like movement: constant speed on every stroke, smoothed to ramps, along straight lines.

The speed is a square wave convolved with one boxcar (trapezoids) or two (S-curves). Length, speed and
acceleration are piecewise polynomials written down in closed form; the convolution has area 1, so the length
of every stroke is kept exactly.

The path has sharp corners or blended ones. A blend is a pair of clothoids: the curvature grows in proportion
to the path length from 0 to its top in the middle of the corner and falls to 0 again, so that a robot that
passes it at a steady speed meets no jump of acceleration. Positions are Fresnel integrals of the arc length:
exact, and no table to interpolate.

Source: section II.C; a square wave of the levels l_j / T_j, "smoothed with realistic aspect".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fresnel

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError
from pc_client.movements.trajectory import Motion, Similarity

#: Below this turn (rad) two lines are one: no blend is built.
_STRAIGHT = 1e-6
#: A corner sharper than this (rad) cannot be blended: the path would come back on itself.
_REVERSAL = math.radians(170.0)


class PathPoints(NamedTuple):
    """Points of a path: position (m), unit tangent and curvature vector dT/ds (1/m), each (n, 3)."""

    p: Array
    tangent: Array
    curvature: Array


@dataclass(frozen=True, slots=True)
class _Line:
    start: Array
    direction: Array
    length: float

    def at(self, s: Array) -> PathPoints:
        tangent = np.broadcast_to(self.direction, (len(s), 3))
        return PathPoints(self.start + s[:, None] * self.direction, tangent, np.zeros((len(s), 3)))


@dataclass(frozen=True, slots=True)
class _Blend:
    """Two clothoids from `start` along `t_in` to `end` along `t_out`."""

    start: Array
    end: Array
    t_in: Array
    t_out: Array
    turn: float
    length: float

    def at(self, s: Array) -> PathPoints:
        # The curve is its own mirror image about the bisector: the second half is the first, run from the
        # end.
        n_in = (self.t_out - math.cos(self.turn) * self.t_in) / math.sin(self.turn)
        n_out = (math.cos(self.turn) * self.t_out - self.t_in) / math.sin(self.turn)
        first = (s <= 0.5 * self.length)[:, None]
        u = np.where(first[:, 0], s, self.length - s)
        x, y = (self.length * part for part in _unit_clothoid(u / self.length, self.turn))
        angle = (2.0 * self.turn * (u / self.length) ** 2)[:, None]
        bend = (4.0 * self.turn * u / self.length**2)[:, None]
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = x[:, None], y[:, None]
        return PathPoints(
            np.where(first, self.start + x * self.t_in + y * n_in, self.end - x * self.t_out + y * n_out),
            np.where(first, cos * self.t_in + sin * n_in, cos * self.t_out - sin * n_out),
            bend * np.where(first, cos * n_in - sin * self.t_in, sin * self.t_out + cos * n_out),
        )


@dataclass(frozen=True, slots=True)
class CornerPath:
    """The path along target points.

    Attributes:
        target_points: (n, 3), m, consecutive ones apart.
        blend: how far (m) before and after an inner target point the path leaves the straight lines; 0 keeps
            the corners sharp. A blend never takes more than half of a line.
        targets_at: arc lengths (n,), m, of the target points, or of the middles of their blends.
    """

    target_points: Array
    blend: float = 0.0
    _pieces: tuple[_Line | _Blend, ...] = field(init=False, repr=False, compare=False)
    _starts: Array = field(init=False, repr=False, compare=False)
    targets_at: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        targets = read_only(self.target_points)
        if targets.ndim != 2 or targets.shape[1] != 3 or len(targets) < 2:
            raise MovementError(
                f"path with target points of shape {targets.shape}: give n >= 2 points of x, y, z"
            )
        if not (math.isfinite(self.blend) and self.blend >= 0.0):
            raise MovementError(
                f"blend of {self.blend} m: give 0 for sharp corners, or a length greater than 0"
            )
        legs = np.diff(targets, axis=0)
        lengths = np.linalg.norm(legs, axis=1)
        if not np.all(np.isfinite(legs)) or np.any(lengths <= 1e-9):
            raise MovementError(
                "path with target points that coincide or are not finite: consecutive ones must be apart"
            )
        pieces, targets_at = _build_pieces(targets, legs / lengths[:, None], lengths, self.blend)
        starts = np.concatenate(([0.0], np.cumsum([piece.length for piece in pieces])))
        set_fields(self, target_points=targets, targets_at=read_only(targets_at))
        set_fields(self, _pieces=pieces, _starts=read_only(starts))

    @property
    def length(self) -> float:
        """Arc length of the whole path, m."""
        return float(self._starts[-1])

    def at(self, s: ArrayLike) -> PathPoints:
        """Points at the arc lengths s (n,), m, held to [0, length]."""
        s = np.clip(np.atleast_1d(np.asarray(s, dtype=np.float64)), 0.0, self.length)
        which = np.clip(np.searchsorted(self._starts, s, side="right") - 1, 0, len(self._pieces) - 1)
        result = PathPoints(*(np.empty((len(s), 3)) for _ in PathPoints._fields))
        for index in np.unique(which):
            chosen = which == index
            for out, part in zip(
                result, self._pieces[index].at(s[chosen] - self._starts[index]), strict=True
            ):
                out[chosen] = part
        return result


def _build_pieces(
    targets: Array, directions: Array, lengths: Array, blend: float
) -> tuple[tuple[_Line | _Blend, ...], list[float]]:
    """Lines and blends in order, and the arc length at each target point."""
    pieces: list[_Line | _Blend] = []
    targets_at = [0.0]
    setback, done = 0.0, 0.0
    for leg, (direction, length) in enumerate(zip(directions, lengths, strict=True)):
        begin = targets[leg] + setback * direction
        next_setback, corner = 0.0, None
        if blend > 0.0 and leg + 1 < len(lengths):
            next_setback = min(blend, 0.5 * float(length), 0.5 * float(lengths[leg + 1]))
            corner = _build_blend(targets[leg + 1], direction, directions[leg + 1], next_setback)
            next_setback = next_setback if corner else 0.0
        line = _Line(begin, direction, float(length) - setback - next_setback)
        pieces.append(line)
        done += line.length
        if corner:
            pieces.append(corner)
        targets_at.append(done + (0.5 * corner.length if corner else 0.0))
        done += corner.length if corner else 0.0
        setback = next_setback
    return tuple(pieces), targets_at


def _build_blend(corner: Array, t_in: Array, t_out: Array, setback: float) -> _Blend | None:
    turn = math.atan2(float(np.linalg.norm(np.cross(t_in, t_out))), float(t_in @ t_out))
    if turn < _STRAIGHT:
        return None
    if turn > _REVERSAL:
        raise MovementError(
            f"corner that turns by {math.degrees(turn):.1f} deg: blends go up to "
            f"{math.degrees(_REVERSAL):.0f} deg; "
            'stop at the target points instead (corners = "stop")'
        )
    x, y = _unit_clothoid(np.array([0.5]), turn)
    length = setback / float(x[0] + y[0] * math.tan(0.5 * turn))
    return _Blend(corner - setback * t_in, corner + setback * t_out, t_in, t_out, turn, length)


def _unit_clothoid(u: Array, turn: float) -> tuple[Array, Array]:
    """Integrals of cos and sin of 2 turn u^2: the first half, u in [0, 1/2], of a blend of length 1."""
    scale = math.sqrt(math.pi / (4.0 * turn))
    sine, cosine = fresnel(u / scale)
    return scale * cosine, scale * sine


#: What happens at the inner target points: come to rest there, or pass a blended corner with the speed
#: between two levels.
Corners = Literal["stop", "blend"]
#: Of a boxcar [s]; the speed divides by products of two.
_SHORTEST_RAMP = 1e-6


class PathMotion(NamedTuple):
    """Length along the path (m), speed (m/s) and acceleration along the path (m/s^2), each (n,)."""

    s: Array
    v: Array
    a: Array


@dataclass(frozen=True, slots=True)
class SmoothedSquareWave:
    """Levels of speed in windows of time, convolved with boxcars of area 1.

    Attributes:
        windows: (n, 2), s: start and end of each level.
        levels: (n,), m/s.
        ramps: width of the boxcar (s), or of both: the longer one bounds the acceleration by level / width,
            the shorter one bounds the jerk.
    """

    windows: Array
    levels: Array
    ramps: tuple[float, ...]

    def __post_init__(self) -> None:
        check_ramps(self.ramps)
        set_fields(self, windows=read_only(self.windows, (-1, 2)), levels=read_only(self.levels, (-1,)))

    def evaluate(self, t: ArrayLike) -> PathMotion:
        """Length, speed and acceleration at the times t (n,), s."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))[:, None]
        up = _smoothed_step(times - self.windows[:, 0], self.ramps)
        down = _smoothed_step(times - self.windows[:, 1], self.ramps)
        return PathMotion(*((rise - fall) @ self.levels for rise, fall in zip(up, down, strict=True)))


@dataclass(frozen=True, slots=True)
class Uniform:
    """The robot-like movement along target points with given stroke durations.

    Attributes:
        target_points: (n, 3), m.
        stroke_durations: (n - 1,), s: the same as those of the human-like twin.
        ramps: boxcar widths, s; their sum must be shorter than every stroke.
        corners: "stop": every stroke is a whole trapezoid that begins and ends at rest, exactly at its target
            points. "blend": the level changes from stroke to stroke, the path rounds each inner target point.
        blend: with "blend" corners, the setback of the blends, m.
    """

    target_points: Array
    stroke_durations: Array
    ramps: tuple[float, ...]
    corners: Corners = "stop"
    blend: float = 0.0
    path: CornerPath = field(init=False, repr=False, compare=False)
    wave: SmoothedSquareWave = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_ramps(self.ramps)
        if self.corners not in ("stop", "blend"):
            raise MovementError(f'corners "{self.corners}": give "stop" or "blend"')
        if (self.corners == "blend") != (self.blend > 0.0):
            raise MovementError(
                f'blend of {self.blend} m with corners "{self.corners}": '
                '"stop" takes 0, "blend" a length above 0'
            )
        path = CornerPath(self.target_points, self.blend)
        durations = read_only(self.stroke_durations)
        if durations.shape != (len(path.target_points) - 1,):
            raise MovementError(
                f"{durations.size} stroke durations for {len(path.target_points)} target points: "
                f"give {len(path.target_points) - 1}"
            )
        smoothing = sum(self.ramps)
        if not (np.all(np.isfinite(durations)) and np.all(durations > smoothing)):
            raise MovementError(
                f"stroke durations {durations.tolist()} s with ramps {list(self.ramps)} s: "
                f"every stroke must last longer than all ramps together ({smoothing:g} s)"
            )
        wave = _square_wave(path, durations, self.ramps, self.corners)
        set_fields(self, target_points=path.target_points, stroke_durations=durations, path=path, wave=wave)

    @property
    def duration(self) -> float:
        """Total time, s: the stroke durations and nothing else; the ramps lie inside."""
        return float(math.fsum(self.stroke_durations))

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        along = self.wave.evaluate(t)
        at = self.path.at(along.s)
        velocity = along.v[:, None] * at.tangent
        acceleration = along.a[:, None] * at.tangent + (along.v**2)[:, None] * at.curvature
        return Motion(at.p, velocity, acceleration)

    def transformed(self, similarity: Similarity) -> Uniform:
        """Moved, scaled and rotated; the timing is untouched."""
        points = similarity.points(self.target_points)
        return replace(self, target_points=points, blend=self.blend * similarity.scale)

    def stretched(self, factor: float) -> Uniform:
        """`factor` times as slow, ramps included."""
        ramps = tuple(ramp * factor for ramp in self.ramps)
        return replace(self, stroke_durations=self.stroke_durations * factor, ramps=ramps)


def check_ramps(ramps: tuple[float, ...]) -> None:
    """Refuse ramps that are not one or two boxcar widths of `_SHORTEST_RAMP` at least."""
    if len(ramps) not in (1, 2) or not all(math.isfinite(ramp) and ramp >= _SHORTEST_RAMP for ramp in ramps):
        raise MovementError(
            f"ramps {list(ramps)} s: give one boxcar width (trapezoids) or two (S-curves), "
            f"{_SHORTEST_RAMP:g} s at least"
        )


def _square_wave(
    path: CornerPath, durations: Array, ramps: tuple[float, ...], corners: Corners
) -> SmoothedSquareWave:
    """The square wave whose smoothed form runs each stroke's length within the stroke's time."""
    edges = np.concatenate(([0.0], np.cumsum(durations)))
    half = 0.5 * sum(ramps)
    begins, ends = edges[:-1].copy(), edges[1:].copy()
    # Smoothing sticks out by half of the ramps at both ends of a level: a level that must begin or end at
    # rest inside its stroke's time is that much shorter, and that much higher.
    if corners == "stop":
        begins += half
        ends -= half
    else:
        begins[0] += half
        ends[-1] -= half
    return SmoothedSquareWave(
        np.column_stack((begins, ends)), np.diff(path.targets_at) / (ends - begins), ramps
    )


def _smoothed_step(t: Array, ramps: tuple[float, ...]) -> PathMotion:
    """A unit step at 0 convolved with the boxcars, its integral and its derivative.

    Outside the ramp the values are exact (0, or t, 1, 0), so that no rounding gathers with time.
    """
    half = 0.5 * sum(ramps)
    inside = np.clip(t, -half, half)
    if len(ramps) == 1:
        (width,) = ramps
        x = inside + half
        s, v, a = x**2 / (2.0 * width), x / width, np.full_like(x, 1.0 / width)
    else:
        area = ramps[0] * ramps[1]
        knots = ((0.0, 1.0), (ramps[0], -1.0), (ramps[1], -1.0), (ramps[0] + ramps[1], 1.0))
        parts = [(sign, np.maximum(inside + half - knot, 0.0)) for knot, sign in knots]
        s = sum((sign * x**3 for sign, x in parts), np.zeros_like(inside)) / (6.0 * area)
        v = sum((sign * x**2 for sign, x in parts), np.zeros_like(inside)) / (2.0 * area)
        a = sum((sign * x for sign, x in parts), np.zeros_like(inside)) / area
    over = t >= half
    ramping = np.abs(t) < half
    return PathMotion(np.where(over, t, s), np.where(over, 1.0, v), np.where(ramping, a, 0.0))


#: The two boxcars (s) that smooth the square wave of a robot-like movement: together they last as long as the
#: ramp that a UR makes by itself, movel's default speed over its default acceleration, .25 m/s / 1.2 m/s^2 =
#: .21 s (Source: URScript manual, movel). Most of it bounds the acceleration, the rest the jerk.
RAMPS = (0.16, 0.05)
#: How far (m) a blended corner keeps from its target point along the lines.
SETBACK = 0.03


def uniform_trajectory(
    target_points: ArrayLike, stroke_durations: ArrayLike, corners: Corners = "stop", setback: float = SETBACK
) -> Uniform:
    """A constant speed a stroke, smoothed to ramps, on the straight lines between target points.

    Args:
        target_points: (n, 3), m.
        stroke_durations: (n - 1,), s.
        corners: come to rest at the inner target points, or blend them.
        setback: of blended corners, m: how far before and after a target point the path leaves the lines.

    Source: section II.C.
    """
    points, durations = (np.asarray(values, dtype=np.float64) for values in (target_points, stroke_durations))
    return Uniform(points, durations, RAMPS, corners, setback if corners == "blend" else 0.0)
