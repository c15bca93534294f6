"""What the ports of a box say of a cycle: they agree, and each value comes from where its table says it does."""

import math

import pytest
from box_support import MessageReader, connect
from dashboard_support import Dashboard
from states_support import BRAKING, COMMANDS, ENTRY, check_wires, moving
from wire_story import ESeriesStory

from protocol.primary import layout as L
from protocol.primary.messages import SafetyModeMessage
from protocol.primary.packages import decode_package, state_types
from protocol.realtime.layout import layout_for_version
from protocol.rtde.fields import output_fields
from protocol.rtde.recipe import Recipe, snapshot_encoder
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SoftwareVersion
from protocol.wire_record import ValueOrigin, wire_fields
from ur_emulator import ControlBox
from ur_emulator.host.ports.primary.robot_state import StateEncoder
from ur_emulator.machine.commands.power import ReleaseBrakes
from ur_emulator.machine.commands.safety import (
    ChangeSafetySettings,
    TriggerProtectiveStop,
)
from ur_emulator.machine.controller.safety.modes import SafetyEvent
from ur_emulator.machine.models.generations import CB3

V3_15 = SoftwareVersion(3, 15, 8)


@pytest.fixture(scope="module")
def story():
    return ESeriesStory()


# --- the same in every package of a busy box

FIELDS = tuple(output_fields(V3_15).values())


def f32(value):
    return pytest.approx(value, rel=1e-6, abs=1e-7)


@pytest.fixture(scope="module")
def moments(story):
    """All packages of all moments: (RTDE by name, realtime frame, sub-packages by class, Modbus registers)."""
    layout = layout_for_version(V3_15)
    frame, rtde = layout.encoder(), snapshot_encoder(FIELDS, b"")
    recipe = Recipe((f.name for f in FIELDS), (f.type for f in FIELDS))
    states = StateEncoder(CB3.software(V3_15), story.controller.state.arm, story.controller.state.safety)
    names = [f.name for f in FIELDS]
    return [
        (
            dict(zip(names, recipe.decode(rtde(snapshot)), strict=True)),
            layout.decode(frame(snapshot)),
            {type(s): s for s in decode_package(states.encode_first(snapshot), V3_15).sub_packages},
            modbus,
        )
        for snapshot, modbus in story.moments
    ]


def test_the_story_passes_through_the_modes(moments):
    assert {m[0]["safety_mode"] for m in moments} == {1, 2, 3, 5, 7, 8}
    assert {m[0]["robot_mode"] for m in moments} == {-1, 0, 2, 3, 4, 5, 6, 7}
    assert {m[0]["runtime_state"] for m in moments} >= {1, 2, 3, 4}


def test_frames_and_rtde_say_the_same(moments):
    for rtde, frame, _, _ in moments:
        for column in frame.layout.columns:
            if column.name in rtde:
                value = getattr(frame, column.attribute)
                value = tuple(value) if column.count > 1 else value
                assert value == rtde[column.name], column.name


# Record and field of a state, and the name of the same value in RTDE.
SAME = [
    (L.RobotModeData, "robot_mode", "robot_mode"), (L.RobotModeData, "target_speed_fraction", "target_speed_fraction"),
    (L.RobotModeData, "speed_scaling", "speed_scaling"), (L.JointData, "q_actual", "actual_q"),
    (L.JointData, "q_target", "target_q"), (L.JointData, "qd_actual", "actual_qd"), (L.JointData, "joint_mode", "joint_mode"),
    (L.CartesianInfo, "tcp_pose", "actual_TCP_pose"), (L.CartesianInfo, "tcp_offset", "tcp_offset"),
    (L.ForceModeData, "wrench", "actual_TCP_force"),
    (L.MasterboardData, "digital_input_bits", "actual_digital_input_bits"),
    (L.MasterboardData, "digital_output_bits", "actual_digital_output_bits"),
    (L.MasterboardData, "analog_input0", "standard_analog_input0"), (L.MasterboardData, "analog_input1", "standard_analog_input1"),
    (L.MasterboardData, "analog_output0", "standard_analog_output0"), (L.MasterboardData, "analog_output1", "standard_analog_output1"),
    (L.MasterboardData, "safety_mode", "safety_mode"), (L.MasterboardData, "safety_mode", "safety_status"),
    (L.ToolData, "analog_input2", "tool_analog_input0"), (L.ToolData, "analog_input3", "tool_analog_input1"),
    (L.ToolData, "tool_output_voltage", "tool_output_voltage"), (L.ToolData, "tool_mode", "tool_mode"),
]  # fmt: skip
# A state has them in four bytes.
ROUNDED = [
    (L.JointData, "current_actual", "actual_current"), (L.JointData, "voltage_actual", "actual_joint_voltage"),
    (L.JointData, "temperature_motor", "joint_temperatures"), (L.MasterboardData, "robot_voltage_48v", "actual_robot_voltage"),
    (L.MasterboardData, "robot_current", "actual_robot_current"), (L.MasterboardData, "master_io_current", "io_current"),
    (L.ToolData, "tool_current", "tool_output_current"), (L.ToolData, "tool_temperature", "tool_temperature"),
]  # fmt: skip


