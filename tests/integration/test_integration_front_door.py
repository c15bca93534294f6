"""`import pc_client as ur` against a box on real sockets: what a user's program does, and what it is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pc_client as ur
from pc_client.driver import report
from pc_client.kinematics.clearance import clearance_model
from pc_client.planning.joint_path import fixed_tcp_rotation
from pc_client.planning.limits import limits_of
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
        (lambda arm: arm.fk([[1, 2], "x"]), "six finite numbers"),
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


def test_a_plan_and_a_movement_are_one_line():
    movement = ur.Movement.through(POINTS, durations=[2.5])
    assert repr(movement) == "<Movement 'through': lognormal, 2.50 s>"
    assert repr(ur.plan(movement, "ur5e")) == "<Plan of 'through' for a UR5e: 2.50 s>"


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
        (lambda frame: [0.0] * 5, "six finite velocities"),
        (lambda frame: [np.nan] * 6, "six finite velocities"),
        (lambda frame: "fast", "six finite velocities"),
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
    bodies, least = clearance_model(arm.model), limits_of(arm.model).floor_clearance_min
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


@pytest.mark.parametrize("acceleration", [0.0, np.nan, 1e6])
def test_an_acceleration_out_of_its_range_is_refused(arm, acceleration):
    with pytest.raises(ur.ClientError, match="give a number from"):
        arm.stream(lambda frame: None, acceleration=acceleration)


def test_what_a_law_raises_comes_through_and_the_arm_rests(arm):
    with pytest.raises(ZeroDivisionError):
        arm.stream(lambda frame: [1.0 / 0.0])
    assert np.abs(arm.frame().actual_qd).max() < 0.01


def test_a_control_law_of_the_user_runs_a_plan_like_the_other_controllers(arm, tmp_path):
    def my_law(frame, reference):
        return reference.qd_feedforward + 5.0 * (reference.q_array - frame.actual_q)

    run = arm.run(ur.Movement.through(POINTS, durations=[2.5], name="mine"), my_law, out=tmp_path)
    kept = run.measured.recording.provenance
    assert (kept.controller, kept.controller_config["gain_p"]) == ("own law my_law", 0.0)
    np.testing.assert_allclose(run.tcp_pose[-1, :3], POINTS[-1], atol=5e-3)
    assert run.snr > 20.0


@pytest.mark.parametrize(
    ("law", "complaint"),
    [
        (lambda frame, reference: None, "gave None: give six finite velocities"),
        (lambda frame, reference: np.zeros(6), "off its path"),
    ],
)
def test_a_control_law_that_does_not_follow_ends_at_rest(arm, law, complaint):
    with pytest.raises(ur.ClientError, match=complaint):
        arm.run(ur.Movement.through(POINTS, durations=[2.5]), law)
    assert np.abs(arm.frame().actual_qd).max() < 0.01


def test_joint_angles_over_time_are_a_motion(arm):
    begin = ur.plan(ur.Movement.through(POINTS), arm).joints.start_q
    t = np.linspace(0.0, 2.0, 30)
    q = begin + np.outer(0.5 * (1.0 - np.cos(np.pi * t / 2.0)), [0.2, 0.05, -0.1, 0.1, 0.0, 0.3])
    run = arm.run(ur.JointTrajectory(t, q))
    np.testing.assert_allclose(run.ref_q[-1], q[-1], atol=1e-9)
    np.testing.assert_allclose(run.q[-1], q[-1], atol=2e-3)


def test_samples_with_orientations_turn_the_tool(arm):
    t = np.linspace(0.0, 2.0, 200)
    points = np.array(POINTS[0]) + np.outer(0.5 * (1.0 - np.cos(np.pi * t / 2.0)), [0.02, 0.1, 0.0])
    turn = np.outer(np.sin(np.pi * t / 2.0) ** 2, [0.0, 0.0, 0.3])
    wanted = Rotation.from_rotvec(turn) * Rotation.from_matrix(fixed_tcp_rotation())
    by_vectors = ur.Movement.from_samples(t, points, wanted.as_rotvec())
    by_quaternions = ur.Movement.from_samples(t, points, wanted.as_quat())
    np.testing.assert_allclose(
        ur.plan(by_quaternions, arm).joints.q, ur.plan(by_vectors, arm).joints.q, atol=1e-9
    )
    run = arm.run(by_vectors)
    reached = Rotation.from_rotvec(run.tcp_pose[:, 3:])
    turned = (reached * Rotation.from_matrix(fixed_tcp_rotation()).inv()).magnitude()
    assert turned.max() == pytest.approx(0.3, abs=0.01)
    assert turned[-1] < 0.01


def test_a_plan_for_another_arm_or_cell_is_refused_before_it_moves(arm):
    movement = ur.Movement.through(POINTS)
    stranger = ur.plan(movement, "ur5")
    for act in (arm.run, arm.approach):
        with pytest.raises(ur.ClientError, match="planned for a UR5"):
            act(stranger)
    with pytest.raises(ur.ClientError, match="plan it for this arm"):
        arm.run(ur.plan(movement, "ur3", ur.Cell(name="table", floor_z=-0.1)))


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
