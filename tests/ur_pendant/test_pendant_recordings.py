"""Recordings in a window: the moment that is shown, the page without a server, and the commands that open them."""

import json
import subprocess
import sys
import urllib.request

import numpy as np
import pytest

import pc_client as ur
from pc_client.errors import RecordingError
from ur_emulator import ControlBox
from ur_pendant.recordings import RecordingsWindow, load_track


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with ControlBox("ur5e", pace="lockstep", port_base=None, seed=7) as box:
        arm = ur.connect(box.host, box.ports)
        movement = ur.Movement.through([(0.45, -0.1, 0.3), (0.45, 0.1, 0.33)], durations=[1.0])
        return arm.run(ur.plan(movement, arm), out=tmp_path_factory.mktemp("run"))


def test_two_recordings_stand_beside_each_other_at_one_moment(run, server):
    track = load_track(run.recording.path)
    assert track.error.max() < 20.0
    assert track.run.tcp_speed.max() == pytest.approx(track.desired_speed.max(), rel=0.1)
    window = RecordingsWindow(server, [track, track])
    window.show(0.5)
    k = int(np.searchsorted(track.run.t, 0.5))
    for k_arm, (actual, desired) in enumerate(window._arms):
        assert actual.T_base_flange[:3, 3] == pytest.approx(flange(track, track.run.q[k]), abs=1e-4)
        assert desired.T_base_flange[:3, 3] == pytest.approx(flange(track, track.run.ref_q[k]), abs=1e-4)
        root = server.scene.get_handle_by_name(f"/recording{k_arm}")
        assert root.position[1] == pytest.approx(-1.0 * k_arm)


def flange(track, q):
    from pc_client.kinematics.model import tcp_pose

    tcp_pose(track.model, q)
    return track.model.pin_data.oMf[track.model.flange_frame].translation


def test_it_plays_at_a_speed_and_begins_again(run, server, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("ur_pendant.recordings.time.monotonic", lambda: now[0])
    track = load_track(run.recording.path)
    window = RecordingsWindow(server, [track])
    window.update()
    assert window._bar.value == 0.0
    window._plays.value, window._speed.value = True, "1/4"
    now[0] = 1.0
    window.update()
    assert window._bar.value == pytest.approx(0.25)
    now[0] = 100.0
    window.update()
    assert window._bar.value == pytest.approx(track.run.t[0], abs=1e-3)


def test_a_page_needs_no_server(run, tmp_path):
    page = tmp_path / "page.html"
    words = ["view", str(run.recording.path), "--save", str(page)]
    done = subprocess.run(
        [sys.executable, "-m", "pc_client", *words], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"page: {page}\n"
    assert page.read_text().lstrip().lower().startswith("<!doctype html>")


def test_a_run_opens_its_window(run):
    address = run.view()
    with urllib.request.urlopen(address, timeout=60) as answer:
        assert answer.status == 200


@pytest.mark.parametrize("text", ["", "{}", "no recording"])
def test_what_is_no_recording_is_one_line(tmp_path, text):
    path = tmp_path / "no.mcap"
    path.write_text(text)
    with pytest.raises(RecordingError, match=r"no\.mcap"):
        load_track(path)
    window = [sys.executable, "-m", "ur_pendant", json.dumps({"files": [str(path)], "save": None, "port": 0})]
    done = subprocess.run(window, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