def test_states_and_rtde_say_the_same(moments):
    for rtde, _, state, _ in moments:
        for record, field, name in SAME:
            assert getattr(state[record], field) == rtde[name], name
        for record, field, name in ROUNDED:
            assert getattr(state[record], field) == f32(rtde[name]), name
        mode, board, tool = state[L.RobotModeData], state[L.MasterboardData], state[L.ToolData]
        assert mode.timestamp == round(rtde["timestamp"] * 1e6)
        assert mode.timestamp % CB3.period_us == 0
        bits = RobotStatusBits(rtde["robot_status_bits"])
        assert mode.is_program_running == (RobotStatusBits.PROGRAM_RUNNING in bits)
        assert mode.is_program_paused == (rtde["runtime_state"] == ProgramState.PAUSED)
        assert state[L.AdditionalInfo].teach_button_state == bool(bits & RobotStatusBits.TEACH_BUTTON_PRESSED)
        assert math.hypot(*state[L.ForceModeData].wrench[:3]) == pytest.approx(rtde["tcp_force_scalar"])
        assert state[L.SafetyData].elbow_sphere[:3] == rtde["elbow_position"]
        ranges = (board.analog_input_range0, board.analog_input_range1)
        domains = (board.analog_output_domain0, board.analog_output_domain1)
        assert sum(bit << i for i, bit in enumerate((*ranges, *domains))) == rtde["analog_io_types"]
        assert board.in_reduced_mode == (rtde["safety_mode"] == SafetyMode.REDUCED)
        assert board.safety_checksum == state[L.SafetyData].safety_checksum != 0
        types = tool.analog_input_range2 | tool.analog_input_range3 << 1
        assert types == rtde["tool_analog_input_types"]
        assert tool.tool_voltage_48v == f32(rtde["actual_joint_voltage"][5])


def word(value):
    return round(value) & 0xFFFF


def box_word(bits):
    """Standard lines 0-7 and the tool's as 8 and 9, the order of Modbus."""
    return bits & 0xFF | (bits >> 16 & 3) << 8


# First register and the unit of what RTDE says of it.
UNITS = [
    (20, "tool_output_voltage", 1), (258, "robot_mode", 1), (266, "safety_mode", 1), (768, "tool_mode", 1),
    (769, "tool_temperature", 1), (450, "actual_robot_current", 1e3), (451, "io_current", 1e3),
    (770, "tool_output_current", 1e3), (280, "actual_qd", 1e3), (300, "joint_temperatures", 1), (310, "joint_mode", 1),
    (24, "euromap67_input_bits", 1), (26, "euromap67_output_bits", 1),
]  # fmt: skip


def test_modbus_says_the_same_in_its_units(moments):
    for rtde, _, _, modbus in moments:
        for first, name, unit in UNITS:
            values = rtde[name] if isinstance(rtde[name], tuple) else (rtde[name],)
            assert [modbus[first + i] for i in range(len(values))] == [word(it * unit) for it in values], name
        for i in range(3):
            assert modbus[400 + i] == word(rtde["actual_TCP_pose"][i] * 1e4)
            assert modbus[420 + i] == word(rtde["tcp_offset"][i] * 1e3)
        digital_in, digital_out = rtde["actual_digital_input_bits"], rtde["actual_digital_output_bits"]
        assert (modbus[0], modbus[1]) == (box_word(digital_in), box_word(digital_out))
        assert (modbus[21], modbus[22]) == (digital_in >> 16 & 3, digital_out >> 16 & 3)
        assert (modbus[30], modbus[31]) == (digital_in >> 8 & 0xFF, digital_out >> 8 & 0xFF)


def test_voltage_and_power_go_together(moments):
    for rtde, _, _, _ in moments:
        has_power = bool(rtde["robot_status_bits"] & RobotStatusBits.POWER_ON)
        assert (rtde["actual_robot_voltage"] > 40) == has_power
        assert all((v > 40) == has_power for v in rtde["actual_joint_voltage"])
        assert (rtde["actual_robot_current"] > 0) == has_power


# --- what the tables say of where values come from: what is measured or modelled changes, constants do not

