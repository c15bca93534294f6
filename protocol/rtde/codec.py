"""RTDE's packages, one frozen class each, and their bytes in both protocol versions and directions.

    u16 size, header included | u8 type | payload        big-endian

The answer to a request has its name with `Reply`. The same type byte means another payload in the other
direction, so decoding needs to know the sender. The order of packages is in `rtde.server_connection` and
`rtde.client_connection`.

Source: UR RTDE guide. Data packages of the robot carry no recipe id in version 1: so the public client
library and the Robotics Library read them, against the guide's table.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rtde.types import TextLevel
from protocol.ur_types import SoftwareVersion

__all__ = [
    "HEADER_SIZE",
    "MAX_NAMES_SIZE",
    "MAX_SIZE",
    "REQUESTS",
    "VERSIONS",
    "DataPackage",
    "GetControllerVersion",
    "GetControllerVersionReply",
    "Message",
    "Pause",
    "PauseReply",
    "Reply",
    "Request",
    "RequestProtocolVersion",
    "RequestProtocolVersionReply",
    "Role",
    "RtdePackageType",
    "RtdeTextMessage",
    "SetupInputs",
    "SetupInputsReply",
    "SetupOutputs",
    "SetupOutputsReply",
    "Start",
    "StartReply",
    "data_header",
    "decode_message",
    "encode_message",
    "take_package",
]


VERSIONS = (1, 2)
"""Protocol versions that exist; a connection begins in the first."""


class Role(Enum):
    """Which end sends a package."""

    ROBOT = "robot"
    PC = "pc"


class RtdePackageType(IntEnum):
    """Type byte, the same in both directions."""

    REQUEST_PROTOCOL_VERSION = ord("V")
    GET_CONTROLLER_VERSION = ord("v")
    TEXT_MESSAGE = ord("M")
    DATA_PACKAGE = ord("U")
    SETUP_OUTPUTS = ord("O")
    SETUP_INPUTS = ord("I")
    START = ord("S")
    PAUSE = ord("P")


# --- client to robot


@dataclass(frozen=True, slots=True)
class RequestProtocolVersion:
    """Ask for a protocol version."""

    version: int


@dataclass(frozen=True, slots=True)
class GetControllerVersion:
    """Ask for the controller's software version."""


@dataclass(frozen=True, slots=True)
class SetupOutputs:
    """Ask for variables. `frequency`: packages a second; None in version 1, which has one rate only."""

    names: tuple[str, ...]
    frequency: float | None = None


@dataclass(frozen=True, slots=True)
class SetupInputs:
    """Announce variables that the client will write."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Start:
    """Start sending data packages."""


@dataclass(frozen=True, slots=True)
class Pause:
    """Stop sending data packages; recipes stay."""


# --- robot to client


@dataclass(frozen=True, slots=True)
class RequestProtocolVersionReply:
    """Whether the version is used from now on."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class GetControllerVersionReply:
    """The controller's software version."""

    version: SoftwareVersion


@dataclass(frozen=True, slots=True)
class SetupOutputsReply:
    """One word for each name: its type or NOT_FOUND. `recipe_id`: None in version 1."""

    types: tuple[str, ...]
    recipe_id: int | None = None


@dataclass(frozen=True, slots=True)
class SetupInputsReply:
    """One word for each name: its type, NOT_FOUND or IN_USE. `recipe_id`: 0 without a recipe."""

    types: tuple[str, ...]
    recipe_id: int


@dataclass(frozen=True, slots=True)
class StartReply:
    """Whether data packages flow."""

    accepted: bool


@dataclass(frozen=True, slots=True)
class PauseReply:
    """Whether data packages have stopped."""

    accepted: bool


# --- both directions


@dataclass(frozen=True, slots=True)
class RtdeTextMessage:
    """A line for the log. Version 1 carries no source, and no level from client to robot."""

    message: str
    source: str = ""
    level: int = TextLevel.INFO


@dataclass(frozen=True, slots=True)
class DataPackage:
    """Values of one recipe, still as bytes. `recipe_id`: None from the robot in version 1."""

    values: bytes
    recipe_id: int | None = None


Request = RequestProtocolVersion | GetControllerVersion | SetupOutputs | SetupInputs | Start | Pause
Reply = (
    RequestProtocolVersionReply
    | GetControllerVersionReply
    | SetupOutputsReply
    | SetupInputsReply
    | StartReply
    | PauseReply
)
Message = Request | Reply | RtdeTextMessage | DataPackage

REQUESTS: dict[type[Request], type[Reply]] = {
    RequestProtocolVersion: RequestProtocolVersionReply,
    GetControllerVersion: GetControllerVersionReply,
    SetupOutputs: SetupOutputsReply,
    SetupInputs: SetupInputsReply,
    Start: StartReply,
    Pause: PauseReply,
}
"""Requests of the client and their replies; each has exactly one."""


