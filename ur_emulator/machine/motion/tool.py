"""The tool of one move: its pose and twist for joint angles and speeds, and the inverse.

Tool centre point and arm are those at the time of the command: a later `set_tcp` does not change a move that
has begun.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from protocol.pose import Pose
from ur_emulator.machine.kinematics.arm_model import ArmModel, joint_speeds
from ur_emulator.machine.models.robot_model import Vector6, six


class UnreachableError(Exception):
    """The path leads to a pose that the arm cannot reach."""


@dataclass(frozen=True, slots=True)
class Tool:
    """Kinematics of a tool centre point; poses and twists in the base frame [m, rad].

    Attributes:
        arm: the controller's kinematics.
        tcp: tool centre point in the flange frame.
    """

    arm: ArmModel
    tcp: Vector6

    def pose(self, q: Sequence[float]) -> Pose:
        """Return the tool's pose at joint angles `q` [rad]."""
        return self.arm.fk(q, self.tcp)

    def joints(self, pose: Sequence[float], near: Sequence[float]) -> Vector6 | None:
        """Return the joint angles for a pose that are closest to `near` [rad]; None if out of reach."""
        return self.arm.inverse(pose, near, self.tcp)

    def rates(self, q: Sequence[float], twist: Sequence[float]) -> Vector6:
        """Return the joint speeds [rad/s] that give the tool a twist, linear first [m/s, rad/s]."""
        return six(joint_speeds(self.arm.jacobian(q, self.tcp), np.array(twist)).tolist())

    def aspect(self, q: Sequence[float]) -> bool:
        """Return on which side of the singularities the arm is: the sign of the Jacobian's determinant."""
        return bool(np.linalg.det(self.arm.jacobian(q, self.tcp)) > 0.0)

    def twist(self, q: Sequence[float], qd: Sequence[float]) -> Vector6:
        """Return the tool's twist for joint speeds `qd` [rad/s]."""
        return six((self.arm.jacobian(q, self.tcp) @ np.array(qd)).tolist())
