"""Everything that any port can publish at the end of a cycle, frozen.

The first block carries the names of the realtime columns, lower-cased (`actual_TCP_pose` on the wire is
`actual_tcp_pose` here), so that a frame is a pure function of a snapshot and a layout table.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ur_emulator.controller import electrics
from ur_emulator.controller.registers import RegisterValues
from ur_emulator.controller.status_bits import robot_status_bits, safety_status_bits
from ur_emulator.models.robot_model import Vector3, Vector6


class Snapshot(NamedTuple):
    """State of the box at the end of a control cycle; SI units, base frame, vectors as tuples of floats."""

    tick: int
    # --- columns of the realtime interface
    timestamp: float
    target_q: Vector6
    target_qd: Vector6
    target_qdd: Vector6
    target_current: Vector6
    target_moment: Vector6
    actual_q: Vector6
    actual_qd: Vector6
    actual_current: Vector6
    joint_control_output: Vector6
    actual_tcp_pose: Vector6
    actual_tcp_speed: Vector6
    actual_tcp_force: Vector6
    target_tcp_pose: Vector6
    target_tcp_speed: Vector6
    actual_digital_input_bits: int
    joint_temperatures: Vector6
    actual_execution_time: float
    robot_mode: int
    joint_mode: tuple[int, ...]
    safety_mode: int
    actual_tool_accelerometer: Vector3
    speed_scaling: float
    actual_momentum: float
    actual_main_voltage: float
    actual_robot_voltage: float
    actual_robot_current: float
    actual_joint_voltage: Vector6
    actual_digital_output_bits: int
    runtime_state: int
    elbow_position: Vector3
    elbow_velocity: Vector3
    safety_status: int
    payload: float
    payload_cog: Vector3
    payload_inertia: Vector6
    # --- what the primary and dashboard ports need beside them
    target_speed_fraction: float
    tcp_offset: Vector6
    program_name: str
    control_mode: int
    is_guided_by_input: bool
    buttons: int
    # --- what only RTDE needs; lines in the order standard inputs, standard outputs, tool inputs
    analog_values: tuple[float, ...]
    analog_domains: tuple[int, ...]
    tool_output_voltage: int
    euromap_inputs: int
    euromap_outputs: int
    registers: RegisterValues
    script_control_line: int

    @property
    def robot_status_bits(self) -> int:
        """Power, program and buttons, as RobotStatusBits."""
        return robot_status_bits(self.robot_mode, self.runtime_state) | self.buttons

    @property
    def safety_status_bits(self) -> int:
        """The safety mode, as SafetyStatusBits."""
        return safety_status_bits(self.safety_mode)

    @property
    def tcp_force_scalar(self) -> float:
        """Norm of the force part of `actual_tcp_force` [N]."""
        return math.hypot(*self.actual_tcp_force[:3])

    @property
    def tool_mode(self) -> int:
        """JointMode of the tool."""
        return electrics.tool_mode(self.joint_mode[-1])

    @property
    def io_current(self) -> float:
        """Current of the box's outputs [A]."""
        return electrics.io_current(self.actual_digital_output_bits)

    @property
    def tool_output_current(self) -> float:
        """Current out of the tool's supply [A]."""
        return electrics.tool_current(self.tool_output_voltage, self.actual_digital_output_bits)

    @property
    def tool_temperature(self) -> float:
        """Temperature of the tool's board [degree C]: that of the last joint, on which it sits."""
        return self.joint_temperatures[-1]

    @property
    def masterboard_temperature(self) -> float:
        """Temperature inside the box [degree C]."""
        return electrics.board_temperature(self.timestamp)

    @property
    def analog_io_types(self) -> int:
        """Bits 0, 1: domains of the standard inputs; 2, 3: of the standard outputs."""
        return sum(domain << i for i, domain in enumerate(self.analog_domains[:4]))

    @property
    def tool_analog_input_types(self) -> int:
        """Bits 0, 1: domains of the tool inputs."""
        return sum(domain << i for i, domain in enumerate(self.analog_domains[4:]))
