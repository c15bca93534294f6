"""The tables of one software version as lines of text: what `python -m protocol layout` prints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from protocol.primary.messages import MESSAGES
from protocol.primary.state import state_size, state_types
from protocol.primary.values import value_codes
from protocol.realtime.layout import layout_for_version
from protocol.rtde.fields import INPUTS, OUTPUTS, RtdeField
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import WireField, wire_fields

__all__ = ["describe_layouts", "type_name"]


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
