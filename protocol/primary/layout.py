"""Sub-packages of the robot state (package type 16) on the primary and secondary ports, one record each.

Every class is the table of its bytes after the five-byte header (`i32 size | u8 sub-type`): order, types,
units and the software that first had a field. Defaults are what an idle CB3 may send. To add a field: add a
row. `primary.packages` makes packages of records.

Sources: UR "Primary/Secondary Client Interface" (2021, chapters 5.9 and 5.10) and UR "Client_Interface"
workbook (software 1.6 to 3.2); sizes checked against totals seen on robots and simulators from 3.1 to 5.8.
Inferred: that masterboard data and additional info grew with 3.10 / 5.4 (seen as 74 and 8 bytes up to 3.9
and 5.3, as 75 and 9 bytes in 5.8; UR's client library needs 75 on 3.14).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

from protocol.primary.framing import SubPackage
from protocol.ur_types import (
    JOINT_ACCELERATION,
    JOINT_SPEED,
    LOCKSTEP_MASTERBOARD,
    SIMULATED_MASTERBOARD,
    SIMULATOR_CHECKSUM,
    RobotMode,
    SafetyMode,
    SoftwareVersion,
)
from protocol.wire_record import Since, ValueOrigin, since, wire

__all__ = [
    "SUB_PACKAGES",
    "AdditionalInfo",
    "CalibrationData",
    "CartesianInfo",
    "ConfigurationData",
    "ForceModeData",
    "JointData",
    "KinematicsInfo",
    "MasterboardData",
    "RobotModeData",
    "SafetyData",
    "SingularityInfo",
    "ToolCommunicationInfo",
    "ToolData",
    "ToolModeInfo",
]


_MEASURED, _MODELLED, _PROPERTY, _CONSTANT, _ZERO = ValueOrigin

_SINCE_3_1 = since((3, 1))
_SINCE_3_2 = since((3, 2))
_SINCE_3_5 = since((3, 5))
_SINCE_3_10 = since((3, 10), (5, 4))
_SINCE_5_25_1 = Since(None, SoftwareVersion(5, 25, 1))

_SEED = 0xC70F6907
_MULTIPLIER = 0xC6A4A7935BD1E995
_MASK = 2**64 - 1


def calibration_hash(rows: Iterable[tuple[float, float, float, float]]) -> str:
    """Return the name that the maker's drivers give to a calibration, a hash of the arm's DH table.

    A nominal UR5e has "calib_12788084448423163542". Source: UR client library, `KinematicsInfo::toHash`: the
    numbers as a C++ stream writes them, without anything between them, through `std::hash` of libstdc++
    (MurmurHash64A, other in its last bytes).

    Args:
        rows: theta [rad], d [m], a [m], alpha [rad] of each joint, the base first.
    """
    text = "".join(f"{value:.6g}" for row in rows for value in row)
    return f"calib_{_hash_bytes(text.encode())}"


def _hash_bytes(data: bytes) -> int:
    value = _SEED ^ (len(data) * _MULTIPLIER & _MASK)
    whole = len(data) & ~7
    for start in range(0, whole, 8):
        word = int.from_bytes(data[start : start + 8], "little") * _MULTIPLIER & _MASK
        value = (value ^ (_mixed(word) * _MULTIPLIER & _MASK)) * _MULTIPLIER & _MASK
    if len(data) > whole:
        value = (value ^ int.from_bytes(data[whole:], "little")) * _MULTIPLIER & _MASK
    return _mixed(_mixed(value) * _MULTIPLIER & _MASK)


def _mixed(value: int) -> int:
    return value ^ (value >> 47)


# --- what does not change while a box lives; the first two come in the first state of a connection only and
# after the brakes have opened


@dataclass(frozen=True, slots=True)
class KinematicsInfo(SubPackage):
    """Denavit-Hartenberg parameters of this very arm; clients make their calibration check from it."""

    SUB_TYPE: ClassVar[int] = 5
    FIRST_STATE_ONLY: ClassVar[bool] = True

    checksum: tuple[int, ...] = wire(
        "I", "all ones on the maker's simulator", count=6, default=SIMULATOR_CHECKSUM, origin=_PROPERTY
    )
    dh_theta: tuple[float, ...] = wire("d", count=6, unit="rad", origin=_PROPERTY)
    dh_a: tuple[float, ...] = wire("d", count=6, unit="m", origin=_PROPERTY)
    dh_d: tuple[float, ...] = wire("d", count=6, unit="m", origin=_PROPERTY)
    dh_alpha: tuple[float, ...] = wire("d", count=6, unit="rad", origin=_PROPERTY)
    calibration_status: int = wire("I", origin=_CONSTANT)

    @property
    def calibration(self) -> str:
        """The name of the calibration in the maker's drivers."""
        return calibration_hash(zip(self.dh_theta, self.dh_d, self.dh_a, self.dh_alpha, strict=True))


