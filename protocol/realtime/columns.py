"""The realtime interface as tables: every column of port 30003, and the frame size of every software version.

A frame of a version is a prefix of `COLUMNS`. To add a column: add a row at the end with the frame size in
which it first appears, and a row to `VERSIONS`. Frames of CB2 controllers (software before 3.0) have other
columns and are not supported.
Columns are named as in RTDE where RTDE has the value; Python names are the same in lower case.

Source of names, order and sizes, unless a row says otherwise: UR "Realtime Client Interface" (2021,
chapters 5.9 and 5.10) and UR "Client_Interface" workbook (software up to 3.2); sizes between 3.5 and 3.13
from the layouts in sawUniversalRobot and the Robotics Library. The documents agree except for the digital
bits, see their row.
"""

from __future__ import annotations

from dataclasses import dataclass

from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ValueOrigin

__all__ = ["COLUMNS", "VERSIONS", "RealtimeColumn"]


@dataclass(frozen=True, slots=True)
class RealtimeColumn:
    """One row of the table: a scalar or vector of 64-bit floats.

    Attributes:
        name: as in RTDE; internal columns are `internal_<first gnuplot column>`.
        count: number of floats.
        unit: SI unit, or "enum", "bits", "-".
        since_size: size in bytes of the shortest frame that has the column.
        origin: how the emulated box fills it.
        meaning: of the value, with its frame of reference.
        source: only where it is not the sheet named in the module's docstring.
    """

    name: str
    count: int
    unit: str
    since_size: int
    origin: ValueOrigin
    meaning: str
    source: str = "UR realtime client interface sheet"

    @property
    def attribute(self) -> str:
        """The Python name: `actual_TCP_pose` is `actual_tcp_pose`."""
        return self.name.lower()


_C = RealtimeColumn
_MEASURED, _MODELLED, _CONSTANT, _ZERO = (
    ValueOrigin.MEASURED,
    ValueOrigin.MODELLED,
    ValueOrigin.CONSTANT,
    ValueOrigin.INTERNAL_ZERO,
)

_DIGITAL_BITS = (
    "UR realtime sheet ('encoded as int64_t' but typed double); UR forum 1811: every field is a double"
)

COLUMNS: tuple[RealtimeColumn, ...] = (
    _C("timestamp", 1, "s", 1044, _MODELLED, "time since the controller started"),
    _C("target_q", 6, "rad", 1044, _MODELLED, "joint position set-point, not wrapped to +-pi"),
    _C("target_qd", 6, "rad/s", 1044, _MODELLED, "joint velocity set-point"),
    _C("target_qdd", 6, "rad/s2", 1044, _MODELLED, "joint acceleration set-point"),
    _C("target_current", 6, "A", 1044, _MODELLED, "joint current that the controller's model expects"),
    _C("target_moment", 6, "Nm", 1044, _MODELLED, "joint torque that the controller's model expects"),
    _C("actual_q", 6, "rad", 1044, _MEASURED, "joint position, not wrapped to +-pi"),
    _C("actual_qd", 6, "rad/s", 1044, _MEASURED, "joint velocity"),
    _C("actual_current", 6, "A", 1044, _MEASURED, "joint motor current"),
    _C("joint_control_output", 6, "A", 1044, _MEASURED, "joint control current, output of the servo"),
    _C("actual_TCP_pose", 6, "m, rad", 1044, _MODELLED, "pose of the TCP in base, from actual_q"),
    _C("actual_TCP_speed", 6, "m/s, rad/s", 1044, _MODELLED, "twist of the TCP in base axes, from actual_qd"),
    _C("actual_TCP_force", 6, "N, Nm", 1044, _MODELLED, "external wrench in base axes, from currents on CB3"),
    _C("target_TCP_pose", 6, "m, rad", 1044, _MODELLED, "pose of the TCP in base, from target_q"),
    _C("target_TCP_speed", 6, "m/s, rad/s", 1044, _MODELLED, "twist of the TCP in base axes, from target_qd"),
    _C("actual_digital_input_bits", 1, "bits", 1044, _MODELLED,
       "0-7 standard, 8-15 configurable, 16-17 tool; sent as the double 5.0 for bits 0 and 2", _DIGITAL_BITS),
    _C("joint_temperatures", 6, "degC", 1044, _MEASURED, "motor temperatures"),
    _C("actual_execution_time", 1, "-", 1044, _MODELLED,
       "controller timer, run time of a cycle in ms, by the work of programs; 0 on CB3"),
    _C("test_value", 1, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("robot_mode", 1, "enum", 1044, _MODELLED, "RobotMode"),
    _C("joint_mode", 6, "enum", 1044, _MODELLED, "JointMode"),
    _C("safety_mode", 1, "enum", 1044, _MODELLED, "SafetyMode"),
    _C("internal_103", 6, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("actual_tool_accelerometer", 3, "m/s2", 1044, _MEASURED, "x y z at the tool; sign is undocumented"),
    _C("internal_112", 6, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("speed_scaling", 1, "-", 1044, _MODELLED, "0 to 1, of the trajectory limiter"),
    _C("actual_momentum", 1, "kg m/s", 1044, _MODELLED, "norm of the linear momentum"),
    _C("internal_120", 1, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("internal_121", 1, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("actual_main_voltage", 1, "V", 1044, _CONSTANT, "main voltage at the masterboard"),
    _C("actual_robot_voltage", 1, "V", 1044, _MODELLED, "48 V bus of the arm, 0 without power"),
    _C("actual_robot_current", 1, "A", 1044, _MODELLED, "current into the arm"),
    _C("actual_joint_voltage", 6, "V", 1044, _MEASURED, "bus voltage at each joint"),
    _C("actual_digital_output_bits", 1, "bits", 1060, _MODELLED, "numbered and sent as the input bits",
       _DIGITAL_BITS),
    _C("runtime_state", 1, "enum", 1060, _MODELLED, "ProgramState"),
    _C("elbow_position", 3, "m", 1108, _MODELLED, "x y z in base"),
    _C("elbow_velocity", 3, "m/s", 1108, _MODELLED, "x y z in base axes"),
    _C("safety_status", 1, "enum", 1116, _MODELLED, "SafetyStatus"),
    _C("internal_140", 1, "-", 1140, _ZERO, "used by UR's own software only"),
    _C("internal_141", 1, "-", 1140, _ZERO, "used by UR's own software only"),
    _C("internal_142", 1, "-", 1140, _ZERO, "used by UR's own software only"),
    _C("payload", 1, "kg", 1220, _MODELLED, "mass of the payload"),
    _C("payload_cog", 3, "m", 1220, _MODELLED, "x y z of its centre of gravity in the flange frame"),
    _C("payload_inertia", 6, "kg m2", 1220, _MODELLED, "Ixx Iyy Izz Ixy Ixz Iyz, as stated; else 0"),
)  # fmt: skip
"""A frame of n bytes holds the rows with `since_size` <= n."""

VERSIONS: tuple[tuple[SoftwareVersion, int], ...] = (
    (SoftwareVersion(3, 0), 1044),
    (SoftwareVersion(3, 2), 1060),
    (SoftwareVersion(3, 5), 1108),
    (SoftwareVersion(3, 10), 1116),
    (SoftwareVersion(3, 14), 1140),
    (SoftwareVersion(5, 0), 1108),
    (SoftwareVersion(5, 4), 1116),
    (SoftwareVersion(5, 9), 1140),
    (SoftwareVersion(5, 10), 1220),
)
"""First software version of each frame size in bytes, ascending. Major 4 was never released."""
