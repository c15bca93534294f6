"""Recordings in a window: the moment that is shown, the page without a server, and the commands that open them."""

import json
import urllib.request

import numpy as np
import pytest

import pc_client as ur
from pc_client.__main__ import main
from ur_emulator import ControlBox
from ur_pendant import window
from ur_pendant.recordings import RecordingsWindow, load_track


@pytest.fixture(scope="module")
def run(tmp_path_factory, without_page):
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


def test_a_page_needs_no_server(run, tmp_path, monkeypatch, capsys):
    def become(_, command):
        monkeypatch.setattr("sys.argv", command[2:])
        window.main()

    page = tmp_path / "page.html"
    monkeypatch.setattr("os.execv", become)
    monkeypatch.setattr("sys.argv", ["ur-client", "view", str(run.recording.path), "--save", str(page)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert (ended.value.code, capsys.readouterr().out) == (0, f"page: {page}\n")
    assert page.read_text().lstrip().lower().startswith("<!doctype html>")


@pytest.mark.nightly
def test_a_run_opens_its_window(run):
    with urllib.request.urlopen(run.view(), timeout=60) as answer:
        assert answer.status == 200


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ([], 2, "window: start it by `ur-emulator pendant HOST` or `ur-client view FILE`\n"),
        (
            [json.dumps({"files": ["no.mcap"], "save": None, "port": 0})],
            1,
            "window: no.mcap is not a recording",
        ),
    ],
)
def test_what_cannot_be_shown_is_one_line(tmp_path, monkeypatch, capsys, words, code, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "no.mcap").write_text("{}")
    monkeypatch.setattr("sys.argv", ["window", *words])
    with pytest.raises(SystemExit) as ended:
        window.main()
    told = capsys.readouterr()
    assert (ended.value.code, told.out, told.err.count("\n")) == (code, "", 1)
    assert told.err.startswith(said)


def test_what_fails_ends_neither_the_window_nor_the_rest_of_it(server, monkeypatch, capsys):
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(server, "stop", lambda: None)
    turns = []

    def fails():
        raise ValueError("bad\n\x1b value")

    def goes_on():
        turns.append(0)
        server.events.put(fails)
        if len(turns) == 3:
            raise KeyboardInterrupt

    window._serve(server, [fails, goes_on])
    told = capsys.readouterr()
    assert told.out == f"window at http://127.0.0.1:{server.address[1]}\n"
    part, *events = told.err.splitlines()
    assert part.startswith("window: a part of the window is shown no more: ValueError: bad")
    assert len(events) == 2
    assert all(
        line.startswith("window: an event of a page has no effect: ValueError: bad") for line in events
    )
    assert told.err.replace("\n", "").isprintable()
