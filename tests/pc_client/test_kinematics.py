"""Kinematics against the closed form of the DH tables; the models of all arms and their hulls."""

from __future__ import annotations

import sys
from importlib import metadata
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from closed_form_ik import DH, branch_error, closed_form_ik, dh_pose, frames, wrap
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.errors import PlanningError
from pc_client.kinematics.arms import (
    ROBOTS,
    SHARE_VARIABLE,
    DhArm,
    find_robot_file,
    find_share_folder,
    urdf_text,
)
from pc_client.kinematics.clearance import clearance_model, link_hulls, load_hulls
from pc_client.kinematics.model import (
    ROTATION_TOLERANCE,
    flange_difference,
    measure_singularity,
    nearest_posture,
    robot_model,
    solve_ik,
    tcp_jacobian,
    tcp_pose,
    tcp_positions,
)
from pc_client.planning.joint_path import fixed_tcp_rotation
from protocol.pose import T_to_pose

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
    if abs(np.sin(q[4])) > 1e-3 and measure_singularity(tcp_jacobian(UR3, q)[None], 1.0).sigma_min[0] > 1e-3:
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
    measure = measure_singularity(tcp_jacobian(UR3, np.radians(q_deg))[None], 0.5)
    assert measure.sigma_min[0] < 1e-10
    assert measure.condition[0] > 1e9
    assert measure.critical_joint[0] == joint


def test_the_wrist_above_the_base_axis_is_seen_and_named():
    # Of all shoulder angles take the one that brings the wrist centre nearest to the base axis.
    postures = np.radians([(20, q2, -110, -60, 70, 30) for q2 in np.linspace(-180, 0, 2001)])
    radius = [np.hypot(*frames(q)[4][:2, 3]) for q in postures]
    nearest = postures[int(np.argmin(radius))]
    measure = measure_singularity(tcp_jacobian(UR3, nearest)[None], 0.5)
    assert measure.sigma_min[0] < 1e-3
    assert measure.critical_joint[0] == 0


def test_condition_is_the_ratio_of_the_singular_values_and_the_least_that_of_the_inverse():
    q = np.random.default_rng(3).uniform(-3, 3, (30, 6))
    J = np.array([tcp_jacobian(UR3, q_k) for q_k in q])
    measure = measure_singularity(J, 1.0)
    np.testing.assert_allclose(measure.condition, np.linalg.cond(J), rtol=1e-9)
    np.testing.assert_allclose(
        measure.sigma_min, 1 / np.linalg.norm(np.linalg.inv(J), ord=2, axis=(1, 2)), rtol=1e-9
    )


def test_an_arm_of_twice_the_size_is_as_near_a_singularity_in_the_same_posture():
    q = np.random.default_rng(3).uniform(-3, 3, (30, 6))
    J = np.array([tcp_jacobian(UR3, q_k) for q_k in q])
    larger = J * np.repeat((2.0, 1.0), 3)[:, None]
    small, large = measure_singularity(J, 0.5), measure_singularity(larger, 1.0)
    np.testing.assert_allclose(small.sigma_min, large.sigma_min, rtol=1e-12)


def test_a_near_seed_comes_back_to_the_same_posture():
    rng = np.random.default_rng(4)
    tried = 0
    while tried < 300:
        q = rng.uniform(-2 * np.pi, 2 * np.pi, 6)
        if measure_singularity(tcp_jacobian(UR3, q)[None], 1.0).sigma_min[0] < 0.05:
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


HULLS = clearance_model(UR3)


def test_speeds_can_be_stopped_in_time_and_limits_are_not_the_urdfs():
    np.testing.assert_allclose(np.degrees(UR3.limits.qd_max), (180,) * 6)
    np.testing.assert_allclose(np.degrees(UR3.limits.q_max), 360)
    assert UR3.limits.qd_max[0] != pytest.approx(float(UR3.pin_model.velocityLimit[0]))


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_in_its_working_box_an_arm_does_350_mm_a_second_in_every_direction(name):
    model, box = robot_model(name), ROBOTS[name].working_box
    corners = list(product(*zip(box.low, box.high, strict=True)))
    inside = np.random.default_rng(3).uniform(box.low, box.high, (60, 3))
    hulls, T = clearance_model(model), np.eye(4)
    T[:3, :3] = fixed_tcp_rotation()
    q = np.array(model.description.q_branch)
    for goal in (*corners, *inside):
        # On a straight line from point to point, so that the branch is kept.
        begin = tcp_pose(model, q)[:3, 3]
        for share in np.linspace(0.0, 1.0, 12):
            T[:3, 3] = begin + share * (goal - begin)
            solution = solve_ik(model, T, q)
            assert solution.converged
            q = solution.q
        qd_per_speed = np.linalg.norm(np.linalg.inv(tcp_jacobian(model, q))[:, :3], axis=1)
        assert (np.array(model.limits.qd_max) / qd_per_speed).min() > 0.34
        clearance = hulls.along(q)
        assert clearance.own.least[0] > 0.01
        assert clearance.floor.least[0] > 0.03


