"""`rpc_factory`: handles whose methods are calls to an XML-RPC server. A call blocks its thread only.

Values on the wire: integers, floats, booleans, strings and lists as they are, a matrix as a list of rows, a
pose as a struct of x, y, z, rx, ry, rz. A call that fails, for whatever reason, is a run-time error.
Source: URScript manual CB3 3.15, rpc_factory, and UR's XML-RPC article.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, Final

from ur_emulator.scripting.network import Network, RemoteCall, RemoteCallError, RemoteServer
from urscript.errors import ScriptRuntimeError
from urscript.run.threads import ScriptThread
from urscript.run.waits import Blocked
from urscript.values import INT_MAX, INT_MIN, Matrix, Pose, a_type, to_script_text

_POSE_KEYS = ("x", "y", "z", "rx", "ry", "rz")
# The method that does not call the server.
_CLOSE = "closeXMLRPCClientConnection"


class ProgramRemotes:
    """The remote-procedure handles of one program."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._servers: list[RemoteServer] = []

    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Return the builtins by URScript name."""
        return {"rpc_factory": self._rpc_factory}

    def close_all(self) -> None:
        """Close every connection; the program has ended."""
        for server in self._servers:
            server.close()
        self._servers.clear()

    def _rpc_factory(self, thread: object, kind: str, url: str) -> RemoteHandle:
        server = self._network.remote_server(url if "://" in url else f"http://{url}")
        self._servers.append(server)
        return RemoteHandle(server)


class RemoteHandle:
    """A value whose methods are remote procedures (see urscript.run.host.Handle)."""

    script_type: Final = "remote procedure handle"

    def __init__(self, server: RemoteServer) -> None:
        self._server = server

    def call_method(
        self, thread: ScriptThread, method: str, arguments: Sequence[Any], named: Mapping[str, Any]
    ) -> Generator[Blocked, None, Any]:
        """Call a procedure and wait for its result."""
        if method == _CLOSE:
            self._server.close()
            return None
        if named:
            raise ScriptRuntimeError(f"{method}: arguments of a remote procedure have no names")
        call: RemoteCall = self._server.call(method, [_to_wire(value) for value in arguments])
        yield Blocked(lambda: call.is_done, outside=True)
        try:
            return _from_wire(call.result())
        except RemoteCallError as error:
            raise ScriptRuntimeError(f"{method}: remote procedure call failed: {error}") from None


def _to_wire(value: Any) -> Any:
    if isinstance(value, Pose):
        return dict(zip(_POSE_KEYS, value, strict=True))
    if isinstance(value, (list, Matrix)):
        return [_to_wire(item) for item in value]
    if isinstance(value, str):
        data = value.encode("latin-1", "replace")  # one character a byte: what clients mean is UTF-8
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError:
            return value
    if isinstance(value, (bool, int, float)):
        return value
    raise ScriptRuntimeError(f"{a_type(value)} cannot be an argument of a remote procedure")


def _from_wire(value: Any) -> Any:
    match value:
        case None | bool() | float():
            return value
        case int() if INT_MIN <= value <= INT_MAX:
            return value
        case str():
            return to_script_text(value)
        case dict() if set(value) == set(_POSE_KEYS):
            numbers = [value[key] for key in _POSE_KEYS]
            if all(type(number) in (int, float) for number in numbers):
                return Pose.of(numbers)
        case list():
            return _one_type([_from_wire(item) for item in value])
    raise RemoteCallError(f"the result has no counterpart in a script: {str(value)[:80]}")


def _one_type(items: list[Any]) -> list[Any] | Matrix:
    """Return a list of one type, as the language has them: integers among floats become floats."""
    if items and all(type(item) is list for item in items):
        return Matrix(items)
    types = {type(item) for item in items}
    if types == {int, float}:
        return [float(item) for item in items]
    if len(types) > 1:
        raise RemoteCallError("the result is a list of several types")
    return items
