"""Straight lines in joint space over time, for approaches: at rest at each posture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class JointLines:
    """A joint reference along straight joint lines; on each the speed is a trapezoid, from rest to rest.

    All joints begin and end a line together. The joint with the largest distance leads.

    Args:
        postures: at least one, (6,) each [rad].
        v: largest speed of the leading joint [rad/s].
        a: its acceleration [rad/s²].
    """

    __slots__ = ("_a", "_ends", "_postures", "_v")

    def __init__(self, postures: Sequence[Array], v: float, a: float) -> None:
        self._postures = tuple(postures)
        self._v = v
        self._a = a
        durations = [
            self._line_duration(_largest_joint_distance(begin, end))
            for begin, end in pairwise(self._postures)
        ]
        self._ends = tuple(accumulate(durations, initial=0.0))

    @property
    def duration(self) -> float:
        """Time of all lines together [s]."""
        return self._ends[-1]

    def at(self, t: float) -> tuple[Array, Array]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] at time t [s]; at rest before 0 and at the end."""
        still = np.zeros(len(self._postures[0]))
        if t <= 0.0:
            return self._postures[0], still
        if t >= self.duration:
            return self._postures[-1], still
        line = next(k for k in range(1, len(self._ends)) if t < self._ends[k])
        begin, end = self._postures[line - 1], self._postures[line]
        distance = _largest_joint_distance(begin, end)
        s, speed = self._on_line(t - self._ends[line - 1], distance)
        return begin + (s / distance) * (end - begin), (speed / distance) * (end - begin)

    def _line_duration(self, distance: float) -> float:
        v, a = self._v, self._a
        return distance / v + v / a if distance >= v * v / a else 2.0 * sqrt(distance / a)

    def _on_line(self, t: float, distance: float) -> tuple[float, float]:
        """Distance [rad] and speed [rad/s] of the leading joint, t [s] after its line begins."""
        a = self._a
        duration = self._line_duration(distance)
        ramp = min(self._v / a, duration / 2.0)
        if t < ramp:
            return 0.5 * a * t * t, a * t
        if t > duration - ramp:
            left = duration - t
            return distance - 0.5 * a * left * left, a * left
        return a * ramp * (t - 0.5 * ramp), a * ramp


def _largest_joint_distance(begin: Array, end: Array) -> float:
    return float(np.abs(end - begin).max())
