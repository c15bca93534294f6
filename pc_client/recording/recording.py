"""Reads a recording back, also one whose end is missing.

The reader goes through the file from its beginning and never needs the index at its end, so that a run that
was killed loads up to its last whole row. Damage inside the file ends the reading there, and
`Recording.complete` and `Recording.damage` say so.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from pc_client.arrays import Array
from pc_client.errors import RecordingError
from pc_client.files import FILE_KINDS
from pc_client.recording import rows
from pc_client.recording.provenance import Provenance
from pc_client.recording.rows import Phase, Signal, Topic

_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD_BYTES = 40  # of one that is not compressed
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CRC = struct.Struct("<I")
_NEEDED = (Signal("timestamp", 1, "s"), *rows.REFERENCE_SIGNALS, *rows.COMMAND_SIGNALS)


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording in memory; all rows, one array a signal.

    Attributes:
        signals: every column, in file order.
        summary: results that the recorder's `close` was given; empty when the file is cut off.
        complete: True when the file was closed properly and all of it could be read.
        damage: one line about what is missing when not complete, else "".
    """

    path: Path
    provenance: Provenance
    signals: tuple[Signal, ...]
    summary: Mapping[str, Any]
    complete: bool
    damage: str
    _columns: Mapping[str, Array] = field(repr=False)

    def column(self, name: str) -> Array:
        """Return one signal: (n,) for a scalar, (n, count) otherwise; SI units.

        Args:
            name: RTDE spelling, e.g. "actual_TCP_pose", or one of the client's, e.g. "ref_q".

        Raises:
            RecordingError: no such signal in this file.
        """
        try:
            return self._columns[name]
        except KeyError:
            raise RecordingError(
                f"{self.path} has no signal {name!r}; it has {', '.join(self._columns)}"
            ) from None

    @property
    def n_rows(self) -> int:
        """Number of rows, one a control cycle."""
        return len(self.t)

    @property
    def t(self) -> Array:
        """Controller time of each row in s, (n,)."""
        return self._columns["timestamp"]

    @property
    def aborted(self) -> str:
        """Why this is no whole run: it was given up, or the file is cut off; empty for a whole one."""
        given_up = self.summary.get("aborted")
        return self.damage if given_up is None else f"the run was given up ({given_up})"

    def rows_of(self, phase: Phase) -> NDArray[np.bool_]:
        """Return a mask (n,) of the rows of one phase."""
        return np.equal(self._columns["phase"], float(phase))


def load_recording(path: Path | str) -> Recording:
    """Load a recording, up to its last whole row when its end is missing.

    Raises:
        RecordingError: the file cannot be read, is no recording, or was cut before its first row's layout.
    """
    path = Path(path)
    data = FILE_KINDS["recording"].read_bytes(path)
    if not data.startswith(MCAP0_MAGIC):
        raise RecordingError(f"{path} is not a recording: an MCAP file begins with {MCAP0_MAGIC!r}")
    scan = _Scan()
    damage = scan.read(data)
    columns, missing = scan.columns(), scan.missing_signal()
    if missing and not scan.has_begun:  # stopped before its first chunk was whole: no rows
        columns, missing = {signal: _as_column(signal, np.empty((0, signal.count))) for signal in _NEEDED}, ""
    if rows.PROVENANCE_RECORD not in scan.metadata or missing:
        reason = damage or (f"no signal {missing!r}" if missing else "no provenance")
        raise RecordingError(f"{path} holds no recording of this package: {reason}")
    try:
        provenance = Provenance.from_metadata(scan.metadata[rows.PROVENANCE_RECORD])
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error
    try:
        summary = {key: json.loads(text) for key, text in scan.metadata.get(rows.SUMMARY_RECORD, {}).items()}
    except (ValueError, RecursionError) as error:
        summary, damage = {}, damage or f"damaged: the summary cannot be read ({error})"
    return Recording(
        path=path,
        provenance=provenance,
        signals=tuple(columns),
        summary=summary,
        complete=not damage,
        damage=damage,
        _columns={signal.name: values for signal, values in columns.items()},
    )


def _as_column(signal: Signal, values: Array) -> Array:
    return values[:, 0] if signal.count == 1 else values


