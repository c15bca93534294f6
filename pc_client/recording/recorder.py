"""The recorder: takes one row a control cycle and appends them to a file, a chunk at a time.

It runs inside the control loop, so `append` costs a few microseconds and never raises for the disk's sake:
the first I/O error is kept in `error` for the loop to see, rows go on into memory, and `close` reports what
was saved. Truth about time is the controller's stamp in the row; nothing here reads a clock.

A killed process loses at most the rows of the chunk it was filling (half a second); a machine that loses
power may lose what the operating system had not yet written.
"""

from __future__ import annotations

import errno
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self
from zlib import crc32

import numpy as np
from mcap.records import ChunkIndex
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import RecordingError
from pc_client.recording.layout import COMMAND_TOPIC, REFERENCE_TOPIC, STATE_TOPIC, SignalLike, row_layout
from pc_client.recording.mcap_file import CHUNK_HEAD_BYTES, Chunk, encode_chunk, encode_head, encode_tail
from pc_client.recording.provenance import Provenance

ROWS_PER_CHUNK = 64  # half a second at 125 Hz
# Rows that are kept in memory after the disk failed: two minutes at 125 Hz, 24 MB.
MAX_HELD_CHUNKS = 240


class RawFile(Protocol):
    """The part of an unbuffered binary file that the recorder uses."""

    def write(self, data: memoryview, /) -> int | None:
        """Write some of the data and return how many bytes."""

    def seek(self, offset: int, /) -> int:
        """Go to this offset."""

    def truncate(self, size: int, /) -> int:
        """Cut the file to this size."""

    def close(self) -> None:
        """Close the file."""


def _open_unbuffered(path: Path) -> RawFile:
    """Open for writing without Python's own buffer: what `write` returned is out of this process."""
    return open(path, "wb", buffering=0)


