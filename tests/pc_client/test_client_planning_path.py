from __future__ import annotations

import numpy as np
import pytest
from closed_form_ik import branch_error, closed_form_ik, dh_pose, wrap
from hypothesis import given, settings
from hypothesis import strategies as st
from planning_paths import INSIDE_THE_BOX, Arc, Spoiled, StraightStrokes

from pc_client.errors import PlanningError
from pc_client.kinematics.model import robot_model
from pc_client.planning.joint_path import fixed_tcp_rotation, rotation_from_rpy
from pc_client.planning.limits import limits_of
from pc_client.planning.plan import plan_movement

UR3 = robot_model("ur3")
POINTS = st.tuples(st.floats(0.28, 0.42), st.floats(-0.195, 0.195), st.floats(0.155, 0.345))


def poses(p):
    T = np.tile(np.eye(4), (len(p), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = fixed_tcp_rotation(), p
    return T


def test_the_orientation_is_the_papers():
    half = np.sqrt(0.5)
    np.testing.assert_allclose(
        fixed_tcp_rotation(), [[-half, 0, half], [0, 1, 0], [-half, 0, -half]], rtol=0, atol=1e-15
    )


def test_rpy_turns_about_fixed_axes_roll_first():
    roll, pitch, yaw = 0.3, -0.7, 1.9
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    np.testing.assert_allclose(rotation_from_rpy(roll, pitch, yaw), Rz @ Ry @ Rx, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "movement",
    [
        StraightStrokes(INSIDE_THE_BOX, 1.5),
        Arc((0.35, 0.0, 0.25), 0.07, 2 * np.pi, 3.0),
        Arc((0.35, 0.0, 0.25), 0.07, -3 * np.pi, 4.0, axes=((0, 1, 0), (1, 0, 0))),
    ],
    ids=["strokes", "circle", "one and a half turns back"],
)
def test_the_whole_path_is_one_closed_form_branch(movement):
    plan = plan_movement(movement, model=UR3)
    branches = set()
    for q, T in zip(plan.q, poses(plan.p), strict=True):
        reached = dh_pose(q)
        assert np.linalg.norm(reached[:3, 3] - T[:3, 3]) <= 1e-9
        assert np.linalg.norm(reached[:3, :3] - T[:3, :3]) <= 1.5e-9  # Frobenius norm = sqrt(2) angle
        branch, distance = branch_error(q, T)
        assert distance < 1e-8
        branches.add(branch)
    assert len(branches) == 1
    # The elbow-up branch: elbow bent backwards, shoulder to the right, wrist 2 positive.
    q2, q3, q5 = plan.q[:, 1], plan.q[:, 2], plan.q[:, 4]
    assert (q3 < 0).all()
    assert (q2 < 0).all()
    assert (q5 > 0).all()
    assert plan.report.position_error.value <= 1e-9
    assert plan.report.rotation_error.value <= 1e-9


@settings(max_examples=15)
@given(st.lists(POINTS, min_size=2, max_size=3))
def test_every_path_in_the_recommended_box_can_be_planned(points):
    # .35 m/s in any direction is possible all over the box; peak speed here is 1.875 * .45 / 3 = .28 m/s.
    plan = plan_movement(StraightStrokes(points, 3.0), model=UR3, dt=0.02)
    q_first = plan.q[0]
    assert branch_error(q_first, poses(plan.p[:1])[0])[1] < 1e-8
    assert np.abs(np.diff(plan.q, axis=0)).max() < 0.1
    assert plan.report.sigma_min.value >= 0.07


def test_the_planned_joint_speed_gives_the_movements_tcp_velocity():
    movement = Arc((0.35, 0.0, 0.25), 0.07, 2 * np.pi, 3.0)
    plan = plan_movement(movement, model=UR3)
    h = 1e-4
    t = np.linspace(0.1, 2.9, 23)
    after, before = (plan.spline.sample(t + sign * h)[0] for sign in (1, -1))
    v = np.array(
        [(dh_pose(a)[:3, 3] - dh_pose(b)[:3, 3]) / (2 * h) for a, b in zip(after, before, strict=True)]
    )
    np.testing.assert_allclose(v, movement.sample(t)[1], rtol=0, atol=1e-5)


def test_another_branch_is_followed_when_asked_for():
    movement = Arc((0.35, 0.0, 0.25), 0.05)
    # The mirror branch: shoulder to the left, elbow bent the other way.
    mirror = np.radians((157.4, -78.9, 120.3, -174.1, -74.2, 73.6))
    plan = plan_movement(movement, model=UR3, q_branch=mirror)
    np.testing.assert_allclose(plan.q[0], mirror, atol=0.6)
    preferred = plan_movement(movement, model=UR3)
    index, _ = branch_error(plan.q[0], poses(plan.p[:1])[0])
    assert index != branch_error(preferred.q[0], poses(plan.p[:1])[0])[0]


def refused(movement, **options):
    with pytest.raises(PlanningError) as caught:
        plan_movement(movement, model=UR3, **options)
    error = caught.value
    assert "\n" not in str(error)
    assert str(error).startswith(movement.name)
    return error


def names_sample(error):
    return f"sample {error.sample} of" in str(error)


def test_out_of_reach_names_the_first_sample_there_and_the_elbow():
    movement = StraightStrokes([(0.35, 0, 0.25), (0.70, 0, 0.25)], 4.0, name="too far")
    error = refused(movement)
    assert names_sample(error)
    assert error.joint in (1, 2, 3)  # the three parallel axes; the elbow leads
    assert "shoulder" in str(error) or "elbow" in str(error)
    # The oracle agrees: shortly before there is a solution, and at the end there is none.
    t = np.linspace(0, 4.0, 1001)
    T = poses(movement.sample(t)[0])
    assert closed_form_ik(T[error.sample])
    assert not closed_form_ik(T[-1])


def test_a_start_out_of_reach_is_sample_zero():
    error = refused(StraightStrokes([(0.8, 0, 0.3), (0.35, 0, 0.25)], 3.0))
    assert error.sample == 0
    assert names_sample(error)


def test_a_path_through_the_shoulder_singularity_is_refused_before_it():
    # Straight over the base axis: the wrist centre passes within d4 of it.
    movement = StraightStrokes([(0.35, -0.05, 0.35), (-0.25, -0.05, 0.35)], 8.0, name="over the base")
    error = refused(movement)
    assert names_sample(error)
    assert error.joint == 0
    assert "base" in str(error)
    p = movement.sample(np.linspace(0, 8.0, 2001))[0]
    wrist_centre = p - 0.0819 * fixed_tcp_rotation()[:, 2]
    radius = np.hypot(wrist_centre[:, 0], wrist_centre[:, 1])
    assert (radius[: error.sample] > 0.11235).all()
    assert radius[error.sample] < 0.16


def test_not_a_number_is_named_with_its_sample():
    def spoil(t, p, v):
        p[2 * 137, 1] = np.nan  # the movement is sampled twice as finely as the plan

    error = refused(Spoiled(StraightStrokes(INSIDE_THE_BOX), spoil))
    assert error.sample == 137
    assert "position is not finite" in str(error)


def test_an_infinite_velocity_is_named_with_its_sample():
    def spoil(t, p, v):
        v[2 * 20] = np.inf

    error = refused(Spoiled(StraightStrokes(INSIDE_THE_BOX), spoil))
    assert error.sample == 20
    assert "velocity is not finite" in str(error)


def test_a_jump_in_the_path_is_refused_even_when_velocities_look_harmless():
    def spoil(t, p, v):
        p[t > 1.0] += (0.0, 0.05, 0.0)

    error = refused(Spoiled(StraightStrokes(INSIDE_THE_BOX), spoil))
    assert error.sample == 251
    assert "TCP speed" in str(error)


def test_the_joints_may_not_jump_to_another_branch():
    from pc_client.planning.joint_path import follow_path
    from pc_client.planning.limits import PathNames

    # Given straight to the path follower, a gap of 0.3 m: it would have to leap.
    p = np.array([(0.35, -0.15, 0.25), (0.35, -0.15, 0.25), (0.35, 0.15, 0.25), (0.35, 0.15, 0.25)])
    names = PathNames("gap", np.arange(4.0), p)
    with pytest.raises(PlanningError, match="another branch") as caught:
        follow_path(UR3, names, fixed_tcp_rotation(), limits=limits_of(UR3))
    assert caught.value.sample == 2
    assert caught.value.joint is not None


def test_wrap_is_an_independent_half_open_turn():
    np.testing.assert_allclose(wrap([np.pi, -np.pi, 3 * np.pi, 0.1]), [np.pi, np.pi, np.pi, 0.1])