class _Scan:
    """One pass over the records of a file, collecting what a recording consists of."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.topics: dict[int, Topic] = {}
        self.others: set[int] = set()  # channels for viewers, which repeat what the rows say
        self.metadata: dict[str, dict[str, str]] = {}
        self.rows: dict[int, bytearray] = {}
        self.sizes: dict[int, int] = {}  # of a message of each channel
        self.has_begun = False  # what comes behind the head has been seen

    def read(self, data: bytes) -> str:
        """Take in all whole records; return what is missing or damaged, "" when nothing is."""
        in_rows = True  # behind DataEnd there is only the index, which repeats what is known
        damage = ""
        for opcode, start, end in _records(data, len(MCAP0_MAGIC)):
            position = start - _RECORD_HEAD.size
            try:
                if end > len(data):
                    if in_rows and opcode == Opcode.CHUNK and len(data) > start + _CHUNK_HEAD_BYTES:
                        self._take_chunk(data[start:], is_cut=True)
                    return f"cut off inside a record at byte {position} of {len(data)}"
                if opcode == Opcode.DATA_END:
                    in_rows = False
                    if _CRC.unpack_from(data, start)[0] not in (0, crc32(data[:position])):
                        damage = "damaged: the checksum over all records is wrong"
                elif in_rows:
                    self.has_begun |= opcode not in (Opcode.HEADER, Opcode.METADATA)
                    self._take(opcode, data[start:end])
            except (McapError, RecordingError, ValueError, OverflowError, struct.error) as error:
                return f"damaged: record at byte {position} cannot be read ({error})"
            if opcode == Opcode.FOOTER:
                whole = not in_rows and data[end : end + len(MCAP0_MAGIC)] == MCAP0_MAGIC
                return damage if whole else "cut off inside the end mark"
        return f"cut off at byte {len(data)}: the end mark is missing"

    def columns(self) -> dict[Signal, Array]:
        """Return one array a signal; a row counts when all its messages are there."""
        n_rows = min((len(taken) // self.sizes[channel] for channel, taken in self.rows.items()), default=0)
        columns = {}
        for channel, topic in self.topics.items():
            messages = np.frombuffer(self.rows[channel], topic.dtype, n_rows)
            for signal in topic.signals:
                columns[signal] = _as_column(signal, messages[signal.name].astype(np.float64))
        return columns

    def missing_signal(self) -> str:
        """The first signal that every recording has and this one has not, or not with as many numbers."""
        counts = {signal.name: signal.count for topic in self.topics.values() for signal in topic.signals}
        return next((need.name for need in _NEEDED if counts.get(need.name) != need.count), "")

    def _take(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            self._take_channel(Channel.read(stream))
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            self.metadata[metadata.name] = metadata.metadata
        elif opcode == Opcode.CHUNK:
            self._take_chunk(body)
        elif opcode == Opcode.MESSAGE:
            self._take_message(body)

    def _take_message(self, body: bytes) -> None:
        channel = _MESSAGE_HEAD.unpack_from(body)[0]
        if channel in self.others:
            return
        if channel not in self.rows:
            raise ValueError(f"a message names the unknown channel {channel}")
        size = len(body) - _MESSAGE_HEAD.size
        if size != self.sizes[channel]:
            raise ValueError(f"a message has {size} bytes, its topic needs {self.sizes[channel]}")
        self.rows[channel] += body[_MESSAGE_HEAD.size :]

    def _take_channel(self, channel: Channel) -> None:
        if channel.topic not in rows.ROW_TOPICS:
            if channel.id in self.topics:
                raise ValueError(f"channel {channel.id} is defined twice")
            self.others.add(channel.id)
            return
        if channel.schema_id not in self.schemas:
            raise ValueError(f"topic {channel.topic} names the unknown schema {channel.schema_id}")
        schema = self.schemas[channel.schema_id]
        topic = Topic(channel.topic, schema.name, rows.parse_schema_text(schema.data.decode()))
        if channel.id in self.others or self.topics.get(channel.id, topic) != topic:
            raise ValueError(f"channel {channel.id} is defined twice")
        others = [known for number, known in self.topics.items() if number != channel.id]
        rows.check_row([signal for known in (*others, topic) for signal in known.signals])
        self.topics[channel.id] = topic
        self.sizes[channel.id] = topic.dtype.itemsize
        self.rows.setdefault(channel.id, bytearray())

    def _take_chunk(self, body: bytes, *, is_cut: bool = False) -> None:
        """Take the records of a chunk; of one that is cut off those that are whole."""
        chunk = Chunk.read(ReadDataStream(BytesIO(body)))
        if chunk.compression:
            raise ValueError(f"packed by {chunk.compression[:20]!r}; this package does not pack rows")
        if not is_cut and chunk.uncompressed_crc not in (0, crc32(chunk.data)):
            raise ValueError("its checksum is wrong")
        for opcode, start, end in _records(chunk.data, 0):
            if opcode == Opcode.MESSAGE and end <= len(chunk.data):
                self._take_message(chunk.data[start:end])
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and end <= len(chunk.data):
                self._take(opcode, chunk.data[start:end])


def _records(data: bytes, position: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of the content of each record from a position on; the last may end outside."""
    while position + _RECORD_HEAD.size <= len(data):
        opcode, length = _RECORD_HEAD.unpack_from(data, position)
        start = position + _RECORD_HEAD.size
        position = start + length
        yield opcode, start, position
