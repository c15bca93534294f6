"""RTDE, port 30004, without I/O, for either end.

    PC -> robot   V, v, O, I, S, P        every one gets exactly one reply, in order
    PC -> robot   U (input data)          at any time, never a reply
    robot -> PC   U (output data)         after the reply to S, until the reply to P
    both          M (text)                the robot says nothing before the first S but to end a connection

The robot's side: `receive_data`, then `next_event` until it gives None; one `reply` after each `Request`,
before the next event, because it decides how later bytes are read. `encoder` makes the data packages.
The PC's side: `send` a request and wait for its reply, then `DataReceived` events and `send_values`.
Bytes that a method returns are to be sent. After a LocalProtocolError nothing has changed; after a
RemoteProtocolError the connection is to be closed, by the robot after the bytes of `say`.

Source: UR RTDE guide; where it is silent, what public clients need, said at the place.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from protocol.dashboard.connection import Role
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rtde.codec import HEADER_SIZE, MAX_NAMES_SIZE, data_header, decode_message, encode_message
from protocol.rtde.fields import RtdeField, input_fields, output_fields
from protocol.rtde.messages import (
    REQUESTS,
    VERSIONS,
    DataPackage,
    GetControllerVersion,
    GetControllerVersionReply,
    PackageType,
    Pause,
    PauseReply,
    Reply,
    Request,
    RequestProtocolVersion,
    RequestProtocolVersionReply,
    SetupInputs,
    SetupInputsReply,
    SetupOutputs,
    SetupOutputsReply,
    Start,
    StartReply,
    TextMessage,
)
from protocol.rtde.recipe import Recipe, snapshot_encoder
from protocol.rtde.states import TRANSITIONS, RtdeState
from protocol.rtde.types import IN_USE, NOT_FOUND, REFUSALS, RtdeType, RtdeValue
from protocol.ur_types import SoftwareVersion

__all__ = ["MAX_REQUEST_SIZE", "DataReceived", "RtdeConnection", "RtdeEvent"]

MAX_REQUEST_SIZE = 0x1FFF
"""Longest package in bytes that the robot believes: four times the longest list of names, and less than what
any printable text says in its first two characters, such as an HTTP request on the wrong port."""

_LENGTH_SIZE = 2
_LAST_ID = 255
_NEWEST_CB3 = SoftwareVersion(3, 15)


@dataclass(frozen=True, slots=True)
class DataReceived:
    """Values of one recipe. At the robot they may be fewer than the recipe's: see `Recipe.decode_leading`."""

    recipe_id: int | None
    names: tuple[str, ...]
    values: tuple[RtdeValue, ...]

    def as_dict(self) -> dict[str, RtdeValue]:
        """The values by name."""
        return dict(zip(self.names, self.values, strict=True))


RtdeEvent: TypeAlias = Request | Reply | TextMessage | DataReceived


