"""The page docs/protocol/primary.md, made from the tables of sub-packages and messages."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from docs.generate.page_parts import MARKS, example, modes, numbers, table
from protocol.as_text import StreamDecoder, type_name
from protocol.primary.layout import SUB_PACKAGES
from protocol.primary.messages import (
    MESSAGES,
    MessageSource,
    ReportLevel,
    RequestedType,
    ThreadLabel,
    version_message,
)
from protocol.primary.packages import SECONDARY_MESSAGES, SafetyTolerances, encode_message_package, state_size
from protocol.primary.values import value_codes
from protocol.ur_types import ControlMode, JointMode, RobotMode, RobotType, SafetyMode, SoftwareVersion
from protocol.wire_record import ALWAYS, WireField, wire_fields

_V3_15 = SoftwareVersion(3, 15, 8)
_V5_12 = SoftwareVersion(5, 12)
# The first software of each size of a state.
_SIZES = tuple(
    SoftwareVersion(*numbers)
    for numbers in (
        *((3, minor) for minor in (0, 1, 2, 3, 5, 10)),
        *((5, minor) for minor in (0, 1, 4, 9)),
        (5, 25, 1),
    )
)

_INTRODUCTION = """\
# Primary and secondary interface: ports 30001, 30002, 30011 and 30012

Made from `protocol/primary/layout.py` and `protocol/primary/messages.py` by `make docs`.

The teach pendant itself uses this interface. Ten times a second it sends the whole state of the
robot in sub-packages. Between the states, port 30001 also sends messages: texts of programs, their
start, pause, end and failure, error codes, changes of the safety mode, popups and questions, global
variables. All four ports send states; 30001 and 30002 accept scripts ([scripts.md](scripts.md)),
30011 and 30012 ignore all input. urx uses 30002, ur_modern_driver and the maker's client library
use 30001.

A package is its size (i32, itself included), a type (u8) and a body, all big-endian: 16 is a state,
20 a message, 24 are tolerances, 25 global variables. A state is a sequence of sub-packages, each with
a header like that of a package. Readers use the size to skip unknown types.

| type of a field | bytes |
|---|---|
| u8, i8, u16, i32, u32, u64 | an unsigned or signed integer of so many bits |
| f32, f64 | a float of so many bits |
| bool | a byte, 0 or 1 |
| ... x6 | six of them, one after the other; in JointData joint by joint |
| text | up to the end of the package |
| u8+text, i32+text | the length of the text, then the text |
| records | {records}; again and again up to the end of the package |

## On connection

| | package | bytes in 3.15 | in 5.12 |
|---|---|---|---|
| 1 | version message, a segment of its own: some clients read only once | {version} | {version} |
| 2 | startup message, undocumented | 24 | 24 |
| 3 | safety tolerances, undocumented: type 24, 22 floats; from 3.10 on, not from {until} on | 181 | - |
| 4 | the first state, with kinematics and configuration | {first} | {first_e} |
| 5 | 30001 and 30011: names and values of the running program's global variables | from 16 on | from 16 on |

The following states have no kinematics and configuration ({later} bytes, in 5.12 {later_e}). These
two come again in the first state after the brakes have opened.
"""

_MESSAGES = """\
## Messages

Package type 20: time stamp (u64) in microseconds since the controller started (a multiple of the
cycle, all ones for none), source (i8), message type (u8), fields. The secondary ports send only
{secondary}.

* Sources: {sources}.
* Levels of errors: {levels}. Codes print as `C<code>A<argument>`.
* Requested types: {wanted}.
"""

# When the box sends each message, by its name.
_WHEN = {
    "TextMessage": "`textmsg`",
    "ProgramLabelMessage": "up to 3.2: a `$` line was passed",
    "PopupMessage": "`popup`, and the dashboard's",
    "VersionMessage": "on connection",
    "SafetyModeMessage": "the safety mode has changed",
    "ErrorCodeMessage": "a protective stop, a violation, a fault, a warning, a refused command",
    "KeyMessage": "a program has started, paused or stopped; a `sec` program has failed",
    "RequestValueMessage": "`request_..._from_primary_client`",
    "RuntimeExceptionMessage": "a program did not compile, failed or could not be started",
    "StartupMessage": "on connection",
    "ProgramThreadsMessage": "from 3.3: a thread has passed a `$` line",
    "HardwareInfoMessage": "from 5.26: on connection, 30001 and 30011 only",
}

_ORDER = """\
### Order

Everything of a cycle leaves in this order. A client that sees a mode, an error or the end of a
program in a state, on any port, has been sent the message of it on 30001 before.

1. The messages, in the order in which the cycle has caused them: what commands and safety inputs
   do, then what programs do, then what stops the arm. The error code comes before the safety mode
   that it leads to, the safety mode before the program's pause or end.
