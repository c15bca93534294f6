"""Sub-packages of the robot state (package type 16) on the primary and secondary ports, one record each.

Every class is the table of its bytes after the five-byte header (`i32 size | u8 sub-type`): order, types,
units and the software that first had a field. Defaults are what an idle CB3 may send. To add a field: add a
row. `primary.packages` makes packages of records.

Sources: UR "Primary/Secondary Client Interface" (2021, chapters 5.9 and 5.10) and UR "Client_Interface"
workbook (software 1.6 to 3.2); sizes checked against totals seen on robots and simulators from 3.1 to 5.8.
Inferred: that masterboard data and additional info grew with 3.10 / 5.4 (seen as 74 and 8 bytes up to 3.9
and 5.3, as 75 and 9 bytes in 5.8; UR's client library needs 75 on 3.14).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from protocol.primary.framing import SubPackage
from protocol.primary.setup import (
    CalibrationData,
    ConfigurationData,
    KinematicsInfo,
    SingularityInfo,
)
from protocol.primary.tool import ToolCommunicationInfo, ToolData, ToolModeInfo
from protocol.ur_types import RobotMode, SafetyMode
from protocol.wire_record import Since, ValueOrigin, since, wire

__all__ = [
    "SUB_PACKAGES",
    "AdditionalInfo",
    "CartesianInfo",
    "ForceModeData",
    "JointData",
    "MasterboardData",
    "RobotModeData",
    "SafetyData",
]

_MEASURED, _MODELLED, _PROPERTY, _CONSTANT, _ZERO = ValueOrigin

_SINCE_3_1 = since((3, 1))
_SINCE_3_2 = since((3, 2))
_SINCE_3_5 = since((3, 5))
_SINCE_3_10 = since((3, 10), (5, 4))


@dataclass(frozen=True, slots=True)
class RobotModeData(SubPackage):
    """Modes, flags and speed scaling; clients pick their whole parser by its size."""

    SUB_TYPE: ClassVar[int] = 0

    timestamp: int = wire("Q", "since controller start, a multiple of the cycle", unit="us", origin=_MODELLED)
    is_real_robot_connected: bool = wire("?", "control box and arm talk", default=True, origin=_MODELLED)
    is_real_robot_enabled: bool = wire(
        "?", "true from POWER_ON to RUNNING (inferred)", default=False, origin=_MODELLED
    )
    is_robot_power_on: bool = wire(
        "?", "true from POWER_ON to RUNNING (inferred)", default=False, origin=_MODELLED
    )
    is_emergency_stopped: bool = wire("?", default=False, origin=_MODELLED)
    is_protective_stopped: bool = wire("?", default=False, origin=_MODELLED)
    is_program_running: bool = wire("?", default=False, origin=_MODELLED)
    is_program_paused: bool = wire("?", default=False, origin=_MODELLED)
    robot_mode: int = wire(
        "b", "RobotMode; signed, so that NO_CONTROLLER fits", default=RobotMode.POWER_OFF, origin=_MODELLED
    )
    control_mode: int = wire("B", "ControlMode", origin=_MODELLED)
    target_speed_fraction: float = wire("d", "speed slider, 0 to 1", default=1.0, origin=_MODELLED)
    speed_scaling: float = wire("d", "resulting scaling, 0 to 1", default=1.0, origin=_MODELLED)
    target_speed_fraction_limit: float = wire("d", default=1.0, since=_SINCE_3_2, origin=_CONSTANT)
    reserved: int = wire("B", since=_SINCE_3_5, origin=_ZERO)


@dataclass(frozen=True, slots=True)
class JointData(SubPackage):
    """Six joints, base first; on the wire all values of one joint are consecutive."""

    SUB_TYPE: ClassVar[int] = 1

    q_actual: tuple[float, ...] = wire(
        "d", count=6, unit="rad", interleaved="joint", default=0.0, origin=_MEASURED
    )
    q_target: tuple[float, ...] = wire(
        "d", count=6, unit="rad", interleaved="joint", default=0.0, origin=_MODELLED
    )
    qd_actual: tuple[float, ...] = wire(
        "d", count=6, unit="rad/s", interleaved="joint", default=0.0, origin=_MEASURED
    )
    current_actual: tuple[float, ...] = wire(
        "f", count=6, unit="A", interleaved="joint", default=0.0, origin=_MEASURED
    )
    voltage_actual: tuple[float, ...] = wire(
        "f", "0 on simulators", count=6, unit="V", interleaved="joint", default=0.0, origin=_MEASURED
    )
    temperature_motor: tuple[float, ...] = wire(
        "f", count=6, unit="degC", interleaved="joint", default=25.0, origin=_MEASURED
    )
    temperature_micro: tuple[float, ...] = wire(
        "f", "obsolete", count=6, unit="degC", interleaved="joint", default=0.0, origin=_ZERO
    )
    joint_mode: tuple[int, ...] = wire(
        "B", "JointMode", count=6, interleaved="joint", default=239, origin=_MODELLED
    )


@dataclass(frozen=True, slots=True)
class MasterboardData(SubPackage):
    """Inputs, outputs and supply of the control box; Euromap67 fields only where the board is installed."""

    SUB_TYPE: ClassVar[int] = 3

    digital_input_bits: int = wire("i", "0-7 standard, 8-15 configurable, 16-17 tool", origin=_MODELLED)
    digital_output_bits: int = wire("i", "as the inputs", origin=_MODELLED)
    analog_input_range0: int = wire("B", "0 current, 1 voltage", default=1, origin=_MODELLED)
    analog_input_range1: int = wire("B", "0 current, 1 voltage", default=1, origin=_MODELLED)
    analog_input0: float = wire("d", unit="A or V", default=0.0, origin=_MODELLED)
    analog_input1: float = wire("d", unit="A or V", default=0.0, origin=_MODELLED)
    analog_output_domain0: int = wire("b", "0 current, 1 voltage", origin=_MODELLED)
    analog_output_domain1: int = wire("b", "0 current, 1 voltage", origin=_MODELLED)
    analog_output0: float = wire("d", unit="A or V", default=0.004, origin=_MODELLED)
    analog_output1: float = wire("d", unit="A or V", default=0.004, origin=_MODELLED)
    masterboard_temperature: float = wire("f", unit="degC", default=24.0, origin=_MODELLED)
    robot_voltage_48v: float = wire("f", unit="V", default=48.0, origin=_MODELLED)
    robot_current: float = wire("f", unit="A", default=0.0, origin=_MODELLED)
    master_io_current: float = wire("f", unit="A", default=0.0, origin=_MODELLED)
    safety_mode: int = wire("B", "SafetyMode", default=SafetyMode.NORMAL, origin=_MODELLED)
    in_reduced_mode: bool = wire("?", default=False, origin=_MODELLED)
    euromap67_installed: bool = wire(
        "?", "true: the next four fields are there", default=False, origin=_CONSTANT
    )
    euromap67_input_bits: int = wire("I", only_if="euromap67_installed", origin=_CONSTANT)
    euromap67_output_bits: int = wire("I", only_if="euromap67_installed", origin=_CONSTANT)
    euromap67_voltage_24v: float = wire(
        "f", unit="V", default=0.0, only_if="euromap67_installed", origin=_CONSTANT
    )
    euromap67_current: float = wire(
        "f", unit="A", default=0.0, only_if="euromap67_installed", origin=_CONSTANT
    )
    safety_checksum: int = wire("I", "internal; repeats in SafetyData", origin=_PROPERTY)
    operational_mode_selector_input: int = wire("B", default=1, since=_SINCE_3_2, origin=_CONSTANT)
    three_position_enabling_device_input: int = wire("B", default=1, since=_SINCE_3_2, origin=_CONSTANT)
    reserved: int = wire("B", default=1, since=_SINCE_3_10, origin=_CONSTANT)


@dataclass(frozen=True, slots=True)
class CartesianInfo(SubPackage):
    """Tool centre point."""

    SUB_TYPE: ClassVar[int] = 4

    tcp_pose: tuple[float, ...] = wire("d", "in base", count=6, unit="m, rad", default=0.0, origin=_MODELLED)
    tcp_offset: tuple[float, ...] = wire(
        "d", "in flange", count=6, unit="m, rad", default=0.0, since=_SINCE_3_1, origin=_MODELLED
    )


@dataclass(frozen=True, slots=True)
class ForceModeData(SubPackage):
    """Generalised forces at the TCP."""

    SUB_TYPE: ClassVar[int] = 7

    wrench: tuple[float, ...] = wire(
        "d", "in base axes", count=6, unit="N, Nm", default=0.0, origin=_MODELLED
    )
    robot_dexterity: float = wire("d", "squared determinant of the Jacobian", default=0.0, origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class AdditionalInfo(SubPackage):
    """Buttons of the teach pendant. Up to 3.9 the first two are named teach button pressed and enabled."""

    SUB_TYPE: ClassVar[int] = 8

    teach_button_state: int = wire("B", origin=_MODELLED)
    freedrive_button_enabled: bool = wire("?", default=True, origin=_MODELLED)
    io_enabled_freedrive: bool = wire("?", default=False, since=since((3, 3)), origin=_MODELLED)
    reserved: int = wire("B", default=1, since=_SINCE_3_10, origin=_CONSTANT)


@dataclass(frozen=True, slots=True)
class SafetyData(SubPackage):
    """Internal; names are ours, from a capture whose four numbers are the elbow and a radius."""

    SUB_TYPE: ClassVar[int] = 10
    SINCE: ClassVar[Since] = _SINCE_3_5

    safety_checksum: int = wire("I", "repeats in MasterboardData", origin=_PROPERTY)
    flag0: int = wire("B", default=1, origin=_CONSTANT)
    flag1: int = wire("B", default=1, origin=_CONSTANT)
    elbow_sphere: tuple[float, ...] = wire(
        "d", "x y z in base, radius", count=4, unit="m", default=0.0, origin=_MODELLED
    )


SUB_PACKAGES: tuple[type[SubPackage], ...] = (
    RobotModeData,
    JointData,
    CartesianInfo,
    KinematicsInfo,
    CalibrationData,
    MasterboardData,
    ToolData,
    ConfigurationData,
    ForceModeData,
    AdditionalInfo,
    SafetyData,
    ToolCommunicationInfo,
    ToolModeInfo,
    SingularityInfo,
)
"""In the order in which a controller puts them into a state. Source: first state of a 5.8 simulator. A state
of 5.11 had 85 bytes more; SingularityInfo is 7 of them, the others are not known and not sent."""
