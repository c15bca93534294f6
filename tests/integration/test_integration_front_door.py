"""`import pc_client as ur` against a box on real sockets: what a user's program does, and what it is refused."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars
import pytest

import pc_client as ur
from pc_client.driver import report
from pc_client.experiment import law_stream
from pc_client.kinematics.clearance import clearance_model
from pc_client.planning.limits import limits_of
from pc_client.recording.recording import load_recording
from ur_emulator import ControlBox

POINTS = [(0.30, -0.10, 0.30), (0.30, 0.05, 0.35)]


@pytest.fixture(scope="module")
def box():
    with ControlBox(pace="lockstep", port_base=None, seed=7) as box:
        yield box


@pytest.fixture
def arm(box):
    return ur.connect(box.host, box.ports)


@pytest.fixture(scope="module")
def run(box):
    """One run of one movement."""
    with ur.connect(box.host, box.ports) as arm:
        plan = ur.plan(ur.Movement.through(POINTS, style="human", durations=[2.5]), arm)
        return arm.run(plan, controller=ur.Controller.paper(gain_p=4.5))


def test_a_run_has_its_signals_as_arrays(run):
    n = len(run.t)
    assert run.q.shape == run.qd.shape == run.tcp_pose.shape == run.qd_cmd.shape == run.ref_q.shape == (n, 6)
    assert run.tcp_speed.shape == (n,)
    assert run.ref_tcp_position.shape == (n, 3)
    moving = (run.t >= 0.0) & (run.t <= 2.5)
    assert run.tcp_speed[moving].max() == pytest.approx(run.tcp_speed.max())
    np.testing.assert_allclose(run.tcp_pose[-1, :3], POINTS[-1], atol=5e-3)
    np.testing.assert_allclose(run.ref_tcp_position[-1], POINTS[-1], atol=1e-5)


def test_kinematics_of_the_arm_work_on_rows_and_stacks(arm):
    frame = arm.frame()
    pose = arm.fk(frame.actual_q)
    assert pose.shape == (6,)
    assert np.linalg.norm(pose[:3] - frame.actual_tcp_pose[:3]) < 5e-3  # its calibration is its own
    way = pose + np.linspace(0.0, 0.05, 9)[:, None] * [0, 0, 1, 0, 0, 0]
    q = arm.ik(way)
    assert q.shape == (9, 6)
    np.testing.assert_allclose(q[0], frame.actual_q, rtol=0, atol=1e-8)
    np.testing.assert_allclose(arm.fk(q)[:, :3], way[:, :3], rtol=0, atol=1e-9)
    assert np.abs(np.diff(q, axis=0)).max() < 0.2  # one branch
    np.testing.assert_allclose(arm.ik(way[-1], q_near=q[-2]), q[-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda arm: arm.fk([1, 2, 3]), r"q of shape \(3,\): give six finite numbers"),
        (lambda arm: arm.fk([np.nan] * 6), "six finite numbers"),
        (
            lambda arm: arm.ik([2, 0, 0.3, 0, 0, 0]),
            r"no posture of a UR3 brings the TCP to \(2.000, 0.000, 0.300\) m",
        ),
        (lambda arm: arm.ik(np.zeros((1, 2, 6))), r"pose of shape \(1, 2, 6\)"),
    ],
)
def test_kinematics_refuse_in_one_line(arm, call, said):
    with pytest.raises(ur.PlanningError, match=said) as caught:
        call(arm)
    assert "\n" not in str(caught.value)


def test_a_plan_takes_the_cell_as_connect_does(arm, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text('format = 1\nname = "bench"\n[[walls]]\nname = "window"\ny_max = 0.02\n')
    movement = ur.Movement.through(POINTS, durations=[2.5])
    with pytest.raises(ur.PlanningError, match="window"):
        ur.plan(movement, cell=path)
    own = ur.Cell(name="own", walls=(ur.Wall("glass", (0.0, -1.0, 0.0), -0.02),), tool=ur.Tool(mass=0.5))
    with pytest.raises(ur.PlanningError, match="glass"):
        ur.plan(movement, "ur3", own)
    with pytest.raises(ur.ClientError, match="has its own; give it to connect"):
        ur.plan(movement, arm, path)


def test_a_run_is_judged_by_the_speed_of_its_tcp(run):
    moving = run.measured.track.movement_steps
    wanted = np.linalg.norm(np.diff(run.ref_tcp_position, axis=0), axis=1) / np.diff(run.t)
    error = (run.tcp_speed[1:] - wanted)[moving]
    assert run.snr == pytest.approx(10.0 * np.log10(np.sum(wanted[moving] ** 2) / np.sum(error**2)))
    assert run.simulated is True
    assert "paper with gain_p 4.5" in repr(run)


def test_a_run_is_a_table(run):
    frame = run.to_frame()
    assert len(frame) == len(run.t)
    np.testing.assert_array_equal(frame["t"].to_numpy(), run.t)
    np.testing.assert_array_equal(frame["actual_q_2"].to_numpy(), run.q[:, 2])
    whose = frame.select("robot", "software", "serial", "simulated").unique().rows()
    assert whose == [("UR3", "3.15.8", run.measured.provenance.serial, True)]


def test_a_run_is_a_figure_that_says_it_is_simulated(run):
    figure = run.plot()
    assert [text.get_text() for text in figure.texts] == ["SIMULATED"]
    assert "TCP speed" in {axes.get_title("left") for axes in figure.axes}


def test_the_recording_stays_where_a_folder_is_given(arm, tmp_path):
    run = arm.run(ur.Movement.through(POINTS, style="robot", durations=[2.0], name="mine"), out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine_r1.mcap"]
    again = ur.Run.from_file(tmp_path / "mine_r1.mcap")
    assert again.snr == run.snr
    np.testing.assert_array_equal(again.q, run.q)


def test_a_velocity_law_moves_the_arm_and_ends(arm):
    began = []

    def law(frame):
        began.append(frame.timestamp)
        s = frame.timestamp - began[0]
        return None if s > 1.0 else [0.2 * np.sin(np.pi * s), 0, 0, 0, 0, 0]

    signals = arm.stream(law)
    assert np.ptp(signals.q[:, 0]) == pytest.approx(0.2 * 2.0 / np.pi, abs=0.01)
    frame = signals.to_frame()
    assert frame["software"].to_list() == ["3.15.8"] * len(signals.t)
    assert len(signals.plot().axes) == 3


@pytest.mark.parametrize(
    ("law", "complaint"),
    [
        (lambda frame: [np.nan] * 6, "six finite velocities"),
        (lambda frame: [9.0, 0, 0, 0, 0, 0], "not safe to send"),
        (lambda frame: [0, 0.8, 0, 0, 0, 0], "comes within"),
        (lambda frame: None, "there are no signals"),
    ],
)
def test_a_velocity_law_that_leads_out_of_the_limits_ends_at_rest(arm, law, complaint):
    arm.approach(ur.plan(ur.Movement.through(POINTS), arm))
    with pytest.raises(ur.ClientError, match=complaint):
        arm.stream(law)
    assert np.abs(arm.frame().actual_qd).max() < 0.01


def test_a_velocity_law_that_brakes_just_before_its_refusal_cannot_coast_out_of_the_limits(arm):
    """Its `speedj` brakes with .5 rad/s2: .64 rad from .8 rad/s, where the stop would need .1 rad."""
    arm.approach(ur.plan(ur.Movement.through(POINTS), arm))
    bodies, least = clearance_model(arm.model), limits_of(arm.model).clearance_min.floor
    way = arm.frame().actual_q + np.linspace(0.0, 2.5, 5001)[:, None] * np.eye(6)[1]
    last_clear = way[np.argmax(bodies.along(way).floor.least < least), 1]
    reached = []

    def law(frame):
        reached.append(frame.actual_q.copy())
        is_near = frame.actual_q[1] > last_clear - 0.1
        return (
            None if is_near and abs(frame.actual_qd[1]) < 0.01 else [0, 0.0 if is_near else 0.8, 0, 0, 0, 0]
        )

    with pytest.raises(ur.ClientError, match=r"velocity law leads out of the limits: .* of the floor"):
        arm.stream(law, acceleration=0.5)
    assert bodies.along([*reached, arm.frame().actual_q]).floor.least.min() > least


def test_a_control_law_of_the_user_runs_a_plan_like_the_other_controllers(arm, tmp_path):
    def my_law(frame, reference):
        return reference.qd_feedforward + 5.0 * (reference.q_array - frame.actual_q)

    run = arm.run(ur.Movement.through(POINTS, durations=[2.5], name="mine"), my_law, out=tmp_path)
    kept = run.measured.recording.provenance
    assert (kept.controller, kept.controller_config["gain_p"]) == ("own law my_law", 0.0)
    np.testing.assert_allclose(run.tcp_pose[-1, :3], POINTS[-1], atol=5e-3)
    assert run.snr > 20.0


MOVE = ur.Movement.through(POINTS, durations=[2.5])


def law(*numbers):
    return lambda frame, reference: numbers


@pytest.mark.parametrize(
    ("call", "said"),
    [
        *(
            (lambda arm, c=c: arm.run(MOVE, c), "controller: .*; give a Controller or a function of")
            for c in ("preview", None, ur.Controller, lambda frame: None)
        ),
        *(
            (lambda arm, c=c: arm.run(MOVE, c), "six finite velocities")
            for c in (law(1, 2, 3), law(*[np.nan] * 6), law(*["a"] * 6), lambda frame, reference: None)
        ),
        (lambda arm: arm.run(MOVE, law(9, 0, 0, 0, 0, 0)), "not safe to send"),
        (lambda arm: arm.run(MOVE, lambda f, reference: 1 / 0), "before anything has moved: ZeroDivisionErr"),
        (
            lambda arm: arm.run(MOVE, lambda frame, reference: reference.qd_feedforward.__iadd__(1.0)),
            "ValueError: output array is read-only",
        ),
        *((lambda arm, p=p: arm.run(p), "plan: .*; give a Plan, a Movement") for p in (None, [MOVE])),
        (lambda arm: arm.approach(MOVE), "plan: .*; give a Plan"),
        *(
            (lambda arm, n=n: arm.repeat(MOVE, n), "nothing to do|times: .*; give a whole number")
            for n in (0, 2.5, "3")
        ),
        *(
            (lambda arm, out=out: arm.run(MOVE, out=out), "out: .*; give a folder|cannot use the folder")
            for out in (5, "/proc/nothing", "a\0b", "/dev/null")
        ),
        (lambda arm: arm.run(MOVE, overwrite="no"), "overwrite: 'no'; give True or False"),
        (lambda arm: arm.experiment([MOVE], 1, ur.Controller.paper(), Path("x")), "plan: .*; give a Plan"),
        (lambda arm: arm.experiment([], 1, ur.Controller.paper(), Path("x")), "nothing to do"),
        (lambda arm: arm.experiment(None, 1, ur.Controller.paper(), Path("x")), "plans: None; give a list"),
        *((lambda arm, c=c: arm.stream(c), "law: .*; give a function of") for c in (None, law(0))),
        *(
            (lambda arm, a=a: arm.stream(still, acceleration=a), "acceleration: .*; give a number from")
            for a in (0.0, np.nan, 1e6, True)
        ),
        *(
            (lambda arm, mass=mass: arm.set_payload(mass, (0.0, 0.0, 0.05)), "mass: .*; give a number")
            for mass in (-1.0, np.nan, None)
        ),
        *(
            (lambda arm, c=c: arm.set_payload(0.0, c), "centre_of_gravity: ")
            for c in (None, (0.0, 0.0), (0.0, 0.0, np.inf))
        ),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line_before_anything_moves(
    arm, call, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    before = arm.frame()
    with pytest.raises(ur.ClientError, match=said) as caught:
        call(arm)
    assert "\n" not in str(caught.value)
    after = arm.frame()
    assert (after.timestamp, after.actual_q.tolist()) == (before.timestamp, before.actual_q.tolist())


def test_a_control_law_is_called_once_before_anything_moves_as_if_the_arm_rested_at_the_start(
    arm, caplog, monkeypatch
):
    before, calls = arm.frame(), []

    def law(frame, reference):
        calls.append((frame, reference))
        return reference.qd_feedforward

    plan = ur.plan(MOVE, arm)
    ticks = iter((0.0, 0.02))
    monkeypatch.setattr(law_stream, "time", SimpleNamespace(perf_counter=lambda: next(ticks)))
    arm.run(plan, law)
    assert caplog.messages == [
        "own law law took 20.0 ms for its first command, a cycle is 8 ms: frames may come late"
    ]
    (frame, reference), (first, again) = calls[:2]
    assert frame.timestamp == before.timestamp < first.timestamp
    np.testing.assert_allclose(frame.actual_q, plan.joints.start_q)
    np.testing.assert_allclose(frame.actual_tcp_pose, arm.fk(plan.joints.start_q))
    assert not frame.actual_qd.any()
    assert reference.t == again.t == -0.2
    assert not np.any(again.p != reference.p)


@pytest.mark.parametrize("end", [KeyboardInterrupt, SystemExit, ZeroDivisionError])
def test_whatever_ends_a_run_or_a_stream_names_what_is_kept_of_it(arm, end, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def law(frame, reference=None):
        calls.append(frame)
        if len(calls) > 50:
            raise end
        return np.zeros(6) if reference is None else reference.qd_feedforward

    for act in (lambda: arm.run(MOVE, law), lambda: arm.stream(law)):
        calls = []
        with pytest.raises(end) as caught:
            act()
        assert np.abs(arm.frame().actual_qd).max() < 0.01
        (note,) = caught.value.__notes__
        path = Path(note.removeprefix("recorded until then: "))
        assert path.is_relative_to(tmp_path)
        if path.suffix == ".parquet":
            assert len(polars.read_parquet(path)) == 50
        else:
            assert end.__name__ in load_recording(path).aborted


def test_joint_angles_over_time_are_a_motion(arm):
    begin = ur.plan(ur.Movement.through(POINTS), arm).joints.start_q
    t = np.linspace(0.0, 2.0, 30)
    q = begin + np.outer(0.5 * (1.0 - np.cos(np.pi * t / 2.0)), [0.2, 0.05, -0.1, 0.1, 0.0, 0.3])
    run = arm.run(ur.JointTrajectory(t, q))
    np.testing.assert_allclose(run.ref_q[-1], q[-1], atol=1e-9)
    np.testing.assert_allclose(run.q[-1], q[-1], atol=2e-3)


def test_a_plan_for_another_arm_or_cell_is_refused_before_it_moves(arm):
    movement = ur.Movement.through(POINTS, durations=[2.5])
    stranger = ur.plan(movement, "ur5")
    assert (repr(movement), repr(stranger)) == (
        "<Movement 'through': lognormal, 2.50 s>",
        "<Plan of 'through' for a UR5: 2.50 s>",
    )
    for act in (arm.run, arm.approach):
        with pytest.raises(ur.ClientError, match="planned for a UR5"):
            act(stranger)
    with pytest.raises(ur.ClientError, match="plan it for this arm"):
        arm.run(ur.plan(movement, "ur3", ur.Cell(name="table", floor_z=-0.1)))


@pytest.mark.parametrize(
    ("load", "says"),
    [
        ((0.3, (0.0, 0.0, 0.05)), r"payload 0 kg at \(0, 0, 0\) mm.* payload 0.3 kg at \(0, 0, 50\) mm"),
        ((0.0, (0.0, 0.01, 0.0)), r"payload 0 kg at \(0, 0, 0\) mm.* payload 0 kg at \(0, 10, 0\) mm"),
    ],
)
def test_a_plan_for_another_payload_is_refused_by_its_payload(lockstep_box, load, says):
    arm = ur.connect(lockstep_box.host, lockstep_box.ports)
    plan = ur.plan(MOVE, arm)
    arm.set_payload(*load)
    for act in (arm.run, arm.approach):
        with pytest.raises(ur.ClientError, match=says):
            act(plan)
    arm.approach(ur.plan(MOVE, arm))


def test_another_robot_at_the_same_address_is_refused_before_it_moves(box):
    with ControlBox(pace="lockstep", port_base=None, seed=8) as other:
        arm = ur.connect(box.host, box.ports)
        arm._ports = other.ports  # as if the boxes had changed places
        acts = (lambda: arm.approach(ur.plan(ur.Movement.through(POINTS), arm)), lambda: arm.stream(still))
        for act in acts:
            with pytest.raises(ur.ClientError, match="another robot answers: UR3, serial number 20993000008"):
                act()
    real = dataclasses.replace(arm.report.info, simulated=None)
    arm._ports, arm.report = box.ports, dataclasses.replace(arm.report, info=real)
    arm._confirm = lambda text: True
    with pytest.raises(ur.ClientError, match=r"SIMULATED; at connect it was .*: connect again"):
        arm.stream(still)


def still(frame):
    return [0.0] * 6


def test_an_arm_that_may_be_real_is_asked_for(box, monkeypatch):
    shown = []

    def no(text):
        shown.append(text)
        return False

    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)
    real = ur.connect(box.host, box.ports, confirm=no)
    with pytest.raises(ur.ClientError, match="the answer was no"):
        real.run(ur.Movement.through(POINTS))
    with pytest.raises(ur.ClientError, match="the answer was no"):
        real.stream(lambda frame: None)
    assert "box of motion" in shown[0]
    assert "velocity law" in shown[1]


def program(text):
    return lambda box: box.run_program(text, wait=True)


MOVE_AWAY = program("def p():\n  movej([1.6, -1.6, -1.9, -0.5, 1.3, 1.0])\nend\n")


@pytest.mark.parametrize(
    ("act", "meddle", "said", "ends"),
    [
        ("run", MOVE_AWAY, r"the arm was moved, its base by \d+\.\d deg", ""),
        ("approach", program("sec p():\n  set_payload(0.04)\nend\n"), "payload was 0.00 kg, is 0.04 kg", ""),
        ("stream", MOVE_AWAY, r"the arm was moved, its base by \d+\.\d deg", ""),
        (
            "run",
            program("def p():\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])\nend\n"),
            None,
            "the robot's TCP offset is",
        ),
        ("approach", lambda box: box.set_speed(0.5), None, "the robot's speed slider is 50 %"),
        ("stream", lambda box: box.press_button("teach", True), None, "the robot's control mode is TEACH"),
        ("run", lambda box: box.emergency_stop(), None, "the robot's safety mode is ROBOT_EMERGENCY_STOP"),
    ],
)
def test_what_was_agreed_to_is_compared_with_the_robot_after_the_answer(
    lockstep_box, monkeypatch, act, meddle, said, ends
):
    """What has changed and may still move is asked for anew, with the way from there; the rest is refused."""
    box, shown, places = lockstep_box, [], []

    def yes(text):
        shown.append(text)
        places.append(np.degrees(arm.frame().actual_q))
        if len(shown) == 1:
            meddle(box)
        return True

    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)
    arm = ur.connect(box.host, box.ports, confirm=yes)
    plan = ur.plan(MOVE, arm)
    acts = {
        "run": lambda: arm.run(plan),
        "approach": lambda: arm.approach(plan),
        "stream": lambda: arm.stream(ends_soon()),
    }
    before = arm.frame().actual_q
    if ends:
        with pytest.raises(ur.ClientError, match=ends) as caught:
            acts[act]()
        assert "\n" not in str(caught.value)
        np.testing.assert_allclose(arm.frame().actual_q, before, atol=1e-3)
        return
    acts[act]()
    assert len(shown) == 2
    assert re.search(said, shown[1].partition("\n")[0])
    if act != "stream":
        begin = ", ".join(f"{angle:.1f}" for angle in places[1])
        assert f"from            ({begin}) deg" in shown[1]


def ends_soon():
    frames = []
    return lambda frame: None if frames.append(frame) or len(frames) > 20 else [0.0] * 6


def test_nothing_is_asked_anew_of_a_robot_that_stays_as_it_was_shown(lockstep_box, monkeypatch):
    shown = []
    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)
    arm = ur.connect(lockstep_box.host, lockstep_box.ports, confirm=lambda text: not shown.append(text))
    arm.repeat(MOVE, 2)
    assert len(shown) == 1
    assert "expected SNR    at best 45.0 dB" in shown[0]
