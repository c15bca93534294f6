"""`python -m protocol`: decode captured bytes or a running box, and print the tables.

    python -m protocol decode capture.bin                        ports 30001 to 30003; `-` is standard input
    python -m protocol decode rtde capture.bin --names actual_q  what the robot has sent on port 30004
    python -m protocol decode realtime --live 127.0.0.1          the next frame of a box
    python -m protocol layout --version 3.15.8

Exit status: 0 success, 1 bytes that cannot be decoded, 2 wrong arguments, file or address.
"""

import argparse
import os
import socket
import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from protocol.as_text import RtdeDecoder, StreamDecoder, describe_layouts
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rtde.codec import Request, RequestProtocolVersion, Role, SetupOutputs, Start, encode_message
from protocol.ur_types import Ports, SoftwareVersion

_INTERFACES = {
    "realtime": "realtime_ro",
    "primary": "primary_ro",
    "secondary": "secondary_ro",
    "rtde": "rtde",
}
"""Interface and port: the read-only ports where they exist."""

_TIMEOUT = 3.0  # s; every port sends ten times a second or more
_FREQUENCY = 10.0  # packages a second to ask RTDE for


def _watch(
    interface: str, address: str, decoder: StreamDecoder | RtdeDecoder, count: int, names: tuple[str, ...]
) -> Iterator[str]:
    """Decode what a box sends, as lines of text; nothing else of this package opens a socket.

    `count` packages are waited for, after the replies of the set-up on RTDE. LocalProtocolError: this is no
    address (host or host:port), or the box does not have a variable.
    """
    host, _, number = address.partition(":")
    port = number or str(getattr(Ports(), _INTERFACES[interface]))
    if not host or not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise LocalProtocolError(
            f"{address!r} is not an address: give a host such as 127.0.0.1, or host:port"
        )
    with socket.create_connection((host, int(port)), timeout=_TIMEOUT) as sock:
        if isinstance(decoder, RtdeDecoder):
            requests: tuple[Request, ...] = (
                RequestProtocolVersion(2),
                SetupOutputs(names, _FREQUENCY),
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


_DEFAULT_VERSION = "3.15.8"
_DEFAULT_NAMES = "timestamp,actual_q,actual_TCP_pose,robot_mode,safety_mode,runtime_state"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m protocol", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    decode = commands.add_parser("decode", help="bytes of a port to named fields")
    decode.add_argument(
        "source",
        nargs="+",
        metavar="[INTERFACE] [FILE]",
        help=f"{', '.join(_INTERFACES)}; then a capture, - for standard input; without an interface, "
        "the port, 30001 to 30003, is detected",
    )
    decode.add_argument("--live", metavar="HOST[:PORT]", help="decode a running box instead of a file")
    decode.add_argument("--count", type=int, default=1, help="packages to wait for with --live (%(default)s)")
    decode.add_argument(
        "--names",
        default=_DEFAULT_NAMES,
        help="variables of an RTDE recipe, with commas between (%(default)s)",
    )
    layout = commands.add_parser("layout", help="print the tables")
    layout.add_argument("interface", nargs="?", default="", choices=["", *_INTERFACES], help="only this one")
    for command in (decode, layout):
        command.add_argument("--version", default=_DEFAULT_VERSION, help="controller software (%(default)s)")
    return parser


def _lines(options: argparse.Namespace) -> Iterator[str]:
    version = SoftwareVersion.parse(options.version)
    if options.command == "layout":
        return describe_layouts(version, options.interface)
    interface, *files = options.source if options.source[0] in _INTERFACES else ("", *options.source)
    names = tuple(filter(None, options.names.split(",")))
    decoder = RtdeDecoder(names) if interface == "rtde" else StreamDecoder(version)
    if options.live is not None:
        if not interface or files:
            raise LocalProtocolError(f"with --live, name one interface and no file: {', '.join(_INTERFACES)}")
        return _watch(interface, options.live, decoder, options.count, names)
    if len(files) != 1:
        raise LocalProtocolError(
            f"{len(files)} files given: one capture, - for standard input, or --live HOST"
        )
    data = sys.stdin.buffer.read() if files[0] == "-" else Path(files[0]).read_bytes()
    return chain(decoder.feed(data), decoder.end())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        for line in _lines(options):
            print(line)
    except BrokenPipeError:  # the reader, such as `head`, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except RemoteProtocolError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except (LocalProtocolError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
