"""`ur-client` against a box on real sockets: what it refuses, asks and says, and what ends a run: one line, the arm at rest.

Before an arm moves that does not say itself that it is simulated, the plan is shown, and a person says yes.
"""

import re
import signal
import sys
from contextlib import nullcontext
from math import isfinite

import numpy as np
import pytest
from integration_support import (
    PERIOD,
    Frames,
    Messages,
    at,
    finish,
    free_port_base,
    in_background,
    prepare_experiment,
    programs_since,
    reach,
    send,
    start,
)

import pc_client as ur
from pc_client.control.controller import CONTROLLERS
from pc_client.control.loop import LoopModel
from pc_client.control.reference import RunRecipe
from pc_client.driver import report
from pc_client.driver.report import read_report
from pc_client.driver.session import UrDriver
from pc_client.driver.transport import TcpNetwork
from pc_client.errors import DriverError
from pc_client.experiment.prediction import guarded
from pc_client.experiment.run import ExperimentRunner
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import robot_model
from pc_client.recording.recording import load_recording
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator import ControlBox


@pytest.mark.parametrize(
    ("options", "arm", "unreported"),
    [
        ({"robot": "ur3", "seed": 1}, "UR3, software 3.15.8, serial number 20993000001, SIMULATED", ""),
        # No serial number before 3.12; up to 3.2 the build number stands in the place of the third number.
        ({"version": "3.2.0"}, r"UR3, software 3\.2\.\d+, serial number unknown, SIM", "payload"),
        ({"robot": "ur8long", "version": "5.25.1"}, "UR8LONG, software 5.25.1, serial number 2", ""),
    ],
)
def test_doctor_names_the_arm_and_finds_it_ready(ur_client, options, arm, unreported):
    with ControlBox(in_process=True, pace="lockstep", port_base=free_port_base(), **options) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert doctor.code == 0, doctor.out
    assert re.search(rf"^robot +{arm}", doctor.out, re.MULTILINE)
    missing = f"; not reported by this software: {unreported}" if unreported else ""
    assert f"streaming   ready{missing}\n" in doctor.out
    assert "NOT OK" not in doctor.out


def slow_down(box):
    box.set_speed(0.95)


def take_control(box):
    box.set_operational_mode("automatic")
    box.remote_control(False)


@pytest.mark.parametrize(
    ("robot", "spoil", "line"),
    [
        ("ur3", slow_down, "the robot's speed slider is 95 %, must be 100 %; set it to 100 % on the pendant"),
        ("ur3e", take_control, "the robot's control is local, must be remote; in local control it ignores"),
    ],
)
def test_a_robot_that_is_not_as_it_must_be_is_refused_by_run_and_shown_by_doctor(
    ur_client, tmp_path, robot, spoil, line
):
    with ControlBox(robot, in_process=True, pace="lockstep", port_base=free_port_base()) as box:
        spoil(box)
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
        run = ur_client("run", "uniform_4_1", *at(box), "--out", tmp_path / "out")
    assert (doctor.code, run.code) == (1, 1)
    assert line in run.complaint()
    assert f"streaming   NOT NOW: {line}" in doctor.out
    assert doctor.out.count("NOT OK") == 1
    assert not (tmp_path / "out").exists()


def test_where_nobody_can_be_asked_the_answer_is_no(ur_client, standard_box, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)
    monkeypatch.setattr(sys, "stdin", None)
    with Messages(standard_box) as primary:
        done = ur_client("run", "uniform_4_1", *at(standard_box), "--out", tmp_path / "out")
        assert programs_since(primary, standard_box) == []
    assert done.code == 1
    assert re.search("there is no terminal to ask at.*--yes", done.complaint())
    assert not (tmp_path / "out").exists()


def test_only_a_box_in_lockstep_says_that_its_time_waits(lockstep_box, realtime_box):
    for box, waits in ((lockstep_box, True), (realtime_box, False)):
        info = read_report(TcpNetwork(), box.host, box.ports).info
        assert (info.simulated, info.lockstep) == (True, waits)


