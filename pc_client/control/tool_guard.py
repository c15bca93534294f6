"""Ends a run when the tool leaves its path, whatever the joints' errors are called.

The path is what the nominal arm makes of the joint reference. The tool is compared with the part of it around
the present time, not with the one point of the present time: an arm that trails along its path by the loop's
delay is where it should be, one that was pushed aside is not. Both come from the same nominal arm, so its
difference from the real one (a few millimetres, factory calibration) counts in neither direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, ceil, degrees, floor, sqrt

import numpy as np
from numpy.typing import NDArray

from pc_client.control.reference import ReferenceTable
from pc_client.errors import DriverError
from pc_client.kinematics.forward import tcp_pose
from pc_client.kinematics.robot_model import RobotModel

Array = NDArray[np.float64]

BEHIND = 0.3
"""The arm may trail by this time [s]: the longest loop delay that is accepted, and the robot's ramp."""

AHEAD = 0.05
"""It may be ahead by this time [s]: what a feed-forward by a wrong delay does."""

_SURE = 0.25
"""Below this share of the squared tolerance the nearest point of the frame before is near enough."""


class ToolGuard:
    """Watches one run of one reference.

    A pose is a point of twelve numbers: the position [m] and the rotation matrix, this times a length that
    makes the tolerances of both equal; the path is straight between two cycles. Two orientations that differ
    by the angle a have matrices that differ by 2 sqrt(2) sin(a / 2).

    Args:
        reference: what the joints shall do.
        model: the nominal arm; the tool is its flange.
        path_tolerance: largest distance of the tool from its path [m].
        angle_tolerance: largest angle of the tool to its orientation there [rad].
    """

    __slots__ = (
        "_angle",
        "_distance",
        "_inverse",
        "_lead",
        "_model",
        "_period",
        "_points",
        "_scale",
        "_steps",
        "_trail",
    )

    def __init__(
        self, reference: ReferenceTable, model: RobotModel, path_tolerance: float, angle_tolerance: float
    ) -> None:
        self._model = model
        self._distance, self._angle = path_tolerance, angle_tolerance
        self._scale = np.ones((3, 4))
        self._scale[:, :3] = path_tolerance / (sqrt(2.0) * angle_tolerance)
        self._period, self._lead = reference.period, reference.lead
        n = round((reference.lead + reference.duration + reference.settle) / reference.period) + 2
        path = [reference.at(k * reference.period - reference.lead).q for k in range(n)]
        points = np.array([self._point(q) for q in path])
        self._points = points[:-1]
        self._steps = np.diff(points, axis=0)
        squared = np.einsum("ij,ij->i", self._steps, self._steps)
        self._inverse = np.divide(1.0, squared, out=np.zeros(n - 1), where=squared > 0.0)
        self._trail = 0

    def check(self, t: float, q: Sequence[float]) -> None:
        """Compare the tool with its path.

        Args:
            t: time since the movement began [s].
            q: (6,) reported joint positions [rad].

        Raises:
            DriverError: it is further away than allowed, or nowhere (NaN).
        """
        point = self._point(q)
        now = (t + self._lead) / self._period
        # Most frames are as far behind as the one before.
        k = min(max(floor(now) - self._trail, 0), len(self._points) - 1)
        rest = point - self._points[k]
        share = min(max(float(rest @ self._steps[k]) * self._inverse[k], 0.0), 1.0)
        rest -= share * self._steps[k]
        if not float(rest @ rest) < _SURE * self._distance**2:
            self._search(t, point, now)

    def deviation(self, t: float, q: Sequence[float]) -> tuple[float, float]:
        """Distance [m] of the tool from its path around the time t [s], and the angle [rad] to it."""
        rest, _ = self._nearest(self._point(q), (t + self._lead) / self._period)
        return self._measure(rest)

    def _search(self, t: float, point: Array, now: float) -> None:
        rest, k = self._nearest(point, now)
        self._trail = floor(now) - k
        distance, angle = self._measure(rest)
        if not (distance <= self._distance and angle <= self._angle):  # NaN is not
            x, y, z = point[3::4]
            raise DriverError(
                f"the tool is {1e3 * distance:.2f} mm and {degrees(angle):.2f} deg off its path at "
                f"t = {t:.3f} s, near ({x:.3f}, {y:.3f}, {z:.3f}) m; allowed is "
                f"{1e3 * self._distance:g} mm (path_tolerance) and {degrees(self._angle):.1f} deg "
                "(angle_tolerance): the run was ended"
            )

    def _nearest(self, point: Array, now: float) -> tuple[Array, int]:
        """A point less the nearest path point around a time [cycles], (12,), and the cycle of the latter."""
        last = len(self._points) - 1
        first = min(max(floor(now - BEHIND / self._period), 0), last)
        window = slice(first, min(max(ceil(now + AHEAD / self._period), 0), last) + 1)
        rest, steps = point - self._points[window], self._steps[window]
        share = np.clip(np.einsum("ij,ij->i", rest, steps) * self._inverse[window], 0.0, 1.0)
        rest -= share[:, None] * steps
        k = int(np.argmin(np.einsum("ij,ij->i", rest, rest)))
        nearest: Array = rest[k]
        return nearest, first + k

    def _measure(self, rest: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] of a difference of two poses."""
        parts = rest.reshape(3, 4)
        chord = float(np.linalg.norm(parts[:, :3])) / (float(self._scale[0, 0]) * 2.0 * sqrt(2.0))
        return float(np.linalg.norm(parts[:, 3])), 2.0 * asin(min(chord, 1.0)) if chord == chord else chord

    def _point(self, q: Sequence[float]) -> Array:
        point: Array = (tcp_pose(self._model, q)[:3] * self._scale).ravel()
        return point