class RtdeConnection:
    """One connection, as the robot or as the PC sees it.

    Args:
        our_role: which end we are.
        version: software of the robot; decides at the robot's end which variables there are.

    Attributes:
        protocol_version: 1 until another one is agreed on.
        state: whether data packages flow.
        input_recipes: what the client may write, by recipe id.
        frequency: at the robot's end, data packages a second that were asked for last [Hz]; None for all.
    """

    def __init__(self, our_role: Role, version: SoftwareVersion = _NEWEST_CB3) -> None:
        self._role = our_role
        self._software = version
        self._buffer = bytearray()
        self._unanswered: deque[Request] = deque()
        self._outputs: dict[int | None, Recipe] = {}
        self._output_ids = 0
        self._encoder: Callable[[Any], bytes] | None = None
        self._was_started = False
        self.protocol_version = VERSIONS[0]
        self.state = RtdeState.PAUSED
        self.input_recipes: dict[int, Recipe] = {}
        self.frequency: float | None = None

    def receive_data(self, data: bytes) -> None:
        """Take what the socket gave; any split is fine."""
        self._buffer += data

    def next_event(self) -> RtdeEvent | None:
        """The next package as an event, or None when more bytes are needed.

        At the robot, data and text that make no sense are skipped.

        Raises:
            RemoteProtocolError: the stream cannot be trusted any more; every further call raises again.
            LocalProtocolError: at the robot, the last request has no reply yet.
        """
        if self._role is Role.ROBOT and self._unanswered:
            raise LocalProtocolError(f"{self._unanswered[0]!r} has no reply yet: one for each, in order")
        while (package := self._next_package()) is not None:
            event = self._read_pc(*package) if self._role is Role.ROBOT else self._read_robot(*package)
            if event is not None:
                return event
        return None

    def _next_package(self) -> tuple[int, bytes] | None:
        buffer = self._buffer
        if len(buffer) < _LENGTH_SIZE:
            return None
        size = int.from_bytes(buffer[:_LENGTH_SIZE], "big")
        if size < HEADER_SIZE or (self._role is Role.ROBOT and size > MAX_REQUEST_SIZE):
            raise RemoteProtocolError(
                f"an RTDE package of {size} bytes: at least {HEADER_SIZE}"
                f"{f', at most {MAX_REQUEST_SIZE},' if self._role is Role.ROBOT else ''} are possible; "
                "not RTDE, or the package boundary is lost"
            )
        if len(buffer) < size:
            return None
        kind, payload = buffer[_LENGTH_SIZE], bytes(buffer[HEADER_SIZE:size])
        del buffer[:size]
        return kind, payload

    def say(self, message: TextMessage) -> bytes:
        """A text message, in either direction."""
        return encode_message(message, self._role, self.protocol_version)

    # --- robot's side

    @property
    def encoder(self) -> Callable[[Any], bytes] | None:
        """Makes a data package of a snapshot; None while none is to be sent."""
        return self._encoder if self.state is RtdeState.STARTED else None

    def reply(self, in_use: Collection[str] = ()) -> bytes:
        """Answer the request that `next_event` gave, and do what it asks.

        Args:
            in_use: names of input variables that belong to other clients.
        """
        self._must_be(Role.ROBOT, "reply")
        if not self._unanswered:
            raise LocalProtocolError("nothing has been asked: one reply for each request")
        request = self._unanswered.popleft()
        accepted, self.state = TRANSITIONS[self.state, type(request)]
        version = self.protocol_version
        reply: Reply
        match request:
            case RequestProtocolVersion(wanted):
                accepted = accepted and wanted in VERSIONS
                reply = RequestProtocolVersionReply(accepted)
                self.protocol_version = wanted if accepted else version
            case GetControllerVersion():
                reply = GetControllerVersionReply(self._software)
            case SetupOutputs():
                reply = self._set_up_outputs(request)
            case SetupInputs():
                reply = self._set_up_inputs(request, in_use)
            case Start():
                reply = StartReply(accepted)
            case Pause():
                reply = PauseReply(accepted)
        return encode_message(reply, Role.ROBOT, version)

    def _read_pc(self, kind: int, payload: bytes) -> RtdeEvent | None:
        try:
            message = decode_message(kind, payload, Role.PC, self.protocol_version)
        except RemoteProtocolError:
            if kind in (PackageType.DATA_PACKAGE, PackageType.TEXT_MESSAGE):
                return None  # nobody waits for an answer: no reason to end the connection
            raise
        if isinstance(message, DataPackage):
            recipe = self.input_recipes.get(message.recipe_id or 0)
            if recipe is None:
                return None
            values = recipe.decode_leading(message.values)
            return DataReceived(message.recipe_id, recipe.names[: len(values)], values) if values else None
        if isinstance(message, Request):
            self._unanswered.append(message)
            return message
        return message if isinstance(message, TextMessage) else None

    def _set_up_outputs(self, request: SetupOutputs) -> SetupOutputsReply:
        """Replace the output recipe. One that is refused takes no id, and nothing is sent until the next."""
        fields, types = _look_up(request.names, output_fields(self._software), ())
        is_v1 = self.protocol_version == 1
        self.frequency = request.frequency
        self._encoder = None
        if not fields:
            return SetupOutputsReply(types, None if is_v1 else 0)
        self._output_ids = self._output_ids % _LAST_ID + 1
        recipe_id = None if is_v1 else self._output_ids
        size = sum(field.type.size for field in fields)
        self._encoder = snapshot_encoder(fields, data_header(size, recipe_id))
        return SetupOutputsReply(types, recipe_id)

    def _set_up_inputs(self, request: SetupInputs, in_use: Collection[str]) -> SetupInputsReply:
        """Add an input recipe. One that is refused takes no id."""
        fields, types = _look_up(request.names, input_fields(self._software), in_use)
        recipe_id = len(self.input_recipes) + 1
        if not fields or recipe_id > _LAST_ID:
            return SetupInputsReply(types, 0)
        self.input_recipes[recipe_id] = Recipe(request.names, (field.type for field in fields))
        return SetupInputsReply(types, recipe_id)

    # --- PC's side

    def send(self, request: Request) -> bytes:
        """Ask for something; its reply comes as an event."""
        self._must_be(Role.PC, "send")
        data = encode_message(request, Role.PC, self.protocol_version)
        self._unanswered.append(request)
        return data

    def send_values(self, recipe_id: int, values: Sequence[RtdeValue]) -> bytes:
        """Write the variables of an input recipe, in its order."""
        self._must_be(Role.PC, "send_values")
        recipe = self.input_recipes.get(recipe_id)
        if recipe is None:
            raise LocalProtocolError(
                f"no input recipe {recipe_id}: there are {sorted(self.input_recipes) or 'none'}"
            )
        return encode_message(DataPackage(recipe.encode(values), recipe_id), Role.PC, self.protocol_version)

    def _read_robot(self, kind: int, payload: bytes) -> RtdeEvent | None:
        message = decode_message(kind, payload, Role.ROBOT, self.protocol_version)
        if message is None:
            raise RemoteProtocolError(f"the robot sent an RTDE package of the unknown type {kind}")
        if isinstance(message, TextMessage):
            return message
        if isinstance(message, DataPackage):
            return self._read_data(message.values, message.recipe_id)
        asked = self._unanswered[0] if self._unanswered else None
        if asked is None or not isinstance(message, REQUESTS[type(asked)]):
            raise RemoteProtocolError(f"the robot answered {message!r}, but {asked or 'nothing'} was asked")
        self._take_reply(self._unanswered.popleft(), message)
        return message

    def _read_data(self, values: bytes, recipe_id: int | None) -> DataReceived | None:
        if not self._was_started:
            raise RemoteProtocolError("the robot sent data before it had answered a start request")
        if self.state is not RtdeState.STARTED:
            return None  # assumed harmless: on its way when we paused
        recipe = self._outputs.get(recipe_id)
        if recipe is None:
            raise RemoteProtocolError(f"the robot sent data of recipe {recipe_id}, which was not set up")
        return DataReceived(recipe_id, recipe.names, recipe.decode(values))

    def _take_reply(self, request: Request, reply: Reply) -> None:
        match request, reply:
            case RequestProtocolVersion(version), RequestProtocolVersionReply(True):
                self.protocol_version = version
            case SetupOutputs(names), SetupOutputsReply(types, recipe_id):
                self._outputs.clear()
                recipe = _recipe_of(names, types)
                if recipe is not None:
                    self._outputs[recipe_id] = recipe
            case SetupInputs(names), SetupInputsReply(types, recipe_id):
                recipe = _recipe_of(names, types)
                if recipe is not None:
                    self.input_recipes[recipe_id] = recipe
            case Start(), StartReply(True):
                self.state = RtdeState.STARTED
                self._was_started = True
            case Pause(), PauseReply(True):
                self.state = RtdeState.PAUSED

    def _must_be(self, role: Role, method: str) -> None:
        if self._role is not role:
            raise LocalProtocolError(
                f"{method} is for the {role.value}'s end, this is the {self._role.value}'s"
            )


