"""The page docs/protocol/rtde.md, made from the tables of variables, states and types."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby
from types import SimpleNamespace

from docs.generate.page_parts import MARKS, example, modes, numbers, table
from protocol.as_text import RtdeDecoder
from protocol.rtde.client_connection import RtdeClientConnection
from protocol.rtde.codec import (
    MAX_NAMES_SIZE,
    Request,
    RequestProtocolVersion,
    RtdePackageType,
    SetupOutputs,
    Start,
)
from protocol.rtde.fields import INPUTS, OUTPUTS, RtdeField, input_fields, output_fields
from protocol.rtde.server_connection import RtdeServerConnection, request_limits
from protocol.rtde.types import RobotStatusBits, RtdeType, SafetyStatusBits, TextLevel, TimeScaleSource
from protocol.ur_types import JointMode, ProgramState, RobotMode, SafetyMode, SoftwareVersion
from ur_emulator.budgets import BUDGETS

_CB3, _E_SERIES = request_limits(SoftwareVersion(3, 15)), request_limits(SoftwareVersion(5, 15))
_INTRODUCTION = f"""\
# RTDE: port 30004

Made from `protocol/rtde/fields.py` and `protocol/rtde/types.py` by `make docs`.

This is the interface for current programs. A client names the variables that it needs and their
rate, and receives only these in binary packages; it can also write inputs, which programs on the
robot read. ur_rtde, the maker's client library and its Python client, fieldbus gateways and loggers
use it.

A package is its size (16 bits, itself included), a type byte and a payload, all big-endian. A
connection begins in protocol version 1; `V` requests version 2, as all current clients do.

| type | client to robot | robot to client |
|---|---|---|
| `V` | wanted protocol version (16 bits) | accepted (a byte: 1, or 0) |
| `v` | nothing | software: major, minor, bugfix, build (32 bits each) |
| `O` | rate (64-bit float, version 2 only), names of outputs \
| recipe number (a byte, version 2 only), a type for each name |
| `I` | names of inputs | recipe number (a byte), a type for each name |
| `S`, `P` | start, pause: nothing | accepted (a byte) |
| `U` | recipe number (a byte), values of inputs | recipe number (a byte, version 2 only), values of outputs |
| `M` | text | text: to a package of another type, and before the box ends a connection |

Names and types are text, separated by commas without spaces. Values stand one after the other in the
order of the names, without gaps. A text is, in version 2, its length (a byte), the text, the length of
its source (a byte), the source, a level (a byte); in version 1 a level and the text from the robot,
the text alone from the client. Levels: {numbers(TextLevel)}.

* Every request gets exactly one reply, in order; the box sends nothing else before the reply to
  `S`. A package of a type that the table does not have is skipped, with a text message.
* `S` is refused (0) as long as the connection has no output recipe: none was set up, or the last
  one is void.
* Rates are the control cycles of a second, 125 on a CB3 and 500 on an e-Series, divided by a whole
  number: a request for 60 gives 62.5. Rates from 1 to all cycles are possible.
* A connection has one output recipe, the last one, and up to {BUDGETS.rtde_recipes} input recipes with
  {BUDGETS.rtde_variables:,} variables together, numbered from 1; a further one is answered `NOT_FOUND`.
* The reply to a name that the software does not have is `NOT_FOUND`, to an input that another
  connection uses `IN_USE`; either makes the whole recipe void (number 0). Inputs are free again
  when the connection that uses them ends.
* Inputs are accepted at any time, also before `S`, and act in the next control cycle; the last
  value stays. Of a package that is too long or too short, the complete leading values are used.
* If a client does not read, whole packages are dropped. The names of a recipe have at most
  {MAX_NAMES_SIZE} bytes, a package {_CB3.package}. An e-Series takes longer lists, in packages up to
  {_E_SERIES.package}, but beyond {MAX_NAMES_SIZE} bytes no name twice. Data that is not RTDE, such as
  a request over HTTP, ends the connection, with a text message that gives the reason.
* A program may watch that an input is written often enough (`rtde_set_watchdog`), and may take
  `external_force_torque` in place of the estimated force (`enable_external_ft_sensor`).
