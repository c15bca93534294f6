"""Numbers and names of the controller: modes, software versions, ports.

The numbers are those of the vendor's client interface documents, the same on every port.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import IntEnum
from math import radians
from typing import NamedTuple

from protocol.errors import LocalProtocolError

__all__ = [
    "JOINT_ACCELERATION",
    "JOINT_NAMES",
    "JOINT_SPEED",
    "LOCKSTEP_MASTERBOARD",
    "SIMULATED_MASTERBOARD",
    "SIMULATOR_CHECKSUM",
    "ControlMode",
    "JointMode",
    "Ports",
    "ProgramState",
    "RobotMode",
    "RobotType",
    "SafetyMode",
    "SafetyStatus",
    "SoftwareVersion",
]

JOINT_NAMES = ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3")
"""Joints in the order of every six-vector on the wire."""


JOINT_ACCELERATION = radians(80.0)
"""Default of moves of the joints [rad/s²], 1.4 in the manual.

Source: moves with `t` of a real UR3, which stretch the profile of the defaults; captured configuration data.
"""
JOINT_SPEED = radians(60.0)
"""Likewise [rad/s], 1.05 in the manual."""


class RobotMode(IntEnum):
    """Robot mode. Source: UR primary/secondary client interface, robot mode data."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7
    UPDATING_FIRMWARE = 8


class JointMode(IntEnum):
    """Mode of one joint; a subset also serves as tool mode.

    Source: UR primary/secondary client interface, joint data; rarer ones from the older workbook.
    """

    RESET = 235
    SHUTTING_DOWN = 236
    PART_D_CALIBRATION = 237
    BACKDRIVE = 238
    POWER_OFF = 239
    READY_FOR_POWER_OFF = 240
    CALVAL_INITIALIZATION = 241
    ERROR = 242
    FREEDRIVE = 243
    SIMULATED = 244
    NOT_RESPONDING = 245
    MOTOR_INITIALISATION = 246
    BOOTING = 247
    PART_D_CALIBRATION_ERROR = 248
    BOOTLOADER = 249
    CALIBRATION = 250
    VIOLATION = 251
    FAULT = 252
    RUNNING = 253
    INITIALISATION = 254
    IDLE = 255


class ControlMode(IntEnum):
    """How the arm is controlled. Source: UR primary/secondary client interface, robot mode data."""

    POSITION = 0
    TEACH = 1
    FORCE = 2
    TORQUE = 3


class SafetyMode(IntEnum):
    """State of the safety system.

    Source: UR primary/secondary client interface, masterboard data; from 12 on UR client library, e-Series;
    23 messages of the ROS 2 driver (`ur_dashboard_msgs/SafetyStatus`).
    """

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9
    VALIDATE_JOINT_ID = 10
    UNDEFINED_SAFETY_MODE = 11
    AUTOMATIC_MODE_SAFEGUARD_STOP = 12
    SYSTEM_THREE_POSITION_ENABLING_STOP = 13
    TP_THREE_POSITION_ENABLING_STOP = 14
    IMMI_EMERGENCY_STOP = 15
    IMMI_SAFEGUARD_STOP = 16
    PROFISAFE_WAITING_FOR_PARAMETERS = 17
    PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP = 18
    PROFISAFE_SAFEGUARD_STOP = 19
    PROFISAFE_EMERGENCY_STOP = 20
    SAFETY_API_SAFEGUARD_STOP = 22
    IO_PLANE_STOP = 23


SafetyStatus = SafetyMode
"""Safety mode that tells safeguard stops apart, since software 3.10 / 5.4. Source: UR RTDE guide."""


