"""`rpc_factory`: handles whose methods are calls to an XML-RPC server. A call blocks its thread only.

Values on the wire: integers, floats, booleans, strings and lists as they are, a matrix as a list of rows, a
pose as a struct of x, y, z, rx, ry, rz, on an e-Series other structs, too. A call that fails, for whatever
reason, is a run-time error.
Source: URScript manual CB3 3.15, rpc_factory, and UR's XML-RPC article; e-Series 5.19, Lists and Structs.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from typing import Any, Final

from ur_emulator.budgets import BUDGETS, of_cycle
from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.io.network import Network, RemoteCallError
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, builtin
from urscript import ScriptRuntimeError, ScriptThread
from urscript.dialect import LONGEST_NAME, LONGEST_STRING
from urscript.run.variables import same_type
from urscript.run.waits import NEXT_CYCLE, Blocked, Outside, Wait
from urscript.values import INT_MAX, INT_MIN, Matrix, Pose, Struct, a_type, to_script_text

_IN_LISTS: Final = frozenset({bool, int, float, str, Pose, Struct})
_POSE_KEYS = ("x", "y", "z", "rx", "ry", "rz")
# Of a text that a server gives as its error, so many characters are shown.
LONGEST_MESSAGE = 500
# The method that does not call the server.
_CLOSE = "closeXMLRPCClientConnection"


class RpcBuiltins(BuiltinGroup):
    """The remote-procedure handles of one program; `has_structs`: the controller's language has structs."""

    def __init__(self, network: Network, clock: Clock) -> None:
        self.network = network
        self._clock = clock
        self.has_structs = clock.generation.major > 3
        self._servers: set[int] = set()
        # Values sent, since which cycle, and the cycle that counts anew.
        self._sent = self._since = self._renewed_at = 0

    def end(self) -> None:
        """Close every connection; the program has ended."""
        self.network.close_servers(self._servers)

    def may_send(self, n_values: int) -> bool:
        """Count values that a call is about to send; False if the program has sent enough for now.

        A call of more values than a cycle has room for is sent, and takes the room of the next cycles too.
        """
        room = of_cycle(BUDGETS.remote_values_sent, self._clock.period_s)
        if self._clock.tick >= self._renewed_at:
            self._sent, self._since = 0, self._clock.tick
        if self._sent and self._sent + n_values > room:
            return False
        self._sent += n_values
        self._renewed_at = self._since + max(1, math.ceil(self._sent / room))
        return True

    @builtin("rpc_factory")
    def _make_handle(self, thread: object, kind: str, url: str) -> RemoteHandle:
        server = self.network.new_server()
        self._servers.add(server)
        return RemoteHandle(self, server, url if "://" in url else f"http://{url}")


class RemoteHandle:
    """A value whose methods are remote procedures (see urscript.run.host.Handle)."""

    script_type: Final = "remote procedure handle"

    def __init__(self, program: RpcBuiltins, server: int, url: str) -> None:
        self._program = program
        self._server = server
        self._url = url

    def call_method(
        self, thread: ScriptThread, method: str, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> Generator[Wait, None, Any]:
        """Call a procedure and wait for its result."""
        if method == _CLOSE:
            self._program.network.close_server(self._server)
            return None
        if named:
            raise ScriptRuntimeError(f"{method}: arguments of a remote procedure have no names")
        n_values = sum(map(_n_values, arguments))
        if n_values > BUDGETS.remote_values:
            raise ScriptRuntimeError(
                f"{method}: {n_values} values given, a remote procedure takes up to {BUDGETS.remote_values}"
            )
        while not self._program.may_send(n_values):
            yield NEXT_CYCLE
        values = [_to_wire(value) for value in arguments]
        call = self._program.network.call(self._server, self._url, method, values)
        yield Blocked(lambda: call.is_done, Outside.PEER)
        try:
            if call.error:
                raise RemoteCallError(call.error)
            return _from_wire(call.value, self._program.has_structs)
        except RemoteCallError as error:
            text = to_script_text(" ".join(str(error).split())[:LONGEST_MESSAGE])
            raise ScriptRuntimeError(f"{method}: remote procedure call failed: {text}") from None


def _n_values(argument: Any) -> int:
    if isinstance(argument, Matrix):
        rows, columns = argument.shape
        return 1 + rows * (1 + columns)
    if isinstance(argument, Struct):
        return argument.size
    return 1 + len(argument) if isinstance(argument, list) else 1


def _to_wire(value: Any) -> Any:
    if isinstance(value, Pose):
        return dict(zip(_POSE_KEYS, value, strict=True))
    if isinstance(value, (list, Matrix)):
        return [_to_wire(item) for item in value]
    if isinstance(value, Struct):
        return {name: _to_wire(item) for name, item in value.members.items()}
    if isinstance(value, str):
        data = value.encode("latin-1", "replace")  # one character a byte: what clients mean is UTF-8
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError:
            return value
    if isinstance(value, (bool, int, float)):
        return value
    raise ScriptRuntimeError(f"{a_type(value)} cannot be an argument of a remote procedure")


def _from_wire(value: Any, has_structs: bool) -> Any:
    match value:
        case None | bool() | float():
            return value
        case int() if INT_MIN <= value <= INT_MAX:
            return value
        case str() if len(text := to_script_text(value)) <= LONGEST_STRING:
            return text
        case dict() if set(value) == set(_POSE_KEYS):
            numbers = [value[key] for key in _POSE_KEYS]
            if all(type(number) in (int, float) for number in numbers):
                return Pose.of(numbers)
        case list():
            return _one_type([_from_wire(item, has_structs) for item in value])
    if isinstance(value, dict) and value and has_structs and all(len(key) <= LONGEST_NAME for key in value):
        return Struct({to_script_text(name): _from_wire(item, True) for name, item in value.items()})
    raise RemoteCallError(f"the result has no counterpart in a script: {str(value)[:80]}")


def _one_type(items: list[Any]) -> list[Any] | Matrix:
    """Return a list of one type, as the language has them: integers among floats become floats."""
    if items and all(type(item) is list for item in items):
        if not items[0]:
            raise RemoteCallError("the result is a matrix without columns")
        return Matrix(items)
    types = {type(item) for item in items}
    if not types <= _IN_LISTS:
        raise RemoteCallError("the result is a list of what no list of a script has")
    if types == {int, float}:
        return [float(item) for item in items]
    if len(types) > 1 or not all(same_type(items[0], item) for item in items):
        raise RemoteCallError("the result is a list of several types")
    return items