class Recorder:
    """One recording in the making.

    Example:
        with Recorder(path, provenance, [(c.name, c.count) for c in layout.columns]) as recorder:
            recorder.append(frame.values, t, ref_q, ref_qd, ref_p, ref_v, cmd_qd, Phase.MOVEMENT)
            if recorder.error is not None:
                ...stop the arm; leaving the block raises the error

    Attributes:
        path: the file.
        error: the first I/O error, or None. Once set it stays.
        n_rows: rows appended so far.
    """

    def __init__(
        self,
        path: Path | str,
        provenance: Provenance,
        state_signals: Iterable[SignalLike],
        *,
        opener: Callable[[Path], RawFile] = _open_unbuffered,
    ) -> None:
        """Create the file and write its head.

        Args:
            path: file to create; an existing one is replaced.
            provenance: written at the beginning, so that also a cut file says where it comes from.
            state_signals: each column of the realtime frame in its order, as (name, count) or `Signal`.
            opener: opens the file; tests hand in failing disks here.

        Raises:
            RecordingError: the file cannot be created, or a signal cannot be recorded.
        """
        self.path = Path(path)
        self.error: RecordingError | None = None
        self.n_rows = 0
        self._layout = row_layout(state_signals)
        self._closed = False
        self._rows = self._layout.blank_rows(ROWS_PER_CHUNK)
        self._fill = 0
        self._held: list[Chunk] = []
        self._n_dropped = 0
        self._chunks: list[tuple[ChunkIndex, int]] = []  # index and rows of each chunk in the file
        self._cut_views()

        head, self._provenance_index = encode_head(self._layout, provenance.to_metadata())
        self._position = 0  # end of the last record that is wholly in the file
        self._crc = 0  # of everything up to there
        self._partial = 0  # bytes behind it, of a write that failed half-way
        try:
            self._file = opener(self.path)
        except OSError as error:
            raise RecordingError(
                f"cannot create the recording {self.path}: {error.strerror or error}; choose another --out"
            ) from error
        if not self._write(head):
            self._file.close()
            assert self.error is not None
            raise self.error

    def append(
        self,
        frame_values: NDArray[np.float64],
        t_ref: float,
        ref_q: ArrayLike,
        ref_qd: ArrayLike,
        ref_p: ArrayLike,
        ref_v: ArrayLike,
        cmd_qd: ArrayLike,
        phase: int,
    ) -> None:
        """Add one row. Never raises for I/O: look at `error`.

        Args:
            frame_values: (n,) all columns of the realtime frame in frame order, SI units.
            t_ref: s, time of the reference since the movement began.
            ref_q: (6,) reference joint positions at the frame's time stamp, rad.
            ref_qd: (6,) reference joint velocities, rad/s.
            ref_p: (3,) reference TCP position, base frame, m.
            ref_v: (3,) reference TCP velocity, base frame, m/s.
            cmd_qd: (6,) joint velocities sent in answer to this frame, rad/s.
            phase: a `Phase`.
        """
        i = self._fill
        self._state[i] = frame_values
        self._ref_t[i] = t_ref
        self._ref_q[i] = ref_q
        self._ref_qd[i] = ref_qd
        self._ref_p[i] = ref_p
        self._ref_v[i] = ref_v
        self._cmd_qd[i] = cmd_qd
        self._phase[i] = phase
        self.n_rows += 1
        i += 1
        self._fill = i
        if i == ROWS_PER_CHUNK:
            self._finish_chunk()

    def close(self, summary: Mapping[str, object] | None = None) -> None:
        """Write the rest of the rows, the summary and the index, and close the file. Idempotent.

        Args:
            summary: JSON-able results of the run, stored as the metadata record "summary".

        Raises:
            RecordingError: rows or the index could not be written; says what is in the file.
        """
        if self._closed:
            return
        self._closed = True
        self._finish_chunk()
        if self._held and self._rewind():
            while self._held and self._write_chunk(self._held[0]):
                del self._held[0]
        if not self._held:
            texts = {key: json.dumps(value) for key, value in (summary or {}).items()}
            tail = encode_tail(
                self._layout, self._position, self._crc, texts, self._provenance_index, self._chunks
            )
            self._write(tail)
        try:
            self._file.close()
        except OSError as error:
            self._latch(error)
        if self.error is not None:
            raise RecordingError(f"{self.error}; {self._saved()}") from self.error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        try:
            self.close({"aborted": type(error).__name__})
        except RecordingError as lost:
            error.add_note(str(lost))  # the error that ended the run stays the one that is raised

    def _cut_views(self) -> None:
        """Cut the row buffer into one array a value group, so that `append` is a few plain assignments."""
        state = self._rows[STATE_TOPIC]["body"]
        n_values = state.dtype.itemsize // 8
        self._state: NDArray[np.float64] = state.view(np.dtype(("<f8", (n_values,))))
        reference = self._rows[REFERENCE_TOPIC]["body"]
        self._ref_t: NDArray[np.float64] = reference["ref_t"][:, 0]
        self._ref_q: NDArray[np.float64] = reference["ref_q"]
        self._ref_qd: NDArray[np.float64] = reference["ref_qd"]
        self._ref_p: NDArray[np.float64] = reference["ref_tcp_position"]
        self._ref_v: NDArray[np.float64] = reference["ref_tcp_velocity"]
        command = self._rows[COMMAND_TOPIC]["body"]
        self._cmd_qd: NDArray[np.float64] = command["cmd_qd"]
        self._phase: NDArray[np.uint8] = command["phase"][:, 0]

    def _finish_chunk(self) -> None:
        """Encode the filled rows as a chunk, and write it or hold it."""
        n = self._fill
        if n == 0:
            return
        self._fill = 0
        chunk = encode_chunk(self._layout, self._rows[:n], self.n_rows - n)
        if self.error is None and self._write_chunk(chunk):
            return
        if len(self._held) < MAX_HELD_CHUNKS:
            self._held.append(chunk)
        else:
            self._n_dropped += n

    def _write_chunk(self, chunk: Chunk) -> bool:
        at = self._position
        if not self._write(chunk.data):
            return False
        self._chunks.append((chunk.index_at(at), chunk.n_rows))
        return True

    def _write(self, data: bytes) -> bool:
        """Append all bytes; on an I/O error latch it and return False."""
        view = memoryview(data)
        done = 0
        try:
            while done < len(view):
                n_written = self._file.write(view[done:])
                if not n_written:
                    raise OSError(errno.EIO, "the file takes no more bytes")
                done += n_written
        except OSError as error:
            self._partial = done
            self._latch(error)
            return False
        self._position += done
        self._crc = crc32(data, self._crc)
        return True

    def _rewind(self) -> bool:
        """Go back to the end of the last whole record, to try again; a disk may have been cleared."""
        try:
            self._file.seek(self._position)
            self._file.truncate(self._position)
        except OSError:
            return False
        self._partial = 0
        return True

    def _latch(self, error: OSError) -> None:
        if self.error is None:
            self.error = RecordingError(f"cannot write the recording {self.path}: {error.strerror or error}")
            self.error.__cause__ = error

    def _saved(self) -> str:
        """Say in one phrase what is in the file."""
        whole = sum(n_rows for _, n_rows in self._chunks)
        partial = max(0, self._partial - CHUNK_HEAD_BYTES) // self._layout.dtype.itemsize if self._held else 0
        if whole == self.n_rows:
            return f"all {whole} rows are saved; make room before the next run"
        return f"{whole + partial} of {self.n_rows} rows are saved and readable; make room and repeat the run"
