"""Whether what a robot reports of its flange is where the nominal arm has it at the reported joint angles.

It is checked before anything moves and in each frame of a stream: angles that drift away from the pose, or a
pose that drifts away from the angles, mean that one of them is not what the robot measures.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from pc_client.errors import DriverError
from pc_client.kinematics.forward import tcp_pose
from pc_client.kinematics.robot_model import RobotModel
from protocol.pose import T_to_pose, pose_inv, pose_trans

ROTATION_TOLERANCE = 0.02
"""Between the reported flange and the model's [rad]: twice what three real UR3e calibrations come to, 8 mrad.
That of the position stands in the arm's row. A choice: docs/fidelity.md."""

_FARTHEST = 1e3
"""No angle [rad] and no coordinate [m, rad] of a pose is larger."""

_NO_OFFSET = (0.0,) * 6


def flange_difference(
    model: RobotModel, q: Sequence[float], pose: Sequence[float], tcp_offset: Sequence[float] = _NO_OFFSET
) -> tuple[float, float]:
    """How far the reported flange is from the model's.

    Args:
        model: nominal arm.
        q: (6,) reported joint angles [rad].
        pose: (6,) reported pose of the TCP in the base frame [m, rad].
        tcp_offset: (6,) pose of the TCP in the flange frame [m, rad].

    Returns:
        Distance [m] and angle [rad]; endless where a value is no number.
    """
    if not all(-_FARTHEST < value < _FARTHEST for value in (*q, *pose, *tcp_offset)):  # NaN is not
        return inf, inf
    x, y, z, rx, ry, rz = pose
    computed = T_to_pose(tcp_pose(model, q))
    flange = pose_trans((x, y, z, rx, ry, rz), pose_inv(tuple(tcp_offset)))
    difference = pose_trans(pose_inv(computed), flange)
    return float(np.linalg.norm(difference[:3])), float(np.linalg.norm(difference[3:]))


def check_flange(model: RobotModel, q: Sequence[float], pose: Sequence[float]) -> None:
    """Refuse a robot whose angles and pose do not belong together; the TCP is the flange.

    Args:
        model: nominal arm.
        q: (6,) reported joint angles [rad].
        pose: (6,) reported pose of the TCP in the base frame [m, rad].

    Raises:
        DriverError: they are further apart than the tolerances.
    """
    distance, angle = flange_difference(model, q, pose)
    most = model.description.position_tolerance
    if not (distance <= most and angle <= ROTATION_TOLERANCE):
        raise DriverError(
            f"the robot reports its flange {1e3 * distance:.1f} mm and {1e3 * angle:.1f} mrad from where its "
            f"joint angles put it, allowed is {1e3 * most:g} mm and {1e3 * ROTATION_TOLERANCE:g} mrad: "
            "its angles or its pose are not what it measures; the run was ended"
        )
