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

Source: P. Viviani and F. Lacquaniti et al. for the law in the plane; the factor in space as in later work
on drawing in the air.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from pc_client.errors import MovementError
from pc_client.movements.geometry import Similarity, read_only
from pc_client.movements.robotic import SmoothedSquareWave, check_ramps
from pc_client.movements.smooth_path import SmoothPath
from pc_client.movements.stroke import Motion

__all__ = ["TORSION_EXPONENT", "TWO_THIRDS", "PowerLaw"]

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
        path: the smooth path through the target points.

    Raises:
        MovementError: a number is outside its range, or the target points make no smooth path.
    """

    target_points: NDArray[np.float64]
    duration: float
    ramps: tuple[float, ...]
    largest_radius: float
    exponent: float = TWO_THIRDS
    torsion_exponent: float = 0.0
    path: SmoothPath = field(init=False, repr=False, compare=False)
    _parameter: CubicSpline = field(init=False, repr=False, compare=False)
    _wave: SmoothedSquareWave = field(init=False, repr=False, compare=False)
    _targets_at: NDArray[np.float64] = field(init=False, repr=False, compare=False)

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
        object.__setattr__(self, "target_points", path.target_points)
        object.__setattr__(self, "path", path)
        slopes = 1.0 / self._cost(path, u[[0, -1]])
        object.__setattr__(self, "_parameter", CubicSpline(w, u, bc_type=((1, slopes[0]), (1, slopes[1]))))
        object.__setattr__(self, "_targets_at", read_only(w[::_INTERVALS]))
        half = 0.5 * sum(self.ramps)
        window = np.array([[half, self.duration - half]])
        level = np.array([w[-1] / (self.duration - 2.0 * half)])
        object.__setattr__(self, "_wave", SmoothedSquareWave(window, level, self.ramps))

    @property
    def passages(self) -> NDArray[np.float64]:
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
        """The movement moved, scaled and rotated; its timing is untouched."""
        return PowerLaw(
            similarity.points(self.target_points),
            self.duration,
            self.ramps,
            self.largest_radius * similarity.scale,
            self.exponent,
            self.torsion_exponent,
        )

    def stretched(self, factor: float) -> PowerLaw:
        """The movement `factor` times as slow, ramps included."""
        return PowerLaw(
            self.target_points,
            self.duration * factor,
            tuple(ramp * factor for ramp in self.ramps),
            self.largest_radius,
            self.exponent,
            self.torsion_exponent,
        )

    def _cost(self, path: SmoothPath, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """dw/du at the parameters u, m: the path length, scaled up where the power law is slower."""
        bend = path.bend(u)
        radius = self.largest_radius
        torsion = bend.triple / (bend.curvature**2 + radius**-2)
        slowing: NDArray[np.float64] = (1.0 + (radius * bend.curvature) ** 2) ** (0.5 * self.exponent)
        slowing = slowing * (1.0 + (radius * torsion) ** 2) ** (0.5 * self.torsion_exponent)
        return bend.stretch * slowing

    def _table(self, path: SmoothPath, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """The integral w at the parameters u, by Gauss-Legendre quadrature of five points an interval."""
        nodes, weights = np.polynomial.legendre.leggauss(5)
        middle, half = 0.5 * (u[1:] + u[:-1]), 0.5 * np.diff(u)
        cost = self._cost(path, (middle[:, None] + half[:, None] * nodes).ravel()).reshape(len(half), -1)
        return np.concatenate(([0.0], np.cumsum(half * (cost @ weights))))
