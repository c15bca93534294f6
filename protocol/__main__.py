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
import socket
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from protocol.capture import RtdeDecoder, StreamDecoder
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary.messages import MESSAGES
from protocol.primary.state import state_size, state_types
from protocol.primary.values import value_codes
from protocol.realtime.layout import layout_for_version
from protocol.rtde.codec import Request, RequestProtocolVersion, Role, SetupOutputs, Start, encode_message
from protocol.rtde.fields import INPUTS, OUTPUTS, RtdeField
from protocol.ur_types import Ports, SoftwareVersion
from protocol.wire_record import WireField, wire_fields

__all__ = ["INTERFACES", "describe_layouts", "type_name", "watch"]


# --- layout


def describe_layouts(version: SoftwareVersion, interface: str = "") -> Iterator[str]:
    """The tables of one software version as lines of text; of one interface, or of all."""
    layout_for_version(version)  # raises LocalProtocolError if there is no such software
    parts = {"realtime": _realtime_layout, "primary": _primary_layout, "rtde": _rtde_layout}
    chosen = [parts["primary" if interface == "secondary" else interface]] if interface else parts.values()
    for number, part in enumerate(chosen):
        if number:
            yield ""
        yield from part(version)


def _realtime_layout(version: SoftwareVersion) -> Iterator[str]:
    layout = layout_for_version(version)
    yield f"Realtime interface, port 30003, software {version}: {layout.size} bytes"
    yield f"{'byte':>5} {'floats':>6}  {'name':<28} {'unit':<12} {'box':<16} meaning"
    for column in layout.columns:
        yield (
            f"{layout.offset(column):>5} {column.count:>6}  {column.name:<28} {column.unit:<12} "
            f"{column.origin.value:<16} {column.meaning}"
        )


def _primary_layout(version: SoftwareVersion) -> Iterator[str]:
    yield (
        f"Robot state, ports 30001 and 30002, software {version}: "
        f"first {state_size(version, first=True)} bytes, later {state_size(version, first=False)}"
    )
    for record in state_types(version, first=True):
        yield f"  {record.SUB_TYPE} {record.__name__}{' (first state only)' * record.FIRST_STATE_ONLY}"
        yield from _describe_fields(record, version)
    yield ""
    yield "Robot messages, port 30001"
    for message in MESSAGES:
        yield f"  {message.MESSAGE_TYPE} {message.__name__}"
        yield from _describe_fields(message, version)
    yield ""
    yield "Types of global variables in program state messages, port 30001"
    for kind, code in value_codes(version).items():
        yield f"      {code:<8} {kind.value}"


def _rtde_layout(version: SoftwareVersion) -> Iterator[str]:
    tables: tuple[tuple[str, tuple[RtdeField, ...]], ...] = (("outputs", OUTPUTS), ("inputs", INPUTS))
    for number, (title, table) in enumerate(tables):
        fields = [field for field in table if field.since.covers(version)]
        if number:
            yield ""
        yield f"RTDE {title}, port 30004, software {version}: {len(fields)} variables"
        for field in fields:
            origin = field.origin.value if field.origin else ""
            yield (
                f"  {field.name:<36} {field.type.value:<14} {field.unit:<12} {origin:<16} {field.meaning}"
            ).rstrip()


def _describe_fields(record: type[Any], version: SoftwareVersion) -> Iterator[str]:
    for field in wire_fields(record):
        if field.since.covers(version):
            yield f"      {type_name(field):<8} {field.name:<36} {field.unit:<10} {field.note}".rstrip()
            if field.record is not None:
                yield from (f"  {line}" for line in _describe_fields(field.record, version))


_TYPE_NAMES = {
    "?": "bool", "b": "i8", "B": "u8", "H": "u16", "i": "i32", "I": "u32", "Q": "u64", "f": "f32", "d": "f64",
    "p": "u8+text", "t": "i32+text", "s": "text", "*": "records",
}  # fmt: skip


def type_name(field: WireField) -> str:
    """Type of a field, such as `f64 x6`."""
    return _TYPE_NAMES[field.code] + (f" x{field.count}" if field.count > 1 else "")


# --- decode --live: the one place of this package that opens a socket


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
