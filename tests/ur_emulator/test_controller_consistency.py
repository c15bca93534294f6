"""Everything a frame says must agree with everything else it says."""

import math

import numpy as np
import pytest
from box_support import Bench

from protocol.pose import pose_to_T
from protocol.realtime.layout import SNAPSHOT_FIELDS
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.models.calibration import calibrated_dh

MOVE = "def move():\n  movej([0.6,-1.2,-1.9,-0.5,1.0,1.2], a=1.4, v=1.05)\nend\n"


def dh_fk(rows, q):
    """Forward kinematics by the textbook: product of four elementary transforms a joint."""
    T = np.eye(4)
    for row, angle in zip(rows, q, strict=True):
        ct, st = math.cos(angle + row.theta), math.sin(angle + row.theta)
        ca, sa = math.cos(row.alpha), math.sin(row.alpha)
        T = T @ np.array(
            [
                [ct, -st * ca, st * sa, row.a * ct],
                [st, ct * ca, -ct * sa, row.a * st],
                [0, sa, ca, row.d],
                [0, 0, 0, 1],
            ]
        )
    return T


@pytest.fixture(scope="module")
def moved():
    bench = Bench()
    bench.run(MOVE)
    return bench


def test_the_snapshot_has_every_column_of_the_realtime_interface():
    assert all(hasattr(Snapshot, name) for name in SNAPSHOT_FIELDS)
    assert set(SNAPSHOT_FIELDS) <= set(Bench().now.as_dict())


def test_every_value_is_finite_in_motion(moved):
    for snapshot in moved.snapshots:
        for name, value in snapshot.as_dict().items():
            if name not in ("program_name", "registers"):
                assert np.isfinite(value).all(), name


def test_tcp_pose_is_the_forward_kinematics_of_the_same_frame(moved):
    arm = moved.controller.state.arm
    rows = calibrated_dh(arm.robot, arm.calibration)
    for snapshot in moved.snapshots[::20]:
        for q, pose in (
            (snapshot.actual_q, snapshot.actual_tcp_pose),
            (snapshot.target_q, snapshot.target_tcp_pose),
        ):
            assert np.allclose(pose_to_T(pose), dh_fk(rows, q), atol=1e-9)


def test_tcp_speed_is_the_derivative_of_the_tcp_pose(moved):
    dt = moved.controller.period_s
    targets = moved.snapshots
    for k in range(40, 120, 10):
        difference = np.subtract(targets[k + 1].target_tcp_pose[:3], targets[k - 1].target_tcp_pose[:3]) / (
            2 * dt
        )
        assert np.allclose(difference, targets[k].target_tcp_speed[:3], atol=2e-3)


def test_joint_speed_is_the_derivative_of_the_joint_position(moved):
    dt = moved.controller.period_s
    q = np.array([s.actual_q for s in moved.snapshots])
    qd = np.array([s.actual_qd for s in moved.snapshots])
    derivative = np.gradient(q, dt, axis=0)
    error = np.sqrt(np.mean((qd - derivative) ** 2, axis=0))
    assert (error < 0.03 * np.abs(qd).max() + 2e-3).all()


def test_at_rest_target_and_actual_agree_and_the_speed_is_exactly_zero(moved):
    moved.tick(125)
    now = moved.now
    assert now.target_qd == (0.0,) * 6
    assert now.actual_qd == (0.0,) * 6
    assert np.abs(np.subtract(now.actual_q, now.target_q)).max() < 3e-4
    assert np.abs(np.subtract(now.actual_tcp_pose, now.target_tcp_pose))[:3].max() < 2e-4


def test_target_velocity_is_the_derivative_of_the_target_position(moved):
    dt = moved.controller.period_s
    for before, after in zip(moved.snapshots[:-1], moved.snapshots[1:], strict=True):
        mean = np.add(before.target_qd, after.target_qd) / 2
        step = np.subtract(after.target_q, before.target_q) / dt
        assert np.allclose(step, mean, atol=1.4 * dt)


def test_elbow_lies_where_the_second_dh_frame_is(moved):
    arm = moved.controller.state.arm
    rows = calibrated_dh(arm.robot, arm.calibration)
    snapshot = moved.snapshots[100]
    assert np.allclose(snapshot.elbow_position, dh_fk(rows[:2], snapshot.actual_q[:2])[:3, 3], atol=1e-9)


def test_currents_carry_the_gravity_torque_at_rest(moved):
    robot = moved.controller.state.robot
    now = moved.now
    torque = np.multiply(robot.torque_constant, now.actual_current)
    # Friction can hold part of the load either way; the rest must be the model's moment.
    assert (np.abs(torque - now.target_moment) < np.array(robot.coulomb) + 1.5).all()


def test_tool_accelerometer_feels_gravity_at_rest(moved):
    assert math.hypot(*moved.now.actual_tool_accelerometer) == pytest.approx(9.82, abs=0.3)


def test_time_stamps_are_whole_cycles(moved):
    for snapshot in moved.snapshots[:100]:
        assert snapshot.timestamp == snapshot.tick * 8 / 1000


def test_tcp_offset_moves_the_pose_and_the_speed():
    bench = Bench()
    flange = pose_to_T(bench.now.actual_tcp_pose)
    bench.run("def t():\n  set_tcp(p[0,0,0.1,0,0,0])\n  sync()\nend\n")
    tcp = pose_to_T(bench.now.actual_tcp_pose)
    assert np.allclose(tcp[:3, 3], flange[:3, 3] + 0.1 * flange[:3, 2], atol=1e-4)
    assert bench.now.tcp_offset == (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)


def test_same_seed_same_numbers_other_seed_other_numbers():
    def run(seed):
        bench = Bench(seed=seed)
        bench.run(MOVE)
        return bench.snapshots

    first, again, other = run(3), run(3), run(4)
    assert first == again
    assert len(other) == len(first)
    assert all(a.actual_q != b.actual_q for a, b in zip(first[50:100], other[50:100], strict=True))


def test_momentum_is_mass_times_the_velocity_of_the_centres_of_mass(moved):
    arm = moved.controller.state.arm
    rows = calibrated_dh(arm.robot, arm.calibration)
    links = arm.robot.links
    snapshot = moved.snapshots[60]
    step = 1e-6

    def centres(q):
        return [(dh_fk(rows[: i + 1], q[: i + 1]) @ [*link.com, 1.0])[:3] for i, link in enumerate(links)]

    q, qd = np.array(snapshot.actual_q), np.array(snapshot.actual_qd)
    before, after = centres(q - step * qd), centres(q + step * qd)
    momentum = sum(link.mass * (b - a) / (2 * step) for link, a, b in zip(links, before, after, strict=True))
    assert snapshot.actual_momentum == pytest.approx(np.linalg.norm(momentum), rel=1e-6)


def test_a_declared_payload_hangs_on_the_arm():
    bench = Bench(fidelity="ideal")
    light = bench.now.target_moment[1]
    bench.run("def p():\n  set_payload(2.0, [0, 0, 0.05])\n  sleep(0.5)\nend\n")
    assert abs(bench.now.target_moment[1] - light) > 1.0
    assert np.abs(np.subtract(bench.now.actual_q, bench.now.target_q)).max() < 1e-3
    assert bench.now.payload == 2.0
