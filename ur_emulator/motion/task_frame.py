"""The task frame of force mode: the directions of its axes, cycle by cycle.

Source: URScript manual CB3 3.15, force_mode, `type`; UR3/CB3 manual, program node "Force": a point must be at
least 10 mm away; with the motion type no axis is compliant before the tool moves, and when it stands again
the frame stays as it was last. Chosen, where the manuals leave it open: the frame gives directions only, the
wrench acts at the tool centre point; the other axes of type 1; the motion of type 3 is that along the
program's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, rotvec_to_matrix

Axes = NDArray[np.float64]

MIN_DISTANCE = 0.01  # m, of the tool from the origin of a frame of type 1
# The path's speed in the x-y plane that counts as motion [m/s].
_MOTION = 1e-6


class FrameType(IntEnum):
    """How the task frame is oriented."""

    POINT = 1  # y towards its origin
    FIXED = 2
    MOTION = 3  # x along the projected motion of the tool


class TaskFrame:
    """A task frame in the base.

    Args:
        pose: as given to force_mode [m, rad].
        kind: how it is turned.
    """

    def __init__(self, pose: Pose, kind: FrameType) -> None:
        self.kind = kind
        self._origin = np.array(pose[:3])
        self._given: Axes = np.array(rotvec_to_matrix(pose[3:]))
        self._axes = self._given if kind is FrameType.FIXED else None

    @property
    def axes(self) -> Axes | None:
        """Directions of the axes in the base as columns (3, 3); None as long as there are none."""
        return self._axes

    def follow(self, before: TaskFrame) -> None:
        """Begin with the directions of the frame whose place this one takes, if they are of its kind."""
        if self.kind is before.kind is not FrameType.FIXED:
            self._axes = before.axes

    def distance(self, tool: Sequence[float]) -> float:
        """Return how far a tool position is from the origin [m]."""
        return float(np.linalg.norm(self._origin - np.array(tool[:3])))

    def turn(self, tool: Sequence[float], velocity: Sequence[float]) -> Axes | None:
        """Turn the frame to a tool position (3,) [m] and its velocity along the path (3,) [m/s], in base."""
        if self.kind is FrameType.POINT:
            self._turn_to_point(np.array(tool[:3]))
        elif self.kind is FrameType.MOTION:
            self._turn_along(np.array(velocity[:3]))
        return self._axes

    def _turn_to_point(self, tool: NDArray[np.float64]) -> None:
        offset = self._origin - tool
        distance = float(np.linalg.norm(offset))
        if distance < MIN_DISTANCE:
            return
        y = offset / distance
        # z is as close to the given one as possible; if that is parallel to y, the given x takes its place.
        z = self._given[:, 2] - (self._given[:, 2] @ y) * y
        if np.linalg.norm(z) < 1e-6:
            z = np.cross(self._given[:, 0], y)
        z /= np.linalg.norm(z)
        self._axes = np.column_stack([np.cross(y, z), y, z])

    def _turn_along(self, velocity: NDArray[np.float64]) -> None:
        z = self._given[:, 2]
        x = velocity - (velocity @ z) * z
        speed = float(np.linalg.norm(x))
        if speed > _MOTION:
            x /= speed
            self._axes = np.column_stack([x, np.cross(z, x), z])
