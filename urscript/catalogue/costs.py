"""What calls of builtins cost, in units of work: the time of a simple statement, 50 ns.

From measurements on one core of 2026, each in a loop of its own: microseconds of a call times 20, rounded.
Only the ratios matter; `urscript.run.metering` says what a unit buys. An effect beyond the program counts
too: a text message is also a line of the log and a package for the clients of port 30001.
"""

from collections.abc import Mapping
from typing import Final

OF_OTHERS: Final = 10
"""Of a builtin that has no row here (0.2 to 0.7 µs)."""

OF_THREAD: Final = 100
"""Of starting a thread."""

_NAMES: Final = {
    20_000: "set_payload_from_attached_frames",  # 1 ms of 25 frames
    11_000: "set_pos",  # 550 µs: the arm is placed and looked at for contacts
    # 240 µs with five iterations; more are charged when they are done
    4_800: "get_inverse_kin get_inverse_kin_has_solution is_within_safety_limits",
    2_000: "delete_frame",
    1_000: "textmsg popup "  # with the log and the clients of port 30001
    "get_pose convert_pose move_frame attach_frame add_frame",  # 50 µs at the end of a chain of 30 frames
    600: "inv",  # of a matrix; its size comes on top
    400: "get_children socket_open rpc_factory "
    "modbus_add_signal modbus_add_rw_signal modbus_send_custom_command",
    200: "set_runstate_outputs socket_get_var",  # 10 µs
    160: "set_runstate_standard_digital_outputs",
    150: "track_conveyor_circular "
    # 7 µs of one that returns at once: a search is begun, a checkpoint passed
    "socket_read_string socket_read_line socket_read_ascii_float",
    120: "get_target_tcp_speed_along_path",
    110: "track_conveyor_linear",
    100: "socket_close socket_send_line socket_send_string socket_send_int socket_send_byte socket_set_var",
    # 3 µs, as all that compute the pose of the tool
    60: "get_target_tcp_pose_along_path get_actual_tcp_pose get_target_tcp_pose get_target_waypoint "
    "tool_pose get_actual_tool_flange_pose get_forward_kin interpolate_pose wrench_trans get_frame_parent "
    "transpose enable_external_ft_sensor ft_rtde_input_enable "
    "socket_read_binary_integer socket_read_byte_list",
    50: "pose_trans pose_add pose_sub pose_inv pose_dist rotvec2rpy rpy2rotvec "
    "set_runstate_tool_digital_output_to_value set_runstate_gp_float_output_to_value "
    "set_runstate_gp_integer_output_to_value set_runstate_standard_analog_output_to_value "
    "set_runstate_standard_digital_output_to_value set_runstate_gp_boolean_output_to_value "
    "set_runstate_configurable_digital_output_to_value",
    40: "normalize integer_to_binary_list binary_list_to_integer str_cat to_str to_num "
    "encoder_enable_pulse_decode conveyor_pulse_decode "
    "set_payload set_payload_mass set_payload_cog set_target_payload set_tcp",
    20: "read_port_register read_port_bit write_port_register "
    "write_output_integer_register write_output_boolean_register write_output_float_register "
    "get_joint_torques set_gravity tool_contact get_actual_tcp_speed get_target_tcp_speed get_tcp_force "
    "encoder_set_tick_count encoder_enable_set_tick_count encoder_unwind_delta_tick_count "
    "set_conveyor_tick_count set_analog_out set_standard_analog_out set_euromap_runstate_dependent_choice "
    "set_configurable_digital_input_action set_tool_digital_input_action "
    "set_standard_digital_input_action set_gp_boolean_input_action",
}
"""Units of a call, without its long arguments -> builtins."""

UNITS: Final[Mapping[str, int]] = {name: units for units, names in _NAMES.items() for name in names.split()}
"""Builtin -> units of a call."""

TEXT: Final = frozenset(
    {"str_cat", "to_str", "textmsg", "popup", "socket_send_line", "socket_send_string", "socket_set_var"}
)
"""Those that make a text of their arguments: an element takes four times as long as elsewhere."""

EXPENSIVE: Final = 400
"""From so many units on, a program is asked after the call itself whether it may go on."""
