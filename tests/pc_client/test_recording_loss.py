"""What remains when a run is killed, the disk fills up, or a file is damaged."""

from __future__ import annotations

import errno
import random
import time
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_samples import SIGNALS, append_rows, provenance

from pc_client.errors import RecordingError
from pc_client.recording import recorder as recorder_module
from pc_client.recording.recorder import ROWS_PER_CHUNK, Recorder
from pc_client.recording.recording import Recording, load_recording
from pc_client.recording.rows import row_topics

N_ROWS = 3 * ROWS_PER_CHUNK + 10
ROW_BYTES = sum(topic.dtype.itemsize + 9 + 22 for topic in row_topics(SIGNALS))  # with the heads of messages


class FullDisk:
    """A raw file on a disk with this much room; writes short before it fails, as the kernel does.

    Attributes:
        ends: size of the file after each write.
    """

    def __init__(self, path: Path, room: int) -> None:
        self.file = open(path, "wb", buffering=0)  # noqa: SIM115 - closed by close()
        self.room = room
        self.ends: list[int] = []

    def write(self, data: memoryview) -> int:
        free = self.room - self.file.tell()
        if free <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        n_written = self.file.write(data[:free])
        self.ends.append(self.file.tell())
        return n_written

    def seek(self, offset: int) -> int:
        return self.file.seek(offset)

    def truncate(self, size: int) -> int:
        return self.file.truncate(size)

    def close(self) -> None:
        self.file.close()


def wait_for_error(recorder: Recorder) -> str:
    while recorder.error is None:  # the thread that writes has it soon
        time.sleep(0.001)
    return str(recorder.error)


@pytest.fixture
def head(tmp_path: Path) -> int:
    """Bytes of the head, which is written before the first row."""
    recorder = Recorder(tmp_path / "head.mcap", provenance(), SIGNALS)
    size = (tmp_path / "head.mcap").stat().st_size
    recorder.close()
    return size


@pytest.fixture
def whole(tmp_path: Path) -> bytes:
    with Recorder(tmp_path / "whole.mcap", provenance(), SIGNALS) as recorder:
        append_rows(recorder, N_ROWS)
    return (tmp_path / "whole.mcap").read_bytes()


def load_bytes(tmp_path: Path, data: bytes) -> Recording:
    path = tmp_path / "cut.mcap"
    path.write_bytes(data)
    return load_recording(path)


def is_prefix(recording: Recording) -> bool:
    i = np.arange(recording.n_rows)
    return bool(
        np.array_equal(recording.t, 50.0 + 0.008 * i)
        and np.array_equal(recording.column("cmd_qd"), np.arange(6) * 0.5 + i[:, None])
    )


def test_cut_at_every_chunk_boundary(tmp_path: Path) -> None:
    disk = FullDisk(tmp_path / "a.mcap", 10**9)
    recorder = Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda _: disk)
    append_rows(recorder, 3 * ROWS_PER_CHUNK + 1)
    recorder.close()
    data = (tmp_path / "a.mcap").read_bytes()
    assert len(disk.ends) == 5
    for n_chunks, end in enumerate(disk.ends[:4]):  # what a killed process leaves
        recording = load_bytes(tmp_path, data[:end])
        assert recording.n_rows == n_chunks * ROWS_PER_CHUNK
        assert not recording.complete
        assert "end mark is missing" in recording.damage
        assert recording.summary == {}
        assert recording.provenance == provenance()


def test_cut_at_random_bytes_keeps_every_whole_row(tmp_path: Path, head: int, whole: bytes) -> None:
    row = ROW_BYTES
    cuts = random.Random(3).sample(range(head, len(whole)), 150)
    previous = 0
    for cut in sorted(cuts):
        recording = load_bytes(tmp_path, whole[:cut])
        assert not recording.complete
        assert recording.provenance == provenance()
        assert recording.damage
        assert is_prefix(recording)
        assert recording.n_rows >= previous
        # Chunk heads and indexes take less than two rows' bytes a chunk more than this.
        share = (cut - head) / row * ROWS_PER_CHUNK / (ROWS_PER_CHUNK + 12)
        assert recording.n_rows >= min(N_ROWS, int(share) - 4)
        previous = recording.n_rows
    assert load_bytes(tmp_path, whole).complete


def test_cut_inside_the_head_is_refused_in_one_line(tmp_path: Path, head: int, whole: bytes) -> None:
    for cut in range(0, head, 7):
        with pytest.raises(RecordingError) as caught:
            load_bytes(tmp_path, whole[:cut])
        assert "\n" not in str(caught.value)


def test_a_flipped_bit_ends_the_reading_there(tmp_path: Path, head: int, whole: bytes) -> None:
    middle = bytearray(whole)
    middle[head + int(1.5 * (len(whole) - head) / (N_ROWS / ROWS_PER_CHUNK))] ^= 0x10
    recording = load_bytes(tmp_path, bytes(middle))
    assert not recording.complete
    assert recording.n_rows == ROWS_PER_CHUNK
    assert "checksum" in recording.damage
    assert is_prefix(recording)


def test_a_changed_provenance_is_noticed(tmp_path: Path, whole: bytes) -> None:
    assert whole.count(b"20993000007") == 1
    recording = load_bytes(tmp_path, whole.replace(b"20993000007", b"20993000008"))
    assert not recording.complete
    assert "checksum over all records" in recording.damage