def _look_up(
    names: tuple[str, ...], known: Mapping[str, RtdeField], in_use: Collection[str]
) -> tuple[tuple[RtdeField, ...], tuple[str, ...]]:
    """The fields of a recipe, and a word for each name; one refusal leaves no fields at all."""
    fields: list[RtdeField] = []
    words: list[str] = []
    end = -1
    for name in names:
        end += 1 + len(name)
        # The guide limits the list; we answer what lies beyond as if it had not been read.
        field = known.get(name) if end <= MAX_NAMES_SIZE else None
        if field is None:
            words.append(NOT_FOUND)
        elif name in in_use:
            words.append(IN_USE)
        else:
            fields.append(field)
            words.append(field.type.value)
    return (tuple(fields) if len(fields) == len(names) else ()), tuple(words)


def _recipe_of(names: tuple[str, ...], words: tuple[str, ...]) -> Recipe | None:
    """The recipe of a reply, or None if the robot refused it.

    Raises:
        RemoteProtocolError: not one word for each name, or a word that is no type.
    """
    if len(words) != len(names):
        raise RemoteProtocolError(f"the robot answered {len(words)} types for {len(names)} names")
    if not REFUSALS.isdisjoint(words):
        return None
    try:
        return Recipe(names, map(RtdeType, words))
    except ValueError as problem:
        raise RemoteProtocolError(f"the robot answered with an unknown type: {problem}") from None
