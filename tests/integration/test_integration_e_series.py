"""The client on arms of the e-Series: it reads every port, names the arm, runs at 500 Hz, learns from run to run."""

import re

import numpy as np
import pytest
from integration_support import at, free_port_base

from pc_client.analysis.run import Run, analyse_run
from pc_client.analysis.track import speed
from pc_client.driver.report import probe
from pc_client.driver.transport import TcpNetwork
from pc_client.movements.movement import load_movement
from pc_client.recording.recording import load_recording
from ur_emulator import ControlBox

PERIOD = 0.002  # s


def e_series_box(robot, **options):
    return ControlBox(robot=robot, pace="lockstep", port_base=free_port_base(), seed=5, **options)


@pytest.mark.parametrize(
    ("robot", "version", "name"),
    [
        ("ur3e", "5.0.0", "UR3e"),
        ("ur5e", "5.9.4", "UR5e"),
        ("ur8long", "5.25.1", "UR8LONG"),
    ],
)
def test_doctor_names_the_arm_and_finds_it_ready(ur_client, robot, version, name):
    with e_series_box(robot, version=version) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert doctor.code == 0, doctor.out
    assert f"robot       {name}, software {version}, " in doctor.out
    assert re.search(rf"^arm +{name} ", doctor.out, re.MULTILINE)
    assert "streaming   ready" in doctor.out


@pytest.mark.parametrize(
    ("local", "mode", "line"),
    [
        (True, "automatic", "the robot's control is local, must be remote; in local control it ignores"),
        (
            False,
            "manual",
            "the robot's operational mode is MANUAL, must be AUTOMATIC or NONE; in manual mode",
        ),
    ],
    ids=["local control", "manual mode"],
)
def test_local_control_and_manual_mode_are_refused_before_anything_moves(
    ur_client, tmp_path, local, mode, line
):
    with e_series_box("ur3e") as box:
        box.set_operational_mode(mode)
        box.remote_control(not local)
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
        run = ur_client("run", "uniform_4_1", *at(box), "--out", tmp_path / "out")
    assert (doctor.code, run.code) == (1, 1)
    assert line in run.complaint()
    assert f"streaming   NOT NOW: {line}" in doctor.out
    assert doctor.out.count("NOT OK") == 1


@pytest.fixture(scope="module", params=["ur3e", "ur5e"])
def recordings(request, tmp_path_factory, without_page):
    """Two runs of one movement by the controller that learns."""
    from pc_client import cli

    out = tmp_path_factory.mktemp(request.param)
    with e_series_box(request.param) as box:
        arguments = ["run", "uniform_4_1", *at(box), "--out", str(out)]
        assert cli.run([*arguments, "--repeat", "2", "--controller", "best"]) == 0
    return [load_recording(path) for path in sorted(out.glob("*.mcap"))]


def test_every_cycle_of_2_ms_has_its_frame_and_its_command(recordings):
    for recording in recordings:
        np.testing.assert_allclose(np.diff(recording.t), PERIOD, atol=1e-9)
        assert recording.provenance.cycle_time_s == PERIOD
        assert recording.summary["late_frames"] == recording.summary["lost_frames"] == 0
        run = Run.from_file(recording.path)
        np.testing.assert_array_equal(run.q, recording.column("actual_q"))
        track = run.measured.track
        samples = run.tcp_speed[track.rows[1:]]  # of all rows, every fourth is a sample of Eq. 10
        np.testing.assert_allclose(samples, speed(track.t, track.p_actual), rtol=1e-12)
        assert len(run.ref_q) == len(run.ref_tcp_position) == len(run.to_frame()) == recording.n_rows


def test_the_loop_is_as_quick_as_the_cycle_and_the_arm_follows_within_what_its_encoders_show(recordings):
    for recording in recordings:
        assert 0.001 < recording.provenance.identified_delay_s < 0.015
        assert recording.provenance.loop["gain_margin"] > 10.0
        run = analyse_run(recording)
        assert abs(run.snr.speed_lag_s) < 0.002
        assert run.snr.speed_db > 31.0
    assert recordings[1].summary["learned_from"] == 1


def test_a_movement_of_the_library_is_where_the_arm_can_do_it(recordings):
    recording = recordings[0]
    moved = np.array(recording.provenance.target_points) - load_movement("uniform_4_1").target_points
    there = (0.075, 0.0, 0.0) if recording.provenance.robot_model == "UR5e" else (0.0, 0.0, 0.0)
    np.testing.assert_allclose(moved, np.tile(there, (len(moved), 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("software", "size", "payload"),
    [
        ("5.0.5", 1108, None), ("5.3.0", 1108, None), ("5.4.0", 1116, None), ("5.8.0", 1116, 0.0),
        ("5.9.4", 1140, 0.0), ("5.12.2", 1220, 0.0), ("5.25.1", 1220, 0.0),
    ],
)  # fmt: skip
def test_the_client_reads_every_port(software, size, payload):
    with ControlBox(robot="ur5e", version=software, pace="lockstep", port_base=None, seed=7) as box:
        found = probe(TcpNetwork(), box.host, box.ports, 0.02)
    assert found.obstacle == ""
    assert str(found.info.version).startswith(software.removesuffix(".0"))
    assert found.info.simulated is True
    assert found.rhythm.frame_size == size
    assert found.report.configured == found.info.model == "UR5e"
    assert found.report.payload == payload
    assert found.report.tcp_offset == (0.0,) * 6