@pytest.mark.parametrize(
    ("meddle", "words", "mode"),
    [
        (
            lambda box: send(box, "secondary", "sec p():\n  protective_stop()\nend\n"),
            "PROTECTIVE_STOP",
            SafetyMode.PROTECTIVE_STOP,
        ),
        # More than the joints hold: the client is faster than the box.
        (
            lambda box: box.push((0.0, 200.0, 0.0), duration=0.05),
            r"off its path.*allowed is 5 mm \(path_tolerance\)",
            SafetyMode.NORMAL,
        ),
    ],
    ids=["protective stop", "push"],
)
def test_what_stops_the_robot_in_a_run_is_one_line_and_the_arm_rests(
    lockstep_box, tmp_path, meddle, words, mode
):
    done = []

    class MeddlingDriver(UrDriver):
        def stream(self, tracker, on_row, *, acceleration):
            def on_row_and_meddle(frame, step):
                on_row(frame, step)
                of_a_movement = isfinite(step.point.p[0])  # neither approach nor excitation has a TCP path
                if of_a_movement and step.t > 0.5 and not done:
                    done.append(meddle(lockstep_box))

            return super().stream(tracker, on_row_and_meddle, acceleration=acceleration)

    with MeddlingDriver(lockstep_box.host, lockstep_box.ports) as driver:
        experiment = prepare_experiment([reach()], repeat=1, out=tmp_path)
        with pytest.raises(DriverError, match=words) as caught:
            ExperimentRunner(driver, experiment, CONTROLLERS["preview"]).run()
    message = str(caught.value)
    assert "\n" not in message
    recording = load_recording(tmp_path / "reach_r1.mcap")
    assert recording.summary == {"aborted": f"{type(caught.value).__name__}: {message}"}
    assert recording.n_rows > 80
    with Frames(lockstep_box) as frames:
        assert frames.rest().safety_mode == mode


DECELERATION = 20.0  # rad/s^2; of the receiver's own ramp


@pytest.mark.parametrize(
    "end", [signal.SIGKILL, signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)]
)
def test_a_signal_in_a_movement_ends_the_client_and_the_arm_ramps_to_rest(standard_box, tmp_path, end):
    with Frames(standard_box) as frames:
        reach().save(tmp_path / "reach.toml")
        client = start("pc_client", "run", tmp_path / "reach.toml", *at(standard_box), "--out", tmp_path)
        try:
            frames.until(lambda f: abs(f.target_qd).max() > 0.1 and any(tmp_path.glob("*.mcap")))
            client.send_signal(end)
            done = finish(client)
        finally:
            client.kill()
        if end == signal.SIGKILL:
            assert done.code == -signal.SIGKILL
        else:
            assert done.code == 130
            assert "interrupted; the arm rests" in done.complaint()
        before = frames.next()
        while before.runtime_state != ProgramState.STOPPED:
            frame = frames.new()
            assert abs(frame.target_qd - before.target_qd).max() <= DECELERATION * PERIOD * (1 + 1e-9)
            before = frame
        assert frames.rest().safety_mode == SafetyMode.NORMAL
        assert frames.lost() == 0


QUICK = [(0.30, -0.06, 0.30), (0.30, 0.06, 0.35)]
"""Own points .13 m apart: in 1.5 s more acceleration than the published controller lets `speedj` use."""


