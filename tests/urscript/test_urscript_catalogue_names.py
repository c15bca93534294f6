"""The tables against names, counts and defaults of the script manuals, written down here a second time."""

from __future__ import annotations

import itertools
import pickle
from collections import Counter

import pytest

from urscript.builtins import pure_builtins
from urscript.catalogue import (
    ALL_ROWS,
    CB3_3_15,
    REQUIRED,
    Builtin,
    Catalogue,
    Generation,
    ParamType,
    Support,
    TimeClass,
    Version,
    catalogue_for,
)
from urscript.catalogue.calls import compile_check, fits
from urscript.catalogue.catalogue import read_rows

# Script manual CB3 3.15.4, chapter by chapter.
CB3_MANUAL = {
    "motion": """
        movej movel movep movec servoj speedj speedl stopj stopl set_pos reset_revolution_counter
        pause_on_error_code position_deviation_warning set_safety_mode_transition_hardness force_mode
        end_force_mode force_mode_set_damping freedrive_mode freedrive_mode_no_incorrect_payload_check
        end_freedrive_mode teach_mode end_teach_mode encoder_enable_pulse_decode
        encoder_enable_set_tick_count encoder_set_tick_count encoder_get_tick_count
        encoder_unwind_delta_tick_count track_conveyor_linear track_conveyor_circular
        stop_conveyor_tracking get_target_tcp_pose_along_path get_target_tcp_speed_along_path
        conveyor_pulse_decode get_conveyor_tick_count set_conveyor_tick_count
    """,
    "internals": """
        get_actual_joint_positions get_target_joint_positions get_actual_joint_speeds
        get_target_joint_speeds get_joint_torques get_joint_temp get_controller_temp get_actual_tcp_pose
        get_target_tcp_pose get_actual_tool_flange_pose get_actual_tcp_speed get_target_tcp_speed
        get_target_waypoint get_tcp_force force get_tcp_offset get_tool_accelerometer_reading
        get_tool_current get_steptime get_target_payload get_target_payload_cog get_forward_kin
        get_inverse_kin get_inverse_kin_has_solution is_steady is_within_safety_limits set_tcp set_payload
        set_payload_mass set_payload_cog set_gravity sleep sync textmsg popup powerdown str_at str_cat
        str_empty str_len str_find str_sub to_num to_str
    """,
    "urmath": """
        acos asin atan atan2 sin cos tan ceil floor d2r r2d sqrt pow log norm normalize random length
        get_list_length size transpose inv integer_to_binary_list binary_list_to_integer point_dist
        pose_dist pose_add pose_sub pose_trans pose_inv interpolate_pose rotvec2rpy rpy2rotvec
        wrench_trans
    """,
    "interfaces": """
        get_standard_digital_in get_configurable_digital_in get_tool_digital_in get_tool_digital_out
        get_standard_digital_out get_configurable_digital_out set_standard_digital_out
        set_configurable_digital_out set_tool_digital_out get_digital_in get_digital_out set_digital_out
        get_standard_analog_in get_tool_analog_in get_standard_analog_out set_standard_analog_out
        get_analog_in get_analog_out set_analog_out set_analog_inputrange get_flag set_flag
        get_euromap_input get_euromap_output set_euromap_output set_euromap_runstate_dependent_choice
        set_tool_voltage read_input_boolean_register read_input_integer_register read_input_float_register
        read_output_boolean_register read_output_integer_register read_output_float_register
        write_output_boolean_register write_output_integer_register write_output_float_register
        read_port_bit read_port_register write_port_bit write_port_register rtde_set_watchdog
        ft_rtde_input_enable enable_external_ft_sensor socket_open socket_close socket_read_ascii_float
        socket_read_binary_integer socket_read_byte_list socket_read_line socket_read_string
        socket_send_byte socket_send_int socket_send_string socket_send_line socket_set_var socket_get_var
        rpc_factory modbus_add_signal modbus_delete_signal modbus_get_signal_status
        modbus_set_output_register modbus_set_output_signal modbus_set_signal_update_frequency
        modbus_set_digital_input_action modbus_send_custom_command
    """,
    "ioconfiguration": """
        set_standard_analog_input_domain set_tool_analog_input_domain set_analog_outputdomain
        set_input_actions_to_default set_standard_digital_input_action
        set_configurable_digital_input_action set_tool_digital_input_action set_gp_boolean_input_action
        set_runstate_standard_digital_output_to_value set_runstate_configurable_digital_output_to_value
        set_runstate_tool_digital_output_to_value set_runstate_standard_analog_output_to_value
        set_runstate_gp_boolean_output_to_value set_runstate_gp_integer_output_to_value
        set_runstate_gp_float_output_to_value modbus_set_runstate_dependent_choice
    """,
}
# Known to the 3.15 compiler although its manual is silent: driver script, field scripts, PolyScope.
CB3_UNDOCUMENTED = """
    get_joint_positions tool_contact get_actual_joint_positions_history force_mode_set_gain_scaling
    zero_ftsensor servoc protective_stop request_boolean_from_primary_client
    request_integer_from_primary_client request_float_from_primary_client
    request_string_from_primary_client set_runstate_standard_digital_outputs
    set_runstate_configurable_digital_outputs set_runstate_outputs tool_pose varmsg
"""
# Script manual e-Series 5.11: what it has and CB3 3.15.4 has not.
ADDED_IN_5_11 = """
    force_mode_set_gain_scaling get_freedrive_status screw_driving end_screw_driving path_offset_enable
    path_offset_disable path_offset_set path_offset_get path_offset_set_alpha_filter
    path_offset_set_max_offset get_actual_joint_positions_history get_target_payload_inertia tool_contact
    set_target_payload set_tool_communication zero_ftsensor interpreter_mode end_interpreter
    clear_interpreter mc_initialize mc_set_pcs mc_add_linear mc_add_circular mc_load_path mc_add_path
    mc_run_motion mc_set_speed_factor mc_get_target_rtcp_speed
"""
MISSING_IN_5_11 = """
    freedrive_mode_no_incorrect_payload_check get_euromap_input get_euromap_output set_euromap_output
    set_euromap_runstate_dependent_choice set_runstate_gp_integer_output_to_value
    set_runstate_gp_float_output_to_value
"""
LATER = """
    optimovej optimovel motion_version_set motion_version_get jerk_gain_scaling_set jerk_gain_scaling_get
    direct_torque tool_wrench_limit_set tool_wrench_limit_disable force_mode_get_damping
    force_mode_get_gain_scaling get_actual_joint_accelerations get_target_joint_accelerations
    get_tool_temp get_gravity get_base_acceleration set_base_acceleration get_jacobian
    get_jacobian_time_derivative get_mass_matrix get_coriolis_and_centrifugal_torques estimate_payload
    time high_holding_torque_disable high_holding_torque_enable set_baselight_off set_baselight_iec
    set_baselight_solid make_list struct get_rtde_value eip_writer_factory eip_reader_factory
    modbus_add_rw_signal modbus_get_error modbus_get_time_since_signal_invalid
    modbus_request_update_signal_value modbus_reset_connection modbus_set_signal_watchdog add_frame
    attach_frame delete_frame delete_all_frames move_frame get_pose convert_pose reset_world_model
    is_frame get_frame_parent get_children frame_tracking_enable frame_tracking_disable
    set_mass_properties set_payload_from_attached_frames
"""
ROS = "ros_publisher_factory ros_subscriber_factory ros_service_client_factory ros_action_client_factory"

