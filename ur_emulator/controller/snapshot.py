"""Everything that any port can publish at the end of a cycle, frozen.

The first block carries the names of the realtime columns, lower-cased (`actual_TCP_pose` on the wire is
`actual_tcp_pose` here), so that a frame is a pure function of a snapshot and a layout table.
"""

from __future__ import annotations

from typing import NamedTuple

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