def test_the_published_controller_runs_a_quick_movement_as_the_loop_predicts_and_says_so(
    lockstep_box, caplog, monkeypatch
):
    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)
    shown = []

    def yes(text):
        shown.append(text)
        return True

    arm = ur.connect(lockstep_box.host, lockstep_box.ports, confirm=yes)
    q = arm.frame().actual_q

    def before_it_moves(record):
        np.testing.assert_allclose(arm.frame().actual_q, q, atol=1e-3)
        return True

    plan = ur.plan(ur.Movement.through(QUICK, durations=[1.5]), arm)
    with caplog.filtering(before_it_moves):
        run = arm.run(plan, ur.Controller.paper())
    off = np.linalg.norm(run.tcp_pose[:, None, :3] - run.ref_tcp_position[None], axis=2).min(axis=1)
    assert 0.02 < off.max() < ur.Controller.paper().path_tolerance
    assert run.expected_snr == pytest.approx(run.snr, abs=0.5)
    (known,), (first,) = run.warnings, caplog.messages
    assert first in shown[0]
    for line, expected in ((first, r"\d\.\d"), (known, f"{run.expected_snr:.1f}")):
        assert re.search(
            rf"^through: the controller 'paper' .* an SNR of {expected} dB at best .*'preview'$", line
        )
    good = arm.run(plan, ur.Controller.preview())
    assert (good.warnings, len(caplog.messages)) == ((), 1)
    assert good.expected_snr == 45.0  # encoders and gears set the limit


def test_a_predicted_way_too_near_to_a_wall_is_refused():
    """The plan keeps 21 mm from the wall, but the loop leads the tool 43 mm further."""
    quick = ur.Movement.through(QUICK, durations=[1.5])
    loop = LoopModel.of_delay(0.03, 0.0)

    def planned(y):
        cell = ur.Cell(name="c", walls=(ur.Wall("window", (0.0, -1.0, 0.0), -y),))
        return ur.plan(quick, "ur3", cell), robot_model("ur3", cell)

    plan, far = planned(0.5)
    y = 0.5 - clearance_model(far).along(plan.joints.q).cell.least.min() + 0.021
    plan, near = planned(y)
    guarded(plan.joints, RunRecipe(CONTROLLERS["preview"], loop, PERIOD), near)
    with pytest.raises(DriverError, match=r"off its path, .* of wall 'window', at least 20 mm"):
        guarded(plan.joints, RunRecipe(CONTROLLERS["paper"], loop, PERIOD), near)


def test_what_a_user_does_not_allow_is_refused_before_anything_moves(lockstep_box):
    arm = ur.connect(lockstep_box.host, lockstep_box.ports)
    q = arm.frame().actual_q
    wanted = (
        r"would lead the tool \d\d\.\d mm and .* off its path, allowed is 10 mm \(path_tolerance\) and .*: "
        "give the movement 1.3 times its duration or use the controller 'preview'"
    )
    with pytest.raises(ur.ClientError, match=wanted) as caught:
        arm.run(ur.Movement.through(QUICK, durations=[1.5]), ur.Controller.paper(path_tolerance=0.01))
    assert "\n" not in str(caught.value)
    np.testing.assert_allclose(arm.frame().actual_q, q, atol=1e-3)
    slower = ur.Movement.through(QUICK, durations=[1.5 * 1.3])
    arm.run(slower, ur.Controller.paper(path_tolerance=0.01))


@pytest.mark.usefixtures("without_page")
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(ur_client, tmp_path):
    short = tmp_path / "short.toml"
    ur.Movement.through([(0.35, -0.06, 0.25), (0.35, 0.06, 0.3)], "robot", [1.2], name="short").save(short)

    def recorded(name, seed, watched=False):
        with (
            ControlBox(pace="lockstep", port_base=free_port_base(), seed=seed) as box,
            Frames(box) as frames,
            in_background(frames.raw) if watched else nullcontext(),
        ):
            if not watched:
                frames.sock.close()
            done = ur_client("run", short, *at(box), "--out", tmp_path / name)
        assert done.code == 0, done.err
        return load_recording(tmp_path / name / "short_r1.mcap")

    ours, again, other = recorded("a", 7), recorded("b", 7, watched=True), recorded("c", 8)
    assert again.path.read_bytes() == ours.path.read_bytes()
    assert ours.complete
    assert (other.column("actual_q")[:100] != ours.column("actual_q")[:100]).any()
    assert (other.provenance.seed, ours.provenance.seed) == (8, 7)