VERSIONS = (
    "3.2",
    "3.8",
    "3.14",
    "3.15",
    "5.0",
    "5.4",
    "5.10",
    "5.11",
    "5.15",
    "5.21",
    "5.23",
    "5.25",
    "10.13",
)


def documented(catalogue: Catalogue) -> dict[str, set[str]]:
    names: dict[str, set[str]] = {}
    for row in catalogue:
        if row.is_documented_in(catalogue.version):
            names.setdefault(row.module, set()).add(row.name)
    return names


def test_cb3_view_is_the_manual_plus_the_undocumented_names() -> None:
    assert documented(CB3_3_15) == {module: set(names.split()) for module, names in CB3_MANUAL.items()}
    extra = {row.name for row in CB3_3_15 if not row.is_documented_in(CB3_3_15.version)}
    assert extra == set(CB3_UNDOCUMENTED.split())


@pytest.mark.parametrize(
    ("version", "counts"),
    [
        (
            "3.15",
            {"motion": 35, "internals": 44, "urmath": 34, "interfaces": 65, "ioconfiguration": 16},
        ),
        (
            "5.11",
            {
                "motion": 44,
                "internals": 48,
                "urmath": 34,
                "interfaces": 63,
                "ioconfiguration": 14,
                "processpath": 9,
                "interpreter_mode": 3,
            },
        ),
    ],
)
def test_chapters_have_as_many_functions_as_the_manual(version: str, counts: dict[str, int]) -> None:
    found = documented(catalogue_for(version))
    assert {module: len(names) for module, names in found.items()} == counts
    assert sum(counts.values()) == {"3.15": 194, "5.11": 215}[version]


