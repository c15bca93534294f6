"""What remains when a run is killed, the disk fills up, or a file is damaged."""

from __future__ import annotations

import errno
import random
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from hypothesis import given
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

    def close(self) -> None:
        self.file.close()


OnDisk = Callable[[FullDisk], Recorder]


@pytest.fixture
def on_disk(tmp_path: Path) -> OnDisk:
    """A recorder whose file is on a disk."""
    return lambda disk: Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, opener=lambda _: disk)


def wait_for_error(recorder: Recorder) -> str:
    while recorder.error is None:  # the thread that writes has it soon
        time.sleep(0.001)
    return str(recorder.error)


def written(path: Path, n_rows: int) -> bytes:
    with Recorder(path, provenance(), SIGNALS) as recorder:
        append_rows(recorder, n_rows)
    return path.read_bytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return written(tmp_path_factory.mktemp("whole") / "whole.mcap", N_ROWS)


@pytest.fixture(scope="module")
def head(tmp_path_factory: pytest.TempPathFactory) -> int:
    """Bytes of the head, which is written before the first row."""
    path = tmp_path_factory.mktemp("head") / "head.mcap"
    with Recorder(path, provenance(), SIGNALS):
        return path.stat().st_size


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


def test_a_killed_process_leaves_every_whole_chunk(tmp_path: Path, on_disk: OnDisk) -> None:
    disk = FullDisk(tmp_path / "a.mcap", 10**9)
    recorder = on_disk(disk)
    append_rows(recorder, 2 * ROWS_PER_CHUNK + 1)
    recorder.close()
    data = (tmp_path / "a.mcap").read_bytes()
    assert len(disk.ends) == 4
    for n_chunks, end in enumerate(disk.ends[:3]):
        recording = load_bytes(tmp_path, data[:end])
        assert recording.n_rows == n_chunks * ROWS_PER_CHUNK
        assert "end mark is missing" in recording.damage
        assert recording.summary == {}


def test_cut_at_random_bytes_keeps_every_whole_row(tmp_path: Path, head: int, whole: bytes) -> None:
    previous = 0
    for cut in sorted(random.Random(3).sample(range(head, len(whole)), 60)):
        recording = load_bytes(tmp_path, whole[:cut])
        assert not recording.complete
        assert recording.damage
        assert recording.provenance == provenance()
        assert is_prefix(recording)
        # Chunk heads and indexes take less than two rows' bytes a chunk more than this.
        share = (cut - head) / ROW_BYTES * ROWS_PER_CHUNK / (ROWS_PER_CHUNK + 12)
        assert recording.n_rows >= max(previous, min(N_ROWS, int(share) - 4))
        previous = recording.n_rows
    assert load_bytes(tmp_path, whole).complete


def test_cut_inside_the_head_is_refused_in_one_line(tmp_path: Path, head: int, whole: bytes) -> None:
    for cut in range(0, head, 29):
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


def test_a_summary_that_cannot_be_read_is_left_out(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
        recorder.close({"snr_db": 31.5})
    data = (tmp_path / "a.mcap").read_bytes()
    recording = load_bytes(tmp_path, data.replace(b"31.5", b"31.x"))
    assert recording.summary == {}
    assert not recording.complete


@given(st.lists(st.tuples(st.integers(0, 20_000), st.integers(0, 255)), min_size=1, max_size=4))
def test_no_damage_makes_the_loader_fail_otherwise(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]]
) -> None:
    folder = tmp_path_factory.getbasetemp()
    original = written(folder / "small.mcap", 30)
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
def test_files_that_are_no_recordings_are_refused(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(RecordingError, match=r"cut\.mcap"):
        load_bytes(tmp_path, data)


def test_a_missing_file_and_a_missing_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"cannot be read \(No such file"):
        load_recording(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match=r"cannot create the recording .*No such file"):
        Recorder(tmp_path / "none" / "a.mcap", provenance(), SIGNALS)


