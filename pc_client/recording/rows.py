"""Which signals one row of a recording holds, and how they lie in its messages.

A row is three ROS 2 messages (`/robot_state`, `/reference`, `/command`) that share one time stamp. Their
fields are flat float64 numbers and arrays, so in CDR every message is a constant head followed by packed
little-endian doubles.

ROS 2 allows only lower-case field names, and Foxglove and the `mcap-ros2-support` decoder refuse a whole
topic with any other name. The schemas therefore say `actual_tcp_pose`, with the RTDE spelling beside it as a
comment; `Signal.name`, the loader and the exports keep RTDE's `actual_TCP_pose`.
Source: ROS 2 interface definition, "field names"; OMG CDR (XCDR1) alignment rules.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from pc_client.errors import RecordingError
from protocol.realtime.layout import COLUMNS


class Phase(IntEnum):
    """What the client was doing when a row was recorded."""

    SETTLE_BEFORE = 0
    MOVEMENT = 1
    SETTLE_AFTER = 2


@dataclass(frozen=True, slots=True)
class Signal:
    """One column of a recording.

    Attributes:
        name: RTDE spelling where RTDE has the signal, e.g. `actual_TCP_pose`.
        unit: unit for people, e.g. "rad/s"; may be empty.
        type: ROS 2 primitive type of one number.
    """

    name: str
    count: int
    unit: str = ""
    type: str = "float64"

    @property
    def field(self) -> str:
        """The name that ROS 2 allows: lower case."""
        return self.name.lower()

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each of its numbers, "" without one; "m, rad" of six is m of three and rad of three."""
        parts = ("",) if self.unit in ("-", "enum", "bits") else self.unit.split(", ")
        return tuple(parts[k * len(parts) // self.count] for k in range(self.count))


SignalLike = tuple[str, int] | tuple[str, int, str]
"""What callers hand in for a signal: name, count, and maybe the unit."""

REFERENCE_SIGNALS = (
    Signal("ref_t", 1, "s"),
    Signal("ref_q", 6, "rad"),
    Signal("ref_qd", 6, "rad/s"),
    Signal("ref_tcp_position", 3, "m"),
    Signal("ref_tcp_velocity", 3, "m/s"),
)
"""The reference: `ref_t` since the movement began, positions and velocities in UR's `base` frame."""

# `phase` is the one byte of a row; it stands last so that the doubles before it need no padding.
COMMAND_SIGNALS = (Signal("cmd_qd", 6, "rad/s"), Signal("phase", 1, "enum", "uint8"))
"""The velocities that were sent in answer, and the `Phase`."""

ROW_TOPICS = STATE_TOPIC, REFERENCE_TOPIC, COMMAND_TOPIC = "/robot_state", "/reference", "/command"
PROVENANCE_RECORD, UNITS_RECORD, SUMMARY_RECORD = "provenance", "units", "summary"

_MOST_NUMBERS = 2000
"""Most numbers in a row: ten times those of the largest frame."""

_COUNTS = {column.name: column.count for column in COLUMNS}
_NUMPY_TYPES = {"float64": "<f8", "uint8": "u1"}
_FIELD_NAME = re.compile(r"[a-z](?:_?[a-z0-9]+)*")  # as strict as Foxglove's ROS 2 parser
_SCHEMA_LINE = re.compile(
    r"(?P<type>\w+)(?:\[(?P<count>[0-9]{1,6})\])? (?P<field>\w+)  # (?P<name>\w+)(?: \[(?P<unit>.*)\])?"
)


class Topic(NamedTuple):
    """One ROS 2 topic of a recording."""

    name: str
    schema_name: str
    signals: tuple[Signal, ...]

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Numpy record of the CDR message: packed, as no field needs padding."""
        head = [("head of CDR", "u1", (4,))]  # no signal has such a name
        return np.dtype([*head, *((s.name, _NUMPY_TYPES[s.type], (s.count,)) for s in self.signals)])


def row_topics(state_signals: Iterable[SignalLike]) -> tuple[Topic, Topic, Topic]:
    """The topics of a recording whose robot state has these signals: state, reference, command.

    Args:
        state_signals: every column of the realtime frame, in frame order; `timestamp`, the controller's
            time in seconds, must be among them.

    Raises:
        RecordingError: a name is not allowed in ROS 2, appears twice, or `timestamp` is missing.
    """
    state = tuple(Signal(*each) for each in state_signals)
    topics = (
        Topic(STATE_TOPIC, "ur_hil/msg/RobotState", state),
        Topic(REFERENCE_TOPIC, "ur_hil/msg/Reference", REFERENCE_SIGNALS),
        Topic(COMMAND_TOPIC, "ur_hil/msg/Command", COMMAND_SIGNALS),
    )
    fields = [s.field for topic in topics for s in topic.signals]
    for field in fields:
        if not _FIELD_NAME.fullmatch(field):
            raise RecordingError(
                f"signal name {field!r} cannot be recorded; use letters, digits and single underscores"
            )
        if fields.count(field) > 1:
            raise RecordingError(f"signal name {field!r} appears twice; every signal needs its own name")
    if "timestamp" not in [s.name for s in state if s.count == 1]:
        raise RecordingError(
            "the robot state has no scalar 'timestamp'; a recording needs the controller's time"
        )
    return topics


def schema_text(signals: Iterable[Signal]) -> str:
    """Return the ROS 2 message definition of these signals."""
    lines = []
    for s in signals:
        array = f"[{s.count}]" if s.count > 1 else ""
        unit = f" [{s.unit}]" if s.unit else ""
        lines.append(f"{s.type}{array} {s.field}  # {s.name}{unit}")
    return "\n".join(lines) + "\n"


def check_row(signals: Sequence[Signal]) -> None:
    """Refuse signals that no row can have.

    Raises:
        RecordingError: a name twice, none or too many numbers, or a signal of the robot with another number
            of them than its frames have.
    """
    names = [signal.name for signal in signals]
    n_numbers = sum(signal.count for signal in signals)
    if len(set(names)) < len(names) or not 0 < n_numbers <= _MOST_NUMBERS:
        raise RecordingError(
            f"{len(names)} signals of {n_numbers} numbers; give each once, at most {_MOST_NUMBERS}"
        )
    for signal in signals:
        if signal.count != _COUNTS.get(signal.name, signal.count) or not signal.count:
            raise RecordingError(f"{signal.name} of {signal.count} numbers")


def parse_schema_text(text: str) -> tuple[Signal, ...]:
    """Read back what `schema_text` wrote.

    Raises:
        RecordingError: a line is not of that form, so the file was not written by this package.
    """
    signals = []
    for line in text.splitlines():
        match = _SCHEMA_LINE.fullmatch(line)
        if match is None or match["type"] not in _NUMPY_TYPES:
            raise RecordingError(
                f"cannot read the message definition {line!r}; only what this package writes is known"
            )
        signals.append(Signal(match["name"], int(match["count"] or 1), match["unit"] or "", match["type"]))
    return tuple(signals)