class ProgramState(IntEnum):
    """Program state of the realtime interface, RTDE's `runtime_state`. Source: UR RTDE guide."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


class RobotType(IntEnum):
    """Robot type code of the configuration data. Source: UR client library, `datatypes.h`."""

    UR5 = 1
    UR10 = 2
    UR3 = 3
    UR16 = 4
    UR18 = 5
    UR8LONG = 6
    UR20 = 7
    UR30 = 8
    UR15 = 9


class SoftwareVersion(NamedTuple):
    """Version of the controller software; compares as a tuple. CB3 is major 3, e-Series major 5."""

    major: int
    minor: int
    bugfix: int = 0
    build: int = 0

    @classmethod
    def parse(cls, text: str) -> SoftwareVersion:
        """Read `3.15`, `3.15.8` or `3.15.8.106339`; LocalProtocolError if the text is none of these."""
        parts = text.strip().split(".")
        if not 2 <= len(parts) <= 4 or not all(part.isascii() and part.isdigit() for part in parts):
            raise LocalProtocolError(
                f"{text!r} is not a software version: give major.minor.bugfix, such as 3.15.8"
            )
        return cls(*map(int, parts))

    @property
    def as_e_series(self) -> SoftwareVersion:
        """The software 5.x with the same wire formats; only PolyScope X (10.x) has another number.

        Source: releases that the maker documents together, 5.21 and 10.8 to 5.26 and 10.13.
        """
        return self if self.major < 10 else SoftwareVersion(5, self.minor + 13, self.bugfix)

    def __str__(self) -> str:
        text = f"{self.major}.{self.minor}.{self.bugfix}"
        return f"{text}.{self.build}" if self.build else text


@dataclass(frozen=True, slots=True)
class Ports:
    """TCP ports of one control box; 0 for one that is not open.

    Source: UR remote control overview; clients hard-code these numbers.

    Attributes:
        robot_api: Robot API of PolyScope X over HTTP.
        dashboard: commands for programs, power and stops, a line each.
        primary: states and all messages, ten a second; takes scripts.
        secondary: states, ten a second; takes scripts.
        realtime: frames, one a control cycle; takes scripts.
        rtde: the variables that a client asks for, up to one package a control cycle.
        primary_ro: as primary; takes nothing.
        secondary_ro: as secondary; takes nothing.
        realtime_ro: as realtime; takes nothing.
        interpreter: takes statements for a program in interpreter mode; not on CB3. Source: script manual.
        modbus: Modbus TCP.
        gripper: variables of a Robotiq gripper (docs/grippers.md).
        onrobot: methods of OnRobot grippers (docs/grippers.md).
        tool_line: the serial line at the tool (docs/grippers.md).
    """

    robot_api: int = 80
    dashboard: int = 29999
    primary: int = 30001
    secondary: int = 30002
    realtime: int = 30003
    rtde: int = 30004
    primary_ro: int = 30011
    secondary_ro: int = 30012
    realtime_ro: int = 30013
    interpreter: int = 30020
    modbus: int = 502
    gripper: int = 63352
    onrobot: int = 41414
    tool_line: int = 54321

    @classmethod
    def of(cls, numbers: Mapping[str, int]) -> Ports:
        """The ports of these numbers by name; the others are not open."""
        return cls(**{field.name: numbers.get(field.name, 0) for field in fields(cls)})

    @classmethod
    def standard(cls, offset: int = 0) -> Ports:
        """The vendor's ports, all moved by `offset` for machines where they are taken.

        Those of Modbus and of the Robot API, far below the others, and those of grippers, far above them,
        are 0 (none) where they would leave the TCP ports. LocalProtocolError if another one would leave
        1..65535.
        """
        low, high = 1 - cls().dashboard, 65535 - cls().interpreter
        if not low <= offset <= high:
            raise LocalProtocolError(f"port offset {offset} leaves the TCP ports: use {low} to {high}")
        moved = {name: port + offset for name, port in asdict(cls()).items()}
        return cls(**{name: port if 1 <= port <= 65535 else 0 for name, port in moved.items()})


SIMULATED_MASTERBOARD = 2099
"""Masterboard version of an emulated box: software before 3.12 sends no serial number. A UR5e has 6."""

LOCKSTEP_MASTERBOARD = 2100
"""That of an emulated box whose time waits for its clients."""

SIMULATOR_CHECKSUM = 0xFFFFFFFF
"""Calibration checksum of each joint in the maker's own simulator. Source: URCL, captures of URSim."""
