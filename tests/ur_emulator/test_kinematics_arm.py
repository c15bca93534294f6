"""The controller's kinematics against an independent product of DH matrices, and against itself."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from plant_support import dh_frames

from protocol.pose import pose_to_T, pose_trans, rotvec_from_flat
from ur_emulator.errors import KinematicsError
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.kinematics.closed_form import closed_form_inverse
from ur_emulator.machine.models.calibration import draw_dh
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.fidelity import TYPICAL
from ur_emulator.machine.models.robots import ROBOTS

TCP = (0.01, -0.02, 0.13, 0.3, -0.2, 0.7)


def random_angles(n, seed=0, reach=pi):
    return np.random.default_rng(seed).uniform(-reach, reach, (n, 6))


@pytest.fixture(params=[None, 7], ids=["nominal", "calibrated"])
def arm(request):
    return ArmModel(UR3, None if request.param is None else draw_dh(UR3, TYPICAL, request.param))


@pytest.mark.parametrize("tcp", [None, TCP])
def test_forward_kinematics_is_the_product_of_dh_matrices(arm, tcp):
    rows = arm.dh
    for q in random_angles(50, reach=2 * pi):
        expected = dh_frames(rows, q)[-1] @ (np.eye(4) if tcp is None else pose_to_T(tcp))
        assert pose_to_T(arm.fk(q, tcp)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("tcp", [None, TCP])
def test_jacobian_is_the_derivative_of_forward_kinematics(arm, tcp):
    h = 1e-6
    for q in random_angles(10, seed=1):
        jacobian = arm.jacobian(q, tcp)
        for j in range(6):
            step = h * np.eye(6)[j]
            before, after = pose_to_T(arm.fk(q - step, tcp)), pose_to_T(arm.fk(q + step, tcp))
            turn = np.array(rotvec_from_flat(*(after[:3, :3] @ before[:3, :3].T).flat))
            numeric = np.concatenate([after[:3, 3] - before[:3, 3], turn]) / (2 * h)
            assert jacobian[:, j] == pytest.approx(numeric, abs=1e-7)


@pytest.mark.parametrize("tcp", [None, TCP])
def test_state_agrees_with_forward_kinematics_and_jacobian(arm, tcp):
    rows = arm.dh
    h = 1e-6
    for q, qd in zip(random_angles(20, seed=2), random_angles(20, seed=3), strict=True):
        pose, speed, elbow, elbow_velocity, *_ = arm.state(q.tolist(), qd.tolist(), tcp)
        assert pose == pytest.approx(arm.fk(q, tcp), abs=1e-14)
        assert speed == pytest.approx(arm.jacobian(q, tcp) @ qd, abs=1e-12)
        assert elbow == pytest.approx(dh_frames(rows, q)[1, :3, 3], abs=1e-12)
        moved = dh_frames(rows, q + h * qd)[1, :3, 3] - dh_frames(rows, q - h * qd)[1, :3, 3]
        assert elbow_velocity == pytest.approx(moved / (2 * h), abs=1e-7)


def test_another_tool_is_noticed(arm):
    q = UR3.home_q
    longer = (*TCP[:2], TCP[2] + 0.1, *TCP[3:])
    assert arm.fk(q, TCP) == pytest.approx(pose_trans(arm.fk(q), TCP), abs=1e-12)
    assert arm.fk(q, longer) == pytest.approx(pose_trans(arm.fk(q), longer), abs=1e-12)


@pytest.mark.parametrize("tcp", [None, TCP])
def test_inverse_finds_the_pose_again(arm, tcp):
    rng = np.random.default_rng(4)
    for q in random_angles(60, seed=5):
        pose = arm.fk(q, tcp)
        found = arm.inverse(pose, q + rng.uniform(-1.5, 1.5, 6), tcp)
        assert found is not None
        again = arm.fk(found, tcp)
        assert np.abs(pose_to_T(again) - pose_to_T(pose)).max() < 1e-10


def test_inverse_near_a_solution_returns_that_solution(arm):
    rng = np.random.default_rng(6)
    for q in random_angles(60, seed=7, reach=1.8 * pi):
        if abs(np.linalg.det(arm.jacobian(q))) < 1e-4:
            continue  # at a singularity "that solution" is not unique
        found = arm.inverse(arm.fk(q), q + rng.uniform(-0.02, 0.02, 6))
        assert found == pytest.approx(q, abs=1e-7)


def test_inverse_chooses_the_nearest_branch_and_turn():
    arm = ArmModel(UR3)
    pose = arm.fk(UR3.home_q)
    turned = (*UR3.home_q[:5], UR3.home_q[5] - 2 * pi)
    assert arm.inverse(pose, (*UR3.home_q[:5], -4.0)) == pytest.approx(turned, abs=1e-9)
    flipped = np.radians((157.4, -78.9, 120.3, -174.1, -74.2, 73.6))
    mirror = arm.inverse(pose, flipped)
    assert mirror == pytest.approx(flipped, abs=2e-3)


def test_inverse_stays_inside_the_joint_range():
    arm = ArmModel(UR3)
    pose = arm.fk((0.1, -1.0, 1.0, -1.5, 1.2, 6.2))
    found = arm.inverse(pose, (0.1, -1.0, 1.0, -1.5, 1.2, 6.4))
    assert found is not None
    assert max(map(abs, found)) <= 2 * pi


def test_inverse_refuses_what_is_out_of_reach(arm):
    assert arm.inverse((0.6, 0.0, 0.3, 0.0, 0.0, 0.0), UR3.home_q) is None
    assert arm.inverse((0.0, 0.0, 0.1, pi, 0.0, 0.0), UR3.home_q) is None


@pytest.mark.parametrize("pose", [(0.3, 0.0, 0.2), (0.3, 0.0, float("nan"), 0.0, 0.0, 0.0)])
def test_inverse_refuses_what_is_no_pose(pose):
    with pytest.raises(KinematicsError, match="six finite numbers"):
        ArmModel(UR3).inverse(pose, UR3.home_q)


def test_inverse_at_the_wrist_singularity_keeps_joint_6():
    arm = ArmModel(UR3)
    q = (0.4, -1.2, 1.1, 0.3, 0.0, 0.9)
    found = arm.inverse(arm.fk(q), (0.42, -1.21, 1.12, 0.28, 0.01, 0.9))
    assert found is not None
    assert np.abs(pose_to_T(arm.fk(found)) - pose_to_T(arm.fk(q))).max() < 1e-10
    assert max(abs(a - b) for a, b in zip(found, q, strict=True)) < 0.3


def closed_form(q):
    flange = dh_frames(UR3.dh, q)[-1]
    branches = closed_form_inverse(
        UR3.dh, flange[:3, :3].ravel().tolist(), tuple(flange[:3, 3].tolist()), 0.0
    )
    return flange, np.array(branches)


def test_closed_form_gives_eight_different_exact_branches_at_home():
    flange, branches = closed_form(UR3.home_q)
    assert len(branches) == 8
    for i, branch in enumerate(branches):
        assert dh_frames(UR3.dh, branch)[-1] == pytest.approx(flange, abs=1e-12)
        others = np.delete(branches, i, axis=0)
        assert np.abs(others - branch).max(axis=1).min() > 0.1


def test_closed_form_contains_the_angles_that_made_the_pose():
    for q in random_angles(40, seed=8):
        _, branches = closed_form(q)
        wrapped = (branches - q + pi) % (2 * pi) - pi
        assert np.abs(wrapped).max(axis=1).min() < 1e-6


@pytest.mark.parametrize(
    ("name", "distance", "turn"),
    [("ur3", 1.36, 6.8), ("ur3e", 1.16, 6.3), ("ur5", 1.46, 4.5), ("ur5e", 1.17, 4.9), ("ur10e", 1.90, 5.9)],
)
def test_calibrated_arms_differ_from_nominal_as_real_ones_do(name, distance, turn):
    """In the mean over random angles [mm, mrad], and over the real arms of the type (docs/fidelity.md)."""
    nominal = ArmModel(ROBOTS[name])
    distances, turns = [], []
    for seed in range(60):
        arm = ArmModel(ROBOTS[name], draw_dh(ROBOTS[name], TYPICAL, seed))
        for q in random_angles(10, seed=seed):
            theirs, ours = pose_to_T(nominal.fk(q)), pose_to_T(arm.fk(q))
            distances.append(np.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
            turns.append(np.linalg.norm(rotvec_from_flat(*(ours[:3, :3] @ theirs[:3, :3].T).flat)))
    assert 1e3 * np.mean(distances) == pytest.approx(distance, rel=0.2)
    assert 1e3 * np.mean(turns) == pytest.approx(turn, rel=0.2)
