"""What `run` refuses and `doctor` says before an arm moves, what is asked, and the slider in the middle of a run.

Before an arm moves that does not say itself that it is simulated, the plan is shown, and a person says yes.
"""

import io
import sys

import pytest
from integration_support import (
    PERIOD,
    Frames,
    Messages,
    at,
    finish,
    free_port_base,
    port_base_of,
    programs_since,
    run_in_movement,
    send,
)

from pc_client.driver import report
from pc_client.recording.recording import load_recording
from protocol.ur_types import ProgramState
from ur_emulator import ControlBox

TOOL = "def tool():\n  set_tcp(p[0, 0, 0.15, 0, 0, 0])\nend\n"

LONGEST_UNSEEN = 40
"""Cycles that a run goes on with a moved slider: states are due every 13th, the client looks every 16th."""


def program(script):
    def run(box):
        with Frames(box) as frames:
            box.run_program(script)
            frames.until(lambda f: f.runtime_state == ProgramState.STOPPED)

    return run


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (
            lambda box: box.set_speed(0.95),
            "the robot's speed slider is 95 %, must be 100 %; set it to 100 % on the pendant",
        ),
        (program(TOOL), "the robot's TCP offset is (0.0, 0.0, 150.0) mm, (0, 0, 0) mrad, must be 0"),
        (ControlBox.protective_stop, "the robot's safety mode is PROTECTIVE_STOP, must be NORMAL or REDUCED"),
        (ControlBox.power_off, "the robot's mode is POWER_OFF, must be RUNNING; power it on"),
    ],
    ids=["95 %", "TCP", "protective stop", "power off"],
)
def test_a_robot_that_is_not_as_it_must_be_is_refused_by_run_and_shown_by_doctor(
    ur_client, standard_box, tmp_path, spoil, line
):
    spoil(standard_box)
    with Messages(standard_box) as primary:
        doctor = ur_client("doctor", *at(standard_box), "--seconds", 0.1)
        run = ur_client("run", "uniform_4_1", *at(standard_box), "--out", tmp_path / "out")
        if "POWER_OFF" not in line and "PROTECTIVE" not in line:  # there no program starts, ours neither
            assert programs_since(primary, standard_box) == []
    assert (doctor.code, run.code) == (1, 1)
    assert line in run.complaint()
    assert f"streaming   NOT NOW: {line}" in doctor.out
    assert doctor.out.count("NOT OK") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("robot", "seed"), [("ur3", 1), ("ur10", 3)])
def test_an_arm_with_its_own_calibration_is_ready(ur_client, robot, seed):
    with ControlBox(pace="lockstep", port_base=free_port_base(), robot=robot, seed=seed) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert doctor.code == 0, doctor.out
    assert "streaming   ready\n" in doctor.out
    assert doctor.out.count("  ok\n") == 12


@pytest.mark.parametrize(
    ("version", "unreported"), [("3.2.0", "; not reported by this software: payload"), ("3.11.0", "")]
)
def test_software_that_does_not_report_the_payload_is_not_refused(ur_client, version, unreported):
    with ControlBox(pace="lockstep", port_base=free_port_base(), version=version) as box:
        doctor = ur_client("doctor", *at(box), "--seconds", 0.1)
    assert doctor.code == 0, doctor.out
    assert f"streaming   ready{unreported}\n" in doctor.out


def test_a_slider_that_is_moved_in_a_run_ends_it_and_the_recording_is_kept(standard_box, tmp_path):
    with Frames(standard_box) as frames, run_in_movement(standard_box, frames, tmp_path) as client:
        moved = standard_box.set_speed(0.95)
        frames.rest()
        done = finish(client)
    assert done.code == 1
    assert "the robot's speed slider is 95 %, must be 100 %" in done.complaint()
    recording = load_recording(tmp_path / "lognorm_4_1_r1.mcap")
    assert "speed slider" in recording.aborted
    assert round(recording.column("timestamp")[-1] / PERIOD) - moved <= LONGEST_UNSEEN


def test_a_program_that_runs_is_shown_by_doctor(ur_client, standard_box):
    send(
        standard_box,
        "secondary",
        'def busy():\n  socket_open("127.0.0.1", 9)\n  while True:\n    sync()\n  end\nend\n',
    )
    standard_box.wait_until(program_state="PLAYING")
    doctor = ur_client("doctor", *at(standard_box), "--seconds", 0.1)
    standard_box.stop_program()
    assert doctor.code == 1
    assert "NOT NOW: the robot's program is PLAYING, must be STOPPED" in doctor.out


PLAN = (
    "UR3, software 3.15.8",
    "speed slider",
    "TCP offset",
    "box of motion",
    "top TCP speed",
    "top joint speed",
    "duration",
    "joint range",
)


@pytest.fixture
def run_movement(ur_client, standard_box, tmp_path, monkeypatch, without_page):
    """Run a movement on the box; the loopback address says nothing about it: real arms are reached by tunnels."""

    def run(answer, *options):
        monkeypatch.setattr(sys, "stdin", answer if answer is None else io.StringIO(answer))
        where = ("--robot", standard_box.host, "--port-base", port_base_of(standard_box))
        return ur_client("run", "uniform_4_1", *where, "--out", tmp_path / "out", *options)

    return run


@pytest.fixture
def marks_hidden(monkeypatch):
    """The client finds no mark of a simulator in the box, nor a proof that it is real."""
    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)


@pytest.mark.usefixtures("marks_hidden")
@pytest.mark.parametrize("answer", ["\n", "maybe\nno\n"], ids=["enter", "undecided"])
def test_without_a_yes_the_plan_is_shown_and_nothing_moves(run_movement, standard_box, tmp_path, answer):
    with Messages(standard_box) as primary:
        done = run_movement(answer)
        assert done.code == 1
        assert all(words in done.out for words in PLAN)
        assert done.err.splitlines()[-1] == "ur-client: aborted"
        assert "Traceback" not in done.err
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("marks_hidden")
def test_where_nobody_can_be_asked_the_answer_is_no(run_movement, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_movement(None)
        assert done.code == 1
        assert "there is no terminal to ask at" in done.complaint()
        assert "--yes" in done.complaint()
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("marks_hidden")
def test_after_a_yes_it_runs(run_movement, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_movement("y\n")
        assert done.code == 0, done.err
        assert "velocity_receiver" in programs_since(primary, standard_box)
    assert all(words in done.out for words in PLAN)
    assert (tmp_path / "out" / "uniform_4_1_r1.mcap").exists()
