"""The recorder: takes one row a control cycle and appends them to a file, a chunk at a time.

It runs inside the control loop, so `append` costs some microseconds and neither waits for the disk nor raises
for its sake: the thread of an `_Outbox` writes, its first error is kept in `error` for the loop to see, rows
go on into memory, and `close` reports what was saved. Truth about time is the controller's stamp in the row;
nothing here reads a clock.

A killed process loses at most the rows of the chunk it was filling (half a second) and those that a slow
disk had not yet taken; a machine that loses power may lose what the operating system had not yet written.
Chunks are not compressed: one that was cut off is readable up to its last whole row, and the bytes depend on
no compressor's version.
"""

import errno
import json
from collections.abc import Callable, Iterable, Mapping
from io import FileIO
from pathlib import Path
from queue import SimpleQueue
from struct import Struct
from threading import Thread
from types import TracebackType
from typing import IO, Self, cast

from mcap.writer import CompressionType, Writer

from pc_client.arrays import Array
from pc_client.errors import RecordingError, one_line
from pc_client.recording.arm_view import CDR_LITTLE_ENDIAN, ArmTree, ArmView
from pc_client.recording.provenance import Provenance
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import (
    PROVENANCE_RECORD,
    SUMMARY_RECORD,
    UNITS_RECORD,
    SignalLike,
    Topic,
    row_topics,
    schema_text,
)

MOST_WAITING = 120
"""Chunks that may wait for a disk that stands still: a minute at 125 Hz, 15 s at 500 Hz, 15 MB."""


