"""`python -m protocol`: decode captured bytes or a running box, and print the tables.

    python -m protocol decode capture.bin                        ports 30001 to 30003; `-` is standard input
    python -m protocol decode rtde capture.bin --names actual_q  what the robot has sent on port 30004
    python -m protocol decode realtime --live 127.0.0.1          the next frame of a box
    python -m protocol layout --version 3.15.8

Exit status: 0 success, 1 bytes that cannot be decoded, 2 wrong arguments, file or address.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from protocol.capture import RtdeDecoder, StreamDecoder
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.layout_text import describe_layouts
from protocol.live import INTERFACES, watch
from protocol.ur_types import SoftwareVersion

_DEFAULT_VERSION = "3.15.8"
_DEFAULT_NAMES = "timestamp,actual_q,actual_TCP_pose,robot_mode,safety_mode,runtime_state"


def decode_capture(
    data: bytes, version: SoftwareVersion, interface: str = "", names: tuple[str, ...] = ()
) -> Iterator[str]:
    """Lines of text, one a field, for every package in a capture.

    Args:
        data: what a socket gave, from the beginning of a package on.
        version: software of the controller, until its version message arrives.
        interface: one of `INTERFACES`; "" detects which of the ports 30001 to 30003 it is.
        names: of the variables in an RTDE capture.

    Raises:
        RemoteProtocolError: the bytes are not those of such a port.
    """
    decoder = _decoder(interface, version, names)
    yield from decoder.feed(data)
    yield from decoder.end()


def _decoder(interface: str, version: SoftwareVersion, names: tuple[str, ...]) -> StreamDecoder | RtdeDecoder:
    return RtdeDecoder(names) if interface == "rtde" else StreamDecoder(version)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m protocol", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    decode = commands.add_parser("decode", help="bytes of a port to named fields")
    decode.add_argument(
        "source",
        nargs="+",
        metavar="[INTERFACE] [FILE]",
        help=f"{', '.join(INTERFACES)}; then a capture, - for standard input; without an interface, "
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
    layout.add_argument("interface", nargs="?", default="", choices=["", *INTERFACES], help="only this one")
    for command in (decode, layout):
        command.add_argument("--version", default=_DEFAULT_VERSION, help="controller software (%(default)s)")
    return parser


def _lines(options: argparse.Namespace) -> Iterator[str]:
    version = SoftwareVersion.parse(options.version)
    if options.command == "layout":
        return describe_layouts(version, options.interface)
    interface, *files = options.source if options.source[0] in INTERFACES else ("", *options.source)
    names = tuple(filter(None, options.names.split(",")))
    if options.live is not None:
        if not interface or files:
            raise LocalProtocolError(f"with --live, name one interface and no file: {', '.join(INTERFACES)}")
        return watch(interface, options.live, _decoder(interface, version, names), options.count, names)
    if len(files) != 1:
        raise LocalProtocolError(
            f"{len(files)} files given: one capture, - for standard input, or --live HOST"
        )
    data = sys.stdin.buffer.read() if files[0] == "-" else Path(files[0]).read_bytes()
    return decode_capture(data, version, interface, names)


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
