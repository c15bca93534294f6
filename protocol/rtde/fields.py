"""RTDE's variables as two tables: `OUTPUTS` (robot to client) and `INPUTS` (client to robot).

To add a variable: add a row; `comes_from` names the attribute of the snapshot that holds its value, with an
index where it is one element of it. The box implements the inputs.

Source of names, types and meanings, unless a row says otherwise: UR "Real-Time Data Exchange (RTDE) Guide";
types compared with the type table of the public client library (`rtde/data_package.cpp`), with which they
agree. "Base" versions are as old as RTDE itself. The guide gives no first version for most rows of the
e-Series alone: those of 5.23 and 5.26 are from the client library and its tests; the others lie between the
dates of lists of variables in public clients.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from protocol.rtde.types import RtdeType
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import Since, ValueOrigin, since

__all__ = ["INPUTS", "OUTPUTS", "RtdeField", "input_fields", "output_fields"]


@dataclass(frozen=True, slots=True)
class RtdeField:
    """One variable.

    Attributes:
        name: as on the wire.
        unit: SI unit, "enum", "bits" or "-".
        since: first software of each generation that has it.
        origin: how the emulated box fills an output; None for an input.
        meaning: of the value, with its frame of reference.
        comes_from: attribute of the snapshot, such as "actual_q" or "registers.output_integers[3]"; empty if
            `constant` is what the box sends.
        constant: value of an output that is not simulated.
        source: only where it is not what the module's docstring names.
    """

    name: str
    type: RtdeType
    unit: str
    since: Since
    origin: ValueOrigin | None
    meaning: str
    comes_from: str = ""
    constant: float | int = 0
    source: str = "UR RTDE guide"


_MEASURED, _MODELLED, _PROPERTY, _CONSTANT, _ = ValueOrigin
_BOOL, _U8, _U32, _I32, _U64, _F64, _VEC3, _VEC6, _VEC6I, _VEC6U = RtdeType

_BASE = since((3, 2))
_REGISTERS_SINCE = since((3, 4))
_ELBOW_SINCE = since((3, 5))
_UPPER_SINCE = since((3, 9), (5, 3))
_SAFETY_STATUS_SINCE = since((3, 10), (5, 4))
_PAYLOAD_SINCE = Since(SoftwareVersion(3, 11), SoftwareVersion(5, 5, 1))
_TCP_OFFSET_SINCE = Since(SoftwareVersion(3, 12, 3), SoftwareVersion(5, 5, 1))
_SCRIPT_LINE_SINCE = since((3, 14), (5, 9))
_INERTIA_SINCE = since((3, 15), (5, 11))
_E_TOOL_SINCE = since(None, (5, 2))
_MONITORS_SINCE = since(None, (5, 11))  # chosen, between 5.9 and 5.14: a box of 5.12 can serve UR's recorder
_SCALING_SINCE = since(None, (5, 19))  # the end of the range 5.15 to 5.19
_SINCE_5_23 = since(None, (5, 23))
_SINCE_5_26 = since(None, (5, 26))

_LIBRARY = "public client library and ur_rtde; not in the guide"
_AMPERE = "UR primary/secondary client interface gives A; newer guides say mA, older ones A"

_N_BITS, _N_NUMBERS = 128, 48
# Registers below are reserved for fieldbuses and PLCs, those from here on are for RTDE clients, and newer.
_FIRST_UPPER_NUMBER = 24
# Booleans below travel in two words, those from here on one by one.
_FIRST_SINGLE_BIT = 64


def _out(
    name: str,
    kind: RtdeType,
    unit: str,
    origin: ValueOrigin,
    meaning: str,
    *,
    since: Since = _BASE,
    comes_from: str = "",
    source: str = "UR RTDE guide",
) -> RtdeField:
    """An output from the snapshot; its attribute is the lower-case name unless another is given."""
    return RtdeField(name, kind, unit, since, origin, meaning, comes_from or name.lower(), 0, source)


def _fixed(
    name: str,
    kind: RtdeType,
    unit: str,
    constant: float | int,
    meaning: str,
    source: str = "UR RTDE guide",
    since: Since = _BASE,
) -> RtdeField:
    """An output that is not simulated."""
    return RtdeField(name, kind, unit, since, _CONSTANT, meaning, "", constant, source)


def _in(
    name: str, kind: RtdeType, unit: str, meaning: str, since: Since = _BASE, source: str = "UR RTDE guide"
) -> RtdeField:
    return RtdeField(name, kind, unit, since, None, meaning, source=source)


def _number_since(index: int) -> Since:
    return _REGISTERS_SINCE if index < _FIRST_UPPER_NUMBER else _UPPER_SINCE


def _register_outputs(side: str, words_since: Since) -> tuple[RtdeField, ...]:
    """The registers of one side as outputs; those of side "input" are read back."""

    def row(name: str, kind: RtdeType, since: Since, memory: str, index: int) -> RtdeField:
        meaning = f"{side} register"
        return _out(name, kind, "-", _MODELLED, meaning, since=since,
                    comes_from=f"registers.{side}_{memory}[{index}]")  # fmt: skip

    return (
        row(f"{side}_bit_registers0_to_31", _U32, words_since, "words", 0),
        row(f"{side}_bit_registers32_to_63", _U32, words_since, "words", 1),
        *(
            row(f"{side}_bit_register_{i}", _BOOL, _UPPER_SINCE, "booleans", i)
            for i in range(_FIRST_SINGLE_BIT, _N_BITS)
        ),
        *(row(f"{side}_int_register_{i}", _I32, _number_since(i), "integers", i) for i in range(_N_NUMBERS)),
        *(row(f"{side}_double_register_{i}", _F64, _number_since(i), "floats", i) for i in range(_N_NUMBERS)),
    )


OUTPUTS: tuple[RtdeField, ...] = (
    _out("timestamp", _F64, "s", _MODELLED, "time since the controller started"),
    _out("target_q", _VEC6, "rad", _MODELLED, "joint position set-point"),
    _out("target_qd", _VEC6, "rad/s", _MODELLED, "joint velocity set-point"),
    _out("target_qdd", _VEC6, "rad/s2", _MODELLED, "joint acceleration set-point"),
    _out("target_current", _VEC6, "A", _MODELLED, "joint current that the controller's model expects"),
    _out("target_moment", _VEC6, "Nm", _MODELLED, "joint torque that the controller's model expects"),
    _out("actual_q", _VEC6, "rad", _MEASURED, "joint position"),
    _out("actual_qd", _VEC6, "rad/s", _MEASURED, "joint velocity"),
    _out("actual_current", _VEC6, "A", _MEASURED, "joint motor current"),
    _out("actual_current_window", _VEC6, "A", _PROPERTY,
         "allowed deviation of the joint current: that of the greatest torque", since=_MONITORS_SINCE),
    _out("actual_current_as_torque", _VEC6, "Nm", _MEASURED, "actual_current as torque", since=_SINCE_5_23),
    _out("joint_control_output", _VEC6, "A", _MEASURED, "joint control current, output of the servo"),
    _out("actual_TCP_pose", _VEC6, "m, rad", _MODELLED, "pose of the TCP in base, from actual_q"),
    _out("actual_TCP_speed", _VEC6, "m/s, rad/s", _MODELLED, "twist of the TCP in base axes, from actual_qd"),
    _out("actual_TCP_force", _VEC6, "N, Nm", _MODELLED, "external wrench in base axes, from currents on CB3"),
    _out("target_TCP_pose", _VEC6, "m, rad", _MODELLED, "pose of the TCP in base, from target_q"),
    _out("target_TCP_speed", _VEC6, "m/s, rad/s", _MODELLED, "twist of the TCP in base axes, from target_qd"),
    _out("tcp_offset", _VEC6, "m, rad", _MODELLED, "active TCP in the flange frame", since=_TCP_OFFSET_SINCE,
         source="public client library, compatibility table"),
    _out("actual_TCP_acceleration", _VEC6, "m/s2, rad/s2", _MODELLED,
         "of the TCP in base axes, from actual_q, actual_qd and target_qdd", since=_SINCE_5_23,
         comes_from="space.actual_acceleration"),
    _out("target_TCP_acceleration", _VEC6, "m/s2, rad/s2", _MODELLED,
         "of the TCP in base axes, from the target", since=_SINCE_5_23,
         comes_from="space.target_acceleration"),
    _out("actual_digital_input_bits", _U64, "bits", _MODELLED,
         "0-7 standard, 8-15 configurable, 16-17 tool"),
    _out("actual_configurable_digital_input_bits", _U64, "bits", _MODELLED, "0-7 configurable",
         since=_MONITORS_SINCE, comes_from="configurable_inputs"),
    _out("joint_temperatures", _VEC6, "degC", _MEASURED, "motor temperatures"),
    _out("actual_execution_time", _F64, "-", _MODELLED,
         "run time of a cycle of the real-time thread, by the work of programs; in ms, 0 on CB3",
         source="unit: a public script example of execution times; that of CB3 is not known"),
    _fixed("target_execution_time", _F64, "ms", 2.0, "run time that the real-time thread may have: the cycle",
           since=_SINCE_5_23),
    _out("robot_mode", _I32, "enum", _MODELLED, "RobotMode"),
    _out("joint_mode", _VEC6I, "enum", _MODELLED, "JointMode"),
    _out("safety_mode", _I32, "enum", _MODELLED, "SafetyMode"),
    _out("safety_status", _I32, "enum", _MODELLED, "SafetyStatus", since=_SAFETY_STATUS_SINCE),
    _out("actual_tool_accelerometer", _VEC3, "m/s2", _MEASURED, "x y z at the tool; sign is undocumented"),
    _out("speed_scaling", _F64, "-", _MODELLED, "0 to 1, of the trajectory limiter"),
    _out("target_speed_fraction", _F64, "-", _MODELLED, "0 to 1, the speed slider"),
    _out("actual_momentum", _F64, "kg m/s", _MODELLED, "norm of the linear momentum"),
    _out("actual_main_voltage", _F64, "V", _CONSTANT, "main voltage at the masterboard"),
    _out("actual_robot_voltage", _F64, "V", _MODELLED, "48 V bus of the arm, 0 without power"),
    _out("actual_robot_current", _F64, "A", _MODELLED, "current into the arm"),
    _out("actual_joint_voltage", _VEC6, "V", _MEASURED, "bus voltage at each joint"),
    _out("actual_digital_output_bits", _U64, "bits", _MODELLED, "numbered as the inputs"),
    _out("actual_configurable_digital_output_bits", _U64, "bits", _MODELLED, "0-7 configurable",
         since=_MONITORS_SINCE, comes_from="configurable_outputs"),
    _out("runtime_state", _U32, "enum", _MODELLED, "ProgramState"),
    _out("elbow_position", _VEC3, "m", _MODELLED, "x y z in base", since=_ELBOW_SINCE),
    _out("elbow_velocity", _VEC3, "m/s", _MODELLED, "x y z in base axes", since=_ELBOW_SINCE),
    _out("robot_status_bits", _U32, "bits", _MODELLED, "RobotStatusBits"),
    _out("safety_status_bits", _U32, "bits", _MODELLED, "SafetyStatusBits"),
    _out("analog_io_types", _U32, "bits", _MODELLED,
         "0, 1 standard inputs; 2, 3 standard outputs; 0 current, 1 voltage"),
    _out("standard_analog_input0", _F64, "A or V", _MODELLED, "as its type says",
         comes_from="analog_values[0]", source=_AMPERE),
    _out("standard_analog_input1", _F64, "A or V", _MODELLED, "as its type says",
         comes_from="analog_values[1]", source=_AMPERE),
    _out("standard_analog_output0", _F64, "A or V", _MODELLED, "as its type says",
         comes_from="analog_values[2]", source=_AMPERE),
    _out("standard_analog_output1", _F64, "A or V", _MODELLED, "as its type says",
         comes_from="analog_values[3]", source=_AMPERE),
    _out("io_current", _F64, "A", _MODELLED, "current of the digital outputs", source=_AMPERE),
    _out("euromap67_input_bits", _U32, "bits", _MODELLED, "signals of a moulding machine; none is connected",
         comes_from="euromap_inputs"),
    _out("euromap67_output_bits", _U32, "bits", _MODELLED, "signals to the moulding machine",
         comes_from="euromap_outputs"),
    _fixed("euromap67_24V_voltage", _F64, "V", 0.0, "no Euromap67 board is installed"),
    _fixed("euromap67_24V_current", _F64, "A", 0.0, "no Euromap67 board is installed", _AMPERE),
    _out("tool_mode", _U32, "enum", _MODELLED, "JointMode, the tool's subset", comes_from="tool_mode"),
    _out("tool_analog_input_types", _U32, "bits", _MODELLED, "0, 1 tool inputs; 0 current, 1 voltage"),
    _out("tool_analog_input0", _F64, "A or V", _MODELLED, "as its type says",
         comes_from="analog_values[4]", source=_AMPERE),
    _out("tool_analog_input1", _F64, "A or V", _MODELLED, "as its type says",
         comes_from="analog_values[5]", source=_AMPERE),
    _out("tool_output_voltage", _I32, "V", _MODELLED, "0, 12 or 24"),
    _out("tool_output_current", _F64, "A", _MODELLED, "current out of the tool's supply", source=_AMPERE),
    _out("tool_temperature", _F64, "degC", _MEASURED, "that of the last joint"),
    _out("tcp_force_scalar", _F64, "N", _MODELLED, "norm of the force part of actual_TCP_force"),
    *_register_outputs("output", _BASE),
    *_register_outputs("input", _REGISTERS_SINCE),
    _out("tool_output_mode", _U8, "enum", _MODELLED, "0 digital, 1 dual-pin power", since=_E_TOOL_SINCE,
         comes_from="tool_output_modes[0]"),
    *(_out(f"tool_digital_output{i}_mode", _U8, "enum", _MODELLED, "1 sink, 2 source, 3 push-pull",
           since=_E_TOOL_SINCE, comes_from=f"tool_output_modes[{i + 1}]") for i in range(2)),
    _out("payload", _F64, "kg", _MODELLED, "mass of the payload", since=_PAYLOAD_SINCE),
    _out("payload_cog", _VEC3, "m", _MODELLED, "x y z of its centre of gravity in the flange frame",
         since=_PAYLOAD_SINCE),
    _out("payload_inertia", _VEC6, "kg m2", _MODELLED, "Ixx Iyy Izz Ixy Ixz Iyz, as stated; else 0",
         since=_INERTIA_SINCE),
    _out("script_control_line", _U32, "-", _MODELLED, "line of the main thread of the program, 0 without one",
         since=_SCRIPT_LINE_SINCE),
    _out("ft_raw_wrench", _VEC6, "N, Nm", _MODELLED, "force sensor, no zero, with the payload, flange axes",
         since=since(None, (5, 9))),
    _out("actual_robot_energy_consumed", _F64, "J", _MODELLED, "robot voltage times robot current, summed up",
         since=_SINCE_5_23, comes_from="energy_consumed"),
    _fixed("actual_robot_braking_energy_dissipated", _F64, "J", 0.0, "the bus takes what brakes give",
           since=_SINCE_5_23),
    _out("encoder0_raw", _I32, "-", _MODELLED, "tick count of conveyor encoder 0", since=_MONITORS_SINCE,
         comes_from="encoder_counts[0]"),
    _out("encoder1_raw", _I32, "-", _MODELLED, "tick count of conveyor encoder 1", since=_MONITORS_SINCE,
         comes_from="encoder_counts[1]"),
    _out("joint_position_deviation_ratio", _F64, "-", _MODELLED,
         "greatest deviation of a joint from its set-point; from 1 on a protective stop, C153",
         since=_MONITORS_SINCE),
    _out("collision_detection_ratio", _F64, "-", _MODELLED,
         "greatest share of a drive's torque that is needed; 1 for .1 s: a protective stop",
         since=_SCALING_SINCE),
    _out("wrench_calc_from_currents", _VEC6, "N, Nm", _MODELLED,
         "estimate of the external wrench at the flange, base axes", since=_SINCE_5_23,
         comes_from="estimated_force"),
    _out("time_scale_source", _I32, "enum", _MODELLED, "TimeScaleSource", since=_SCALING_SINCE),
    _out("target_gravity", _VEC3, "m/s2", _MODELLED, "as a program or an installation has set it",
         since=_SINCE_5_26, comes_from="gravity"),
    _out("target_base_acceleration", _VEC6, "m/s2, rad/s2", _MODELLED, "of the base, as a program has set it",
         since=_SINCE_5_26),
    _out("control_step", _U64, "-", _MODELLED, "count of control cycles", since=_SINCE_5_26,
         comes_from="tick"),
    _out("target_base_wrench", _VEC6, "N, Nm", _MODELLED,
         "what holds the base at the target, base axes at its origin", since=_SINCE_5_26),
)  # fmt: skip
"""Variables that a client can subscribe to, in the order of the guide."""

INPUTS: tuple[RtdeField, ...] = (
    _in("speed_slider_mask", _U32, "-", "0 leave the slider, 1 apply the fraction"),
    _in("speed_slider_fraction", _F64, "-", "0 to 1"),
    _in("standard_digital_output_mask", _U8, "bits", "set: apply that bit"),
    _in("standard_digital_output", _U8, "bits", "standard outputs 0-7"),
    _in("configurable_digital_output_mask", _U8, "bits", "set: apply that bit"),
    _in("configurable_digital_output", _U8, "bits", "configurable outputs 0-7"),
    _in("tool_digital_output_mask", _U8, "bits", "set: apply that bit", source=_LIBRARY),
    _in("tool_digital_output", _U8, "bits", "tool outputs 0-1", source=_LIBRARY),
    _in("standard_analog_output_mask", _U8, "bits", "set: apply that output"),
    _in("standard_analog_output_type", _U8, "bits", "0 current, 1 voltage"),
    _in("standard_analog_output_0", _F64, "-", "0 to 1 of the range, 4-20 mA or 0-10 V"),
    _in("standard_analog_output_1", _F64, "-", "0 to 1 of the range, 4-20 mA or 0-10 V"),
    _in("input_bit_registers0_to_31", _U32, "bits", "for fieldbuses and PLCs"),
    _in("input_bit_registers32_to_63", _U32, "bits", "for fieldbuses and PLCs"),
    *(
        _in(f"input_bit_register_{i}", _BOOL, "-", "input register", _UPPER_SINCE)
        for i in range(_FIRST_SINGLE_BIT, _N_BITS)
    ),
    *(
        _in(f"input_int_register_{i}", _I32, "-", "input register", _number_since(i))
        for i in range(_N_NUMBERS)
    ),
    *(
        _in(f"input_double_register_{i}", _F64, "-", "input register", _number_since(i))
        for i in range(_N_NUMBERS)
    ),
    _in("external_force_torque", _VEC6, "N, Nm", "replaces the estimate of the external wrench when a script "
        "has enabled that", since((3, 3))),
)  # fmt: skip
"""Variables that a client can write, in the order of the guide."""


@cache
def output_fields(
    version: SoftwareVersion, table: tuple[RtdeField, ...] = OUTPUTS
) -> Mapping[str, RtdeField]:
    """Outputs that software `version` has, by name."""
    return MappingProxyType({field.name: field for field in table if field.since.covers(version)})


@cache
def input_fields(version: SoftwareVersion, table: tuple[RtdeField, ...] = INPUTS) -> Mapping[str, RtdeField]:
    """Inputs that software `version` has, by name."""
    return MappingProxyType({field.name: field for field in table if field.since.covers(version)})
