"""The robot's side of RTDE, port 30004, without I/O.

    PC -> robot   V, v, O, I, S, P        every one gets exactly one reply, in order
    PC -> robot   any other type          the reply is a text (chosen)
    PC -> robot   U (input data)          at any time, never a reply
    robot -> PC   U (output data)         after the reply to S, until the reply to P
    both          M (text)                the robot also sends one to end a connection

Call `receive_data`, then `next_event` until it returns None; call `reply` after each `Request` and
`UnknownPackage`, before the next event, because it decides how later bytes are read. `encoder` makes the data
packages. Send the bytes that a method returns. After a LocalProtocolError nothing has changed; after a
RemoteProtocolError send `text` and close the connection.

Source: UR RTDE guide; where it says nothing, what public clients need, as noted at the place.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rtde import codec
from protocol.rtde.fields import RtdeField
from protocol.rtde.recipe import Recipe, recipe_of, snapshot_encoder
from protocol.rtde.types import IN_USE, NOT_FOUND, RtdeState, RtdeValue, TextLevel
from protocol.ur_types import SoftwareVersion

__all__ = [
    "InputReceived",
    "RequestLimits",
    "RtdeServerConnection",
    "ServerEvent",
    "UnknownPackage",
    "cycles_per_package",
    "request_limits",
]


def cycles_per_package(frequency: float | None, rate: int) -> int:
    """How many control cycles lie between two packages: floor(rate / frequency).

    A frequency [Hz] outside of 1 to `rate` is clamped (assumed: the guide gives the range only); None is the
    full rate.
    """
    if frequency is None or math.isnan(frequency):
        return 1
    return int(rate / min(max(frequency, 1.0), rate))


class RequestLimits(NamedTuple):
    """What a robot takes.

    Attributes:
        package: largest package in bytes: less than the number that two letters make, such as the first two
            of an HTTP request on the wrong port.
        takes_long_lists: beyond `MAX_NAMES_SIZE` it finds names that it has not yet read; else none at all.
    """

    package: int
    takes_long_lists: bool


_CB3_LIMITS = RequestLimits(0x1FFF, takes_long_lists=False)
# UR's client library asks the newest simulator for all outputs at once, 9 kB.
_E_SERIES_LIMITS = RequestLimits(0x2FFF, takes_long_lists=True)


def request_limits(version: SoftwareVersion) -> RequestLimits:
    """The limits of software `version`; the sizes of packages are chosen."""
    return _CB3_LIMITS if version.major < 5 else _E_SERIES_LIMITS


_LAST_ID = 255


@dataclass(frozen=True, slots=True)
class InputReceived:
    """Values of an input recipe; they may be fewer than the recipe's: see `Recipe.decode_leading`."""

    names: tuple[str, ...]
    values: tuple[RtdeValue, ...]


@dataclass(frozen=True, slots=True)
class UnknownPackage:
    """A package of a type that RTDE does not have."""

    kind: int


ServerEvent = codec.Request | codec.RtdeTextMessage | InputReceived | UnknownPackage