def test_e_series_manual_differs_from_cb3_as_listed() -> None:
    cb3 = set(itertools.chain(*documented(CB3_3_15).values()))
    e_series = set(itertools.chain(*documented(catalogue_for("5.11")).values()))
    assert e_series - cb3 == set(ADDED_IN_5_11.split())
    assert cb3 - e_series == set(MISSING_IN_5_11.split())


def test_later_names_are_known_later_only() -> None:
    later = set(LATER.split())
    assert later <= catalogue_for("5.25").names
    assert not later & CB3_3_15.names
    assert not later & catalogue_for("5.11").names
    assert set(ROS.split()) <= catalogue_for("10.13").names
    assert not set(ROS.split()) & catalogue_for("5.25").names


# e-Series release -> what it brought. Source: the maker's manuals by release, gates of the maker's clients.
BROUGHT = {
    "5.3": "get_target_waypoint",
    "5.4": "tool_contact",
    "5.9": "get_inverse_kin_has_solution ft_rtde_input_enable",
    "5.10": """
        set_target_payload get_freedrive_status get_target_payload_inertia
        interpreter_mode end_interpreter clear_interpreter
    """,
    "5.14": "struct",
    "5.15": """
        make_list estimate_payload high_holding_torque_disable high_holding_torque_enable
        modbus_add_rw_signal modbus_get_error modbus_get_time_since_signal_invalid
        modbus_request_update_signal_value modbus_reset_connection modbus_set_signal_watchdog
        set_base_acceleration set_baselight_off set_baselight_iec set_baselight_solid
    """,
    "5.16": "eip_writer_factory eip_reader_factory",
    "5.17": "get_gravity get_base_acceleration get_tool_temp time",
    "5.19": "tool_wrench_limit_set tool_wrench_limit_disable",
    "5.21": "optimovej optimovel",
    "5.22": "motion_version_set motion_version_get",
    "5.23": """
        direct_torque get_mass_matrix get_jacobian get_jacobian_time_derivative
        get_coriolis_and_centrifugal_torques
    """,
    "5.24": """
        get_actual_joint_accelerations get_target_joint_accelerations get_rtde_value jerk_gain_scaling_set
        jerk_gain_scaling_get force_mode_get_damping force_mode_get_gain_scaling
        freedrive_mode_no_incorrect_payload_check add_frame attach_frame delete_frame delete_all_frames
        move_frame get_pose convert_pose reset_world_model is_frame get_frame_parent get_children
        frame_tracking_enable frame_tracking_disable set_mass_properties set_payload_from_attached_frames
    """,
}


@pytest.mark.parametrize("minor", range(1, 26))
def test_each_release_of_the_e_series_brought_its_names_and_dropped_none(minor: int) -> None:
    before, after = ({row.name for row in ALL_ROWS if row.is_in(Version(5, n))} for n in (minor - 1, minor))
    assert after - before == set(BROUGHT.get(f"5.{minor}", "").split())
    assert before <= after


