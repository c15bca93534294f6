"""`ur-client` against a box on real sockets: what it refuses, asks and says, and what ends a run: one line, the arm at rest.

Before an arm moves that does not say itself that it is simulated, the plan is shown, and a person says yes.
"""

import io
import re
import resource
import sys
import threading
from contextlib import contextmanager, nullcontext
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

TOOL = "def tool():\n  set_tcp(p[0, 0, 0.15, 0, 0, 0])\nend\n"
NO_PAYLOAD = "; not reported by this software: payload"


@pytest.mark.parametrize(
    ("options", "arm", "unreported"),
    [
        ({"robot": "ur3", "seed": 1}, "UR3, software 3.15.8, serial number 20993000001, SIMULATED", ""),
        ({"robot": "ur10", "seed": 3}, "UR10, software 3.15.8, serial number 2099", ""),  # calibrated, too
        # No serial number before 3.12; up to 3.2 the build number stands in the place of the third number.
        ({"version": "3.2.0"}, r"UR3, software 3\.2\.\d+, serial number unknown, SIMULATED", NO_PAYLOAD),
        ({"version": "3.11.0"}, "UR3, software 3.11.0, serial number unknown, SIMULATED", ""),
        ({"robot": "ur8long", "version": "5.25.1"}, "UR8LONG, software 5.25.1, serial number 2", ""),
    ],
)
def test_doctor_names_the_arm_and_finds_it_ready(ur_client, options, arm, unreported):
    with ControlBox(pace="lockstep", port_base=free_port_base(), **options) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert doctor.code == 0, doctor.out
    assert re.search(rf"^robot +{arm}", doctor.out, re.MULTILINE)
    assert f"streaming   ready{unreported}\n" in doctor.out
    assert "NOT OK" not in doctor.out


def run_tool_program(box):
    with Frames(box) as frames:
        box.run_program(TOOL)
        frames.until(lambda f: f.runtime_state == ProgramState.STOPPED)


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (
            lambda box: box.set_speed(0.95),
            "the robot's speed slider is 95 %, must be 100 %; set it to 100 % on the pendant",
        ),
        (run_tool_program, "the robot's TCP offset is (0.0, 0.0, 150.0) mm, (0, 0, 0) mrad, must be 0"),
    ],
    ids=["95 %", "TCP"],
)
def test_a_robot_that_is_not_as_it_must_be_is_refused_by_run_and_shown_by_doctor(
    ur_client, standard_box, tmp_path, spoil, line
):
    spoil(standard_box)
    with Messages(standard_box) as primary:
        doctor = ur_client("doctor", *at(standard_box), "--seconds", 0.1)
        run = ur_client("run", "uniform_4_1", *at(standard_box), "--out", tmp_path / "out")
        assert programs_since(primary, standard_box) == []
    assert (doctor.code, run.code) == (1, 1)
    assert line in run.complaint()
    assert f"streaming   NOT NOW: {line}" in doctor.out
    assert doctor.out.count("NOT OK") == 1
    assert not (tmp_path / "out").exists()


def test_only_a_box_in_lockstep_says_that_its_time_waits(lockstep_box, realtime_box):
    for box, waits in ((lockstep_box, True), (realtime_box, False)):
        info = read_report(TcpNetwork(), box.host, box.ports).info
        assert (info.simulated, info.lockstep) == (True, waits)


# --- the question


REACH = [(0.35, -0.06, 0.25), (0.35, 0.06, 0.3)]


@pytest.fixture
def short(tmp_path):
    """A file of a short movement."""
    ur.Movement.through(REACH, "robot", [1.2], name="short").save(tmp_path / "short.toml")
    return tmp_path / "short.toml"


@pytest.fixture
def run_of_unknown_arm(ur_client, standard_box, short, tmp_path, monkeypatch, without_page):
    """Run a movement on a box in which the client finds no mark of a simulator, nor a proof that it is real."""
    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)

    def run(answer):
        monkeypatch.setattr(sys, "stdin", answer if answer is None else io.StringIO(answer))
        words = ("experiment", "--movements", short, "--repeat", 1)
        return ur_client(*words, *at(standard_box), "--out", tmp_path / "out")

    return run