class _Outbox:
    """A stream that takes all bytes at once; a thread writes them to a file without a buffer.

    Whoever makes the bytes never waits for the disk and gets no error from it: the first one is kept. What
    the file has taken is out of this process.

    Attributes:
        error: the first one of the file, or that it is too slow; nothing is written from then on to `close`.
    """

    def __init__(self, file: FileIO) -> None:
        self.error: OSError | None = None
        self._file = file
        self._made: list[bytes] = []  # since the last chunk was posted
        self._n_taken = 0
        # Not `queue.Queue`: where a signal interrupts its `put`, the thread may wait for ever.
        self._posted: SimpleQueue[bytes | None] = SimpleQueue()
        self._left = memoryview(b"")  # what the file did not take
        self._thread = Thread(target=self._work, name="recording", daemon=True)

    def write(self, data: bytes) -> int:
        """Take bytes."""
        self._made.append(data)
        self._n_taken += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the number of all bytes taken: the place of the next one in the file."""
        return self._n_taken

    def flush(self) -> None:
        """Do nothing; `post` hands the bytes on."""

    def start(self) -> None:
        """Write what was taken so far, then start the thread.

        Raises:
            OSError: the file does not take it, and is closed.
        """
        try:
            self._write(self._take())
        except OSError:
            self._file.close()
            raise
        self._thread.start()

    def post(self) -> None:
        """Give the thread what was taken since the last call; keep it if there is an error, or no room."""
        if self.error is None:
            if self._posted.qsize() < MOST_WAITING:
                self._posted.put(self._take())
            else:
                self.error = OSError(errno.EIO, f"the disk is too slow, {MOST_WAITING} chunks wait for it")

    def close(self) -> None:
        """Write all that waits, also after an error: a disk may have been cleared; close the file.

        Raises:
            OSError: the file takes no more.
        """
        self._posted.put(None)
        self._thread.join()
        try:
            self._write(self._take())
        finally:
            self._file.close()

    def _take(self) -> bytes:
        chunk = b"".join(self._made)
        self._made.clear()
        return chunk

    def _work(self) -> None:
        while (chunk := self._posted.get()) is not None:
            try:
                self._write(chunk, trying=self.error is None)
            except OSError as error:
                self.error = error

    def _write(self, chunk: bytes, *, trying: bool = True) -> None:
        """Write a chunk after what is left of those before it."""
        self._left = memoryview(bytes(self._left) + chunk)
        while trying and self._left:
            n_written = self._file.write(self._left)
            if not n_written:
                raise OSError(errno.EIO, "the file takes no more bytes")
            self._left = self._left[n_written:]


ROWS_PER_CHUNK = 64  # half a second at 125 Hz, an eighth of one at 500 Hz
# Rows that are kept in memory after the disk failed: two minutes at 125 Hz, half of one at 500 Hz, 30 MB.
MAX_HELD_ROWS = 240 * ROWS_PER_CHUNK

_LATEST = 2.0**31
"""No controller has run this long [s]; seconds of ROS time are 32-bit numbers."""

_REFERENCE = Struct("<4sd6d6d3d3d")
_COMMAND = Struct("<4s6dB")


class Recorder:
    """One recording in the making.

    Example:
        with Recorder(path, provenance, [(c.name, c.count) for c in layout.columns]) as recorder:
            recorder.append(frame.values, t, ref_q, ref_qd, ref_p, ref_v, cmd_qd, Phase.MOVEMENT)
            if recorder.error is not None:
                ...stop the arm; leaving the block raises the error

    Attributes:
        n_rows: rows appended so far.
    """

    def __init__(
        self,
        path: Path | str,
        provenance: Provenance,
        state_signals: Iterable[SignalLike],
        *,
        arm: ArmTree | None = None,
        now: Callable[[], int] | None = None,
        opener: Callable[[Path], FileIO] = lambda path: path.open("wb", buffering=0),
    ) -> None:
        """Create the file and write its head.

        Args:
            path: file to create; an existing one is replaced.
            provenance: written at the beginning, so that also a cut file says where it comes from.
            state_signals: each column of the realtime frame in its order: name, count, and maybe the unit.
            arm: links and joints, for the topics by which viewers show a moving arm; None: no such topics.
            now: reads the clock of the PC, ns since 1970 (UTC), at the first row; the log times of all rows
                are counted from there by the controller's stamps. None: they are the controller's time, so
                that equal runs give equal bytes.
            opener: opens the file; tests hand in failing disks here.

        Raises:
            RecordingError: the file cannot be created, or a signal cannot be recorded.
        """
        self.path = Path(path)
        self.n_rows = 0
        topics = row_topics(state_signals)
        names = [signal.name for signal in topics[0].signals for _ in range(signal.count)]
        self._stamp_at = names.index("timestamp")
        self._now = now
        self._epoch = 0  # log time of the controller's time 0
        self._closed = False
        self._n_posted = 0  # rows that were given to the thread before the disk failed
        try:
            self._outbox = _Outbox(opener(self.path))
        except OSError as error:
            raise RecordingError(
                f"cannot create the recording {self.path}: {error.strerror or error}; choose another --out"
            ) from error
        self._writer = Writer(
            cast(IO[bytes], self._outbox), compression=CompressionType.NONE, enable_data_crcs=True
        )
        self._writer.start(profile="ros2", library="ur-hil")
        self._writer.add_metadata(UNITS_RECORD, _units(topics, is_absolute=now is not None))
        self._writer.add_metadata(PROVENANCE_RECORD, provenance.to_metadata())
        self._channels = [self._register(topic) for topic in topics]
        self._view = None if arm is None else ArmView(arm, self._writer, names, provenance.cycle_time_s)
        try:
            self._outbox.start()
        except OSError as error:
            raise self._failure(error) from error

    @property
    def error(self) -> RecordingError | None:
        """The first I/O error, or None. Once there it stays."""
        return None if self._outbox.error is None else self._failure(self._outbox.error)

    def append(
        self,
        frame_values: Array,
        t_ref: float,
        ref_q: Iterable[float],
        ref_qd: Iterable[float],
        ref_p: Iterable[float],
        ref_v: Iterable[float],
        cmd_qd: Iterable[float],
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
        """
        n, log_time = self.n_rows, self._log_time(float(frame_values[self._stamp_at]))
        self.n_rows += 1
        if n - self._n_posted >= MAX_HELD_ROWS:
            return
        row = (
            CDR_LITTLE_ENDIAN + frame_values.tobytes(),
            _REFERENCE.pack(CDR_LITTLE_ENDIAN, t_ref, *ref_q, *ref_qd, *ref_p, *ref_v),
            _COMMAND.pack(CDR_LITTLE_ENDIAN, *cmd_qd, phase),
        )
        for channel, message in zip(self._channels, row, strict=True):
            self._writer.add_message(channel, log_time, message, log_time, n)
        if self._view is not None:
            self._view.show(n, log_time, frame_values, ref_q, ref_p)
        if self.n_rows % ROWS_PER_CHUNK == 0:
            self._writer.flush()
            self._outbox.post()
            if self._outbox.error is None:
                self._n_posted = self.n_rows

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
        self._writer.flush()
        self._writer.add_metadata(
            SUMMARY_RECORD, {key: json.dumps(value) for key, value in (summary or {}).items()}
        )
        self._writer.finish()
        try:
            self._outbox.close()
        except OSError as error:
            self._outbox.error = self._outbox.error or error
        if (failure := self.error) is not None:
            raise RecordingError(f"{failure}; {self._saved()}") from self._outbox.error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        try:
            self.close({"aborted": f"{type(error).__name__}: {one_line(error)}".removesuffix(": ")})
            error.add_note(f"recorded until then: {self.path}")
        except RecordingError as lost:
            error.add_note(str(lost))  # the error that ended the run stays the one that is raised

    def _register(self, topic: Topic) -> int:
        schema = self._writer.register_schema(
            topic.schema_name, "ros2msg", schema_text(topic.signals).encode()
        )
        return int(self._writer.register_channel(topic.name, "cdr", schema))

    def _log_time(self, stamp: float) -> int:
        """The log time [ns] of the controller's time [s]; 0 for one that no controller has."""
        since_start = round(stamp * 1e9) if 0.0 <= stamp < _LATEST else 0
        if self._now is not None and self.n_rows == 0:
            self._epoch = self._now() - since_start
        return self._epoch + since_start

    def _failure(self, error: OSError) -> RecordingError:
        return RecordingError(f"cannot write the recording {self.path}: {error.strerror or error}")

    def _saved(self) -> str:
        """Say in one phrase what can be read of the file."""
        try:
            n_saved = load_recording(self.path).n_rows
        except RecordingError:
            n_saved = 0
        if n_saved == self.n_rows:
            return f"all {n_saved} rows are saved; make room before the next run"
        return f"{n_saved} of {self.n_rows} rows are saved and readable; make room and repeat the run"


def _units(topics: Iterable[Topic], *, is_absolute: bool) -> dict[str, str]:
    """What the numbers of a recording are: the unit of each signal, and what log times count."""
    units = {signal.name: signal.unit for topic in topics for signal in topic.signals}
    start = "1970-01-01T00:00:00Z, clock of the PC" if is_absolute else "the controller started"
    return {"log_time": f"ns since {start}", **units}