@dataclass(frozen=True, slots=True)
class ConfigurationData(SubPackage):
    """Limits, defaults and nominal kinematics; the order of the DH columns differs from KinematicsInfo."""

    SUB_TYPE: ClassVar[int] = 6
    FIRST_STATE_ONLY: ClassVar[bool] = True

    joint_min_limit: tuple[float, ...] = wire(
        "d", count=6, unit="rad", interleaved="limits", origin=_PROPERTY
    )
    joint_max_limit: tuple[float, ...] = wire(
        "d", count=6, unit="rad", interleaved="limits", origin=_PROPERTY
    )
    joint_max_speed: tuple[float, ...] = wire(
        "d", count=6, unit="rad/s", interleaved="rates", origin=_PROPERTY
    )
    joint_max_acceleration: tuple[float, ...] = wire(
        "d", count=6, unit="rad/s2", interleaved="rates", default=40.0, origin=_CONSTANT
    )
    v_joint_default: float = wire("d", unit="rad/s", default=JOINT_SPEED, origin=_CONSTANT)
    a_joint_default: float = wire("d", unit="rad/s2", default=JOINT_ACCELERATION, origin=_CONSTANT)
    v_tool_default: float = wire("d", unit="m/s", default=0.25, origin=_CONSTANT)
    a_tool_default: float = wire("d", unit="m/s2", default=1.2, origin=_CONSTANT)
    eq_radius: float = wire("d", unit="m", default=0.25, origin=_CONSTANT)
    dh_a: tuple[float, ...] = wire("d", count=6, unit="m", origin=_PROPERTY)
    dh_d: tuple[float, ...] = wire("d", count=6, unit="m", origin=_PROPERTY)
    dh_alpha: tuple[float, ...] = wire("d", count=6, unit="rad", origin=_PROPERTY)
    dh_theta: tuple[float, ...] = wire("d", count=6, unit="rad", origin=_PROPERTY)
    masterboard_version: int = wire(
        "i",
        f"{SIMULATED_MASTERBOARD} of this box, {LOCKSTEP_MASTERBOARD} in lockstep, by which clients know it; "
        "6 in a UR5e capture, CB3 unknown",
        default=6,
        origin=_CONSTANT,
    )
    controller_box_type: int = wire("i", "4 UR5, 5 UR10, 6 UR3", default=6, origin=_PROPERTY)
    robot_type: int = wire("i", "RobotType", default=3, origin=_PROPERTY)
    robot_sub_type: int = wire("i", "1 CB2, 2 CB3, 3 e-Series", default=2, origin=_PROPERTY)
    box_series: int = wire(
        "H",
        "5 CB5, 7 CB7; early software writes 1 and 2 (URCL)",
        default=5,
        since=_SINCE_5_25_1,
        origin=_CONSTANT,
    )
    tool_flange_type: int = wire(
        "H", "1 and 2: versions of the flange", default=1, since=_SINCE_5_25_1, origin=_CONSTANT
    )


@dataclass(frozen=True, slots=True)
class CalibrationData(SubPackage):
    """Internal."""

    SUB_TYPE: ClassVar[int] = 9

    wrench: tuple[float, ...] = wire("d", count=6, unit="N, Nm", origin=_ZERO)


@dataclass(frozen=True, slots=True)
class SingularityInfo(SubPackage):
    """Internal, e-Series. That 5.9 is the first software is inferred: a state of 5.8 does not have it."""

    SUB_TYPE: ClassVar[int] = 13
    SINCE: ClassVar[Since] = since(None, (5, 9))

    severity: int = wire("B", origin=_ZERO)
    singularity_type: int = wire("B", origin=_ZERO)


