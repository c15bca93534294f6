"""The MCAP records around the rows of a recording: head, chunks, tail.

Pure functions from values to bytes; this module must not open files. The small records are encoded by the
`mcap` package, the bulk (rows and their indexes) by numpy.

    head   magic, Header, 3 Schemas, 3 Channels, Metadata "provenance"
    chunk  Chunk (uncompressed rows, CRC), 3 MessageIndexes                 one for every 64 rows
    tail   Metadata "summary", DataEnd, summary section, Footer, magic      only when closed properly

Chunks are not compressed: a chunk that was cut off is then still readable up to its last whole row, and the
bytes depend on no compressor's version. A second of rows takes about 190 kB.
Source: MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from pc_client.recording.layout import STATE_TOPIC, RowLayout, schema_text

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "ur-hil"
PROVENANCE_RECORD = "provenance"
SUMMARY_RECORD = "summary"

# opcode, length, start and end time, uncompressed size, CRC, length of the compression name "", data length
_CHUNK_HEAD = struct.Struct("<BQQQQIIQ")
_INDEX_HEAD = struct.Struct("<BQHI")
_INDEX_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
CHUNK_HEAD_BYTES = _CHUNK_HEAD.size


class Chunk(NamedTuple):
    """One encoded chunk with its message indexes.

    Attributes:
        data: the bytes to append to the file.
        n_rows: rows in it.
        start_time: log time of the first row, ns.
        end_time: log time of the last row, ns.
        chunk_length: bytes of the Chunk record alone.
        rows_size: bytes of the rows alone.
        index_offsets: channel id -> offset of its MessageIndex from the beginning of `data`.
    """

    data: bytes
    n_rows: int
    start_time: int
    end_time: int
    chunk_length: int
    rows_size: int
    index_offsets: dict[int, int]

    def index_at(self, offset: int) -> ChunkIndex:
        """Return the index record of this chunk when it stands at this offset in the file."""
        return ChunkIndex(
            chunk_length=self.chunk_length,
            chunk_start_offset=offset,
            compression="",
            compressed_size=self.rows_size,
            message_end_time=self.end_time,
            message_index_length=len(self.data) - self.chunk_length,
            message_index_offsets={channel: offset + at for channel, at in self.index_offsets.items()},
            message_start_time=self.start_time,
            uncompressed_size=self.rows_size,
        )


def encode_head(layout: RowLayout, provenance: Mapping[str, str]) -> tuple[bytes, MetadataIndex]:
    """Return everything that stands before the first row, and where the provenance lies in it."""
    builder = RecordBuilder()
    builder.write(MAGIC)
    Header(profile="ros2", library=LIBRARY).write(builder)
    for record in _schemas_and_channels(layout):
        record.write(builder)
    index = _write_metadata(builder, 0, PROVENANCE_RECORD, provenance)
    return builder.end(), index


def encode_chunk(layout: RowLayout, rows: NDArray[np.void], first_row: int) -> Chunk:
    """Stamp the rows with sequence number and controller time, and wrap them as one chunk.

    Args:
        layout: how a row lies in memory.
        rows: (n,) rows, n >= 1; sequence and times are filled in here, in place.
        first_row: sequence number of the first of them.
    """
    stamps = np.rint(rows[STATE_TOPIC]["body"]["timestamp"][:, 0] * 1e9).astype(np.uint64)
    sequence = np.arange(first_row, first_row + len(rows), dtype=np.uint32)
    for topic in layout.topics:
        message = rows[topic.name]
        message["sequence"] = sequence
        message["log_time"] = message["publish_time"] = stamps
    data = rows.tobytes()
    start, end = int(stamps.min()), int(stamps.max())
    length = CHUNK_HEAD_BYTES - 9 + len(data)
    parts = [
        _CHUNK_HEAD.pack(Opcode.CHUNK, length, start, end, len(data), zlib.crc32(data), 0, len(data)),
        data,
    ]

    entries = np.empty(len(rows), _INDEX_ENTRY)
    entries["log_time"] = stamps
    offsets = np.arange(len(rows), dtype=np.uint64) * np.uint64(layout.dtype.itemsize)
    position = CHUNK_HEAD_BYTES + len(data)
    index_offsets = {}
    for channel, topic in enumerate(layout.topics, start=1):
        assert layout.dtype.fields is not None
        entries["offset"] = offsets + np.uint64(layout.dtype.fields[topic.name][1])
        index_offsets[channel] = position
        parts.append(_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + entries.nbytes, channel, entries.nbytes))
        parts.append(entries.tobytes())
        position += _INDEX_HEAD.size + entries.nbytes
    return Chunk(
        b"".join(parts), len(rows), start, end, CHUNK_HEAD_BYTES + len(data), len(data), index_offsets
    )


def encode_tail(
    layout: RowLayout,
    position: int,
    crc: int,
    summary: Mapping[str, str],
    provenance_index: MetadataIndex,
    chunks: Sequence[tuple[ChunkIndex, int]],
) -> bytes:
    """Return everything that stands behind the last row.

    Args:
        layout: layout of the rows.
        position: where in the file the tail will stand.
        crc: CRC-32 of all bytes before it.
        summary: texts of the summary record.
        provenance_index: from `encode_head`.
        chunks: index and number of rows of every chunk in the file.
    """
    builder = RecordBuilder()
    summary_index = _write_metadata(builder, position, SUMMARY_RECORD, summary)
    summary_record = builder.end()
    DataEnd(data_section_crc=zlib.crc32(summary_record, crc)).write(builder)
    data_end = summary_record + builder.end()

    n_rows = sum(n for _, n in chunks)
    statistics = Statistics(
        attachment_count=0,
        channel_count=len(layout.topics),
        channel_message_counts=dict.fromkeys(range(1, len(layout.topics) + 1), n_rows),
        chunk_count=len(chunks),
        message_count=n_rows * len(layout.topics),
        message_end_time=max((index.message_end_time for index, _ in chunks), default=0),
        message_start_time=min((index.message_start_time for index, _ in chunks), default=0),
        metadata_count=2,
        schema_count=len(layout.topics),
    )
    records = _schemas_and_channels(layout)
    groups: list[tuple[Opcode, list[McapRecord]]] = [
        (Opcode.SCHEMA, [r for r in records if isinstance(r, Schema)]),
        (Opcode.CHANNEL, [r for r in records if isinstance(r, Channel)]),
        (Opcode.STATISTICS, [statistics]),
        (Opcode.CHUNK_INDEX, [index for index, _ in chunks]),
        (Opcode.METADATA_INDEX, [provenance_index, summary_index]),
    ]
    summary_start = position + len(data_end)
    offsets = []
    for opcode, group in groups:
        group_start = builder.count
        for record in group:
            record.write(builder)
        offsets.append(SummaryOffset(opcode, summary_start + group_start, builder.count - group_start))
    offset_start = summary_start + builder.count
    for offset in offsets:
        if offset.group_length:
            offset.write(builder)
    section = builder.end()

    # The CRC covers the summary section and the footer up to the CRC field itself.
    footer_head = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
    Footer(summary_start, offset_start, zlib.crc32(section + footer_head)).write(builder)
    return b"".join((data_end, section, builder.end(), MAGIC))


def _schemas_and_channels(layout: RowLayout) -> list[McapRecord]:
    """Return schema and channel of each topic; a schema always before its channel."""
    records: list[McapRecord] = []
    for number, topic in enumerate(layout.topics, start=1):
        text = schema_text(topic.signals).encode()
        records.append(Schema(id=number, data=text, encoding="ros2msg", name=topic.schema_name))
        records.append(
            Channel(id=number, topic=topic.name, message_encoding="cdr", metadata={}, schema_id=number)
        )
    return records


def _write_metadata(
    builder: RecordBuilder, position: int, name: str, values: Mapping[str, str]
) -> MetadataIndex:
    """Write a metadata record and return its index; the builder's first byte stands at `position`."""
    start = builder.count
    Metadata(name=name, metadata=dict(values)).write(builder)
    return MetadataIndex(offset=position + start, length=builder.count - start, name=name)
