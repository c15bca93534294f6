from __future__ import annotations

import numpy as np
import pytest
from closed_form_ik import DH, branch_error, closed_form_ik, dh_pose

from pc_client.errors import PlanningError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import (
    measure_singularity,
    nearest_posture,
    robot_model,
    solve_ik,
    tcp_jacobian,
)

UR3 = robot_model("ur3")


def test_a_near_seed_comes_back_to_the_same_posture():
    rng = np.random.default_rng(4)
    tried = 0
    while tried < 300:
        q = rng.uniform(-2 * np.pi, 2 * np.pi, 6)
        if measure_singularity(tcp_jacobian(UR3, q)[None]).sigma_min[0] < 0.05:
            continue
        tried += 1
        solution = solve_ik(UR3, dh_pose(q), q + rng.uniform(-0.03, 0.03, 6))
        assert solution.converged
        assert solution.iterations <= 6
        np.testing.assert_allclose(solution.q, q, rtol=0, atol=1e-8)


def test_from_anywhere_it_ends_on_a_true_solution_or_says_that_it_did_not():
    rng = np.random.default_rng(4)
    solved = 0
    for _ in range(200):
        T = dh_pose(rng.uniform(-3, 3, 6))
        solution = solve_ik(UR3, T, rng.uniform(-3, 3, 6))
        reached = dh_pose(solution.q)
        if solution.converged:
            solved += 1
            np.testing.assert_allclose(reached, T, rtol=0, atol=1e-9)
            assert max(solution.position_error, solution.rotation_error) <= 1e-9
    assert solved > 150


def test_a_solution_is_one_of_the_closed_form_branches():
    rng = np.random.default_rng(5)
    seed = np.array(UR3.description.q_branch)
    T = dh_pose(seed)
    for _ in range(50):
        T[:3, 3] = rng.uniform((0.275, -0.2, 0.15), (0.425, 0.2, 0.35))
        solution = solve_ik(UR3, T, seed)
        assert solution.converged
        assert branch_error(solution.q, T)[1] < 1e-8


def test_out_of_reach_it_stops_at_the_nearest_it_can_do():
    T = dh_pose(UR3.description.q_branch)
    T[:3, 3] = (0.9, 0.0, 0.3)
    solution = solve_ik(UR3, T, UR3.description.q_branch)
    assert not solution.converged
    assert 0.2 < solution.position_error < 1.0
    assert np.isfinite(solution.q).all()


def test_a_singular_seed_is_no_dead_end():
    goal = np.radians((22.6, -101.1, -120.3, -5.9, 74.2, 106.4))
    solution = solve_ik(UR3, dh_pose(goal), np.radians((20.0, -90.0, 0.0, -90.0, 0.0, 0.0)))
    assert solution.converged


@pytest.mark.parametrize("name", ROBOTS)
def test_the_nearest_posture_is_the_nearest_of_all_branches(name):
    rng, model, dh = np.random.default_rng(6), robot_model(name), DH[name]
    for _ in range(40):
        T, near = dh_pose(rng.uniform(-np.pi, np.pi, 6), dh), rng.uniform(-np.pi, np.pi, 6)
        q = nearest_posture(model, T, near)
        np.testing.assert_allclose(dh_pose(q, dh), T, rtol=0, atol=1e-9)
        others = [o + 2 * np.pi * np.rint((near - o) / (2 * np.pi)) for o in closed_form_ik(T, dh).values()]
        assert np.sum((q - near) ** 2) <= min(np.sum((o - near) ** 2) for o in others) + 1e-6


def test_a_near_posture_keeps_its_turns_within_the_ranges():
    q = np.array(UR3.description.q_branch)
    turned = q + 2 * np.pi * np.array([-1, 1, 1, 0, -1, 0])
    np.testing.assert_allclose(nearest_posture(UR3, dh_pose(q), turned), turned, rtol=0, atol=1e-8)
    for turns in (1, 40):
        beyond = q + 2 * np.pi * turns
        assert np.abs(nearest_posture(UR3, dh_pose(q), beyond)).max() <= 2 * np.pi


def test_aligned_wrists_and_a_stretched_elbow_have_postures_too():
    for q in ((0.3, -1.2, 1.0, 0.2, 0.0, 0.7), (0.3, -1.2, 0.0, 0.2, 0.9, 0.7)):
        T = dh_pose(q)
        reached = dh_pose(nearest_posture(UR3, T, np.add(q, 0.01)))
        np.testing.assert_allclose(reached, T, rtol=0, atol=1e-9)


def test_a_pose_out_of_reach_is_refused_in_one_line():
    T = dh_pose(UR3.description.q_branch)
    for place in ((0.9, 0.0, 0.3), (0.0, 0.01, 0.3)):
        T[:3, 3] = place
        with pytest.raises(PlanningError, match=r"no posture of a UR3 brings the TCP to \(") as caught:
            nearest_posture(UR3, T, UR3.description.q_branch)
        assert "\n" not in str(caught.value)


def test_the_seed_is_left_alone():
    seed = np.array(UR3.description.q_branch)
    before = seed.copy()
    solve_ik(UR3, dh_pose(seed + 0.1), seed)
    np.testing.assert_array_equal(seed, before)