_HEADER = struct.Struct(">HB")
HEADER_SIZE = _HEADER.size

MAX_SIZE = 0xFFFF
"""Largest package in bytes that the header can announce."""

MAX_NAMES_SIZE = 2048
"""Longest list of names in bytes that every software takes. Source: UR RTDE guide."""


# --- encoding


def encode_message(message: Message, sender: Role, version: int) -> bytes:
    """Bytes of a package in a version of the protocol; only text messages depend on who sends them.

    LocalProtocolError: a name, text or number has no place on the wire.
    """
    try:
        kind, payload = _encode_payload(message, sender, version)
        return _HEADER.pack(HEADER_SIZE + len(payload), kind) + payload
    except (struct.error, UnicodeEncodeError, OverflowError) as problem:
        raise LocalProtocolError(f"{message!r} cannot be sent: {problem}") from None


def data_header(size: int, recipe_id: int | None) -> bytes:
    """The header of a data package with `size` bytes of values."""
    tail = b"" if recipe_id is None else bytes((recipe_id,))
    return _HEADER.pack(HEADER_SIZE + len(tail) + size, RtdePackageType.DATA_PACKAGE) + tail


def _encode_payload(message: Message, sender: Role, version: int) -> tuple[RtdePackageType, bytes]:
    match message:
        case RequestProtocolVersion(wanted):
            return RtdePackageType.REQUEST_PROTOCOL_VERSION, struct.pack(">H", wanted)
        case RequestProtocolVersionReply(accepted):
            return RtdePackageType.REQUEST_PROTOCOL_VERSION, bytes((accepted,))
        case GetControllerVersion():
            return RtdePackageType.GET_CONTROLLER_VERSION, b""
        case GetControllerVersionReply(software):
            return RtdePackageType.GET_CONTROLLER_VERSION, struct.pack(">4I", *software)
        case SetupOutputs(names, frequency):
            if (frequency is None) is not (version == 1):
                raise LocalProtocolError(
                    f"frequency {frequency} given: version 1 takes none, version 2 needs one"
                )
            head = b"" if frequency is None else struct.pack(">d", frequency)
            return RtdePackageType.SETUP_OUTPUTS, head + _encode_names(names)
        case SetupOutputsReply(types, recipe_id):
            if (recipe_id is None) is not (version == 1):
                raise LocalProtocolError(
                    f"recipe id {recipe_id} given: version 1 takes none, version 2 needs one"
                )
            head = b"" if recipe_id is None else struct.pack(">B", recipe_id)
            return RtdePackageType.SETUP_OUTPUTS, head + _encode_words(types)
        case SetupInputs(names):
            return RtdePackageType.SETUP_INPUTS, _encode_names(names)
        case SetupInputsReply(types, recipe_id):
            return RtdePackageType.SETUP_INPUTS, struct.pack(">B", recipe_id) + _encode_words(types)
        case Start():
            return RtdePackageType.START, b""
        case StartReply(accepted):
            return RtdePackageType.START, bytes((accepted,))
        case Pause():
            return RtdePackageType.PAUSE, b""
        case PauseReply(accepted):
            return RtdePackageType.PAUSE, bytes((accepted,))
        case DataPackage(values, recipe_id):
            head = b"" if recipe_id is None else struct.pack(">B", recipe_id)
            return RtdePackageType.DATA_PACKAGE, head + values
        case RtdeTextMessage():
            return RtdePackageType.TEXT_MESSAGE, _encode_text(message, sender, version)


def _encode_text(message: RtdeTextMessage, sender: Role, version: int) -> bytes:
    text = message.message.encode("latin-1", "replace")
    level = struct.pack(">B", message.level)
    if version == 1:
        return level + text if sender is Role.ROBOT else text
    # Lengths are one byte: the end of a long text is cut off rather than the text refused.
    text, source = text[:255], message.source.encode("latin-1", "replace")[:255]
    return bytes((len(text),)) + text + bytes((len(source),)) + source + level


def _encode_words(words: tuple[str, ...]) -> bytes:
    return ",".join(words).encode("ascii")


def _encode_names(names: tuple[str, ...]) -> bytes:
    for name in names:
        if not name or "," in name:
            raise LocalProtocolError(f"{name!r} is not a name of a variable")
    data = _encode_words(names)
    if len(data) > MAX_NAMES_SIZE:
        raise LocalProtocolError(
            f"{len(names)} names take {len(data)} bytes, a recipe takes {MAX_NAMES_SIZE}: ask for fewer"
        )
    return data


# --- decoding