@given(st.lists(st.tuples(st.integers(0, 20_000), st.integers(0, 255)), min_size=1, max_size=4))
@settings(max_examples=150)
def test_no_damage_makes_the_loader_fail_otherwise(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]]
) -> None:
    folder = tmp_path_factory.getbasetemp()
    with Recorder(folder / "small.mcap", provenance(), SIGNALS) as recorder:
        append_rows(recorder, 30)
    original = (folder / "small.mcap").read_bytes()
    data = bytearray(original)
    for position, value in changes:
        data[position % len(data)] = value
    try:
        recording = load_bytes(folder, bytes(data))
    except RecordingError:
        return
    data_end = original.index(b"\x0f\x04" + bytes(7))  # behind it only the index follows, which is not read
    assert not recording.complete or data[:data_end] == original[:data_end]


@pytest.mark.parametrize("data", [b"", b"hello", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(100)])
def test_files_that_are_no_recordings(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(RecordingError, match=r"cut\.mcap"):
        load_bytes(tmp_path, data)


def test_missing_file_and_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"cannot be read \(No such file"):
        load_recording(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match=r"cannot create the recording .*No such file"):
        Recorder(tmp_path / "none" / "a.mcap", provenance(), SIGNALS)


def test_a_full_disk_never_raises_inside_the_loop_and_loses_nothing_written(
    tmp_path: Path, head: int
) -> None:
    chunk_bytes = ROWS_PER_CHUNK * ROW_BYTES
    room = head + int(2.4 * chunk_bytes)
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, provenance(), SIGNALS, opener=lambda p: FullDisk(p, room))
    append_rows(recorder, N_ROWS)
    assert "No space left on device" in wait_for_error(recorder)
    assert recorder.n_rows == N_ROWS
    with pytest.raises(RecordingError) as caught:
        recorder.close()
    recording = load_recording(path)
    assert is_prefix(recording)
    assert 2 * ROWS_PER_CHUNK < recording.n_rows < N_ROWS
    assert f"{recording.n_rows} of {N_ROWS} rows are saved" in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    recorder.close()  # idempotent: reported once


def test_every_size_of_disk(tmp_path: Path, head: int, whole: bytes) -> None:
    for room in range(head, len(whole) + 5000, 4999):
        path = tmp_path / "a.mcap"
        recorder = Recorder(path, provenance(), SIGNALS, opener=lambda p, room=room: FullDisk(p, room))
        append_rows(recorder, N_ROWS)
        if room >= len(whole):
            recorder.close()
            assert path.read_bytes() == whole
            continue
        with pytest.raises(RecordingError):
            recorder.close()
        recording = load_recording(path)
        assert is_prefix(recording)
        assert whole.startswith(path.read_bytes())


def test_rows_held_in_memory_are_written_when_there_is_room_again(
    tmp_path: Path, head: int, whole: bytes
) -> None:
    disk = FullDisk(tmp_path / "a.mcap", head + 20_000)
    recorder = Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda _: disk)
    append_rows(recorder, N_ROWS)
    wait_for_error(recorder)
    disk.room = 10**9
    with pytest.raises(RecordingError, match=f"all {N_ROWS} rows are saved"):
        recorder.close()
    assert (tmp_path / "a.mcap").read_bytes() == whole


def test_memory_for_held_rows_is_bounded(tmp_path: Path, head: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "MAX_HELD_ROWS", 2 * ROWS_PER_CHUNK)
    disk = FullDisk(tmp_path / "a.mcap", head)
    recorder = Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda _: disk)
    append_rows(recorder, ROWS_PER_CHUNK)
    wait_for_error(recorder)
    append_rows(recorder, 4 * ROWS_PER_CHUNK)
    disk.room = 10**9
    with pytest.raises(RecordingError, match=f"{3 * ROWS_PER_CHUNK} of {5 * ROWS_PER_CHUNK} rows are saved"):
        recorder.close()
    assert load_recording(tmp_path / "a.mcap").n_rows == 3 * ROWS_PER_CHUNK


def test_a_disk_that_stands_still_delays_no_row_and_is_an_error(
    tmp_path: Path, whole: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pc_client.recording.recorder.MOST_WAITING", 1)
    goes_on = Event()

    class StandingDisk(FullDisk):
        def write(self, data: memoryview) -> int:
            assert not self.ends or goes_on.wait(60.0)  # the head is written at once
            return super().write(data)

    disk = StandingDisk(tmp_path / "a.mcap", 10**9)
    recorder = Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda _: disk)
    append_rows(recorder, N_ROWS)  # one chunk is being written, one waits, the third finds no room
    assert "the disk is too slow" in str(recorder.error)
    goes_on.set()
    with pytest.raises(RecordingError, match=f"too slow.*all {N_ROWS} rows are saved"):
        recorder.close()
    assert (tmp_path / "a.mcap").read_bytes() == whole


def test_disk_full_from_the_first_byte(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No space left"):
        Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda p: FullDisk(p, 0))


def test_the_error_that_ended_a_run_is_not_hidden_by_the_disk(tmp_path: Path, head: int) -> None:
    def run() -> None:
        disk = FullDisk(tmp_path / "a.mcap", head)
        with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda _: disk) as recorder:
            append_rows(recorder, 1)
            raise KeyError("the robot stopped")

    with pytest.raises(KeyError) as caught:
        run()
    assert any("No space left" in note for note in caught.value.__notes__)


def test_a_run_that_ends_in_an_error_leaves_a_complete_file_that_says_so(tmp_path: Path) -> None:
    def run() -> None:
        with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
            append_rows(recorder, 5)
            raise KeyError("the robot stopped")

    with pytest.raises(KeyError):
        run()
    recording = load_recording(tmp_path / "a.mcap")
    assert recording.complete
    assert recording.n_rows == 5
    assert recording.summary == {"aborted": "KeyError: 'the robot stopped'"}
