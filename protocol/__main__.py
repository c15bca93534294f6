"""`python -m protocol`: captured bytes to named fields, and the tables as text.

    python -m protocol decode capture.bin      bytes of port 30003 or 30001/30002, `-` reads standard input
    python -m protocol layout --version 3.15.8

Exit status: 0 done, 1 the capture is not what it should be, 2 wrong arguments or file. Prints, nothing else.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.frame_buffer import FrameBuffer
from protocol.primary_messages import MESSAGES, ThreadLabel, VersionMessage
from protocol.primary_packages import (
    MAX_PACKAGE_SIZE,
    MIN_PACKAGE_SIZE,
    PackageType,
    RobotState,
    decode_package,
    state_size,
    state_types,
)
from protocol.primary_values import TypedValue, value_codes
from protocol.realtime_layout import MAX_FRAME_SIZE, layout_for_size, layout_for_version
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import WireField, wire_fields

_DEFAULT_VERSION = "3.15.8"


def decode_capture(data: bytes, version: SoftwareVersion) -> Iterator[str]:
    """Lines of text, one a field, for every package in a capture.

    Args:
        data: what a socket gave, from the beginning of a package on.
        version: software of the controller, until its version message says better.

    Raises:
        RemoteProtocolError: the bytes are not those of a realtime, primary or secondary port.
    """
    is_primary = len(data) >= MIN_PACKAGE_SIZE and data[4] in PackageType.__members__.values()
    frames = (
        FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)
        if is_primary
        else FrameBuffer(max_size=MAX_FRAME_SIZE)
    )
    frames.feed(data)
    position = 0
    while (frame := frames.next_frame()) is not None:
        if is_primary:
            package = decode_package(frame, version)
            if isinstance(package, VersionMessage):
                version = SoftwareVersion(package.major, package.minor, package.bugfix)
            yield f"byte {position}: {type(package).__name__}, {len(frame)} bytes"
            yield from _describe(package)
        else:
            realtime = layout_for_size(len(frame)).decode(frame)
            yield f"byte {position}: realtime frame, {len(frame)} bytes"
            for column in realtime.layout.columns:
                yield f"  {column.name:<28} {_number(getattr(realtime, column.attribute))} {column.unit}"
        position += len(frame)
    if frames.pending:
        yield f"byte {position}: {frames.pending} bytes of a package that is not complete"


def _describe(package: Any) -> Iterator[str]:
    if isinstance(package, RobotState):
        for sub_package in package.sub_packages:
            yield f"  {type(sub_package).__name__}"
            yield from (f"  {line}" for line in _describe(sub_package))
        return
    units = {field.name: field.unit for field in wire_fields(type(package))}
    for field in dataclasses.fields(package):
        value = getattr(package, field.name)
        text = value.hex(" ") if isinstance(value, bytes) else _number(value)
        yield f"  {field.name:<28} {text} {units.get(field.name, '')}".rstrip()


def _number(value: Any) -> str:
    if isinstance(value, str | bool):
        return repr(value)
    if isinstance(value, TypedValue):
        return f"{value.type.value} {value}"
    if isinstance(value, ThreadLabel):
        return f"{value.thread_name!r}: {value.label_id} {value.text!r}"
    if isinstance(value, float | int):
        return f"{value:.10g}" if isinstance(value, float) else str(value)
    return "[" + ", ".join(_number(item) for item in list(value)) + "]"


def describe_layouts(version: SoftwareVersion) -> Iterator[str]:
    """The tables of one software version as lines of text."""
    layout = layout_for_version(version)
    yield f"Realtime interface, port 30003, software {version}: {layout.size} bytes"
    yield f"{'byte':>5} {'floats':>6}  {'name':<28} {'unit':<12} {'box':<16} meaning"
    for column in layout.columns:
        yield (
            f"{layout.offset(column):>5} {column.count:>6}  {column.name:<28} {column.unit:<12} "
            f"{column.filled.value:<16} {column.meaning}"
        )
    if version.major < 3:
        return
    yield ""
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m protocol", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    decode = commands.add_parser(
        "decode", help="captured bytes of port 30001, 30002 or 30003 to named fields"
    )
    decode.add_argument("file", help="capture, or - for standard input")
    layout = commands.add_parser("layout", help="print the tables")
    for command in (decode, layout):
        command.add_argument("--version", default=_DEFAULT_VERSION, help="controller software (%(default)s)")
    options = parser.parse_args(arguments)
    try:
        version = SoftwareVersion.parse(options.version)
        if options.command == "layout":
            lines = describe_layouts(version)
        else:
            data = sys.stdin.buffer.read() if options.file == "-" else Path(options.file).read_bytes()
            lines = decode_capture(data, version)
        for line in lines:
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