def test_where_nobody_can_be_asked_the_answer_is_no(run_of_unknown_arm, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_of_unknown_arm(None)
        assert done.code == 1
        assert "there is no terminal to ask at" in done.complaint()
        assert "--yes" in done.complaint()
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


def test_after_a_yes_it_runs(run_of_unknown_arm, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_of_unknown_arm("y\n")
        assert done.code == 0, done.err
        assert "velocity_receiver" in programs_since(primary, standard_box)
    assert "box of motion" in done.out
    assert (tmp_path / "out" / "short_r1.mcap").exists()


# --- what ends a run

LONGEST_UNSEEN = 40
"""Cycles that a run goes on with a moved slider: states are due every 13th, the client looks every 16th."""


def protective_stop(box):
    send(box, "secondary", "sec p():\n  protective_stop()\nend\n")


def another_program(box):
    send(box, "secondary", "def bad():\n  x = 1 / 0\nend\n")


def moved_slider(box):
    return box.set_speed(0.95)


class MeddlingDriver(UrDriver):
    """A session in which something happens to the box in the midst of a movement; keeps the last frame."""

    def __init__(self, box, meddle):
        super().__init__(box.host, box.ports)
        self._box, self._meddle = box, meddle
        self.last_frame = None
        self.answers = []

    def stream(self, tracker, on_row, *, acceleration):
        def on_row_and_meddle(frame, step):
            on_row(frame, step)
            self.last_frame = frame
            of_a_movement = isfinite(step.point.p[0])  # neither approach nor excitation has a TCP path
            if of_a_movement and step.t > 0.5 and not self.answers:
                self.answers.append(self._meddle(self._box))

        return super().stream(tracker, on_row_and_meddle, acceleration=acceleration)


def stopped_run(driver, out):
    """Run a movement that does not come to its end; returns the message, and the recording, which has it too."""
    experiment = prepare_experiment([reach()], repeat=1, out=out)
    with pytest.raises(DriverError) as caught:
        ExperimentRunner(driver, experiment, CONTROLLERS["preview"]).run()
    message = str(caught.value)
    assert "\n" not in message
    recording = load_recording(out / "reach_r1.mcap")
    assert recording.summary == {"aborted": f"{type(caught.value).__name__}: {message}"}
    return message, recording


@pytest.mark.parametrize(
    ("meddle", "words"),
    [
        (protective_stop, "PROTECTIVE_STOP"),
        # Whether the client first sees that its socket is closed or that its program has gone is a matter of timing.
        (another_program, r"program|closed the connection"),
        (moved_slider, "the robot's speed slider is 95 %, must be 100 %"),
    ],
)
def test_what_stops_the_robot_in_a_run_is_one_line_and_the_arm_rests(lockstep_box, tmp_path, meddle, words):
    with MeddlingDriver(lockstep_box, meddle) as driver:
        message, recording = stopped_run(driver, tmp_path)
    assert re.search(words, message)
    cycle = driver.answers[0]
    if cycle is not None:
        assert round(recording.column("timestamp")[-1] / PERIOD) - cycle <= LONGEST_UNSEEN
    with Frames(lockstep_box) as frames:
        frames.rest()


def push(box):
    """A shove [N] of so many seconds: more than the joints hold."""
    return box.push((0.0, 200.0, 0.0), duration=0.05)


def test_a_push_ends_the_run_before_the_box_protects_itself(lockstep_box, tmp_path):
    with MeddlingDriver(lockstep_box, push) as driver:
        message, recording = stopped_run(driver, tmp_path)
        assert driver.last_frame.safety_mode == SafetyMode.NORMAL
        driver.check_ready()
    assert "off its path" in message
    assert "allowed is 5 mm (path_tolerance)" in message
    assert recording.column("actual_q").shape[0] > 80


def finished_beside(frames, client):
    """Wait for the end of a client while its box is read."""
    reader = threading.Thread(target=frames.until, args=(lambda _: client.poll() is not None, frames.raw))
    reader.start()
    done = finish(client)
    reader.join()
    return done


ROOM = 150_000  # bytes; about a third of the recording of a short movement


def no_room():
    """Let files of this process grow to a size only: writing fails as on a full disk (errno aside)."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, ROOM))


def test_a_full_disk_stops_the_arm_says_what_is_saved_and_that_can_be_read(standard_box, short, tmp_path):
    with Frames(standard_box) as frames:
        words = ("run", short, *at(standard_box), "--out", tmp_path / "out")
        done = finished_beside(frames, start("pc_client", *words, preexec_fn=no_room))
        rest = frames.rest()
        assert frames.lost() == 0
    assert done.code == 1
    complaint = done.complaint()
    assert "short_r1.mcap" in complaint
    assert "rows are saved and readable" in complaint
    recording = load_recording(tmp_path / "out" / "short_r1.mcap")
    assert not recording.complete
    assert f"{recording.n_rows} of" in complaint
    assert recording.n_rows > 50
    assert abs(rest.actual_qd).max() < 2e-3


# --- a movement that the loop leads off its path

QUICK = [(0.30, -0.06, 0.30), (0.30, 0.06, 0.35)]
"""Own points .13 m apart: in 1.5 s more acceleration than the published controller lets `speedj` use."""


@pytest.mark.parametrize("duration", [1.5, 1.2])
def test_the_published_controller_runs_a_quick_movement_as_the_loop_predicts_and_says_so(
    lockstep_box, caplog, monkeypatch, duration
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

    plan = ur.plan(ur.Movement.through(QUICK, durations=[duration]), arm)
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


# --- recordings


@contextmanager
def bystander(box):
    """A client of 30003 that takes its frames and has nothing to do with the run."""
    with Frames(box) as frames, in_background(frames.raw):
        yield


@pytest.mark.usefixtures("without_page")
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(ur_client, short, tmp_path):
    def recorded(name, seed, watched=False):
        with (
            ControlBox(pace="lockstep", port_base=free_port_base(), seed=seed) as box,
            bystander(box) if watched else nullcontext(),
        ):
            done = ur_client("run", short, *at(box), "--out", tmp_path / name)
        assert done.code == 0, done.err
        return load_recording(tmp_path / name / "short_r1.mcap")

    ours, again, other = recorded("a", 7), recorded("b", 7, watched=True), recorded("c", 8)
    assert again.path.read_bytes() == ours.path.read_bytes()
    assert ours.complete
    assert other.n_rows == pytest.approx(ours.n_rows, abs=20)
    assert (other.column("actual_q")[:100] != ours.column("actual_q")[:100]).any()
    assert (other.provenance.seed, ours.provenance.seed) == (8, 7)