def test_no_row_is_left_out_of_the_lists_above() -> None:
    listed = " ".join([*CB3_MANUAL.values(), CB3_UNDOCUMENTED, ADDED_IN_5_11, LATER, ROS]).split()
    polyscope = {"set_tool_output_mode", "set_tool_digital_output_mode"}
    assert {row.name for row in ALL_ROWS} == {*listed, *polyscope}


@pytest.mark.parametrize(
    ("version", "name", "known"),
    [
        ("3.5", "get_tcp_offset", False),
        ("3.6", "get_tcp_offset", True),
        ("3.7", "protective_stop", False),
        ("3.8", "protective_stop", True),
        ("3.13", "tool_contact", False),
        ("3.14", "tool_contact", True),
        ("3.14", "get_inverse_kin_has_solution", False),
        ("5.8", "get_inverse_kin_has_solution", False),
        ("5.9", "get_inverse_kin_has_solution", True),
        ("5.9", "set_target_payload", False),
        ("5.10", "set_target_payload", True),
        ("5.14", "make_list", False),
        ("5.15", "make_list", True),
        ("5.22", "get_jacobian", False),
        ("5.23", "get_jacobian", True),
        ("3.15", "interpreter_mode", False),
        ("3.15", "set_tool_communication", False),
        ("10.7", "optimovej", False),
        ("10.8", "optimovej", True),
        ("5.24", "ros_publisher_factory", False),
        ("10.11", "ros_publisher_factory", True),
        ("10.10", "direct_torque", False),
        ("10.11", "direct_torque", True),
    ],
)
def test_first_releases(version: str, name: str, known: bool) -> None:
    assert (name in catalogue_for(version)) is known


@pytest.mark.parametrize(
    ("version", "name", "signature"),
    [
        ("3.15", "movej", "movej(q, a=1.4, v=1.05, t=0, r=0)"),
        ("3.15", "movel", "movel(pose, a=1.2, v=0.25, t=0, r=0)"),
        ("3.15", "movep", "movep(pose, a=1.2, v=0.25, r=0)"),
        ("3.15", "movec", "movec(pose_via, pose_to, a=1.2, v=0.25, r=0, mode=0)"),
        ("3.15", "servoj", "servoj(q, a=0, v=0, t=0.008, lookahead_time=0.1, gain=300)"),
        ("5.25", "servoj", "servoj(q, a=0, v=0, t=0.002, lookahead_time=0.1, gain=300)"),
        ("3.15", "stopl", "stopl(a, aRot=a)"),
        ("3.15", "stop_conveyor_tracking", "stop_conveyor_tracking(a=20)"),
        ("3.15", "freedrive_mode", "freedrive_mode()"),
        (
            "5.10",
            "freedrive_mode",
            "freedrive_mode(freeAxes=[1, 1, 1, 1, 1, 1], feature=p[0, 0, 0, 0, 0, 0])",
        ),
        (
            "3.15",
            "get_inverse_kin",
            "get_inverse_kin(x, qnear=current joint positions, maxPositionError=1e-10, "
            "maxOrientationError=1e-10, tcp=active TCP)",
        ),
        ("3.15", "popup", 'popup(s, title="Popup", warning=False, error=False, blocking=False)'),
        ("3.15", "socket_open", 'socket_open(address, port, socket_name="socket_0")'),
        (
            "3.15",
            "socket_read_binary_integer",
            'socket_read_binary_integer(number, socket_name="socket_0", timeout=2)',
        ),
        (
            "3.15",
            "socket_read_string",
            'socket_read_string(socket_name="socket_0", prefix="", suffix="", interpret_escape=False, '
            "timeout=2)",
        ),
        ("3.15", "rtde_set_watchdog", 'rtde_set_watchdog(variable_name, min_frequency, action="pause")'),
        (
            "5.25",
            "direct_torque",
            "direct_torque(torque, friction_comp=True, viscous_scale=[0.9, 0.9, 0.8, 0.9, 0.9, 0.9], "
            "coulomb_scale=[0.8, 0.8, 0.7, 0.8, 0.8, 0.8])",
        ),
        ("5.24", "direct_torque", "direct_torque(torque, friction_comp=True)"),
        ("10.11", "direct_torque", "direct_torque(torque, friction_comp=True)"),
        ("5.17", "time", "time()"),
        ("5.18", "time", "time(mode=0)"),
        (
            "5.10",
            "set_target_payload",
            "set_target_payload(m, cog, inertia=[0, 0, 0, 0, 0, 0], transition_time=0)",
        ),
    ],
)
def test_signatures(version: str, name: str, signature: str) -> None:
    assert catalogue_for(version)[name].signature == signature


@pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: f"{row.name}-{row.since}")
def test_row_is_sane(row: Builtin) -> None:
    names = [param.name for param in row.params]
    assert len(set(names)) == len(names)
    optional = [not param.is_required for param in row.params]
    assert optional == sorted(optional), "a parameter with default stands before one without"
    assert row.summary
    assert row.source
    assert str(row.since) != "-"
    # Approximate rows say what differs.
    assert bool(row.note) or row.support is Support.EXACT


@pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: f"{row.name}-{row.since}")
def test_defaults_fit_their_own_parameters(row: Builtin) -> None:
    defaults = [param.default for param in row.params if param.default is not REQUIRED]
    required = [param for param in row.params if param.is_required]
    for param in row.params[len(required) :]:
        if param.default is not None:
            assert fits(param.type, param.default)
    if not required:
        compile_check(row)(defaults)


RESULTS = {"None", "bool", "int", "float", "number", "string", "pose", "list", "handle", "value"} | {
    "int or float",
    "float or None",
    "int or list",
    "bool or int",
    "matrix or list",
    "matrix or pose",
    "matrix 6 x 6",
    "list of 3",
    "list of 6",
    "list of 32 bool",
    "list of strings",
    "list of number + 1",
    "struct",
    "struct(mass",
    "struct(sec",
}


@pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: f"{row.name}-{row.since}")
def test_results_are_declared_in_words_the_compiler_reads(row: Builtin) -> None:
    assert row.returns.partition(",")[0] in RESULTS


@pytest.mark.parametrize("version", VERSIONS)
def test_no_version_has_two_forms_of_one_name(version: str) -> None:
    wanted = Version.of(version)
    names = Counter(row.name for row in ALL_ROWS if row.is_in(wanted))
    assert [name for name, count in names.items() if count > 1] == []
    assert catalogue_for(version).names == set(names)


def test_successive_forms_leave_no_gap() -> None:
    forms: dict[str, list[Builtin]] = {}
    for row in ALL_ROWS:
        forms.setdefault(row.name, []).append(row)
    for rows in forms.values():
        for earlier, later in itertools.pairwise(rows):
            ends, begins = earlier.until.e_series, later.since.e_series
            only_other_generation = earlier.since.e_series is None
            assert only_other_generation or ends == begins


def test_time_classes_that_the_interpreter_depends_on() -> None:
    def of_class(time: TimeClass) -> set[str]:
        return {row.name for row in CB3_3_15 if row.time is time}

    assert of_class(TimeClass.FRAMES) == {"sleep", "sync"}
    assert of_class(TimeClass.MOTION) == {
        "movej",
        "movel",
        "movep",
        "movec",
        "servoj",
        "servoc",
        "speedj",
        "speedl",
        "stopj",
        "stopl",
        "stop_conveyor_tracking",
    }
    assert of_class(TimeClass.SWITCH) == {
        "force_mode",
        "end_force_mode",
        "freedrive_mode",
        "freedrive_mode_no_incorrect_payload_check",
        "end_freedrive_mode",
        "teach_mode",
        "end_teach_mode",
    }
    assert of_class(TimeClass.BLOCKING) == {
        "popup",
        *(row.name for row in CB3_3_15 if row.name.startswith(("socket_read", "request_"))),
        "socket_open",
        "socket_get_var",
    }
    assert CB3_3_15["speedj"].may_wait
    assert not CB3_3_15["force_mode"].may_wait
    assert not CB3_3_15["socket_send_int"].may_wait


