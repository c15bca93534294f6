"""Interfaces of the script functions to the network; the servers implement them, tests have a fake."""

from collections.abc import Sequence
from typing import Any, Protocol

from ur_emulator.machine.controller.io.modbus_signals import ModbusUnit, UnitAddress


class ScriptSocket(Protocol):
    """One TCP connection opened by a script. All calls return at once."""

    @property
    def problem(self) -> str:
        """Why there is no connection; "" while there is one, and if the peer refused."""
        ...

    @property
    def inbox(self) -> bytearray:
        """Bytes that have come and were not read yet; the reader takes them out of it."""
        ...

    @property
    def is_connecting(self) -> bool:
        """True while the connection is being made."""
        ...

    @property
    def is_open(self) -> bool:
        """True while the connection stands and the peer has not closed it."""
        ...

    @property
    def is_own(self) -> bool:
        """True of a connection to a port of the box itself."""
        ...

    def send(self, data: bytes) -> bool:
        """Queue bytes for sending; False if the connection is closed or its buffer is full."""
        ...

    def close(self) -> None:
        """Close the connection; harmless if it is closed already."""
        ...


class RemoteCallError(Exception):
    """A remote procedure call failed; the text says why."""


class RemoteCall(Protocol):
    """One call of a remote procedure, running or done."""

    @property
    def is_done(self) -> bool:
        """True once the result, or the failure, is known."""
        ...

    def result(self) -> Any:
        """Return what the procedure returned; RemoteCallError if the call failed."""
        ...


class RemoteServer(Protocol):
    """A server of remote procedures. All calls return at once."""

    def call(self, method: str, arguments: Sequence[Any]) -> RemoteCall:
        """Begin to call a procedure, connecting first if need be; calls are made one after the other."""
        ...

    def close(self) -> None:
        """Close the connection and forget the running calls; a later call connects again."""
        ...


class Network(Protocol):
    """Opens connections for scripts."""

    def open(self, host: str, port: int) -> ScriptSocket:
        """Begin to connect to `host`:`port`; the result says when it is done."""
        ...

    def remote_server(self, url: str) -> RemoteServer:
        """Return a server of remote procedures; nothing is connected before its first call."""
        ...

    def modbus_unit(self, address: UnitAddress) -> ModbusUnit:
        """Return the connection to a Modbus unit, shared by its signals; connected when it is needed."""
        ...