# --- the tool connector


@dataclass(frozen=True, slots=True)
class ToolData(SubPackage):
    """Tool connector: analogue inputs, supply, temperature."""

    SUB_TYPE: ClassVar[int] = 2

    analog_input_range2: int = wire("B", "0 current, 1 voltage", origin=_MODELLED)
    analog_input_range3: int = wire("B", "0 current, 1 voltage", origin=_MODELLED)
    analog_input2: float = wire("d", unit="A or V", origin=_MODELLED)
    analog_input3: float = wire("d", unit="A or V", origin=_MODELLED)
    tool_voltage_48v: float = wire("f", unit="V", default=48.0, origin=_MEASURED)
    tool_output_voltage: int = wire("B", "0, 12 or 24", unit="V", origin=_MODELLED)
    tool_current: float = wire("f", unit="A", origin=_MODELLED)
    tool_temperature: float = wire("f", unit="degC", default=25.0, origin=_MEASURED)
    tool_mode: int = wire("B", "JointMode, the tool's subset", default=239, origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class ToolCommunicationInfo(SubPackage):
    """Serial line at the tool, e-Series."""

    SUB_TYPE: ClassVar[int] = 11
    SINCE: ClassVar[Since] = since(None, (5, 0))

    is_enabled: bool = wire("?", origin=_MODELLED)
    baud_rate: int = wire("i", default=115200, origin=_MODELLED)
    parity: int = wire("i", "0 none, 1 odd, 2 even", origin=_MODELLED)
    stop_bits: int = wire("i", default=1, origin=_MODELLED)
    rx_idle_chars: float = wire("f", default=1.5, origin=_MODELLED)
    tx_idle_chars: float = wire("f", default=3.5, origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class ToolModeInfo(SubPackage):
    """Digital outputs at the tool, e-Series."""

    SUB_TYPE: ClassVar[int] = 12
    SINCE: ClassVar[Since] = since(None, (5, 1))

    output_mode: int = wire("B", "0 digital, 1 dual-pin power", origin=_MODELLED)
    digital_output_mode0: int = wire("B", "1 sinking, 2 sourcing, 3 push-pull", default=1, origin=_MODELLED)
    digital_output_mode1: int = wire("B", "1 sinking, 2 sourcing, 3 push-pull", default=1, origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class RobotModeData(SubPackage):
    """Modes, flags and speed scaling; clients pick their whole parser by its size."""

    SUB_TYPE: ClassVar[int] = 0

    timestamp: int = wire("Q", "since controller start, a multiple of the cycle", unit="us", origin=_MODELLED)
    is_real_robot_connected: bool = wire("?", "control box and arm talk", default=True, origin=_MODELLED)
    is_real_robot_enabled: bool = wire("?", "true from POWER_ON to RUNNING (inferred)", origin=_MODELLED)
    is_robot_power_on: bool = wire("?", "true from POWER_ON to RUNNING (inferred)", origin=_MODELLED)
    is_emergency_stopped: bool = wire("?", origin=_MODELLED)
    is_protective_stopped: bool = wire("?", origin=_MODELLED)
    is_program_running: bool = wire("?", origin=_MODELLED)
    is_program_paused: bool = wire("?", origin=_MODELLED)
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

    q_actual: tuple[float, ...] = wire("d", count=6, unit="rad", interleaved="joint", origin=_MEASURED)
    q_target: tuple[float, ...] = wire("d", count=6, unit="rad", interleaved="joint", origin=_MODELLED)
    qd_actual: tuple[float, ...] = wire("d", count=6, unit="rad/s", interleaved="joint", origin=_MEASURED)
    current_actual: tuple[float, ...] = wire("f", count=6, unit="A", interleaved="joint", origin=_MEASURED)
    voltage_actual: tuple[float, ...] = wire(
        "f", "0 on simulators", count=6, unit="V", interleaved="joint", origin=_MEASURED
    )
    temperature_motor: tuple[float, ...] = wire(
        "f", count=6, unit="degC", interleaved="joint", default=25.0, origin=_MEASURED
    )
    temperature_micro: tuple[float, ...] = wire(
        "f", "obsolete", count=6, unit="degC", interleaved="joint", origin=_ZERO
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
    analog_input0: float = wire("d", unit="A or V", origin=_MODELLED)
    analog_input1: float = wire("d", unit="A or V", origin=_MODELLED)
    analog_output_domain0: int = wire("b", "0 current, 1 voltage", origin=_MODELLED)
    analog_output_domain1: int = wire("b", "0 current, 1 voltage", origin=_MODELLED)
    analog_output0: float = wire("d", unit="A or V", default=0.004, origin=_MODELLED)
    analog_output1: float = wire("d", unit="A or V", default=0.004, origin=_MODELLED)
    masterboard_temperature: float = wire("f", unit="degC", default=24.0, origin=_MODELLED)
    robot_voltage_48v: float = wire("f", unit="V", default=48.0, origin=_MODELLED)
    robot_current: float = wire("f", unit="A", origin=_MODELLED)
    master_io_current: float = wire("f", unit="A", origin=_MODELLED)
    safety_mode: int = wire("B", "SafetyMode", default=SafetyMode.NORMAL, origin=_MODELLED)
    in_reduced_mode: bool = wire("?", origin=_MODELLED)
    euromap67_installed: bool = wire("?", "true: the next four fields are there", origin=_CONSTANT)
    euromap67_input_bits: int = wire("I", only_if="euromap67_installed", origin=_CONSTANT)
    euromap67_output_bits: int = wire("I", only_if="euromap67_installed", origin=_CONSTANT)
    euromap67_voltage_24v: float = wire("f", unit="V", only_if="euromap67_installed", origin=_CONSTANT)
    euromap67_current: float = wire("f", unit="A", only_if="euromap67_installed", origin=_CONSTANT)
    safety_checksum: int = wire("I", "internal; repeats in SafetyData", origin=_PROPERTY)
    operational_mode_selector_input: int = wire("B", default=1, since=_SINCE_3_2, origin=_CONSTANT)
    three_position_enabling_device_input: int = wire("B", default=1, since=_SINCE_3_2, origin=_CONSTANT)
    reserved: int = wire("B", default=1, since=_SINCE_3_10, origin=_CONSTANT)


@dataclass(frozen=True, slots=True)
class CartesianInfo(SubPackage):
    """Tool centre point."""

    SUB_TYPE: ClassVar[int] = 4

    tcp_pose: tuple[float, ...] = wire("d", "in base", count=6, unit="m, rad", origin=_MODELLED)
    tcp_offset: tuple[float, ...] = wire(
        "d", "in flange", count=6, unit="m, rad", since=_SINCE_3_1, origin=_MODELLED
    )


@dataclass(frozen=True, slots=True)
class ForceModeData(SubPackage):
    """Generalised forces at the TCP."""

    SUB_TYPE: ClassVar[int] = 7

    wrench: tuple[float, ...] = wire("d", "in base axes", count=6, unit="N, Nm", origin=_MODELLED)
    robot_dexterity: float = wire("d", "squared determinant of the Jacobian", origin=_MODELLED)


@dataclass(frozen=True, slots=True)
class AdditionalInfo(SubPackage):
    """Buttons of the teach pendant. Up to 3.9 the first two are named teach button pressed and enabled."""

    SUB_TYPE: ClassVar[int] = 8

    teach_button_state: int = wire("B", origin=_MODELLED)
    freedrive_button_enabled: bool = wire("?", default=True, origin=_MODELLED)
    io_enabled_freedrive: bool = wire("?", since=since((3, 3)), origin=_MODELLED)
    reserved: int = wire("B", default=1, since=_SINCE_3_10, origin=_CONSTANT)


@dataclass(frozen=True, slots=True)
class SafetyData(SubPackage):
    """Internal; names are ours, from a capture whose four numbers are the elbow and a radius."""

    SUB_TYPE: ClassVar[int] = 10
    SINCE: ClassVar[Since] = _SINCE_3_5

    safety_checksum: int = wire("I", "repeats in MasterboardData", origin=_PROPERTY)
    flag0: int = wire("B", default=1, origin=_CONSTANT)
    flag1: int = wire("B", default=1, origin=_CONSTANT)
    elbow_sphere: tuple[float, ...] = wire("d", "x y z in base, radius", count=4, unit="m", origin=_MODELLED)


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