def test_pure_functions_are_exactly_those_of_the_table() -> None:
    newest = catalogue_for("5.25")
    strings = {row.name for row in newest if row.name.startswith(("str_", "to_"))}
    urmath = {row.name for row in newest if row.module == "urmath"}
    assert set(pure_builtins(0)) == strings | urmath
    assert all(newest[name].support is not Support.DECLARED_ONLY for name in pure_builtins(0))


def test_module_variables_and_arrays() -> None:
    values = {name: item.value for name, item in CB3_3_15.variables.items()}
    assert values == {
        "a_joint_default": 1.4,
        "a_tool_default": 1.2,
        "v_joint_default": 1.05,
        "v_tool_default": 0.25,
    }
    array = CB3_3_15.arrays["digital_out"]
    assert array.getter in CB3_3_15
    assert array.setter in CB3_3_15
    assert CB3_3_15[array.getter].params[0].high == array.size - 1


def test_extra_names_are_switched_on_by_hand() -> None:
    opened = catalogue_for("3.15", extra=["set_tool_communication", "movej"])
    assert "set_tool_communication" in opened
    assert opened["movej"] == CB3_3_15["movej"]
    assert "set_tool_communication" not in CB3_3_15
    with pytest.raises(ValueError, match="no builtin named 'no_such'"):
        catalogue_for("3.15", extra=["no_such"])


def test_versions() -> None:
    assert Version.of("3.15.8") == Version.of((3, 15, 8, 106339)) == (3, 15)
    assert catalogue_for((3, 15, 8, 0)) is CB3_3_15
    assert Version(5, 9) < Version(5, 11)
    assert [Version(major, 0).generation for major in (3, 5, 10, 11)] == [
        Generation.CB3,
        Generation.E_SERIES,
        Generation.POLYSCOPE_X,
        Generation.POLYSCOPE_X,
    ]
    with pytest.raises(ValueError, match=r"use 3\.x"):
        catalogue_for("1.8")
    with pytest.raises(ValueError, match="not a software version"):
        catalogue_for("three")


@pytest.mark.parametrize(
    ("misspelt", "meant"),
    [
        ("movJ", "movej"),
        ("getactual_joint_positions", "get_actual_joint_positions"),
        ("sock_open", "socket_open"),
        ("a_joint_defualt", "a_joint_default"),
        ("my_functoin", "my_function"),
        ("zzz", None),
    ],
)
def test_suggestions(misspelt: str, meant: str | None) -> None:
    assert CB3_3_15.suggest(misspelt, ["my_function"]) == meant


def test_parameter_types_all_have_a_check() -> None:
    assert [kind for kind in ParamType if kind is not ParamType.ANY and fits(kind, object())] == []


def test_a_catalogue_of_the_tables_is_pickled_by_its_version_and_any_other_whole():
    assert pickle.loads(pickle.dumps(CB3_3_15)) is CB3_3_15
    own = catalogue_for("5.11", rows=ALL_ROWS[:30])
    assert pickle.loads(pickle.dumps(own)).names == own.names < catalogue_for("5.11").names


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f(a: number)\n    sum\n    exact", "write name"),
        ("f(a: number) -> None", "write name"),
        ("f(a: float) -> None\n    sum\n    exact", "'a: float' of .* is not a parameter"),
        ("f(a: number = 1 2) -> None\n    sum\n    exact", "'a: number = 1 2' of .* is not a parameter"),
        ("f() -> None\n    sum\n    exactly", "exactly in 'exactly'; allowed: zero, motion"),
    ],
)
def test_a_row_that_cannot_be_read_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        list(read_rows(text, "motion"))


def test_what_holds_by_default_ends_with_the_section():
    text = "by default:\n    exact, nan ok\nf() -> int\n    one\ng() -> int\n    two\n    motion, exact\n\n"
    f, g, h = read_rows(text + "h() -> int\n    three\n    approximate: why", "motion")
    assert [row.nan_ok for row in (f, g, h)] == [True, False, False]
    assert (g.time, h.support, h.note) == (TimeClass.MOTION, Support.APPROXIMATE, "why")
