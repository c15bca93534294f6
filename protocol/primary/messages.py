"""Robot messages (package type 20) of the primary port, one record each.

    i32 size | u8 20 | u64 timestamp | i8 source | u8 message type | fields

Every class is the table of its fields; the functions at the end interpret them, for the box and for
the client. Messages with text at the end use what the package size leaves. Software up to 3.2 had shorter
forms; the rows show which fields came with 3.3.

Sources: UR "Primary/Secondary Client Interface" (2021), UR "Client_Interface" workbook, UR client library;
byte captures named at the classes.
"""

import struct
from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum
from typing import ClassVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary.framing import NO_TIME
from protocol.ur_types import SafetyMode, SoftwareVersion
from protocol.wire_record import ALWAYS, OLDEST, Since, codec_for, since, wire

__all__ = [
    "LONGEST_TITLE",
    "MESSAGES",
    "ErrorCodeMessage",
    "HardwareInfoMessage",
    "KeyMessage",
    "MessageSource",
    "PopupMessage",
    "ProgramLabelMessage",
    "ProgramThreadsMessage",
    "ReportLevel",
    "RequestValueMessage",
    "RequestedType",
    "RobotMessage",
    "RuntimeExceptionMessage",
    "SafetyModeMessage",
    "StartupMessage",
    "TextMessage",
    "ThreadLabel",
    "UnknownMessage",
    "VersionMessage",
    "decode_message",
    "encode_message",
    "version_message",
]


class MessageSource(IntEnum):
    """Sender of a message; joints and boards have further numbers from 20 to 127."""

    GUI = -5
    SIMULATED_ROBOT = -4
    RTMACHINE = -3
    ROBOTINTERFACE = -2
    CONTROLLER = 7
    RTDE = 8


class ReportLevel(IntEnum):
    """Weight of an error code; a client stops its script from VIOLATION on."""

    DEBUG = 0
    INFO = 1
    WARNING = 2
    VIOLATION = 3
    FAULT = 4
    CRITICAL_FAULT = 5


class RequestedType(IntEnum):
    """Type of the answer to a value request; NONE is a popup."""

    BOOLEAN = 0
    INTEGER = 1
    FLOAT = 2
    STRING = 3
    POSE = 4
    JOINT_VECTOR = 5
    NONE = 8


