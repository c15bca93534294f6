"""Recordings of the whole way, command line to file: repeatable to the byte, and safe on a full disk."""

import resource
import threading
from contextlib import contextmanager, nullcontext

import pytest
from integration_support import (
    Frames,
    Messages,
    at,
    finish,
    free_port_base,
    programs_since,
    start,
)

from pc_client.recording.recording import load_recording
from ur_emulator import ControlBox

ROOM = 400_000  # bytes; about a third of the recording of a short movement


@contextmanager
def bystander(box):
    """A client of 30003 that takes its frames and has nothing to do with the run."""
    ending = threading.Event()

    def read():
        with Frames(box) as frames:
            while not ending.is_set():
                frames.raw()

    thread = threading.Thread(target=read)
    thread.start()
    yield
    ending.set()
    thread.join()


def recorded(ur_client, out, seed, *, watched=False):
    with (
        ControlBox(pace="lockstep", port_base=free_port_base(), seed=seed) as box,
        bystander(box) if watched else nullcontext(),
    ):
        done = ur_client("run", "uniform_4_1", *at(box), "--repeat", "1", "--out", out)
    assert done.code == 0, done.err
    return (out / "uniform_4_1_r1.mcap").read_bytes()


@pytest.mark.usefixtures("without_page")
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(ur_client, tmp_path):
    first = recorded(ur_client, tmp_path / "a", 7)
    assert recorded(ur_client, tmp_path / "b", 7, watched=True) == first
    other = load_recording_of(tmp_path / "c", recorded(ur_client, tmp_path / "c", 8))
    ours = load_recording_of(tmp_path / "a", first)
    assert other.n_rows == pytest.approx(ours.n_rows, abs=20)
    assert (other.column("actual_q")[:100] != ours.column("actual_q")[:100]).any()
    assert (other.provenance.seed, ours.provenance.seed) == (8, 7)


def load_recording_of(out, data):
    recording = load_recording(out / "uniform_4_1_r1.mcap")
    assert recording.complete
    assert recording.path.read_bytes() == data
    return recording


def no_room():
    """Let files of this process grow to a size only: writing fails as on a full disk (errno aside)."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, ROOM))


def test_a_full_disk_stops_the_arm_says_what_is_saved_and_that_can_be_read(standard_box, tmp_path):
    with Frames(standard_box) as frames:
        client = start(
            "pc_client",
            *("run", "uniform_4_1", *at(standard_box), "--out", tmp_path),
            preexec_fn=no_room,
        )
        reader = threading.Thread(target=frames.until, args=(lambda _: client.poll() is not None, frames.raw))
        reader.start()
        done = finish(client)
        reader.join()
        rest = frames.rest()
        assert frames.lost() == 0
    assert done.code == 1
    complaint = done.complaint()
    assert "uniform_4_1_r1.mcap" in complaint
    assert "rows are saved and readable" in complaint
    recording = load_recording(tmp_path / "uniform_4_1_r1.mcap")
    assert not recording.complete
    assert f"{recording.n_rows} of" in complaint
    assert recording.n_rows > 100
    assert abs(rest.actual_qd).max() < 2e-3


@pytest.mark.parametrize("out", ["/dev/full", "/proc/here", "FILE", "FILE/below"])
def test_a_folder_that_cannot_be_is_one_line_and_nothing_moves(standard_box, ur_client, tmp_path, out):
    (tmp_path / "file").write_text("taken\n")
    out = out.replace("FILE", str(tmp_path / "file"))
    with Messages(standard_box) as primary:
        done = ur_client("run", "uniform_4_1", *at(standard_box), "--out", out)
        assert done.code == 1
        assert out in done.complaint()
        assert programs_since(primary, standard_box) == []
    assert (tmp_path / "file").read_text() == "taken\n"


@pytest.mark.parametrize(
    "arguments", [("report", "FILE"), ("report", "."), ("export", "FILE"), ("export", "gone.mcap")]
)
def test_what_is_no_recording_is_one_line(ur_client, monkeypatch, tmp_path, arguments):
    (tmp_path / "file.mcap").write_bytes(b"no recording")
    monkeypatch.chdir(tmp_path)
    done = ur_client(*(a.replace("FILE", "file.mcap") for a in arguments))
    assert done.code == 1
    assert done.complaint()
