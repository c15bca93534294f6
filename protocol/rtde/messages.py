"""RTDE packages as values, one frozen class each; `rtde.codec` encodes them.

The answer to a request has its name with `Reply`. The order of packages is in
`rtde.server_connection` and `rtde.client_connection`.

Source: UR RTDE guide.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TypeAlias

from protocol.rtde.types import TextLevel
from protocol.ur_types import SoftwareVersion

__all__ = [
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


Request: TypeAlias = (
    RequestProtocolVersion | GetControllerVersion | SetupOutputs | SetupInputs | Start | Pause
)
Reply: TypeAlias = (
    RequestProtocolVersionReply
    | GetControllerVersionReply
    | SetupOutputsReply
    | SetupInputsReply
    | StartReply
    | PauseReply
)
Message: TypeAlias = Request | Reply | RtdeTextMessage | DataPackage

REQUESTS: dict[type[Request], type[Reply]] = {
    RequestProtocolVersion: RequestProtocolVersionReply,
    GetControllerVersion: GetControllerVersionReply,
    SetupOutputs: SetupOutputsReply,
    SetupInputs: SetupInputsReply,
    Start: StartReply,
    Pause: PauseReply,
}
"""Requests of the client and their replies; each has exactly one."""