_SINCE_3_3 = since((3, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotMessage:
    """What all messages share; software of SINCE was the first to send it.

    Attributes:
        MESSAGE_TYPE: number on the wire.
        timestamp: microseconds since controller start, or NO_TIME.
        source: sender, see MessageSource.
    """

    MESSAGE_TYPE: ClassVar[int]
    SINCE: ClassVar[Since] = ALWAYS

    timestamp: int = NO_TIME
    source: int = MessageSource.RTMACHINE


@dataclass(frozen=True, slots=True, kw_only=True)
class TextMessage(RobotMessage):
    """Output of the script function `textmsg`."""

    MESSAGE_TYPE: ClassVar[int] = 0

    text: str = wire("s")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramLabelMessage(RobotMessage):
    """Position in PolyScope's program tree; software up to 3.2, then replaced by `ProgramThreadsMessage`."""

    MESSAGE_TYPE: ClassVar[int] = 1

    label_id: int = wire("i", "number after the $")
    text: str = wire("s")


# Characters of a title: its length is one byte on the wire.
LONGEST_TITLE = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class PopupMessage(RobotMessage):
    """Output of the script function `popup`."""

    MESSAGE_TYPE: ClassVar[int] = 2

    request_id: int = wire("I", since=_SINCE_3_3)
    requested_type: int = wire("I", "RequestedType", default=RequestedType.NONE, since=_SINCE_3_3)
    is_warning: bool = wire("?")
    is_error: bool = wire("?")
    is_blocking: bool = wire("?", since=_SINCE_3_3)
    title: str = wire("p")
    text: str = wire("s")


@dataclass(frozen=True, slots=True, kw_only=True)
class VersionMessage(RobotMessage):
    """The first package of every connection; `version_message` makes one.

    Source of the form: captures of 3.3, 3.10, 5.11 and 5.12.
    """

    MESSAGE_TYPE: ClassVar[int] = 3

    source: int = MessageSource.ROBOTINTERFACE
    project_name: str = wire("p", "clients want URControl", default="URControl")
    major: int = wire("B")
    minor: int = wire("B")
    bugfix: int = wire("i", "up to 3.2 the source revision stands here")
    build: int = wire("i", "0 in newer software", since=_SINCE_3_3)
    build_date: str = wire("s", "dd-mm-yyyy, hh:mm:ss; old clients hold 20 characters")


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyModeMessage(RobotMessage):
    """The safety mode changed."""

    MESSAGE_TYPE: ClassVar[int] = 5

    code: int = wire("i", "printed as C<code>A<argument>")
    argument: int = wire("i")
    safety_mode: int = wire("B", "SafetyMode", default=SafetyMode.NORMAL)
    data_type: int = wire("I", "2 signed, 3 float, 4 hexadecimal, else unsigned", since=_SINCE_3_3)
    data: int = wire("I", "bits of the datum", since=_SINCE_3_3)


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorCodeMessage(RobotMessage):
    """An entry of the error log ("RobotComm" in the documents)."""

    MESSAGE_TYPE: ClassVar[int] = 6

    code: int = wire("i", "printed as C<code>A<argument>")
    argument: int = wire("i")
    report_level: int = wire("i", "ReportLevel", default=ReportLevel.INFO, since=_SINCE_3_3)
    data_type: int = wire("I", "2 signed, 3 float, 4 hexadecimal, else unsigned", since=_SINCE_3_3)
    data: int = wire("I", "bits of the datum", since=_SINCE_3_3)
    text: str = wire("s")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyMessage(RobotMessage):
    """Life of a program: the title is one of those below, the text its name.

    Sources: captures quoted by the public client library; PAUSED from Hirebotics/urscript-tools. None is
    known for a program that goes on after a pause.
    """

    MESSAGE_TYPE: ClassVar[int] = 7
    STARTED: ClassVar[str] = "PROGRAM_XXX_STARTED"
    PAUSED: ClassVar[str] = "PROGRAM_XXX_PAUSED"
    STOPPED: ClassVar[str] = "PROGRAM_XXX_STOPPED"

    code: int = wire("i")
    argument: int = wire("i")
    title: str = wire("p")
    text: str = wire("s")


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestValueMessage(RobotMessage):
    """A program asks for a value (`request_integer_from_primary_client` and similar)."""

    MESSAGE_TYPE: ClassVar[int] = 9

    request_id: int = wire("I")
    requested_type: int = wire("I", "RequestedType", default=RequestedType.BOOLEAN)
    text: str = wire("s")


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimeExceptionMessage(RobotMessage):
    """A program failed, while compiling or while running; line 1 is the `def` line, columns count from 1."""

    MESSAGE_TYPE: ClassVar[int] = 10

    line: int = wire("i", since=_SINCE_3_3)
    column: int = wire("i", since=_SINCE_3_3)
    text: str = wire("s")


@dataclass(frozen=True, slots=True, kw_only=True)
class StartupMessage(RobotMessage):
    """Undocumented; follows the version message once.

    Source: captures: (489, 239, 1) on 3.3, (510, 259, 1) on 3.10, (0, 0, 1) on simulators.
    """

    MESSAGE_TYPE: ClassVar[int] = 12

    source: int = MessageSource.ROBOTINTERFACE
    first: int = wire("i")
    second: int = wire("i")
    flag: int = wire("B", default=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreadLabel:
    """Position of one thread in PolyScope's program tree."""

    label_id: int = wire("i", "number after the $")
    text: str = wire("t")
    thread_name: str = wire("t")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramThreadsMessage(RobotMessage):
    """Positions of the threads of a program in PolyScope's program tree.

    Source: the form from UR's document of 5.9. That 3.3 is the first software to send it is assumed: the
    document of 3.2 has the message of one thread, and 3.3 changed other messages.
    """

    MESSAGE_TYPE: ClassVar[int] = 14
    SINCE: ClassVar[Since] = _SINCE_3_3

    threads: tuple[ThreadLabel, ...] = wire("*", record=ThreadLabel)


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareInfoMessage(RobotMessage):
    """What the arm and the box are; once for each client of the primary port.

    Source: UR client library, which names 5.26 and 10.14 as the first software; that 10.13 sends it too is
    inferred, since its wire is that of 5.26.
    """

    MESSAGE_TYPE: ClassVar[int] = 18
    SINCE: ClassVar[Since] = since(None, (5, 26))

    source: int = MessageSource.ROBOTINTERFACE
    robot_type: int = wire("i", "RobotType")
    reserved1: int = wire("H")
    box_series: int = wire("H", "5 CB5, 7 CB7", default=5)
    reserved2: int = wire("H")
    tool_flange_type: int = wire("H", "1 and 2: versions of the flange", default=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownMessage(RobotMessage):
    """A message that this package has no table for; `body` is what follows the message type."""

    MESSAGE_TYPE: ClassVar[int] = -1

    message_type: int
    body: bytes


MESSAGES: tuple[type[RobotMessage], ...] = (
    TextMessage,
    ProgramLabelMessage,
    PopupMessage,
    VersionMessage,
    SafetyModeMessage,
    ErrorCodeMessage,
    KeyMessage,
    RequestValueMessage,
    RuntimeExceptionMessage,
    StartupMessage,
    ProgramThreadsMessage,
    HardwareInfoMessage,
)
"""All messages with a table."""


# --- their bytes


# First software whose version message has the third number, and the first with the new form of the date.
_THIRD_NUMBER = since((3, 3))
_NEW_FORM = SoftwareVersion(3, 10)
_BY_TYPE = {message.MESSAGE_TYPE: message for message in MESSAGES}
_HEADER = struct.Struct(">QbB")  # timestamp, source, message type


def version_message(
    version: SoftwareVersion, built: datetime = datetime(2019, 5, 3, 6, 39)
) -> VersionMessage:
    """Return the version message of a controller.

    Up to 3.2 the build number is in the place of the third number; from 3.10 on it is 0. The date has two
    forms. Source: captures of 3.3 and 3.10; that both changes came with 3.10 is assumed.
    """
    is_new = version >= _NEW_FORM
    return VersionMessage(
        major=version.major,
        minor=version.minor,
        bugfix=version.bugfix if _THIRD_NUMBER.covers(version) else version.build,
        build=0 if is_new else version.build,
        build_date=built.strftime("%d-%m-%Y, %H:%M:%S" if is_new else "%b %d %Y, %H:%M:%S"),
    )


def encode_message(message: RobotMessage, version: SoftwareVersion) -> bytes:
    """Body of a message package, from the timestamp on, as software `version` sends it.

    LocalProtocolError: a value does not fit its field, or the message has no table.
    """
    if message.MESSAGE_TYPE not in _BY_TYPE:
        raise LocalProtocolError(f"{type(message).__name__} has no table and cannot be sent")
    try:
        header = _HEADER.pack(message.timestamp, message.source, message.MESSAGE_TYPE)
    except struct.error as problem:
        raise LocalProtocolError(
            f"timestamp {message.timestamp} or source {message.source} cannot be sent: {problem}"
        ) from None
    return header + codec_for(type(message), version).encode(message)


def decode_message(body: bytes, version: SoftwareVersion) -> RobotMessage:
    """The inverse of `encode_message`; a version message is decoded for the version that it contains.

    RemoteProtocolError: the body ends before the fields do.
    """
    if len(body) < _HEADER.size:
        raise RemoteProtocolError(f"a robot message of {len(body)} bytes is shorter than its header")
    timestamp, source, message_type = _HEADER.unpack_from(body)
    data = body[_HEADER.size :]
    record = _BY_TYPE.get(message_type)
    if record is None:
        return UnknownMessage(timestamp=timestamp, source=source, message_type=message_type, body=data)
    if record is VersionMessage:
        name_end = 1 + data[0] if data else 0
        if len(data) >= name_end + 2:
            version = SoftwareVersion(data[name_end], data[name_end + 1])
    fields = codec_for(record, max(version, OLDEST)).decode_fields(data)
    return record(timestamp=timestamp, source=source, **fields)
