"""Read the packages of a running box: `python -m protocol decode --live`.

The one place of this package that opens a socket.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator

from protocol.capture import RtdeDecoder, StreamDecoder
from protocol.errors import LocalProtocolError
from protocol.rtde.codec import encode_message
from protocol.rtde.messages import Request, RequestProtocolVersion, Role, SetupOutputs, Start
from protocol.ur_types import Ports

__all__ = ["INTERFACES", "watch"]

INTERFACES = {"realtime": "realtime_ro", "primary": "primary_ro", "secondary": "secondary_ro", "rtde": "rtde"}
"""Interface and port: the read-only ports where they exist."""

_TIMEOUT = 3.0  # s; every port sends ten times a second or more


def watch(
    interface: str,
    address: str,
    decoder: StreamDecoder | RtdeDecoder,
    count: int,
    names: tuple[str, ...] = (),
    frequency: float = 10.0,
) -> Iterator[str]:
    """Decode what a box sends, as lines of text.

    Args:
        interface: one of `INTERFACES`.
        address: host, or host:port for another port than the standard one.
        decoder: for that interface.
        count: packages to wait for, after the replies of the set-up on RTDE.
        names: variables to ask RTDE for.
        frequency: packages a second to ask RTDE for.

    Raises:
        LocalProtocolError: not an address, or the box does not have a variable.
        OSError: no connection.
        RemoteProtocolError: the bytes are not those of a box.
    """
    host, _, number = address.partition(":")
    port = number or str(getattr(Ports(), INTERFACES[interface]))
    if not host or not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise LocalProtocolError(
            f"{address!r} is not an address: give a host such as 127.0.0.1, or host:port"
        )
    with socket.create_connection((host, int(port)), timeout=_TIMEOUT) as sock:
        if isinstance(decoder, RtdeDecoder):
            requests: tuple[Request, ...] = (
                RequestProtocolVersion(2),
                SetupOutputs(names, frequency),
                Start(),
            )
            for n_replies, request in enumerate(requests, 1):
                version = 1 if n_replies == 1 else 2
                sock.sendall(encode_message(request, Role.PC, version))
                yield from _until(sock, decoder, n_replies)
                if decoder.refused:
                    unknown = ", ".join(decoder.refused)
                    raise LocalProtocolError(f"this box has no {unknown}: `layout rtde` lists the variables")
            count += len(requests)
        yield from _until(sock, decoder, count)


def _until(sock: socket.socket, decoder: StreamDecoder | RtdeDecoder, count: int) -> Iterator[str]:
    while decoder.count < count:
        data = sock.recv(65536)
        if not data:
            raise LocalProtocolError("the box has closed the connection")
        yield from decoder.feed(data)