class RtdeServerConnection:
    """One connection, as the robot sees it.

    Args:
        version: software of the robot, sent to clients on request.
        outputs, inputs: variables that a client can subscribe to, and write, by name.

    Attributes:
        protocol_version: 1 until another one is agreed on.
        state: whether data packages flow.
        input_recipes: what the client may write, by recipe id.
        frequency: data packages a second that were asked for last [Hz]; None for the full rate.
    """

    def __init__(
        self, version: SoftwareVersion, outputs: Mapping[str, RtdeField], inputs: Mapping[str, RtdeField]
    ) -> None:
        self._software = version
        self._limits = request_limits(version)
        self._known_outputs = outputs
        self._known_inputs = inputs
        self._buffer = bytearray()
        self._unanswered: codec.Request | UnknownPackage | None = None
        self._output_ids = 0
        self._encoder: Callable[[Any], bytes] | None = None
        self.protocol_version = codec.VERSIONS[0]
        self.state = RtdeState.PAUSED
        self.input_recipes: dict[int, Recipe] = {}
        self.frequency: float | None = None

    def receive_data(self, data: bytes) -> None:
        """Take what the socket gave; any split is fine."""
        self._buffer += data

    def next_event(self) -> ServerEvent | None:
        """The next package as an event, or None when more bytes are needed.

        Data and text that cannot be read are skipped. RemoteProtocolError: the stream cannot be trusted any
        more; every further call raises again. LocalProtocolError: the last request has no reply yet.
        """
        if self._unanswered is not None:
            raise LocalProtocolError(f"{self._unanswered!r} has no reply yet: one for each, in order")
        while (package := codec.take_package(self._buffer, self._limits.package)) is not None:
            event = self._read(*package)
            if event is not None:
                return event
        return None

    def text(self, message: codec.RtdeTextMessage) -> bytes:
        """A text message to the client."""
        return codec.encode_message(message, codec.Role.ROBOT, self.protocol_version)

    @property
    def encoder(self) -> Callable[[Any], bytes] | None:
        """Makes a data package of a snapshot; None while none is to be sent."""
        return self._encoder if self.state is RtdeState.STARTED else None

    def reply(self, in_use: Collection[str] = (), *, has_room: bool = True) -> bytes:
        """Answer the request that `next_event` gave, and do what it asks.

        Names `in_use` are input variables of other clients. Without room for an input recipe, its names are
        answered as if they had not been read.
        """
        request, self._unanswered = self._unanswered, None
        if request is None:
            raise LocalProtocolError("nothing has been asked: one reply for each request")
        version = self.protocol_version
        reply: codec.Reply | codec.RtdeTextMessage
        match request:
            case codec.RequestProtocolVersion(wanted):
                # The layout of what flows cannot change under it.
                accepted = wanted in codec.VERSIONS and self.state is RtdeState.PAUSED
                reply = codec.RequestProtocolVersionReply(accepted)
                self.protocol_version = wanted if accepted else version
            case codec.GetControllerVersion():
                reply = codec.GetControllerVersionReply(self._software)
            # Assumed of both: the guide shows them before S or after P only, but not that others fail.
            case codec.SetupOutputs():
                reply = self._set_up_outputs(request)
            case codec.SetupInputs():
                reply = self._set_up_inputs(request, in_use, self._known_inputs if has_room else {})
            case codec.Start():
                # Source: the guide says that a start fails while no outputs are set up; issue 13 of the
                # maker's Python client. That a refused recipe counts as none is assumed.
                self.state = RtdeState.PAUSED if self._encoder is None else RtdeState.STARTED
                reply = codec.StartReply(self.state is RtdeState.STARTED)
            case codec.Pause():
                # Also without a start: ur_rtde's I/O interface waits for this reply when it ends.
                self.state = RtdeState.PAUSED
                reply = codec.PauseReply(True)
            case UnknownPackage(kind):
                text = f"RTDE has no package of type {chr(kind)!r} ({kind}): skipped"
                reply = codec.RtdeTextMessage(text, "RTDE", TextLevel.WARNING)
        return codec.encode_message(reply, codec.Role.ROBOT, version)

    def _read(self, kind: int, payload: bytes) -> ServerEvent | None:
        try:
            message = codec.decode_message(kind, payload, codec.Role.PC, self.protocol_version)
        except RemoteProtocolError:
            if kind in (codec.RtdePackageType.DATA_PACKAGE, codec.RtdePackageType.TEXT_MESSAGE):
                return None  # no answer is expected: the connection need not end
            raise
        if isinstance(message, codec.DataPackage):
            recipe = self.input_recipes.get(message.recipe_id or 0)
            if recipe is None:
                return None
            values = recipe.decode_leading(message.values)
            return InputReceived(recipe.names[: len(values)], values) if values else None
        if isinstance(message, codec.RtdeTextMessage):
            return message
        self._unanswered = message if isinstance(message, codec.Request) else UnknownPackage(kind)
        return self._unanswered

    def _set_up_outputs(self, request: codec.SetupOutputs) -> codec.SetupOutputsReply:
        """Replace the output recipe. One that is refused takes no id, and nothing is sent until the next."""
        fields, types = _look_up(request.names, self._known_outputs, (), self._limits)
        is_v1 = self.protocol_version == 1
        self.frequency = request.frequency
        self._encoder = None
        if not fields:
            return codec.SetupOutputsReply(types, None if is_v1 else 0)
        self._output_ids = self._output_ids % _LAST_ID + 1
        recipe_id = None if is_v1 else self._output_ids
        size = sum(field.type.size for field in fields)
        self._encoder = snapshot_encoder(fields, codec.data_header(size, recipe_id))
        return codec.SetupOutputsReply(types, recipe_id)

    def _set_up_inputs(
        self, request: codec.SetupInputs, in_use: Collection[str], known: Mapping[str, RtdeField]
    ) -> codec.SetupInputsReply:
        """Add an input recipe. One that is refused takes no id."""
        fields, types = _look_up(request.names, known, in_use, self._limits)
        recipe_id = len(self.input_recipes) + 1
        if not fields or recipe_id > _LAST_ID:
            return codec.SetupInputsReply(types, 0)
        self.input_recipes[recipe_id] = recipe_of(fields)
        return codec.SetupInputsReply(types, recipe_id)


def _look_up(
    names: tuple[str, ...], known: Mapping[str, RtdeField], in_use: Collection[str], limits: RequestLimits
) -> tuple[tuple[RtdeField, ...], tuple[str, ...]]:
    """The fields of a recipe, and a word for each name; one refusal leaves no fields at all."""
    fields: list[RtdeField] = []
    words: list[str] = []
    read: set[str] = set()
    end = -1
    for name in names:
        end += 1 + len(name)
        # What lies beyond the limits is answered as if it had not been read.
        is_read = end <= codec.MAX_NAMES_SIZE or (limits.takes_long_lists and name not in read)
        read.add(name)
        field = known.get(name) if is_read else None
        if field is None:
            words.append(NOT_FOUND)
        elif name in in_use:
            words.append(IN_USE)
        else:
            fields.append(field)
            words.append(field.type.value)
    return (tuple(fields) if len(fields) == len(names) else ()), tuple(words)
