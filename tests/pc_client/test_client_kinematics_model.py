from __future__ import annotations

import sys
from importlib import metadata
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from closed_form_ik import DH

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
from pc_client.kinematics.model import robot_model, solve_ik, tcp_jacobian, tcp_pose
from pc_client.planning.joint_path import fixed_tcp_rotation

UR3 = robot_model("ur3")
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


def test_the_large_joints_of_large_arms_accelerate_less():
    shoulder = [ROBOTS[name].limits.qdd_max[1] for name in ("ur3", "ur5", "ur10")]
    assert shoulder == sorted(shoulder, reverse=True)
    for description in ROBOTS.values():
        # No joint gets more than UR's own driver asks for.
        assert max(description.limits.qdd_max) <= 40.0


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


def test_an_arm_in_the_floor_has_negative_clearance():
    clearance = HULLS.along(np.radians((0, 40, 0, 0, 0, 0)))
    assert clearance.floor.least[0] < -0.1


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
