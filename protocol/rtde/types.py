"""Data types of RTDE variables, and the words that a reply has instead of a type.

Everything is big-endian. The variables are in `rtde.fields`, the packages in `rtde.codec`.
"""

import struct
from enum import Enum, IntEnum, IntFlag

__all__ = [
    "IN_USE",
    "NOT_FOUND",
    "REFUSALS",
    "RobotStatusBits",
    "RtdeState",
    "RtdeType",
    "RtdeValue",
    "SafetyStatusBits",
    "TextLevel",
    "TimeScaleSource",
]

RtdeValue = bool | int | float | tuple[int, ...] | tuple[float, ...]
"""Value of a variable in Python: a tuple for a vector, a number otherwise."""


class RtdeType(Enum):
    """Data type of a variable; the value is its name on the wire.

    The guide also lists STRING, but no variable has that type and its bytes are written down nowhere.
    Source: UR RTDE guide, table of data types.
    """

    BOOL = "BOOL"
    UINT8 = "UINT8"
    UINT32 = "UINT32"
    INT32 = "INT32"
    UINT64 = "UINT64"
    DOUBLE = "DOUBLE"
    VECTOR3D = "VECTOR3D"
    VECTOR6D = "VECTOR6D"
    VECTOR6INT32 = "VECTOR6INT32"
    VECTOR6UINT32 = "VECTOR6UINT32"

    @property
    def letters(self) -> str:
        """One `struct` letter for each number."""
        return _LETTERS[self]

    @property
    def count(self) -> int:
        """Numbers in a value; 1 for a scalar."""
        return len(_LETTERS[self])

    @property
    def size(self) -> int:
        """Bytes of a value."""
        return struct.calcsize(">" + _LETTERS[self])


_LETTERS = {
    RtdeType.BOOL: "?",
    RtdeType.UINT8: "B",
    RtdeType.UINT32: "I",
    RtdeType.INT32: "i",
    RtdeType.UINT64: "Q",
    RtdeType.DOUBLE: "d",
    RtdeType.VECTOR3D: "ddd",
    RtdeType.VECTOR6D: "dddddd",
    RtdeType.VECTOR6INT32: "iiiiii",
    RtdeType.VECTOR6UINT32: "IIIIII",
}

NOT_FOUND = "NOT_FOUND"
"""Stands for a type in a reply: this software has no such variable."""

IN_USE = "IN_USE"
"""Stands for a type in a reply to an input set-up: another client owns the variable."""

REFUSALS = frozenset((NOT_FOUND, IN_USE))
"""Words that make the recipe of a reply invalid as a whole."""


class TextLevel(IntEnum):
    """Severity of a text message. Source: UR RTDE guide."""

    EXCEPTION = 0
    ERROR = 1
    WARNING = 2
    INFO = 3


class RtdeState(Enum):
    """Whether data packages flow to the client."""

    PAUSED = "paused"
    STARTED = "started"


class RobotStatusBits(IntFlag):
    """Bits of `robot_status_bits`. Source: UR RTDE guide."""

    POWER_ON = 1 << 0
    PROGRAM_RUNNING = 1 << 1
    TEACH_BUTTON_PRESSED = 1 << 2
    POWER_BUTTON_PRESSED = 1 << 3


class SafetyStatusBits(IntFlag):
    """Bits of `safety_status_bits`. Source: UR RTDE guide; bit 11: UR client library, e-Series."""

    NORMAL_MODE = 1 << 0
    REDUCED_MODE = 1 << 1
    PROTECTIVE_STOPPED = 1 << 2
    RECOVERY_MODE = 1 << 3
    SAFEGUARD_STOPPED = 1 << 4
    SYSTEM_EMERGENCY_STOPPED = 1 << 5
    ROBOT_EMERGENCY_STOPPED = 1 << 6
    EMERGENCY_STOPPED = 1 << 7
    VIOLATION = 1 << 8
    FAULT = 1 << 9
    STOPPED_DUE_TO_SAFETY = 1 << 10
    THREE_POSITION_ENABLING_INPUT_ACTIVE = 1 << 11


class TimeScaleSource(IntEnum):
    """What scales the time of the running program: `time_scale_source`. Source: UR RTDE guide."""

    OTHER = -1
    PROGRAM_NOT_RUNNING = 0
    NOT_SCALED = 1
    JOINT_TORQUE = 2
    JOINT_ACCELERATION = 3
    POWER_SUPPLY = 4
    MOMENTUM = 5
    STOPPING_TIME = 6
    STOPPING_DISTANCE = 7
    TOOL_SPEED = 8
    ELBOW_SPEED = 9
    JOINT_SPEED = 10
    SAFETY_STATE_CHANGE = 11
    SAFETY_API_STOPPING_DISTANCE = 12
    TOOL_WRENCH = 13
    EXTERNAL_AXIS_SPEED = 14
    EXTERNAL_AXIS_STOPPING = 15
