from __future__ import annotations

import numpy as np
import pytest
from closed_form_ik import DH, closed_form_ik, dh_pose, frames, wrap
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import measure_singularity, robot_model, tcp_jacobian, tcp_pose, tcp_positions

ANGLES = st.lists(st.floats(-2 * np.pi, 2 * np.pi), min_size=6, max_size=6).map(np.array)
UR3 = robot_model("ur3")


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_the_nominal_model_is_the_published_dh_table_in_the_base_frame(name):
    model, rng = robot_model(name), np.random.default_rng(1)
    for q in rng.uniform(-2 * np.pi, 2 * np.pi, (200, 6)):
        np.testing.assert_allclose(tcp_pose(model, q), dh_pose(q, DH[name]), rtol=0, atol=1e-10)


@given(ANGLES)
def test_the_oracle_solves_its_own_forward_kinematics(q):
    T = dh_pose(q)
    for solution in closed_form_ik(T).values():
        np.testing.assert_allclose(dh_pose(solution), T, rtol=0, atol=1e-11)
    # The posture itself is one of them, unless it is so near the wrist singularity that q4 and q6 blur.
    if abs(np.sin(q[4])) > 1e-3 and measure_singularity(tcp_jacobian(UR3, q)[None]).sigma_min[0] > 1e-3:
        assert min(np.abs(wrap(q - solution)).max() for solution in closed_form_ik(T).values()) < 1e-8


@settings(max_examples=50)
@given(ANGLES)
def test_the_jacobian_is_the_derivative_of_the_pose(q):
    J, h = tcp_jacobian(UR3, q), 1e-6
    R = tcp_pose(UR3, q)[:3, :3]
    for joint in range(6):
        dq = np.zeros(6)
        dq[joint] = h
        after, before = dh_pose(q + dq), dh_pose(q - dq)
        spin = (after[:3, :3] - before[:3, :3]) / (2 * h) @ R.T
        difference = [*((after - before)[:3, 3] / (2 * h)), spin[2, 1], spin[0, 2], spin[1, 0]]
        np.testing.assert_allclose(J[:, joint], difference, rtol=0, atol=1e-8)


def test_positions_along_a_path_are_those_of_the_poses():
    q = np.random.default_rng(2).uniform(-3, 3, (20, 6))
    np.testing.assert_array_equal(tcp_positions(UR3, q), [tcp_pose(UR3, q_k)[:3, 3] for q_k in q])


def test_results_are_not_overwritten_by_the_next_call():
    q = np.array(UR3.description.q_branch)
    T, J = tcp_pose(UR3, q), tcp_jacobian(UR3, q)
    T_copy, J_copy = T.copy(), J.copy()
    tcp_pose(UR3, q + 1)
    tcp_jacobian(UR3, q + 1)
    np.testing.assert_array_equal(T, T_copy)
    np.testing.assert_array_equal(J, J_copy)


@pytest.mark.parametrize(
    ("q_deg", "joint"),
    [
        ((20, -100, 0, -60, 70, 30), 2),  # elbow stretched
        ((20, -100, -90, -60, 0, 30), 4),  # wrist 1 and wrist 3 aligned
    ],
)
def test_known_singularities_are_seen_and_named(q_deg, joint):
    measure = measure_singularity(tcp_jacobian(UR3, np.radians(q_deg))[None])
    assert measure.sigma_min[0] < 1e-10
    assert measure.condition[0] > 1e9
    assert measure.critical_joint[0] == joint


def test_the_wrist_above_the_base_axis_is_seen_and_named():
    # Of all shoulder angles take the one that brings the wrist centre nearest to the base axis.
    postures = np.radians([(20, q2, -110, -60, 70, 30) for q2 in np.linspace(-180, 0, 2001)])
    radius = [np.hypot(*frames(q)[4][:2, 3]) for q in postures]
    nearest = postures[int(np.argmin(radius))]
    measure = measure_singularity(tcp_jacobian(UR3, nearest)[None])
    assert measure.sigma_min[0] < 1e-3
    assert measure.critical_joint[0] == 0


def test_manipulability_is_the_jacobian_determinant_and_condition_the_ratio():
    q = np.random.default_rng(3).uniform(-3, 3, (30, 6))
    J = np.array([tcp_jacobian(UR3, q_k) for q_k in q])
    measure = measure_singularity(J)
    np.testing.assert_allclose(measure.manipulability, np.abs(np.linalg.det(J)), rtol=1e-9)
    np.testing.assert_allclose(measure.condition, np.linalg.cond(J), rtol=1e-9)
    np.testing.assert_allclose(
        measure.sigma_min, 1 / np.linalg.norm(np.linalg.inv(J), ord=2, axis=(1, 2)), rtol=1e-9
    )