"""
assert {chr(kind) for kind in RtdePackageType} == set("VvOISPUM")

_NUMBERS = {
    "?": "a byte, 0 or 1",
    "B": "{} bits, unsigned",
    "I": "{} bits, unsigned",
    "i": "{} bits, signed",
    "Q": "{} bits, unsigned",
    "d": "float of {} bits",
}

_OUTPUTS = """\
## Outputs

*From* gives the first software of CB3 and e-Series; before it, and where it is "-", the answer is
`NOT_FOUND`.
"""

_INPUTS = """\
## Inputs

Masks select the values that act; the other values are ignored. Programs read the registers
(`read_input_integer_register` and similar functions); they can be read back as outputs.
"""


def render() -> str:
    """Return the page."""
    return "\n".join(
        (
            _INTRODUCTION,
            "## Try it\n",
            _example(),
            "\nThis decodes a running box; `decode rtde FILE --names ...` decodes captured bytes.\n",
            "## Types\n",
            *table(("type", "bytes", "what"), map(_type_row, RtdeType)),
            "",
            _OUTPUTS,
            MARKS,
            *table(("name", "type", "unit", "origin", "meaning", "from"), _output_rows()),
            "",
            *_bits("robot_status_bits", RobotStatusBits),
            *_bits("safety_status_bits", SafetyStatusBits),
            "* `time_scale_source`: "
            + ", ".join(f"{int(one)} {_words(one.name)}" for one in TimeScaleSource)
            + ".",
            "",
            _INPUTS,
            *table(("name", "type", "unit", "meaning", "from"), _input_rows()),
            "",
            *modes(RobotMode, JointMode, SafetyMode, ProgramState),
        )
    )


def _type_row(kind: RtdeType) -> tuple[object, ...]:
    number = _NUMBERS[kind.letters[0]].format(8 * kind.size // kind.count)
    return kind.value, kind.size, number if kind.count == 1 else f"{kind.count} numbers: {number}"


def _output_rows() -> Iterator[tuple[object, ...]]:
    for name, field in _grouped(OUTPUTS):
        if field.origin:  # all outputs have one
            yield f"`{name}`", field.type.value, field.unit, field.origin.value, field.meaning, field.since


def _input_rows() -> Iterator[tuple[object, ...]]:
    for name, field in _grouped(INPUTS):
        yield f"`{name}`", field.type.value, field.unit, field.meaning, field.since


def _grouped(fields: tuple[RtdeField, ...]) -> Iterator[tuple[str, RtdeField]]:
    """Rows, the many registers of one kind as one."""

    def kind(field: RtdeField) -> tuple[object, ...]:
        return re.sub(r"_\d+$", "", field.name), field.type, field.since, field.meaning

    for (stem, *_), group in groupby(fields, kind):
        first, *others = group
        last = re.search(r"\d+$", others[-1].name) if others else None
        yield f"{first.name} ... {last[0]}" if last else first.name, first
        assert last or stem


def _bits(name: str, bits: type[RobotStatusBits] | type[SafetyStatusBits]) -> Iterator[str]:
    names = ", ".join(f"{bit.bit_length() - 1} {_words(bit.name)}" for bit in bits if bit.name)
    yield f"* `{name}`: {names}."


def _words(name: str) -> str:
    return name.lower().replace("_", " ")


def _example() -> str:
    """A session as `decode` prints it; the robot's side is our own."""
    names = ("timestamp", "actual_q", "safety_status")
    version = SoftwareVersion(3, 15, 8)
    pc = RtdeClientConnection()
    robot = RtdeServerConnection(version, output_fields(version), input_fields(version))
    requests: tuple[Request, ...] = (RequestProtocolVersion(2), SetupOutputs(names, 10.0), Start())
    sent = b""
    for request in requests:
        robot.receive_data(pc.send(request))
        robot.next_event()
        reply = robot.reply()
        pc.receive_data(reply)
        pc.next_event()
        sent += reply
    assert robot.encoder is not None
    actual_q = (0.3944052, -1.7645076, -2.0996064, -0.1029924, 1.295028, 1.857006)
    sent += robot.encoder(SimpleNamespace(timestamp=63.536, actual_q=actual_q, safety_status=1))
    command = f"python -m protocol decode rtde --live 127.0.0.1 --names {','.join(names)}"
    return example(command, RtdeDecoder(names).feed(sent))