def test_a_full_disk_never_raises_inside_the_loop_and_loses_nothing_written(
    tmp_path: Path, head: int, on_disk: OnDisk
) -> None:
    path = tmp_path / "a.mcap"
    recorder = on_disk(FullDisk(path, head + int(2.4 * ROWS_PER_CHUNK * ROW_BYTES)))
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


def test_every_size_of_disk_has_a_part_of_the_file_or_all_of_it(
    tmp_path: Path, head: int, whole: bytes, on_disk: OnDisk
) -> None:
    path = tmp_path / "a.mcap"
    for room in range(head, len(whole) + 12_000, 11_999):
        recorder = on_disk(FullDisk(path, room))
        append_rows(recorder, N_ROWS)
        if room >= len(whole):
            recorder.close()
            assert path.read_bytes() == whole
            continue
        with pytest.raises(RecordingError):
            recorder.close()
        assert is_prefix(load_recording(path))
        assert whole.startswith(path.read_bytes())


def test_rows_up_to_a_limit_are_held_in_memory_and_written_when_there_is_room_again(
    tmp_path: Path, head: int, on_disk: OnDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "MAX_HELD_ROWS", 2 * ROWS_PER_CHUNK)
    disk = FullDisk(tmp_path / "a.mcap", head + 20_000)
    recorder = on_disk(disk)
    append_rows(recorder, ROWS_PER_CHUNK)
    wait_for_error(recorder)
    append_rows(recorder, 4 * ROWS_PER_CHUNK)
    disk.room = 10**9
    with pytest.raises(RecordingError, match=f"{3 * ROWS_PER_CHUNK} of {5 * ROWS_PER_CHUNK} rows are saved"):
        recorder.close()
    recording = load_recording(tmp_path / "a.mcap")
    assert recording.n_rows == 3 * ROWS_PER_CHUNK
    assert recording.t[-1] == 50.0 + 0.008 * 127  # of the second call


def test_a_disk_that_stands_still_delays_no_row_and_is_an_error(
    tmp_path: Path, whole: bytes, on_disk: OnDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "MOST_WAITING", 1)
    goes_on = Event()

    class StandingDisk(FullDisk):
        def write(self, data: memoryview) -> int:
            assert not self.ends or goes_on.wait(60.0)  # the head is written at once
            return super().write(data)

    recorder = on_disk(StandingDisk(tmp_path / "a.mcap", 10**9))
    append_rows(recorder, N_ROWS)  # one chunk is being written, one waits, the third finds no room
    assert "the disk is too slow" in str(recorder.error)
    goes_on.set()
    with pytest.raises(RecordingError, match=f"too slow.*all {N_ROWS} rows are saved"):
        recorder.close()
    assert (tmp_path / "a.mcap").read_bytes() == whole


def test_a_disk_that_is_full_from_the_first_byte_is_refused(tmp_path: Path, on_disk: OnDisk) -> None:
    with pytest.raises(RecordingError, match="No space left"):
        on_disk(FullDisk(tmp_path / "a.mcap", 0))


def stopped_run(recorder: Recorder) -> list[str]:
    """Notes of the error that ends a run of five rows."""

    def run() -> None:
        with recorder:
            append_rows(recorder, 5)
            raise KeyError("the robot stopped")

    with pytest.raises(KeyError) as caught:
        run()
    return caught.value.__notes__


def test_the_error_that_ended_a_run_is_not_hidden_by_the_disk(
    tmp_path: Path, head: int, on_disk: OnDisk
) -> None:
    notes = stopped_run(on_disk(FullDisk(tmp_path / "a.mcap", head)))
    assert any("No space left" in note for note in notes)


def test_a_run_that_ends_in_an_error_leaves_a_complete_file_that_says_so(tmp_path: Path) -> None:
    stopped_run(Recorder(tmp_path / "a.mcap", provenance(), SIGNALS))
    recording = load_recording(tmp_path / "a.mcap")
    assert recording.complete
    assert recording.n_rows == 5
    assert recording.summary == {"aborted": "KeyError: 'the robot stopped'"}
