"""A smooth path through target points, with its curvature and torsion.

The quintic spline through the points, natural at its ends (third and fourth derivative zero), over the
centripetal parameter: a step of the parameter is the square root of the distance of two points, which keeps
the curve from swinging out at sharp turns. It is continuous up to the fourth derivative, so curvature and
torsion are smooth along the path. Two points give the straight line. This module is independent of time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline

from pc_client.errors import MovementError
from pc_client.movements.geometry import Similarity, read_only

__all__ = ["PathBend", "SmoothPath"]

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

    stretch: NDArray[np.float64]
    curvature: NDArray[np.float64]
    triple: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SmoothPath:
    """The path.

    Attributes:
        target_points: (n, 3), m, robot base frame, consecutive ones apart.
        knots: (n,) parameters u of the target points, 0 to 1.

    Raises:
        MovementError: target points of another shape, coinciding ones, or a path that turns on the spot.
    """

    target_points: NDArray[np.float64]
    knots: NDArray[np.float64] = field(init=False, compare=False)
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
        object.__setattr__(self, "target_points", targets)
        object.__setattr__(self, "knots", read_only(knots))
        object.__setattr__(self, "_curve", _curve_through(knots, targets))
        stretch = np.linalg.norm(self.derivative(np.linspace(0.0, 1.0, 1001), 1), axis=1)
        if stretch.min() < _CUSP * stretch.mean():
            raise MovementError(
                "path that turns on the spot: these target points lead back on their own line; move one aside"
            )

    def derivative(self, u: ArrayLike, order: int) -> NDArray[np.float64]:
        """The position (order 0) or its derivative in u at the parameters u (n,); (n, 3), m."""
        values: NDArray[np.float64] = self._curve(np.atleast_1d(np.asarray(u, dtype=np.float64)), order)
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

    def transformed(self, similarity: Similarity) -> SmoothPath:
        """The path moved, scaled and rotated."""
        return SmoothPath(similarity.points(self.target_points))


def _curve_through(knots: NDArray[np.float64], targets: NDArray[np.float64]) -> BSpline:
    if len(targets) == 2:
        # The natural spline through two points is not unique: the line, by six control points in a row.
        return BSpline(np.repeat([0.0, 1.0], 6), np.linspace(targets[0], targets[1], 6), 5)
    natural = [(3, np.zeros(3)), (4, np.zeros(3))]
    return make_interp_spline(knots, targets, k=5, bc_type=(natural, natural))
