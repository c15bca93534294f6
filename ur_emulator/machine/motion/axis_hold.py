"""AxisHold: the torque that holds blocked axes of an arm which is guided by hand.

A spring and a damper act on the tool along the blocked axes of a feature. Source of the axes: URScript manual
e-Series 5.11, freedrive_mode. Chosen: stiffness and damping; the axes are directions only, so that the tool
turns about its own centre point; those of the tool are as they were when freedrive began.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from protocol.pose import pose_sub, rotvec_to_matrix
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.machine.motion.tool import Tool

# Linear and angular: 50 N give by 2.5 mm. Slow enough for the delay of the measurement.
_STIFFNESS = np.repeat([20_000.0, 400.0], 3)  # N/m, Nm/rad
_DAMPING = np.repeat([600.0, 12.0], 3)  # N s/m, Nm s/rad
# Singular values of the Jacobian [1] below which the arm is near, or too near, to a singularity.
_NEAR, _TOO_NEAR = 0.1, 0.04


class AxisHold:
    """Holds the tool, along some axes, where it is at q [rad].

    `axes` is the rotation vector of the feature in the base [rad]; `blocked` are x, y, z and the rotations
    about them.
    """

    def __init__(self, tool: Tool, axes: Sequence[float], blocked: Sequence[bool], q: Vector6) -> None:
        self._tool = tool
        rotation = np.zeros((6, 6))
        rotation[:3, :3] = rotation[3:, 3:] = rotvec_to_matrix(axes)
        chosen = rotation[:, list(blocked)]
        self._stiffness = chosen @ np.diag(_STIFFNESS[list(blocked)]) @ chosen.T
        self._damping = chosen @ np.diag(_DAMPING[list(blocked)]) @ chosen.T
        self._pose = tool.pose(q)

    def torque(self, q: Vector6, qd: Vector6) -> Vector6:
        """Return the torque of the joints [Nm] at measured angles [rad] and speeds [rad/s]."""
        jacobian = self._tool.arm.jacobian(q, self._tool.tcp)
        away = np.array(pose_sub(self._tool.pose(q), self._pose))
        wrench = self._stiffness @ away + self._damping @ (jacobian @ np.array(qd))
        return six((-jacobian.T @ wrench).tolist())


def singularity_status(jacobian: NDArray[np.float64]) -> int:
    """Return how near an arm with a Jacobian (6, 6) is to a singularity: 0 not, 1 near, 2 too near.

    Source: URScript manual e-Series 5.11, get_freedrive_status; chosen: the thresholds.
    """
    least = float(np.linalg.svd(jacobian, compute_uv=False)[-1])
    return 2 if least < _TOO_NEAR else int(least < _NEAR)