ALIVE = (ValueOrigin.MEASURED, ValueOrigin.MODELLED)
# Vectors are looked at element by element, but for these: the last of them is a radius; and a motor that does
# little stays as warm as it is.
ANY_ELEMENT = {"target_base_acceleration", "elbow_sphere", "joint_temperatures", "temperature_motor"}
# Modelled on an e-Series only; the stories run with the control cycle of CB3.
ZERO_ON_CB3 = {"actual_execution_time"}


def check(name, origin, values):
    """Check one mark against all values that were sent."""
    columns = list(zip(*(value if isinstance(value, tuple) else (value,) for value in values), strict=True))
    changes = [len(set(column)) > 1 for column in columns]
    if name in ZERO_ON_CB3:
        assert not any(map(any, columns)), name
    elif origin in ALIVE:
        assert any(changes) if name in ANY_ELEMENT else all(changes), f"{name} is {origin.value}: {changes}"
    else:
        assert not any(changes), f"{name} is {origin.value}, but changes: {changes}"
        if origin is ValueOrigin.INTERNAL_ZERO:
            assert not any(map(any, columns)), name


@pytest.mark.parametrize("version", [V3_15, SoftwareVersion(5, 26)], ids=str)
def test_every_output_of_rtde_is_what_the_table_says(story, version):
    fields = tuple(output_fields(version).values())
    recipe = Recipe((f.name for f in fields), (f.type for f in fields))
    encode = snapshot_encoder(fields, b"")
    packages = [recipe.decode(encode(snapshot)) for snapshot, _ in story.moments]
    for field, *values in zip(fields, *packages, strict=True):
        check(field.name, field.origin, values)


def test_every_column_of_a_frame_is_what_the_table_says(story):
    layout = layout_for_version(SoftwareVersion(5, 12))  # the longest frame
    encode = layout.encoder()
    frames = [layout.decode(encode(snapshot)) for snapshot, _ in story.moments]
    for column in layout.columns:
        values = [getattr(frame, column.attribute) for frame in frames]
        check(column.name, column.origin, [tuple(v) if column.count > 1 else v for v in values])


@pytest.mark.parametrize("version", [V3_15, SoftwareVersion(5, 26)], ids=str)
def test_every_field_of_a_state_is_what_the_table_says(story, version):
    encoder = StateEncoder(CB3.software(version), story.controller.state.arm, story.controller.state.safety)
    states = [decode_package(encoder.encode_first(s), version).sub_packages for s, _ in story.moments]
    for record, *sent in zip(state_types(version, first=True), *states, strict=True):
        for field in wire_fields(record):
            if field.since.covers(version) and not field.only_if:
                check(field.name, field.origin, [getattr(one, field.name) for one in sent])


# --- the modes, cycle by cycle

MODES = [mode for mode in ENTRY if mode is not SafetyMode.RECOVERY]


@pytest.mark.parametrize("mode", MODES)
def test_ports_agree_in_every_cycle_of_a_mode(mode):
    bench = moving(fidelity="exact")
    check_wires(bench)
    bench.tick(1, *([COMMANDS[ENTRY[mode]]] if ENTRY[mode] else []))
    for _ in range(BRAKING):
        check_wires(bench)
        bench.tick()
    bench.tick(1, ReleaseBrakes())
    check_wires(bench)


def test_ports_agree_in_recovery_and_while_powering_up():
    bench = moving(fidelity="exact")
    bench.tick(1, COMMANDS[SafetyEvent.POWERED_OFF])
    bench.tick(1, ReleaseBrakes())
    for _ in range(250):
        check_wires(bench)
        bench.tick()
    assert bench.now.robot_mode == RobotMode.RUNNING
    bench.controller.safety.handle(SafetyEvent.RANGE_LEFT)
    bench.controller.state.past.snapshot = bench.now._replace(
        safety_mode=int(SafetyMode.RECOVERY), safety_status=int(SafetyMode.RECOVERY)
    )
    assert bench.now.safety_status_bits == 1 << 3
    check_wires(bench)


@pytest.fixture
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7) as running:
        yield running


def test_a_script_port_unlocks_a_protective_stop_at_once_and_confirms_safety_settings(box):
    with Dashboard(box) as dashboard, connect(box, "primary") as primary:
        messages = MessageReader(primary)
        messages.state()
        box.submit(TriggerProtectiveStop())
        assert messages.message(SafetyModeMessage).safety_mode == SafetyMode.PROTECTIVE_STOP
        primary.sendall(b"set unlock protective stop\n")  # no five seconds on this port
        assert messages.message(SafetyModeMessage).safety_mode == SafetyMode.NORMAL
        box.submit(ChangeSafetySettings())
        dashboard.until("robotmode", "Robotmode: CONFIRM_SAFETY")
        primary.sendall(b"confirm user safety parameters\n")
        dashboard.until("robotmode", "Robotmode: POWER_OFF")
