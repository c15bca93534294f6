"""The PC's side of RTDE, port 30004, without I/O; `rtde.server_connection` shows the packages.

`send` a request and wait for its reply, then for `DataReceived` events; `send_data` writes inputs. Send the
bytes that a method returns. After a LocalProtocolError nothing has changed; after a RemoteProtocolError close
the connection.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rtde import codec
from protocol.rtde.recipe import Recipe
from protocol.rtde.types import REFUSALS, RtdeState, RtdeType, RtdeValue

__all__ = ["ClientEvent", "DataReceived", "RtdeClientConnection"]


@dataclass(frozen=True, slots=True)
class DataReceived:
    """Values of the output recipe, in the order of its names."""

    names: tuple[str, ...]
    values: tuple[RtdeValue, ...]


ClientEvent = codec.Reply | codec.RtdeTextMessage | DataReceived


class RtdeClientConnection:
    """One connection, as the PC sees it.

    `protocol_version` is 1 until another one is agreed on; `state` says whether data packages flow.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._unanswered: deque[codec.Request] = deque()
        self._outputs: dict[int | None, Recipe] = {}
        self._inputs: dict[int, Recipe] = {}
        self._was_started = False
        self.protocol_version = codec.VERSIONS[0]
        self.state = RtdeState.PAUSED

    def receive_data(self, data: bytes) -> None:
        """Take what the socket gave; any split is fine."""
        self._buffer += data

    def send(self, request: codec.Request) -> bytes:
        """Ask for something; its reply comes as an event."""
        data = codec.encode_message(request, codec.Role.PC, self.protocol_version)
        self._unanswered.append(request)
        return data

    def send_data(self, recipe_id: int, values: Iterable[RtdeValue]) -> bytes:
        """Write the inputs of a recipe that the robot has accepted; LocalProtocolError if it is another."""
        if recipe_id not in self._inputs:
            raise LocalProtocolError(f"recipe {recipe_id} given: accepted are {[*self._inputs]}")
        package = codec.DataPackage(self._inputs[recipe_id].encode(values), recipe_id)
        return codec.encode_message(package, codec.Role.PC, self.protocol_version)

    def next_event(self) -> ClientEvent | None:
        """The next package as an event, or None when more bytes are needed.

        RemoteProtocolError: the stream cannot be trusted any more.
        """
        while (package := codec.take_package(self._buffer, codec.MAX_SIZE)) is not None:
            event = self._read(*package)
            if event is not None:
                return event
        return None

    def _read(self, kind: int, payload: bytes) -> ClientEvent | None:
        message = codec.decode_message(kind, payload, codec.Role.ROBOT, self.protocol_version)
        if message is None:
            raise RemoteProtocolError(f"the robot sent an RTDE package of the unknown type {kind}")
        if isinstance(message, codec.RtdeTextMessage):
            return message
        if isinstance(message, codec.DataPackage):
            return self._read_data(message.values, message.recipe_id)
        asked = self._unanswered[0] if self._unanswered else None
        if asked is None or not isinstance(message, codec.REQUESTS[type(asked)]):
            raise RemoteProtocolError(f"the robot answered {message!r}, but {asked or 'nothing'} was asked")
        self._take_reply(self._unanswered.popleft(), message)
        return message

    def _read_data(self, values: bytes, recipe_id: int | None) -> DataReceived | None:
        if not self._was_started:
            raise RemoteProtocolError("the robot sent data before it had answered a start request")
        if self.state is not RtdeState.STARTED:
            return None  # assumed harmless: it was sent before the pause
        recipe = self._outputs.get(recipe_id)
        if recipe is None:
            raise RemoteProtocolError(f"the robot sent data of recipe {recipe_id}, which was not set up")
        return DataReceived(recipe.names, recipe.decode(values))

    def _take_reply(self, request: codec.Request, reply: codec.Reply) -> None:
        match request, reply:
            case codec.RequestProtocolVersion(version), codec.RequestProtocolVersionReply(True):
                self.protocol_version = version
            case codec.SetupOutputs(names), codec.SetupOutputsReply(types, recipe_id):
                self._outputs.clear()
                recipe = _recipe_of(names, types)
                if recipe is not None:
                    self._outputs[recipe_id] = recipe
            case codec.SetupInputs(names), codec.SetupInputsReply(types, recipe_id):
                recipe = _recipe_of(names, types)
                if recipe is not None:
                    self._inputs[recipe_id] = recipe
            case codec.Start(), codec.StartReply(accepted):
                self.state = RtdeState.STARTED if accepted else RtdeState.PAUSED
                self._was_started |= accepted
            case codec.Pause(), codec.PauseReply(True):
                self.state = RtdeState.PAUSED


def _recipe_of(names: tuple[str, ...], words: tuple[str, ...]) -> Recipe | None:
    """The recipe of a reply, or None if the robot refused it.

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
