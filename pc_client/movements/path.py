"""Geometric paths by arc length: straight lines between target points, corners sharp or blended.

A blend is a pair of clothoids: the curvature grows in proportion to the path length from 0 to its top in the
middle of the corner and falls to 0 again, so that a robot that passes it at a steady speed meets no jump of
acceleration. Positions are Fresnel integrals of the arc length: exact, and no table to interpolate. This
module is independent of time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fresnel

from pc_client.errors import MovementError
from pc_client.movements.geometry import Similarity, read_only

__all__ = ["CornerPath", "PathPoints"]

#: Below this turn (rad) two lines are one: no blend is built.
_STRAIGHT = 1e-6
#: A corner sharper than this (rad) cannot be blended: the path would come back on itself.
_REVERSAL = math.radians(170.0)


class PathPoints(NamedTuple):
    """Points of a path: position (m), unit tangent and curvature vector dT/ds (1/m), each (n, 3)."""

    p: NDArray[np.float64]
    tangent: NDArray[np.float64]
    curvature: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Line:
    start: NDArray[np.float64]
    direction: NDArray[np.float64]
    length: float

    def at(self, s: NDArray[np.float64]) -> PathPoints:
        tangent = np.broadcast_to(self.direction, (len(s), 3))
        return PathPoints(self.start + s[:, None] * self.direction, tangent, np.zeros((len(s), 3)))


@dataclass(frozen=True, slots=True)
class _Blend:
    """Two clothoids from `start` along `t_in` to `end` along `t_out`."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    t_in: NDArray[np.float64]
    t_out: NDArray[np.float64]
    turn: float
    length: float

    def at(self, s: NDArray[np.float64]) -> PathPoints:
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
    """

    target_points: NDArray[np.float64]
    blend: float = 0.0
    _pieces: tuple[_Line | _Blend, ...] = field(init=False, repr=False, compare=False)
    _starts: NDArray[np.float64] = field(init=False, repr=False, compare=False)
    _targets_at: NDArray[np.float64] = field(init=False, repr=False, compare=False)

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
        object.__setattr__(self, "target_points", targets)
        object.__setattr__(self, "_pieces", pieces)
        object.__setattr__(self, "_starts", read_only(starts))
        object.__setattr__(self, "_targets_at", read_only(targets_at))

    @property
    def length(self) -> float:
        """Arc length of the whole path, m."""
        return float(self._starts[-1])

    @property
    def targets_at(self) -> NDArray[np.float64]:
        """Arc lengths (n,), m, of the target points, or of the middles of their blends."""
        return self._targets_at

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

    def transformed(self, similarity: Similarity) -> CornerPath:
        """The path moved, scaled and rotated."""
        return CornerPath(similarity.points(self.target_points), self.blend * similarity.scale)


def _build_pieces(
    targets: NDArray[np.float64], directions: NDArray[np.float64], lengths: NDArray[np.float64], blend: float
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


def _build_blend(
    corner: NDArray[np.float64], t_in: NDArray[np.float64], t_out: NDArray[np.float64], setback: float
) -> _Blend | None:
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


def _unit_clothoid(u: NDArray[np.float64], turn: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Integrals of cos and sin of 2 turn u^2: the first half, u in [0, 1/2], of a blend of length 1."""
    scale = math.sqrt(math.pi / (4.0 * turn))
    sine, cosine = fresnel(u / scale)
    return scale * cosine, scale * sine
