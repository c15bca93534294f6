from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from closed_form_ik import dh_pose
from planning_paths import INSIDE_THE_BOX, Arc, Spoiled, StraightStrokes

from pc_client.errors import PlanningError
from pc_client.kinematics.arms import JointLimits
from pc_client.kinematics.model import RobotModel, robot_model
from pc_client.planning.approach import plan_text
from pc_client.planning.limits import limits_of
from pc_client.planning.plan import plan_movement

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


def test_the_spline_stays_on_the_movement_between_samples():
    t = np.random.default_rng(10).uniform(0, PLAN.duration, 300)
    reached = np.array([dh_pose(q)[:3, 3] for q in PLAN.spline.sample(t)[0]])
    assert np.linalg.norm(reached - STROKES.sample(t)[0], axis=1).max() < 1e-6


def test_a_plan_is_sealed():
    with pytest.raises(FrozenInstanceError):
        PLAN.name = "other"
    for values in (PLAN.q, PLAN.p, PLAN.t, PLAN.start_q):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


def test_samples_lie_on_a_whole_number_of_steps():
    plan = plan_movement(Arc((0.35, 0, 0.25), 0.05, 1.5, duration=1.2345), model=UR3)
    steps = np.diff(plan.t)
    assert steps.max() <= 0.004 + 1e-12
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    assert plan.t[-1] == plan.duration == 1.2345


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
    error = refused(limits=replace(LIMITS, own_clearance_min=PLAN.report.own_clearance.extreme.value + 1e-3))
    assert " comes within " in str(error)
    assert error.joint == PLAN.report.own_clearance.nearest.joint


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


@pytest.mark.parametrize("dt", [0.0, -0.004, np.nan])
def test_a_senseless_step_is_refused(dt):
    assert "time between samples" in str(refused(dt=dt))


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan])
def test_a_movement_without_duration_is_refused(duration):
    movement = StraightStrokes(INSIDE_THE_BOX)
    movement.duration = duration
    assert "positive duration" in str(refused(movement))


def test_a_movement_of_wrong_shape_is_refused():
    class Flat(StraightStrokes):
        def sample(self, t):
            p, v = super().sample(t)
            return p[:, :2], v[:, :2]

    assert "shape" in str(refused(Flat(INSIDE_THE_BOX)))


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


def test_the_plan_in_words_holds_what_the_arm_will_do():
    text = plan_text(PLAN)
    report = PLAN.report
    assert f"{report.duration:.2f} s" in text
    assert f"{report.tcp_speed.value:.3f} m/s" in text
    assert f"{np.degrees(report.joint_speed.value):.0f} deg/s" in text
    assert f"{report.box_min[0]:.3f}..{report.box_max[0]:.3f}" in text
    assert "joint range" in text
    assert "ur3" in text
    assert max(map(len, text.splitlines())) <= 120


@pytest.mark.parametrize("name", ["ur5", "ur10"])
def test_the_larger_arms_plan_the_same_kind_of_movement(name):
    model = robot_model(name)
    from pc_client.kinematics.model import tcp_pose

    centre = tcp_pose(model, model.description.q_branch)[:3, 3]
    plan = plan_movement(Arc(centre, 0.08, duration=4.0), model=model)
    assert plan.report.robot == name
    assert plan.report.position_error.value <= 1e-9


def test_limits_are_those_given():
    assert isinstance(PLAN.report.joint_limits, JointLimits)
    assert PLAN.report.limits == LIMITS
