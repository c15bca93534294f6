"""The tool of one move: where it is and how it moves, for the joints; and back.

Tool centre point and arm are those that held when the move was commanded: a `set_tcp` meanwhile changes
nothing of a path that is already under way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from protocol.pose import Pose
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.robot_model import Vector6, six

# Keeps joint speeds finite at a singularity; without effect (1e-9 relative) elsewhere.
_DAMPING = 1e-12 * np.eye(6)


class UnreachableError(Exception):
    """The path leads to a pose that the arm cannot take."""


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
        """Return the joint angles for a pose, those next to `near` [rad]; None if it cannot be reached."""
        return self.arm.inverse(pose, near, self.tcp)

    def rates(self, q: Sequence[float], twist: Sequence[float]) -> Vector6:
        """Return the joint speeds [rad/s] that give the tool a twist, linear first [m/s, rad/s]."""
        jacobian = self.arm.jacobian(q, self.tcp)
        transposed = jacobian.T
        return six(np.linalg.solve(transposed @ jacobian + _DAMPING, transposed @ np.array(twist)).tolist())

    def aspect(self, q: Sequence[float]) -> bool:
        """Return on which side of the singularities the arm is: the sign of the Jacobian's determinant."""
        return bool(np.linalg.det(self.arm.jacobian(q, self.tcp)) > 0.0)

    def twist(self, q: Sequence[float], qd: Sequence[float]) -> Vector6:
        """Return the tool's twist for joint speeds `qd` [rad/s]."""
        return six((self.arm.jacobian(q, self.tcp) @ np.array(qd)).tolist())
