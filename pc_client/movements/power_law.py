"""The two-thirds power law: slow where the path is bent, fast where it is straight, as a hand draws.

    speed = V r(t) (1 + (R kappa)^2)^(-beta/2) (1 + (R tau)^2)^(-gamma/2)

With beta = 1/3 this is speed = k kappa^(-1/3) wherever the radius of the path is small against R, in other
words an angular speed in proportion to kappa^(2/3). gamma = 1/6 adds the factor tau^(-1/6) that the law has
in space. A straight piece or an inflection has no curvature, where the bare law asks for infinite speed: R,
the largest radius, bounds it by V. Torsion is undefined there; kappa^2 tau / (kappa^2 + 1/R^2) is taken for
it, which tends to 0. r(t) rises from 0 to 1 at the start and falls to 0 at the end.

As a function of time: with w = integral of ds / (speed / (V r)), a length, the law says dw/dt =
V r(t). Its right side is a smoothed square wave, so w(t) is a closed form; where on the path the TCP is at
w comes from a table that is made once.

The path is the quintic spline through the points, natural at its ends (third and fourth derivative zero),
over the centripetal parameter: a step of the parameter is the square root of the distance of two points,
which keeps the curve from swinging out at sharp turns. It is continuous up to the fourth derivative, so
curvature and torsion are smooth along the path. Two points give the straight line.

Source: P. Viviani and F. Lacquaniti et al. for the law in the plane; the factor in space as in later work
on drawing in the air.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline
from scipy.optimize import brentq

from pc_client.arrays import Array, read_only, set_fields
from pc_client.errors import MovementError
from pc_client.movements.trajectory import Motion, Similarity
from pc_client.movements.uniform import SmoothedSquareWave, check_ramps

#: A path that is slower than this in its own parameter, against its mean, turns on the spot.
_CUSP = 1e-3


class PathBend(NamedTuple):
    """How a path bends, each (n,).

    Attributes:
        stretch: |p'|, m.
        curvature: |p' x p''| / |p'|^3, 1/m.
        triple: (p' x p'') . p''' / |p'|^6, 1/m^3: curvature squared times torsion, finite on straight
            pieces, where torsion is not.
    """

    stretch: Array
    curvature: Array
    triple: Array


@dataclass(frozen=True, slots=True)
class SmoothPath:
    """The path.

    Attributes:
        target_points: (n, 3), m, robot base frame, consecutive ones apart.
        knots: (n,) parameters u of the target points, 0 to 1.

    Raises:
        MovementError: target points of another shape, coinciding ones, or a path that turns on the spot.
    """

    target_points: Array
    knots: Array = field(init=False, compare=False)
    _curve: BSpline = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        targets = read_only(self.target_points)
        if targets.ndim != 2 or targets.shape[1] != 3 or len(targets) < 2 or not np.all(np.isfinite(targets)):
            raise MovementError(
                f"path with target points of shape {targets.shape}: give n >= 2 finite points of x, y, z"
            )
        lengths = np.linalg.norm(np.diff(targets, axis=0), axis=1)
        if np.any(lengths <= 1e-9):
            raise MovementError("path with target points that coincide: consecutive ones must be apart")
        knots = np.concatenate(([0.0], np.cumsum(np.sqrt(lengths))))
        knots /= knots[-1]
        curve = _curve_through(knots, targets)
        set_fields(self, target_points=targets, knots=read_only(knots), _curve=curve)
        stretch = np.linalg.norm(self.derivative(np.linspace(0.0, 1.0, 1001), 1), axis=1)
        if stretch.min() < _CUSP * stretch.mean():
            raise MovementError(
                "path that turns on the spot: these target points lead back on their own line; move one aside"
            )

    def derivative(self, u: ArrayLike, order: int) -> Array:
        """The position (order 0) or its derivative in u at the parameters u (n,); (n, 3), m."""
        values: Array = self._curve(np.atleast_1d(np.asarray(u, dtype=np.float64)), order)
        return values

    def bend(self, u: ArrayLike) -> PathBend:
        """How the path bends at the parameters u (n,)."""
        first, second, third = (self.derivative(u, order) for order in (1, 2, 3))
        stretch = np.linalg.norm(first, axis=1)
        across = np.cross(first, second)
        return PathBend(
            stretch,
            np.linalg.norm(across, axis=1) / stretch**3,
            np.einsum("ij,ij->i", across, third) / stretch**6,
        )


def _curve_through(knots: Array, targets: Array) -> BSpline:
    if len(targets) == 2:
        # The natural spline through two points is not unique: the line, by six control points in a row.
        return BSpline(np.repeat([0.0, 1.0], 6), np.linspace(targets[0], targets[1], 6), 5)
    natural = [(3, np.zeros(3)), (4, np.zeros(3))]
    return make_interp_spline(knots, targets, k=5, bc_type=(natural, natural))


#: beta of the two-thirds power law: speed goes with curvature^-1/3, angular speed with curvature^2/3.
TWO_THIRDS = 1.0 / 3.0
#: gamma of the law in space.
TORSION_EXPONENT = 1.0 / 6.0

#: Intervals of the table between two target points.
_INTERVALS = 256


@dataclass(frozen=True, slots=True)
class PowerLaw:
    """The movement along a smooth path through target points, by the power law.

    Attributes:
        target_points: (n, 3), m, robot base frame; all of them are passed exactly. The power law sets the
            times at which they are passed.
        duration: total time, s.
        ramps: widths (s) of the two boxcars that smooth start and stop: the speed rises over their sum; or
            of one.
        largest_radius: R, m: a path straighter than this is run at one speed.
        exponent: beta, 0 to 1; 1/3 is the two-thirds power law, 0 a constant speed.
        torsion_exponent: gamma, 0 to 1; 0 is the power law in the plane, 1/6 that in space.

    Raises:
        MovementError: a number is outside its range, or the target points make no smooth path.
    """

    target_points: Array
    duration: float
    ramps: tuple[float, ...]
    largest_radius: float
    exponent: float = TWO_THIRDS
    torsion_exponent: float = 0.0
    path: SmoothPath = field(init=False, repr=False, compare=False)
    _parameter: CubicSpline = field(init=False, repr=False, compare=False)
    _wave: SmoothedSquareWave = field(init=False, repr=False, compare=False)
    _targets_at: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_ramps(self.ramps)
        if not (math.isfinite(self.duration) and self.duration > sum(self.ramps)):
            raise MovementError(
                f"power law of {self.duration} s with ramps {list(self.ramps)} s: "
                "the movement must last longer than all ramps together"
            )
        if not (math.isfinite(self.largest_radius) and self.largest_radius > 0.0):
            raise MovementError(f"largest radius of {self.largest_radius} m: give a length above 0")
        for name, value in (("exponent", self.exponent), ("torsion exponent", self.torsion_exponent)):
            if not 0.0 <= value <= 1.0:
                raise MovementError(f"{name} {value}: give a number from 0 to 1")
        path = SmoothPath(self.target_points)
        legs = len(path.knots) - 1
        u = np.interp(np.linspace(0.0, legs, legs * _INTERVALS + 1), np.arange(legs + 1), path.knots)
        w = self._table(path, u)
        slopes = 1.0 / self._cost(path, u[[0, -1]])
        parameter = CubicSpline(w, u, bc_type=((1, slopes[0]), (1, slopes[1])))
        half = 0.5 * sum(self.ramps)
        window = np.array([[half, self.duration - half]])
        level = np.array([w[-1] / (self.duration - 2.0 * half)])
        wave = SmoothedSquareWave(window, level, self.ramps)
        set_fields(self, target_points=path.target_points, path=path, _parameter=parameter, _wave=wave)
        set_fields(self, _targets_at=read_only(w[::_INTERVALS]))

    @property
    def passages(self) -> Array:
        """Times (n,), s, at which the target points are passed; 0 and the duration are the outer ones."""
        inner = [
            brentq(lambda t, at=at: float(self._wave.evaluate(t).s[0]) - at, 0.0, self.duration, xtol=1e-13)
            for at in self._targets_at[1:-1].tolist()
        ]
        return np.array([0.0, *inner, self.duration])

    def evaluate(self, t: ArrayLike) -> Motion:
        """Position, velocity and acceleration at the times t (n,), s; each (n, 3)."""
        along = self._wave.evaluate(t)
        w = np.clip(along.s, 0.0, self._targets_at[-1])
        u, rate, change = (self._parameter(w, order) for order in range(3))
        first, second = self.path.derivative(u, 1), self.path.derivative(u, 2)
        u_dot = rate * along.v
        u_dot_dot = change * along.v**2 + rate * along.a
        return Motion(
            self.path.derivative(u, 0),
            u_dot[:, None] * first,
            (u_dot**2)[:, None] * second + u_dot_dot[:, None] * first,
        )

    def transformed(self, similarity: Similarity) -> PowerLaw:
        """Moved, scaled and rotated; the timing is untouched."""
        points = similarity.points(self.target_points)
        return replace(self, target_points=points, largest_radius=self.largest_radius * similarity.scale)

    def stretched(self, factor: float) -> PowerLaw:
        """`factor` times as slow, ramps included."""
        ramps = tuple(ramp * factor for ramp in self.ramps)
        return replace(self, duration=self.duration * factor, ramps=ramps)

    def _cost(self, path: SmoothPath, u: Array) -> Array:
        """dw/du at the parameters u, m: the path length, scaled up where the power law is slower."""
        bend = path.bend(u)
        radius = self.largest_radius
        torsion = bend.triple / (bend.curvature**2 + radius**-2)
        slowing: Array = (1.0 + (radius * bend.curvature) ** 2) ** (0.5 * self.exponent)
        slowing = slowing * (1.0 + (radius * torsion) ** 2) ** (0.5 * self.torsion_exponent)
        return bend.stretch * slowing

    def _table(self, path: SmoothPath, u: Array) -> Array:
        """The integral w at the parameters u, by Gauss-Legendre quadrature of five points an interval."""
        nodes, weights = np.polynomial.legendre.leggauss(5)
        middle, half = 0.5 * (u[1:] + u[:-1]), 0.5 * np.diff(u)
        cost = self._cost(path, (middle[:, None] + half[:, None] * nodes).ravel()).reshape(len(half), -1)
        return np.concatenate(([0.0], np.cumsum(half * (cost @ weights))))
