"""Input and output of the plant, once a control cycle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from ur_emulator.models.robot_model import Vector3, Vector6


class Target(Protocol):
    """The set-point at the end of a cycle: any record with these three, as `motion.JointTarget`."""

    @property
    def q(self) -> Sequence[float]:
        """Angles (6,) [rad]."""

    @property
    def qd(self) -> Sequence[float]:
        """Speeds (6,) [rad/s]."""

    @property
    def qdd(self) -> Sequence[float]:
        """Accelerations (6,) [rad/s²], for the torque that the controller's model sends along."""


class PlantState(NamedTuple):
    """The state of the arm after a cycle, as the control box reads it; names as in RTDE where one exists.

    The first group is measured: noisy, and as old as the feedback age. The second group is computed inside
    the box for the present target. The third is for the safety system: the present state.

    Attributes:
        actual_q: joint angles [rad].
        actual_qd: joint speeds [rad/s]; exactly 0 at rest.
        actual_current: motor currents [A].
        joint_voltage: joint supply voltages [V].
        tool_accelerometer: specific force in the flange frame [m/s²]; +g upwards at rest.
        tcp_force: the box's estimate of the external wrench at the flange, base axes [N, Nm].
        joint_temperatures: [°C].
        target_current: current that the controller's model expects for the target, friction included [A].
        target_moment: torque of the controller's rigid-body model for the target [Nm].
        joint_control_output: current that the drives ask for at the end of the cycle [A].
        torque_saturated: some joint was at its torque limit at the start and at the end of the cycle.
        position_error: set-point of the drives (after delay and lag) minus true angle, end of cycle [rad].
    """

    actual_q: Vector6
    actual_qd: Vector6
    actual_current: Vector6
    joint_voltage: Vector6
    tool_accelerometer: Vector3
    tcp_force: Vector6
    joint_temperatures: Vector6
    target_current: Vector6
    target_moment: Vector6
    joint_control_output: Vector6
    torque_saturated: bool
    position_error: Vector6