2. The changed variables of a program that ends come before its `PROGRAM_XXX_STOPPED`, the names of
   the variables of one that starts after its `PROGRAM_XXX_STARTED`.
3. Frames of 30003 and data of 30004, if the cycle sends them.
4. `ProgramThreadsMessage` and `ProgramLabelMessage`, then the state, if one is due (ten times a
   second), then the changed variables.

A client that connects gets the state of the last cycle; there are no messages of what was before.
"""

_VARIABLES = """\
## Global variables

Package type 25, on 30001 and 30011: time stamp (u64), sub-type (u8), number of the first variable
(u16), variables, each ended by a line feed. Sub-type 0 gives the names of a program's `global`
variables when it starts, sub-type 1 the values that have changed, ten times a second and at the end.
A value is a type code (u8) and its data, so its end is known before the line feed:

| type | data |
|---|---|
| none | nothing |
| const string, var string | length (i16), text |
| list | length (i16), values, each with its code |
| matrix | rows (i16), columns (i16), values row by row, each with its code |
| pose | six f32 |
| bool | a byte |
| int | i32 |
| num, float | f32 |

The codes:
"""


def render() -> str:
    """Return the page."""
    greeting = encode_message_package(version_message(_V3_15), _V3_15)
    introduction = _INTRODUCTION.format(
        version=len(greeting),
        until=f"{SafetyTolerances.UNTIL.major}.{SafetyTolerances.UNTIL.minor}",
        first=state_size(_V3_15, first=True),
        later=state_size(_V3_15, first=False),
        first_e=state_size(_V5_12, first=True),
        later_e=state_size(_V5_12, first=False),
        records=_fields(ThreadLabel),
    )
    decoded = StreamDecoder(_V3_15).feed(greeting)
    messages = _MESSAGES.format(
        secondary=" and ".join(message.__name__ for message in SECONDARY_MESSAGES),
        sources=numbers(MessageSource),
        levels=numbers(ReportLevel),
        wanted=numbers(RequestedType),
    )
    return "\n".join(
        (
            introduction,
            "## Try it\n",
            example("python -m protocol decode primary --live 127.0.0.1", decoded),
            "\n`--count 4` shows the first state too; `decode FILE` reads captured bytes.\n",
            "## Sizes of a state\n",
            *table(("from software", "first", "later"), map(_size_row, _SIZES)),
            "\n## Sub-packages of a state\n",
            MARKS,
            "They follow each other in the order of this list.\n",
            *_sub_packages(),
            messages,
            *_message_rows(),
            "",
            _ORDER,
            _VARIABLES,
            *_codes(),
            "",
            *modes(RobotMode, JointMode, SafetyMode, ControlMode, RobotType),
        )
    )


def _size_row(version: SoftwareVersion) -> tuple[object, ...]:
    first, later = state_size(version, first=True), state_size(version, first=False)
    return str(version).removesuffix(".0"), first, later


def _sub_packages() -> Iterator[str]:
    for record in SUB_PACKAGES:
        notes = [_first_line(record)]
        if record.FIRST_STATE_ONLY:
            notes.append("In the first state, and after the brakes have opened.")
        if record.SINCE.cb3 != SoftwareVersion(3, 0):
            notes.append(f"From {record.SINCE}.")
        yield f"### {record.SUB_TYPE} {record.__name__}\n"
        yield " ".join(notes) + "\n"
        yield from table(
            ("field", "type", "unit", "origin", "meaning", "from"),
            (
                (f"`{f.name}`", type_name(f), f.unit, f.origin.value if f.origin else "", f.note, _since(f))
                for f in wire_fields(record)
            ),
        )
        yield ""


def _since(field: WireField) -> str:
    """First software of a field that came after its record."""
    return "" if field.since == ALWAYS else str(field.since)


def _message_rows() -> Iterator[str]:
    yield from table(
        ("type", "message", "sent when", "fields (from software)"),
        (
            (message.MESSAGE_TYPE, message.__name__, _WHEN[message.__name__], _fields(message))
            for message in MESSAGES
        ),
    )


def _fields(record: type[Any]) -> str:
    return ", ".join(
        f"`{field.name}` {type_name(field)}" + (f" ({_since(field)})" * bool(_since(field)))
        for field in wire_fields(record)
    )


def _codes() -> Iterator[str]:
    columns = [value_codes(SoftwareVersion(3, minor)) for minor in (2, 3, 14)]
    yield from table(
        ("type", "up to 3.2", "from 3.3 / 5.0", "from 3.14 / 5.9"),
        ((kind.value, *(codes.get(kind, "-") for codes in columns)) for kind in columns[-1]),
    )


def _first_line(record: type[Any]) -> str:
    return (record.__doc__ or "").strip().splitlines()[0]
