"""What calls of builtins cost, in units of work: the time of a simple statement, 50 ns.

From measurements on one core of 2026, each in a loop of its own: microseconds of a call times 20, rounded.
Only the ratios matter; `urscript.run.metering` says what a unit buys. An effect beyond the program counts
too: a text message is also a line of the log and a package for the clients of port 30001.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

OF_HOST: Final = 10
"""Of a builtin of the host that has no row here (0.2 to 0.7 µs)."""

OF_PURE: Final = 10
"""Of a pure builtin that has no row here (0.3 to 0.6 µs)."""

OF_THREAD: Final = 100
"""Of starting a thread."""

UNITS: Final[Mapping[str, int]] = {
    "set_pos": 11_000,  # 550 µs: the arm is placed and looked at for contacts
    "get_inverse_kin": 4_800,  # 215 to 240 µs
    "get_inverse_kin_has_solution": 4_800,
    "is_within_safety_limits": 4_800,
    "textmsg": 1_000,  # with the log and the clients of port 30001
    "popup": 1_000,
    "set_runstate_outputs": 200,  # 10 µs
    "set_runstate_standard_digital_outputs": 160,
    "track_conveyor_circular": 150,
    "track_conveyor_linear": 110,
    "get_target_tcp_speed_along_path": 120,
    "get_target_tcp_pose_along_path": 60,
    "get_actual_tcp_pose": 60,  # 3 µs, as all that compute the pose of the tool
    "get_target_tcp_pose": 60,
    "tool_pose": 60,
    "get_actual_tool_flange_pose": 60,
    "get_target_waypoint": 60,
    "get_forward_kin": 60,
    "interpolate_pose": 60,
    "wrench_trans": 60,
    "pose_trans": 50,
    "pose_add": 50,
    "pose_sub": 50,
    "pose_inv": 50,
    "pose_dist": 50,
    "rotvec2rpy": 50,
    "rpy2rotvec": 50,
    "set_payload_from_attached_frames": 20_000,  # 1 ms of 25 frames
    "delete_frame": 2_000,
    "get_pose": 1_000,  # 50 µs at the end of a chain of 30 frames
    "convert_pose": 1_000,
    "move_frame": 1_000,
    "attach_frame": 1_000,
    "add_frame": 1_000,
    "get_frame_parent": 60,
    "get_children": 400,
    "inv": 600,  # of a matrix; its size comes on top
    "transpose": 60,
    "normalize": 40,
    "integer_to_binary_list": 40,
    "binary_list_to_integer": 40,
    "str_cat": 40,
    "to_str": 40,
    "to_num": 40,
    "encoder_enable_pulse_decode": 40,
    "conveyor_pulse_decode": 40,
    "enable_external_ft_sensor": 60,
    "ft_rtde_input_enable": 60,
    "set_payload": 40,
    "set_payload_mass": 40,
    "set_payload_cog": 40,
    "set_target_payload": 40,
    "set_tcp": 40,
    "socket_open": 400,
    "socket_close": 100,
    "socket_read_string": 150,  # 7 µs of one that returns at once: a search is begun, a checkpoint passed
    "socket_read_line": 150,
    "socket_read_ascii_float": 150,
    "socket_read_binary_integer": 60,  # 3 µs
    "socket_read_byte_list": 60,
    "socket_get_var": 200,
    "socket_send_line": 100,
    "socket_send_string": 100,
    "socket_send_int": 100,
    "socket_send_byte": 100,
    "socket_set_var": 100,
    "set_runstate_tool_digital_output_to_value": 50,
    "set_runstate_gp_float_output_to_value": 50,
    "set_runstate_gp_integer_output_to_value": 50,
    "set_runstate_standard_analog_output_to_value": 50,
    "set_runstate_standard_digital_output_to_value": 50,
    "set_runstate_gp_boolean_output_to_value": 50,
    "set_runstate_configurable_digital_output_to_value": 50,
    "read_port_register": 20,
    "read_port_bit": 20,
    "write_port_register": 20,
    "write_output_integer_register": 20,
    "write_output_boolean_register": 20,
    "write_output_float_register": 20,
    "get_joint_torques": 20,
    "set_gravity": 20,
    "tool_contact": 20,
    "get_actual_tcp_speed": 20,
    "get_target_tcp_speed": 20,
    "get_tcp_force": 20,
    "encoder_set_tick_count": 20,
    "encoder_enable_set_tick_count": 20,
    "encoder_unwind_delta_tick_count": 20,
    "set_conveyor_tick_count": 20,
    "set_analog_out": 20,
    "set_standard_analog_out": 20,
    "set_euromap_runstate_dependent_choice": 20,
    "set_configurable_digital_input_action": 20,
    "set_tool_digital_input_action": 20,
    "set_standard_digital_input_action": 20,
    "set_gp_boolean_input_action": 20,
    "rpc_factory": 400,
    "modbus_add_signal": 400,
    "modbus_add_rw_signal": 400,
    "modbus_send_custom_command": 400,
}
"""Builtin -> units of a call, without its long arguments."""

TEXT: Final = frozenset(
    {"str_cat", "to_str", "textmsg", "popup", "socket_send_line", "socket_send_string", "socket_set_var"}
)
"""Those that make a text of their arguments: an element takes four times as long as elsewhere."""

EXPENSIVE: Final = 400
"""From so many units on, a program is asked after the call itself whether it may go on."""
