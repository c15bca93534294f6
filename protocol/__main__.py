"""`python -m protocol`: captured bytes to named fields, a look at a box that runs, and the tables as text.

    python -m protocol decode capture.bin                        port 30001 to 30003; `-` is standard input
    python -m protocol decode rtde capture.bin --names actual_q  what the robot has sent on port 30004
    python -m protocol decode realtime --live 127.0.0.1          the next frame of a box
    python -m protocol layout --version 3.15.8

Exit status: 0 done, 1 the bytes are not what they should be, 2 wrong arguments, file or address.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from protocol.capture import RtdeDecoder, StreamDecoder
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.live import INTERFACES, watch
from protocol.primary_messages import MESSAGES
from protocol.primary_packages import state_size, state_types
from protocol.primary_values import value_codes
from protocol.realtime_layout import layout_for_version
from protocol.rtde_fields import INPUTS, OUTPUTS, RtdeField
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import WireField, wire_fields

_DEFAULT_VERSION = "3.15.8"
_DEFAULT_NAMES = "timestamp,actual_q,actual_TCP_pose,robot_mode,safety_mode,runtime_state"


def decode_capture(
    data: bytes, version: SoftwareVersion, interface: str = "", names: tuple[str, ...] = ()
) -> Iterator[str]:
    """Lines of text, one a field, for every package in a capture.

    Args:
        data: what a socket gave, from the beginning of a package on.
        version: software of the controller, until its version message says better.
        interface: one of `INTERFACES`; "" finds out which of the ports 30001 to 30003 it was.
        names: of the variables in an RTDE capture.

    Raises:
        RemoteProtocolError: the bytes are not those of such a port.
    """
    decoder = _decoder(interface, version, names)
    yield from decoder.feed(data)
    yield from decoder.end()


def _decoder(interface: str, version: SoftwareVersion, names: tuple[str, ...]) -> StreamDecoder | RtdeDecoder:
    return RtdeDecoder(names) if interface == "rtde" else StreamDecoder(version)


def describe_layouts(version: SoftwareVersion, interface: str = "") -> Iterator[str]:
    """The tables of one software version as lines of text; of one interface, or of all."""
    layout_for_version(version)  # says so if there is no such software
    parts = {"realtime": _realtime_layout, "primary": _primary_layout, "rtde": _rtde_layout}
    chosen = [parts["primary" if interface == "secondary" else interface]] if interface else parts.values()
    for number, part in enumerate(chosen):
        if number and version.major >= 3:
            yield ""
        yield from part(version)


def _realtime_layout(version: SoftwareVersion) -> Iterator[str]:
    layout = layout_for_version(version)
    yield f"Realtime interface, port 30003, software {version}: {layout.size} bytes"
    yield f"{'byte':>5} {'floats':>6}  {'name':<28} {'unit':<12} {'box':<16} meaning"
    for column in layout.columns:
        yield (
            f"{layout.offset(column):>5} {column.count:>6}  {column.name:<28} {column.unit:<12} "
            f"{column.filled.value:<16} {column.meaning}"
        )


def _primary_layout(version: SoftwareVersion) -> Iterator[str]:
    if version.major < 3:
        return
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
            filled = field.filled.value if field.filled else ""
            yield (
                f"  {field.name:<36} {field.type.value:<14} {field.unit:<12} {filled:<16} {field.meaning}"
            ).rstrip()


def _describe_fields(record: type[Any], version: SoftwareVersion) -> Iterator[str]:
    for field in wire_fields(record):
        if field.since.covers(version):
            yield f"      {_type_name(field):<8} {field.name:<36} {field.unit:<10} {field.note}".rstrip()
            if field.record is not None:
                yield from (f"  {line}" for line in _describe_fields(field.record, version))


_TYPE_NAMES = {
    "?": "bool", "b": "i8", "B": "u8", "i": "i32", "I": "u32", "Q": "u64", "f": "f32", "d": "f64",
    "p": "u8+text", "t": "i32+text", "s": "text", "*": "records",
}  # fmt: skip


def _type_name(field: WireField) -> str:
    return _TYPE_NAMES[field.code] + (f" x{field.count}" if field.count > 1 else "")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m protocol", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    decode = commands.add_parser("decode", help="bytes of a port to named fields")
    decode.add_argument(
        "source",
        nargs="+",
        metavar="[INTERFACE] [FILE]",
        help=f"{', '.join(INTERFACES)}; then a capture, - for standard input; without an interface, "
        "which of the ports 30001 to 30003 it was is found out",
    )
    decode.add_argument("--live", metavar="HOST[:PORT]", help="look at a box that runs, instead of a file")
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
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
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
