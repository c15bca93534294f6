"""Plans: the joint spline, what is checked of a path, one branch along it, and what is refused with its sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_form_ik import branch_error, closed_form_ik, dh_pose
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from planning_paths import INSIDE_THE_BOX, Arc, Spoiled, StraightStrokes
from scipy.spatial.transform import Rotation

from pc_client.errors import PlanningError
from pc_client.kinematics.model import RobotModel, robot_model
from pc_client.movements.movement import Movement
from pc_client.movements.samples import JointTrajectory
from pc_client.planning.joint_path import fixed_tcp_rotation, rotation_from_rpy
from pc_client.planning.joint_spline import JointSpline
from pc_client.planning.limits import limits_of
from pc_client.planning.plan import make_plan, plan_movement

ANGLES = st.floats(-6, 6, width=32)
KNOTS = st.integers(2, 30).flatmap(
    lambda n: st.tuples(
        arrays(np.float64, n - 1, elements=st.floats(0.01, 2.0)), arrays(np.float64, (n, 6), elements=ANGLES)
    ).map(lambda drawn: (np.append(0.0, np.cumsum(drawn[0])), drawn[1]))
)
"""Times, seldom in equal steps, and joint angles."""


@given(KNOTS)
def test_it_passes_through_its_knots_and_rests_at_both_ends(knots):
    q, qd = JointSpline(*knots).sample(knots[0])
    np.testing.assert_allclose(q, knots[1], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(qd[[0, -1]], 0.0)


@given(KNOTS)
def test_position_velocity_and_acceleration_are_continuous_at_knots(knots):
    spline, t = JointSpline(*knots), knots[0][1:-1]
    h = float(np.diff(knots[0]).min())
    eps = 1e-7 * h
    scale = max(1.0, float(np.abs(knots[1]).max())) * 30
    (q_a, qd_a), (q_b, qd_b) = spline.sample(t - eps), spline.sample(t + eps)
    np.testing.assert_allclose(q_a, q_b, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(qd_a, qd_b, rtol=0, atol=1e-5 * scale / h)
    np.testing.assert_allclose(spline.qdd(t - eps), spline.qdd(t + eps), rtol=0, atol=1e-5 * scale / h**2)


@given(KNOTS, st.lists(st.floats(-0.2, 1.2), min_size=1, max_size=20))
def test_one_time_and_many_times_give_the_same(knots, fractions):
    spline = JointSpline(*knots)
    t = np.append(np.array(fractions) * spline.duration, knots[0])
    q, qd = spline.sample(t)
    for k, t_k in enumerate(t.tolist()):
        q_at, qd_at = spline.at(t_k)
        np.testing.assert_allclose(q_at, q[k], rtol=1e-13, atol=1e-12)
        np.testing.assert_allclose(qd_at, qd[k], rtol=1e-12, atol=1e-9)


def test_velocity_and_acceleration_are_the_derivatives():
    rng = np.random.default_rng(6)
    spline = JointSpline(np.linspace(0.0, 4.0, 101), np.cumsum(rng.normal(0, 0.1, (101, 6)), axis=0))
    t, h = rng.uniform(0.1, 3.9, 200), 1e-6
    np.testing.assert_allclose(
        spline.sample(t)[1], (spline.sample(t + h)[0] - spline.sample(t - h)[0]) / (2 * h), atol=1e-6
    )
    np.testing.assert_allclose(
        spline.qdd(t), (spline.sample(t + h)[1] - spline.sample(t - h)[1]) / (2 * h), atol=1e-2
    )


def test_it_is_exact_for_a_cubic_that_rests_at_both_ends():
    t = np.linspace(0.0, 2.0, 21)
    cubic = t**2 * (3.0 - t)  # derivative 3 t (2 - t) vanishes at 0 and 2
    spline = JointSpline(t, np.outer(cubic, np.arange(1.0, 7.0)))
    q, qd = spline.at(0.7331)
    np.testing.assert_allclose(q, 0.7331**2 * (3 - 0.7331) * np.arange(1.0, 7.0), rtol=1e-12)
    np.testing.assert_allclose(qd, 3 * 0.7331 * (2 - 0.7331) * np.arange(1.0, 7.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("t", "knot"),
    [*((t, 0) for t in (-np.inf, -1.0, -0.0, 0.0)), *((t, -1) for t in (1.0, 1.0 + 1e-15, 7.0, np.inf))],
)
def test_outside_it_rests_at_its_first_and_its_last_knot(t, knot):
    knots = np.random.default_rng(7).normal(size=(5, 6))
    q, qd = JointSpline(np.linspace(0.0, 1.0, 5), knots).at(t)
    np.testing.assert_array_equal(q, knots[knot])
    np.testing.assert_array_equal(qd, 0.0)


@given(st.floats(0.01, 60.0), st.integers(2, 3000))
def test_the_last_moment_before_the_end_is_inside(duration, n):
    knots = np.linspace(0.0, 1.0, n)[:, None] * np.ones(6)
    q, qd = JointSpline(np.linspace(0.0, duration, n), knots).at(float(np.nextafter(duration, 0.0)))
    np.testing.assert_allclose(q, 1.0, atol=1e-9)
    np.testing.assert_allclose(qd, 0.0, atol=1e-5 / duration)


NINE = np.linspace(0.0, 1.0, 9)


def test_acceleration_outside_is_zero():
    spline = JointSpline(NINE, np.random.default_rng(8).normal(size=(9, 6)))
    np.testing.assert_array_equal(spline.qdd([-0.1, 1.1]), 0.0)
    assert np.abs(spline.qdd([0.0, 1.0])).min() > 0.0


def test_what_is_handed_out_at_the_ends_cannot_be_spoiled():
    spline = JointSpline([0.0, 0.5, 1.0], np.zeros((3, 6)))
    for values in (*spline.at(-1.0), *spline.at(2.0)):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_a_shift_moves_positions_and_nothing_else():
    spline = JointSpline(NINE, np.random.default_rng(9).normal(size=(9, 6)))
    offset = 2 * np.pi * np.array((1, 0, -1, 0, 0, 1))
    t = np.linspace(0, 1, 50)
    (q, qd), (q_shifted, qd_shifted) = spline.sample(t), spline.shifted(offset).sample(t)
    np.testing.assert_allclose(q_shifted, q + offset, atol=1e-12)
    np.testing.assert_allclose(qd_shifted, qd, atol=1e-10)


@pytest.mark.parametrize(
    "t", [(0, 1, 1), (0, 2, 1), (0, 1, np.nan), (0, 1, np.inf), (1, 2, 3), (-1, 0, 1), (np.nan, 1, 2)]
)
def test_times_that_are_none_are_refused(t):
    with pytest.raises(PlanningError, match="increase from 0"):
        JointSpline(t, np.zeros((3, 6)))


@pytest.mark.parametrize("shape", [(1, 6), (6,), (0, 6), (2, 6)])
def test_too_few_knots_or_times_are_refused(shape):
    with pytest.raises(PlanningError, match="knots of shape"):
        JointSpline(np.arange(1.0 if shape[0] == 1 else 3.0), np.zeros(shape))


def test_a_knot_that_is_no_number_is_named_with_its_joint():
    knots = np.zeros((5, 6))
    knots[3, 2] = np.nan
    with pytest.raises(PlanningError) as caught:
        JointSpline(np.arange(5.0), knots)
    assert (caught.value.sample, caught.value.joint) == (3, 2)


UR3 = robot_model("ur3")
LIMITS = limits_of(UR3)
STROKES = StraightStrokes(INSIDE_THE_BOX, 1.5)
PLAN = plan_movement(STROKES, model=UR3)


def refused(movement=STROKES, limits=LIMITS, model=UR3, **options):
    with pytest.raises(PlanningError) as caught:
        plan_movement(movement, model=model, limits=limits, **options)
    assert "\n" not in str(caught.value)
    return caught.value


def arm_with(**limits) -> RobotModel:
    """A UR3 whose joint limits are changed: fields of JointLimits."""
    return replace(UR3, description=replace(UR3.description, limits=replace(UR3.limits, **limits)))


def test_the_report_holds_what_an_independent_look_at_the_plan_finds():
    report, t = PLAN.report, np.linspace(0, PLAN.duration, 20001)
    q, qd = PLAN.spline.sample(t)
    p, v = STROKES.sample(t)
    assert report.duration == PLAN.duration == STROKES.duration
    assert report.samples == len(PLAN.t) == len(PLAN.q) == len(PLAN.p)
    np.testing.assert_allclose(report.box_min, p.min(axis=0), atol=1e-4)
    np.testing.assert_allclose(report.box_max, p.max(axis=0), atol=1e-4)
    np.testing.assert_allclose(report.qd_peak, np.abs(qd).max(axis=0), rtol=1e-3)
    np.testing.assert_allclose(report.qdd_peak, np.abs(PLAN.spline.qdd(t)).max(axis=0), rtol=1e-4)
    np.testing.assert_allclose(report.q_min, q.min(axis=0), atol=1e-5)
    assert report.tcp_speed.value == pytest.approx(np.linalg.norm(v, axis=1).max(), rel=1e-4)
    chords = np.linalg.norm(np.diff(STROKES.target_points, axis=0), axis=1)
    assert report.path_length == pytest.approx(chords.sum(), rel=1e-6)
    limit = 0.9 * np.array(UR3.limits.qd_max)
    assert report.joint_speed.share == pytest.approx((report.qd_peak / limit).max())
    assert report.joint_speed.joint == int((report.qd_peak / limit).argmax())
    assert report.joint_range.value == pytest.approx(2 * np.pi - np.abs(q).max(), abs=1e-5)
    assert report.interpolation_error.value < 1e-6


def test_the_top_joint_speed_may_lie_between_samples():
    plan = plan_movement(Movement.library("uniform_4_1"), model=UR3, dt=0.05)
    between = 0.5 * (plan.t[1:] + plan.t[:-1])
    fastest, at_samples = (np.abs(plan.spline.sample(t)[1]).max(axis=0) for t in (between, plan.t))
    assert (fastest > at_samples).any()
    assert (plan.report.qd_peak >= fastest).all()


def test_the_spline_stays_on_the_movement_between_samples():
    t = np.random.default_rng(10).uniform(0, PLAN.duration, 300)
    reached = np.array([dh_pose(q)[:3, 3] for q in PLAN.spline.sample(t)[0]])
    assert np.linalg.norm(reached - STROKES.sample(t)[0], axis=1).max() < 1e-6


def test_the_arrays_of_a_plan_cannot_be_changed():
    for values in (PLAN.q, PLAN.p, PLAN.t, PLAN.start_q):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


def test_samples_lie_on_a_whole_number_of_steps():
    plan = plan_movement(Arc((0.35, 0, 0.25), 0.05, 1.5, duration=1.2345), model=UR3)
    steps = np.diff(plan.t)
    assert steps.max() <= 0.004 + 1e-12
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    assert plan.t[-1] == plan.duration == 1.2345


SAMPLED = np.sort(np.append(np.random.default_rng(11).uniform(0.0, 2.0, 300), [0.0, 2.0]))
"""Times of samples that no grid has."""
REST_TO_REST = 0.5 * (1.0 - np.cos(0.5 * np.pi * SAMPLED))


def test_a_plan_goes_through_all_samples_of_joint_angles():
    steps = np.random.default_rng(12).normal(0.0, 1e-9, (len(SAMPLED), 6))
    q = np.array(UR3.description.q_branch) + np.outer(REST_TO_REST, [0.2, 0.05, -0.1, 0.1, 0.0, 0.3]) + steps
    plan = make_plan(JointTrajectory(SAMPLED, q), UR3)
    np.testing.assert_allclose(plan.joints.spline.sample(SAMPLED)[0], q, rtol=0, atol=1e-14)
    assert np.isin(SAMPLED, plan.joints.t).all()
    assert np.diff(plan.joints.t).max() <= 0.004 + 1e-12
    between = 0.5 * (plan.joints.t[1:] + plan.joints.t[:-1])
    reached = np.array([dh_pose(q)[:3, 3] for q in plan.joints.spline.sample(between)[0]])
    apart = np.linalg.norm(plan.movement.sample(between).p - reached, axis=1).max()
    assert plan.joints.report.interpolation_error.value == pytest.approx(apart, rel=1e-3)


def test_a_plan_goes_through_all_samples_of_the_tcp_and_turns_with_them():
    wobble = np.random.default_rng(13).normal(0.0, 1e-9, (len(SAMPLED), 3))
    p = np.array(INSIDE_THE_BOX[0]) + np.outer(REST_TO_REST, [0.05, 0.1, 0.1]) + wobble
    turns = Rotation.from_rotvec(np.outer(REST_TO_REST, [0.0, 0.0, 0.2]) + wobble)
    turns = turns * Rotation.from_matrix(fixed_tcp_rotation())
    plan = plan_movement(Movement.from_samples(SAMPLED, p, turns.as_quat()), model=UR3)
    reached = [dh_pose(q) for q in plan.spline.sample(SAMPLED)[0]]
    np.testing.assert_allclose([T[:3, 3] for T in reached], p, rtol=0, atol=2e-9)
    np.testing.assert_allclose([T[:3, :3] for T in reached], turns.as_matrix(), rtol=0, atol=4e-9)


@pytest.mark.parametrize("frequency", [250.0, 500.0, 125.0])
def test_a_vibration_between_the_usual_samples_is_seen(frequency):
    """At each whole number of periods, and half way between, it is 0."""
    t = np.linspace(0.0, 2.0, 4001)
    way, bell = 0.5 * (1.0 - np.cos(0.5 * np.pi * t)), 0.5 * (1.0 - np.cos(np.pi * t))
    vibration = (bell * np.sin(2.0 * np.pi * frequency * t))[:, None]
    begin, turn = np.array(UR3.description.q_branch), np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.3])
    joints = JointTrajectory(t, begin + np.outer(way, turn) + 3e-4 * vibration)
    p = np.array(INSIDE_THE_BOX[0]) + np.outer(way, [0.05, 0.1, 0.1]) + 2e-5 * vibration
    for motion in joints, Movement.from_samples(t, p):
        with pytest.raises(PlanningError, match="acceleration"):
            make_plan(motion, UR3)


def test_the_joint_speed_limit_names_the_fast_joint_where_it_is_fastest():
    fast = int(PLAN.report.joint_speed.joint)
    qd_max = list(UR3.limits.qd_max)
    qd_max[fast] = 0.5 * float(PLAN.report.qd_peak[fast])
    error = refused(model=arm_with(qd_max=tuple(qd_max)))
    assert error.joint == fast
    assert abs(np.abs(PLAN.spline.at(PLAN.t[error.sample])[1][fast]) - PLAN.report.qd_peak[fast]) < 1e-3
    assert "rad/s" in str(error)


def test_a_movement_too_fast_for_its_joints_is_refused():
    error = refused(StraightStrokes(INSIDE_THE_BOX, 0.3), replace(LIMITS, tcp_speed_max=10.0))
    assert error.joint is not None
    assert "give the movement more time" in str(error)


def test_the_tcp_speed_limit_names_the_first_sample_above():
    error = refused(limits=replace(LIMITS, tcp_speed_max=0.1))
    speed = np.linalg.norm(STROKES.sample(PLAN.t)[1], axis=1)
    assert error.sample == pytest.approx(int(np.argmax(speed > 0.1)), abs=1)
    assert "at most 0.1 m/s" in str(error)


def test_the_acceleration_limit_names_joint_and_sample():
    joint = 3
    qdd_max = [1e3] * 6
    qdd_max[joint] = 0.5 * float(PLAN.report.qdd_peak[joint])
    error = refused(limits=replace(LIMITS, qdd_max=tuple(qdd_max)))
    assert error.joint == joint
    peak = np.abs(PLAN.spline.qdd(PLAN.t[error.sample]))[0, joint]
    assert peak == pytest.approx(PLAN.report.qdd_peak[joint])


@pytest.mark.parametrize(("joint", "side"), [(0, "max"), (2, "min"), (5, "max")])
def test_the_end_of_a_joint_range_names_joint_and_sample(joint, side):
    reached = PLAN.q[:, joint].max() if side == "max" else PLAN.q[:, joint].min()
    bound = list(UR3.limits.q_max if side == "max" else UR3.limits.q_min)
    bound[joint] = float(reached) + (
        0.05 if side == "max" else -0.05
    )  # inside, but nearer than the margin of .1
    error = refused(model=arm_with(**{f"q_{side}": tuple(bound)}))
    assert error.joint == joint
    assert PLAN.q[error.sample, joint] == reached
    assert "end of its range" in str(error)
    assert plan_movement(STROKES, model=arm_with(), limits=LIMITS).report.joint_range.share < 1


def test_too_near_the_base_plane_is_refused_with_the_link():
    low = StraightStrokes([(0.35, 0.0, 0.25), (0.35, 0.0, 0.03)], 4.0)
    error = refused(low)
    assert "wrist 1 comes within" in str(error)
    assert error.joint == 3
    t = np.linspace(0, 4.0, 1001)
    # The lowest sample of the path is the offender.
    assert low.sample(t)[0][error.sample, 2] == pytest.approx(0.03, abs=1e-9)


def test_too_near_itself_is_refused():
    more = LIMITS.clearance_min._replace(own=PLAN.report.clearance.own.extreme.value + 1e-3)
    error = refused(limits=replace(LIMITS, clearance_min=more))
    assert " comes within " in str(error)
    assert error.joint == PLAN.report.clearance.own.nearest.joint


@pytest.mark.parametrize(("end", "word"), [(0, "begins"), (-1, "ends")])
def test_a_movement_must_begin_and_end_at_rest(end, word):
    def spoil(t, p, v):
        v[end] = (0.0, 0.05, 0.0)

    error = refused(Spoiled(STROKES, spoil))
    assert f"the movement {word} at 0.050 m/s" in str(error)
    assert error.sample == (0 if end == 0 else len(PLAN.t) - 1)


def test_a_coarse_plan_that_would_leave_the_path_is_refused():
    error = refused(
        Arc((0.35, 0, 0.25), 0.07, 4 * np.pi, 4.0), dt=0.5, limits=replace(LIMITS, joint_step_max=3)
    )
    assert "the joint spline leaves the movement" in str(error)


class Strange(StraightStrokes):
    """Strokes of another duration, or with fewer coordinates, than they should have."""

    def __init__(self, duration=3.0, n_coordinates=3):
        super().__init__(INSIDE_THE_BOX)
        self.duration, self.n_coordinates = duration, n_coordinates

    def sample(self, t):
        return tuple(values[:, : self.n_coordinates] for values in super().sample(t))


@pytest.mark.parametrize(
    ("movement", "options", "words"),
    [
        *((STROKES, {"dt": dt}, "time between samples") for dt in (0.0, -0.004, np.nan)),
        *((Strange(duration), {}, "positive duration") for duration in (0.0, -1.0, np.nan)),
        (Strange(n_coordinates=2), {}, "shape"),
    ],
)
def test_what_is_no_movement_or_no_step_is_refused(movement, options, words):
    assert words in str(refused(movement, **options))


def test_whole_turns_shift_a_plan_within_the_joint_ranges():
    turns = np.array((0, 1, 1, 0, 0, -1))
    shifted = PLAN.shifted(turns)
    np.testing.assert_allclose(shifted.q, PLAN.q + 2 * np.pi * turns)
    np.testing.assert_allclose(shifted.spline.at(1.0)[0], PLAN.spline.at(1.0)[0] + 2 * np.pi * turns)
    np.testing.assert_allclose(dh_pose(shifted.q[77])[:3, 3], PLAN.p[77], atol=1e-9)
    assert shifted.report.joint_range.value == pytest.approx(2 * np.pi - np.abs(shifted.q).max())
    assert PLAN.shifted(np.zeros(6)) is PLAN


@pytest.mark.parametrize("turns", [(0, 0, 0, 0, 0, 1), (2, 0, 0, 0, 0, 0)])
def test_turns_that_leave_a_joint_range_are_refused(turns):
    with pytest.raises(PlanningError, match="end of its range") as caught:
        PLAN.shifted(turns)
    assert caught.value.joint == int(np.argmax(turns))


def test_half_turns_are_refused():
    with pytest.raises(PlanningError, match="whole turns"):
        PLAN.shifted((0.5, 0, 0, 0, 0, 0))


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


def names_sample(error):
    return f"sample {error.sample} of" in str(error)


def test_out_of_reach_names_the_first_sample_there_and_the_elbow():
    movement = StraightStrokes([(0.35, 0, 0.25), (0.70, 0, 0.25)], 4.0, name="too far")
    error = refused(movement)
    assert str(error).startswith("too far: ")
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


def test_a_start_behind_a_singularity_is_refused_though_the_arm_could_stand_there():
    start = (-0.106, -0.199, 0.144)
    movement = Movement.through([start, (-0.106, -0.219, 0.144)])
    with pytest.raises(PlanningError, match="without passing a singularity"):
        plan_movement(movement, model=UR3)


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


@pytest.mark.parametrize(("index", "value", "word"), [(0, np.nan, "position"), (1, np.inf, "velocity")])
def test_what_is_no_number_is_named_with_its_sample(index, value, word):
    def spoil(t, *of_movement):
        of_movement[index][2 * 137, 1] = value  # the movement is sampled twice as finely as the plan

    error = refused(Spoiled(StraightStrokes(INSIDE_THE_BOX), spoil))
    assert error.sample == 137
    assert f"{word} is not finite" in str(error)


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
