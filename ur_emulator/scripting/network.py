"""What the script functions need of the network; the servers provide it, tests provide a fake."""

from __future__ import annotations

from typing import Protocol


class ScriptSocket(Protocol):
    """One TCP connection opened by a script. All calls return at once."""

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

    def send(self, data: bytes) -> bool:
        """Queue bytes for sending; False if the connection is closed or its buffer is full."""
        ...

    def close(self) -> None:
        """Close the connection; harmless if it is closed already."""
        ...


class Network(Protocol):
    """Opens connections for scripts."""

    def open(self, host: str, port: int) -> ScriptSocket:
        """Begin to connect to `host`:`port`; the result tells when it is done."""
        ...