def test_an_unknown_arm_is_refused_with_the_known_ones():
    with pytest.raises(PlanningError, match=r"'ur4'.*ur3, ur5, ur10, ur3e"):
        robot_model("ur4")


def test_models_share_no_scratch_memory():
    assert robot_model("ur3").pin_data is not UR3.pin_data


@pytest.fixture
def nothing_installed(monkeypatch, tmp_path):
    def not_found(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", not_found)
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.delenv(SHARE_VARIABLE, raising=False)
    return tmp_path


def test_a_missing_package_is_one_line_that_says_what_to_install(nothing_installed):
    with pytest.raises(PlanningError, match=r"pip install 'ur-hil\[client\]'") as error:
        find_share_folder()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("place", ["variable", "sys.path", "prefix", "ros"])
def test_the_share_folder_is_found_where_installers_put_it(nothing_installed, monkeypatch, place):
    if place == "sys.path":
        share = nothing_installed / "cmeel.prefix" / "share"
    elif place == "prefix":
        share = nothing_installed / "share"
    else:
        share = nothing_installed / "elsewhere" / "share"
        name = SHARE_VARIABLE if place == "variable" else "AMENT_PREFIX_PATH"
        monkeypatch.setenv(name, str(share if place == "variable" else share.parent))
    (share / "example-robot-data" / "robots").mkdir(parents=True)
    assert find_share_folder() == share
    with pytest.raises(PlanningError, match=r"no arm\.urdf"):
        find_robot_file("arm.urdf")


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_the_preferred_branch_is_elbow_up_clear_and_points_forward_and_down(name):
    model = robot_model(name)
    q = np.array(model.description.q_branch)
    tool_z = tcp_pose(model, q)[:3, 2]
    np.testing.assert_allclose(tool_z, (np.sqrt(0.5), 0, -np.sqrt(0.5)), atol=2e-3)
    clearance = clearance_model(model).along(q)
    assert clearance.floor.least[0] > 0.08
    assert clearance.own.least[0] > 0.005


def test_the_flange_face_sets_the_floor_distance_of_a_tool_that_points_down():
    # Flange face down (tool z = -z): the lowest point of the last link is the face, 0 to 2 mm below the TCP.
    q = np.radians((0, -90, -90, -90, 90, 0))
    T = tcp_pose(UR3, q)
    np.testing.assert_allclose(T[:3, 2], (0, 0, -1), atol=1e-9)
    clearance = HULLS.along(q)
    assert clearance.floor.nearest[0] == ("wrist 3", "the floor at z = 0 m", 5)
    assert clearance.floor.least[0] == pytest.approx(T[2, 3], abs=3e-3)


def test_turning_the_base_changes_no_clearance_from_the_floor():
    # Holds only if floor and arm are in the same frame.
    q = np.tile(UR3.description.q_branch, (8, 1))
    q[:, 0] = np.linspace(-3, 3, 8)
    np.testing.assert_allclose(HULLS.along(q).floor.least, HULLS.along(q).floor.least[0], atol=1e-6)


def test_a_folded_arm_hits_itself_and_an_upright_one_does_not():
    clearance = HULLS.along(np.radians([(0, -90, 160, -90, -90, 0), (0, -90, 0, -90, 0, 0)]))
    assert clearance.own.least[0] < 0.0
    assert clearance.own.nearest[0] == ("wrist 1", "upper arm", 3)
    assert clearance.own.least[1] > 0.02


@pytest.mark.parametrize(
    "q_deg", [(22, -101, -120, -6, 74, 106), (200, -30, 80, -150, -100, 5), (0, 40, 0, 0, 0, 0)]
)
def test_floor_distances_are_those_of_the_lowest_mesh_vertex(q_deg):
    # Against the meshes themselves, every vertex moved by the DH table's own chain of link frames.
    q = np.radians(q_deg)
    urdf = str(find_robot_file(UR3.description.geometry))
    shares = [str(find_share_folder())]
    root = pin.buildModelFromUrdf(urdf)
    meshes = pin.buildGeomFromUrdf(root, urdf, pin.GeometryType.COLLISION, package_dirs=shares)
    data = root.createData()
    pin.forwardKinematics(root, data, q)
    heights = {}
    for mesh in meshes.geometryObjects:
        if mesh.parentJoint >= 3 and hasattr(mesh.geometry, "num_vertices"):
            vertices = np.array(mesh.geometry.vertices())
            placement = data.oMi[mesh.parentJoint] * mesh.placement
            heights[mesh.parentJoint - 1] = (vertices @ placement.rotation.T + placement.translation)[
                :, 2
            ].min()
    clearance = HULLS.along(q)
    assert clearance.floor.least[0] == pytest.approx(min(heights.values()), abs=1e-6)
    assert clearance.floor.nearest[0].joint == min(heights, key=heights.get)


# Offsets and radii of CB3 arms, by their URDF and meshes: what `e_series_lengths` has of the others. (The frame
# of a UR10's upper arm is not in its middle plane.)
CB3_SIZES = {
    "ur3": (0.1198, 0.0273, 0.064, (0.046, 0.038, 0.032)),
    "ur5": (0.13585, 0.01615, 0.075, (0.06, 0.06, 0.038)),
}


@pytest.mark.parametrize("name", CB3_SIZES)
def test_hulls_by_dh_table_and_joint_sizes_enclose_the_published_meshes(name):
    out, elbow, foot, radii = CB3_SIZES[name]
    arm = DhArm(**DH[name]._asdict(), shoulder_offset=out, elbow_offset=elbow, foot=foot, radii=radii)
    made = link_hulls(arm, pin.buildModelFromXML(urdf_text(arm, name)))
    published = load_hulls(ROBOTS[name])
    directions = np.random.default_rng(4).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for ours, theirs in zip(made[2:], published[2:], strict=True):
        assert theirs.name.startswith(ours.name)
        beyond = farthest(ours, directions) - farthest(theirs, directions)
        assert beyond.min() > -0.012


def farthest(body, directions):
    """How far a body reaches in each direction, in the frame of the joint that carries it [m]."""
    points = np.array([body.geometry.point(i) for i in range(body.geometry.num_points)])
    moved = points @ body.placement.rotation.T + body.placement.translation
    return (moved @ directions.T).max(axis=0)


def test_the_base_of_the_arm_stands_in_the_base_frame():
    # The base's hull reaches 99 mm to one side (its plug): turned with base_link, that side is +y of `base`.
    frames = UR3.pin_model.frames
    np.testing.assert_allclose(
        frames[UR3.pin_model.getFrameId("base")].placement.homogeneous, np.eye(4), atol=1e-12
    )
    root = frames[UR3.pin_model.getFrameId("base_link")].placement
    np.testing.assert_allclose(root.rotation, np.diag((-1.0, -1.0, 1.0)), atol=1e-9)
    hull = next(h for h in HULLS._own.geometry.geometryObjects if h.parentJoint == 0)
    points = np.array([hull.geometry.point(i) for i in range(hull.geometry.num_points)])
    y = (points @ hull.placement.rotation.T + hull.placement.translation)[:, 1]
    assert y.max() == pytest.approx(0.099, abs=1e-3)
    assert y.min() == pytest.approx(-0.064, abs=1e-3)


# --- how far a real arm may be from its model

# Largest difference of the flange over 3000 random postures, of 35 factory calibrations [mm, mrad].
WORST = {
    "ur3": (3.9, 15.8),
    "ur3e": (3.5, 14.7),
    "ur5": (5.2, 8.4),
    "ur5e": (3.8, 13.0),
    "ur10": (14.9, 42.5),
    "ur10e": (5.1, 16.5),
    "ur16e": (3.1, 7.1),
}


@pytest.mark.parametrize("name", WORST)
def test_a_real_calibration_is_within_the_tolerance(name):
    distance, angle = WORST[name]
    assert 1e-3 * distance < ROBOTS[name].position_tolerance
    assert 1e-3 * angle < ROTATION_TOLERANCE


@pytest.mark.parametrize(
    ("name", "other"),
    [("ur3", "ur3e"), ("ur5", "ur5e"), ("ur10", "ur10e"), ("ur16e", "ur18"), ("ur30", "ur15")],
)
def test_the_nearest_arm_of_another_type_is_outside_of_it_in_nearly_all_postures(name, other):
    model, reported = robot_model(name), robot_model(other)
    postures = np.random.default_rng(1).uniform(-3.1, 3.1, (200, 6))
    distances = [flange_difference(model, q, T_to_pose(tcp_pose(reported, q)))[0] for q in postures]
    assert np.mean(np.array(distances) > ROBOTS[name].position_tolerance) > 0.95
