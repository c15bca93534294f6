"""The joint target: the set-point of the arm at the end of a control cycle."""

from __future__ import annotations

from typing import NamedTuple

from ur_emulator.models.robot_model import ZERO6, Vector6


class JointTarget(NamedTuple):
    """Set-point of all joints at the end of a control cycle.

    Attributes:
        q: joint positions [rad].
        qd: joint velocities [rad/s].
        qdd: joint accelerations during the cycle [rad/s^2].
    """

    q: Vector6
    qd: Vector6 = ZERO6
    qdd: Vector6 = ZERO6

    def at_rest(self) -> JointTarget:
        """Return the same position without motion."""
        return JointTarget(self.q)
