"""Path offset: an overlay that displaces the tool from its path by what a program sets cycle by cycle.

Source: URScript manual e-Series 5.2x, path_offset_*: frames, filter, limits. Chosen: the rotation of the
motion frame acts about its axes; an arm that stands keeps the last motion frame, at first it is that of the
tool.
"""

from enum import IntEnum

import numpy as np

from protocol.pose import Pose, pose_add, pose_inv, pose_sub, pose_trans, rotvec_from_flat, rotvec_to_matrix
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion.tool import Tool

# The path moves by more than this in a cycle [m]: there its direction is that of the motion frame.
_MOTION = 1e-9
# Limits of the offset where a program sets none [m, rad]. Source: manual, path_offset_set_max_offset.
MAX_OFFSET = (0.1, 0.52)


class OffsetType(IntEnum):
    """What an offset refers to."""

    BASE = 1
    TCP = 2
    MOTION = 3  # x along the path, y perpendicular to it and to z of the tool
    WORLD = 4  # the offset is the pose of the base in the world, which the path refers to


class PathOffset:
    """The overlay that displaces a tool by the offset; offset, filter and limits outlive its removal.

    Attributes:
        alpha: share of the offset that a cycle takes over; 1 without a filter.
        limits: greatest displacement and rotation along an axis [m, rad].
    """

    def __init__(self, tool: Tool) -> None:
        self.alpha = 1.0
        self.limits = MAX_OFFSET
        self._wanted: Vector6 = ZERO6
        self._kind = OffsetType.BASE
        self.begin(tool)

    def begin(self, tool: Tool) -> None:
        """Begin to displace a tool, without an offset in the first cycle if there is a filter."""
        self.tool = tool
        self._filtered = np.zeros(6)
        self._path: Pose | None = None
        self._displaced: Pose | None = None
        self._motion_axes: Pose | None = None

    def set(self, offset: Vector6, kind: OffsetType) -> None:
        """Set the offset [m, rad]."""
        self._wanted, self._kind = offset, kind

    def applied(self, kind: OffsetType) -> Pose:
        """Return the offset of the last cycle in one of the frames."""
        path, displaced = self._path, self._displaced
        if path is None or displaced is None:
            return ZERO6
        match kind:
            case OffsetType.BASE:
                return pose_sub(displaced, path)
            case OffsetType.TCP:
                return pose_trans(pose_inv(path), displaced)
            case OffsetType.WORLD:
                return pose_trans(path, pose_inv(displaced))
        axes = self._motion_axes or (*ZERO6[:3], *path[3:])
        return _in_axes(pose_inv(axes), pose_sub(displaced, path))

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """Return where a tool on its path is with the offset, filtered and limited."""
        self._follow(tool_pose)
        most = np.repeat(self.limits, 3)
        self._filtered += self.alpha * (np.clip(self._wanted, -most, most) - self._filtered)
        offset = six(self._filtered.tolist())
        match self._kind:
            case OffsetType.BASE:
                displaced = pose_add(offset, tool_pose)
            case OffsetType.TCP:
                displaced = pose_trans(tool_pose, offset)
            case OffsetType.WORLD:
                displaced = pose_trans(pose_inv(offset), tool_pose)
            case _:
                axes = self._motion_axes or (*ZERO6[:3], *tool_pose[3:])
                displaced = pose_add(_in_axes(axes, offset), tool_pose)
        self._path, self._displaced = tool_pose, displaced
        return displaced

    def _follow(self, tool_pose: Pose) -> None:
        """Turn the motion frame to the path."""
        if self._path is None:
            return
        x = np.subtract(tool_pose[:3], self._path[:3])
        y = np.cross(x, rotvec_to_matrix(tool_pose[3:])[:, 2])
        if np.linalg.norm(x) > _MOTION < np.linalg.norm(y):
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
            turn = rotvec_from_flat(*np.column_stack([x, y, np.cross(x, y)]).ravel().tolist())
            self._motion_axes = (0.0, 0.0, 0.0, *turn)


def _in_axes(axes: Pose, offset: Pose) -> Pose:
    """Return an offset along turned axes as one along the axes that these are turned from."""
    return pose_trans(pose_trans(axes, offset), pose_inv(axes))
