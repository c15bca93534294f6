"""The client on arms of the e-Series: it reads every port, runs at 500 Hz, and learns from run to run."""

import numpy as np
import pytest

import pc_client as ur
from pc_client.analysis.measures import speed
from pc_client.driver.report import probe
from pc_client.driver.transport import TcpNetwork
from ur_emulator import ControlBox

PERIOD = 0.002  # s


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_every_cycle_has_its_frame_and_its_command_and_the_arm_follows_better_from_run_to_run(times):
    movement = ur.Movement.through([(0.42, -0.08, 0.3), (0.42, 0.08, 0.35)], durations=[1.5])
    with ControlBox(robot="ur5e", pace="lockstep", port_base=None, seed=5) as box:
        runs = ur.connect(box.host, box.ports).repeat(movement, times, ur.Controller.best())
    for run in runs:
        recording, track = run.recording, run.measured.track
        np.testing.assert_allclose(np.diff(recording.t), PERIOD, atol=1e-9)
        assert recording.provenance.cycle_time_s == PERIOD
        assert recording.summary["late_frames"] == recording.summary["lost_frames"] == 0
        samples = run.tcp_speed[4:]  # each frame is set against the one 8 ms before
        np.testing.assert_allclose(samples, speed(track.t, track.p_actual), rtol=1e-12)
        assert len(run.ref_q) == len(run.ref_tcp_position) == len(run.to_frame()) == recording.n_rows
        assert 0.001 < recording.provenance.identified_delay_s < 0.015
        assert recording.provenance.loop["gain_margin"] > 10.0
        assert abs(run.measured.snr.speed_lag_s) < 0.002
        assert run.snr > 35.0
    assert times == 1 or runs[1].snr > runs[0].snr + 1.0
    assert times == 1 or runs[1].recording.summary["learned_from"] == 1


@pytest.mark.parametrize(
    ("software", "size", "payload"),
    [
        ("5.0.5", 1108, None), ("5.8.0", 1116, 0.0), ("5.9.4", 1140, 0.0), ("5.25.1", 1220, 0.0),
    ],
)  # fmt: skip
def test_the_client_reads_every_port(software, size, payload):
    with ControlBox(
        robot="ur5e", version=software, in_process=True, pace="lockstep", port_base=None, seed=7
    ) as box:
        found = probe(TcpNetwork(), box.host, box.ports, 0.02)
    assert found.obstacle == ""
    assert str(found.info.version).startswith(software.removesuffix(".0"))
    assert found.info.simulated is True
    assert found.rhythm.frame_size == size
    assert found.report.configured == found.info.model == "UR5e"
    assert found.report.payload == payload
    assert found.report.tcp_offset == (0.0,) * 6