def take_package(buffer: bytearray, max_size: int) -> tuple[int, bytes] | None:
    """Remove the first package from received bytes: its type byte and payload, or None if it is not whole.

    RemoteProtocolError: the header announces less than itself or more than `max_size` bytes.
    """
    if len(buffer) < 2:
        return None
    size = int.from_bytes(buffer[:2], "big")
    if not HEADER_SIZE <= size <= max_size:
        raise RemoteProtocolError(
            f"an RTDE package of {size} bytes: at least {HEADER_SIZE}, at most {max_size}, are possible; "
            "not RTDE, or the package boundary is lost"
        )
    if len(buffer) < size:
        return None
    package = buffer[2], bytes(buffer[HEADER_SIZE:size])
    del buffer[:size]
    return package


def decode_message(kind: int, payload: bytes, sender: Role, version: int) -> Message | None:
    """Package from its type byte and what follows, or None if the type is unknown.

    Surplus bytes after a fixed payload are skipped. RemoteProtocolError: the payload is too short for its
    type.
    """
    decode = (_FROM_PC if sender is Role.PC else _FROM_ROBOT).get(kind)
    if decode is None:
        return None
    try:
        return decode(payload, version)
    except (struct.error, IndexError):
        raise RemoteProtocolError(
            f"an RTDE package of type {chr(kind)!r} cannot have only {len(payload)} bytes of payload"
        ) from None


def _decode_words(data: bytes) -> tuple[str, ...]:
    words = data.decode("latin-1").split(",")
    if not words[-1]:
        words.pop()  # ur_rtde ends every list with a comma
    return tuple(words)


def _decode_setup_outputs(payload: bytes, version: int) -> SetupOutputs:
    if version == 1:
        return SetupOutputs(_decode_words(payload))
    (frequency,) = struct.unpack_from(">d", payload)
    return SetupOutputs(_decode_words(payload[8:]), frequency)


def _decode_setup_outputs_reply(payload: bytes, version: int) -> SetupOutputsReply:
    if version == 1:
        return SetupOutputsReply(_decode_words(payload))
    return SetupOutputsReply(_decode_words(payload[1:]), payload[0])


def _decode_robot_data(payload: bytes, version: int) -> DataPackage:
    return DataPackage(payload) if version == 1 else DataPackage(payload[1:], payload[0])


def _decode_pc_text(payload: bytes, version: int) -> RtdeTextMessage:
    return RtdeTextMessage(payload.decode("latin-1")) if version == 1 else _decode_text(payload)


def _decode_robot_text(payload: bytes, version: int) -> RtdeTextMessage:
    if version == 1:
        return RtdeTextMessage(payload[1:].decode("latin-1"), level=payload[0])
    return _decode_text(payload)


def _decode_text(payload: bytes) -> RtdeTextMessage:
    end = 1 + payload[0]
    source_end = end + 1 + payload[end]
    return RtdeTextMessage(
        payload[1:end].decode("latin-1"), payload[end + 1 : source_end].decode("latin-1"), payload[source_end]
    )


_Decoder = Callable[[bytes, int], Message]

_FROM_PC: dict[int, _Decoder] = {
    RtdePackageType.REQUEST_PROTOCOL_VERSION: lambda data, _: RequestProtocolVersion(
        *struct.unpack_from(">H", data)
    ),
    RtdePackageType.GET_CONTROLLER_VERSION: lambda data, _: GetControllerVersion(),
    RtdePackageType.SETUP_OUTPUTS: _decode_setup_outputs,
    RtdePackageType.SETUP_INPUTS: lambda data, _: SetupInputs(_decode_words(data)),
    RtdePackageType.START: lambda data, _: Start(),
    RtdePackageType.PAUSE: lambda data, _: Pause(),
    RtdePackageType.TEXT_MESSAGE: _decode_pc_text,
    RtdePackageType.DATA_PACKAGE: lambda data, _: DataPackage(data[1:], data[0]),
}
_FROM_ROBOT: dict[int, _Decoder] = {
    RtdePackageType.REQUEST_PROTOCOL_VERSION: lambda data, _: RequestProtocolVersionReply(data[0] != 0),
    RtdePackageType.GET_CONTROLLER_VERSION: lambda data, _: GetControllerVersionReply(
        SoftwareVersion(*struct.unpack_from(">4I", data))
    ),
    RtdePackageType.SETUP_OUTPUTS: _decode_setup_outputs_reply,
    RtdePackageType.SETUP_INPUTS: lambda data, _: SetupInputsReply(_decode_words(data[1:]), data[0]),
    RtdePackageType.START: lambda data, _: StartReply(data[0] != 0),
    RtdePackageType.PAUSE: lambda data, _: PauseReply(data[0] != 0),
    RtdePackageType.TEXT_MESSAGE: _decode_robot_text,
    RtdePackageType.DATA_PACKAGE: _decode_robot_data,
}
