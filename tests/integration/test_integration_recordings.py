"""Recordings of the whole way, command line to file: repeatable to the byte, safe on a full disk, marked SIMULATED."""

import json
import re
import resource
import threading
from contextlib import contextmanager, nullcontext

import pytest
from integration_support import (
    Frames,
    Messages,
    at,
    command,
    finish,
    free_port_base,
    programs_since,
    start,
)

from pc_client.driver.report import read_report
from pc_client.driver.transport import TcpNetwork
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


@pytest.mark.parametrize("out", ["/proc/here", "FILE/below"])
def test_a_folder_that_cannot_be_is_one_line_and_nothing_moves(standard_box, ur_client, tmp_path, out):
    (tmp_path / "file").write_text("taken\n")
    out = out.replace("FILE", str(tmp_path / "file"))
    with Messages(standard_box) as primary:
        done = ur_client("run", "uniform_4_1", *at(standard_box), "--out", out)
        assert done.code == 1
        assert out in done.complaint()
        assert programs_since(primary, standard_box) == []
    assert (tmp_path / "file").read_text() == "taken\n"


@pytest.mark.parametrize("name", ["report", "export"])
def test_what_is_no_recording_is_one_line(ur_client, monkeypatch, tmp_path, name):
    (tmp_path / "file.mcap").write_bytes(b"no recording")
    monkeypatch.chdir(tmp_path)
    done = ur_client(name, "file.mcap")
    assert done.code == 1
    assert done.complaint()


# No serial number before 3.12; up to 3.2 the build number stands in the place of the third number.
@pytest.mark.parametrize(("version", "told"), [("3.2.0", r"3\.2\.\d+"), ("3.11.0", r"3\.11\.0")])
def test_a_box_that_reports_no_serial_number_is_simulated(ur_client, version, told):
    with ControlBox(pace="lockstep", port_base=free_port_base(), seed=7, version=version) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert re.search(f"UR3, software {told}, serial number unknown, SIMULATED", doctor.out)


def test_only_a_box_in_lockstep_says_that_its_time_waits(lockstep_box, realtime_box):
    for box, waits in ((lockstep_box, True), (realtime_box, False)):
        info = read_report(TcpNetwork(), box.host, box.ports).info
        assert (info.simulated, info.lockstep) == (True, waits)


def test_a_box_that_reports_no_serial_number_may_be_run_again_and_its_data_are_marked(ur_client, tmp_path):
    out = tmp_path / "out"
    with ControlBox(pace="lockstep", port_base=free_port_base(), seed=7, version="3.2.0") as box:
        run = ("run", "uniform_4_1", *at(box), "--out", out, "--overwrite")
        assert ur_client(*run).code == 0
        done = command("pc_client", *run)  # a process of its own writes its page, see `without_page`
        assert done.code == 0, done.err
    assert "Table I: SIMULATED UR3" in done.out
    provenance = load_recording(out / "uniform_4_1_r1.mcap").provenance
    assert (provenance.simulated, provenance.serial, provenance.seed) == (True, "unknown", None)
    assert json.loads((out / "table1.json").read_text())["simulated"] is True
    page = (out / "report.html").read_text()
    assert "SIMULATED: an emulated arm, no real robot moved" in page
    assert "measured on a real arm" not in page
    # `preview` identifies one delay: what it does not identify must not look measured.
    assert not {"dead_time_s", "lag_s", "joint_spread_s"} & set(provenance.loop)
    assert "joints within" not in done.out
    assert "loop delay identified by the client" in page
    assert "identified loop" not in page
