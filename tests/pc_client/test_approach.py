"""The approach: straight joint lines over time, and a clear way from any posture to the start of a plan."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from closed_form_ik import dh_pose, frames
from hypothesis import given, settings
from hypothesis import strategies as st
from planning_paths import INSIDE_THE_BOX, StraightStrokes

from pc_client.errors import PlanningError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import robot_model
from pc_client.planning.approach import JointLines, _raised, plan_approach
from pc_client.planning.plan import plan_movement

angle = st.floats(-6.0, 6.0)
posture = st.lists(angle, min_size=6, max_size=6).map(np.array)
distances = st.lists(posture, min_size=2, max_size=4)
limits = {"v": st.floats(0.05, 0.5), "a": st.floats(0.05, 0.8)}


@given(postures=distances, **limits)
def test_it_begins_and_ends_at_rest_in_the_first_and_the_last_posture(postures, v, a):
    lines = JointLines(postures, v, a)
    for t, wanted in (
        (-1.0, postures[0]),
        (0.0, postures[0]),
        (lines.duration, postures[-1]),
        (99.0, postures[-1]),
    ):
        if t > 0.0:
            t = max(t, lines.duration)
        q, qd = lines.at(t)
        np.testing.assert_allclose(q, wanted, atol=1e-12)
        assert not qd.any()


@given(distance=st.floats(1e-4, 6.0), **limits)
def test_the_leading_joint_has_the_trapezoid_of_v_and_a(distance, v, a):
    lines = JointLines([np.zeros(6), np.array((0, -distance, distance / 2, 0, 0, 0))], v, a)
    t = np.linspace(0.0, lines.duration, 401)
    expected = np.minimum(np.minimum(a * t, v), a * (lines.duration - t))
    q, qd = (np.array(x) for x in zip(*(lines.at(time) for time in t), strict=True))
    np.testing.assert_allclose(-qd[:, 1], expected, atol=1e-6)
    np.testing.assert_allclose(qd[:, 2], -qd[:, 1] / 2, atol=1e-12)
    np.testing.assert_allclose(np.trapezoid(qd[:, 1], t), -distance, rtol=5e-3)
    np.testing.assert_allclose(q[:, 2], -q[:, 1] / 2, atol=1e-12)


@given(postures=distances, **limits)
def test_it_stays_on_the_lines_and_rests_at_each_posture(postures, v, a):
    lines = JointLines(postures, v, a)
    step = 0.05
    times = np.arange(0.0, lines.duration, step)
    q = np.array([lines.at(t)[0] for t in times])
    assert (np.abs(np.diff(q, axis=0)) <= v * step + 1e-9).all()
    end = 0.0
    for begin, goal in pairwise(postures):
        end += JointLines([begin, goal], v, a).duration
        at_posture, qd = lines.at(end)
        np.testing.assert_allclose(at_posture, goal, atol=1e-6)
        assert np.abs(qd).max() <= 1e-6
        middle = lines.at(end - JointLines([begin, goal], v, a).duration / 2)[0]
        np.testing.assert_allclose(middle, (begin + goal) / 2, atol=1e-6)


def test_no_distance_takes_no_time():
    here = np.full(6, 0.3)
    lines = JointLines([here, here, here], 0.5, 0.8)
    assert lines.duration == 0.0
    assert lines.at(0.0)[0] == pytest.approx(here)


UR3 = robot_model("ur3")
PLAN = plan_movement(StraightStrokes(INSIDE_THE_BOX, 1.5), model=UR3)
FLOOR_MARGIN, OWN_MARGIN, _ = PLAN.report.limits.clearance_min
HOME = np.radians((0, -90, 0, -90, 0, 0))


def path(approach, step=0.01):
    """All postures of an approach, finely."""
    postures = [approach.q_from, *approach.waypoints]
    for begin, end in pairwise(postures):
        n = int(np.abs(end - begin).max() / step) + 2
        yield from (begin + s * (end - begin) for s in np.linspace(0, 1, n))


def assert_above_the_plane(approach):
    """Joint centres and TCP, by the DH table alone, stay above the plane."""
    for q in path(approach):
        heights = [T[2, 3] for T in frames(q)]
        assert min(heights[1:]) >= FLOOR_MARGIN


def test_from_home_the_direct_route_is_taken():
    approach = plan_approach(PLAN, HOME, model=UR3)
    assert approach.plan is PLAN
    assert len(approach.waypoints) == 1
    np.testing.assert_array_equal(approach.waypoints[-1], PLAN.start_q)
    assert approach.clearance.floor >= FLOOR_MARGIN
    assert approach.clearance.own >= OWN_MARGIN
    assert_above_the_plane(approach)


@settings(max_examples=30)
@given(st.lists(st.integers(-1, 1), min_size=6, max_size=6), st.floats(-0.3, 0.3))
def test_turns_of_the_present_posture_are_kept_not_unwound(turns, offset):
    q_now = PLAN.start_q + 2 * np.pi * np.array(turns) + offset
    margin = 2 * np.pi - 0.1
    q_now = np.where(np.abs(q_now) > margin - 0.5, q_now - 2 * np.pi * np.array(turns), q_now)
    approach = plan_approach(PLAN, q_now, model=UR3)
    target = approach.waypoints[-1]
    np.testing.assert_array_equal(target, approach.plan.start_q)
    # It is the plan's start up to whole turns, reached with less than half a turn wherever ranges allow it.
    shift = (target - PLAN.start_q) / (2 * np.pi)
    np.testing.assert_allclose(shift, np.rint(shift), atol=1e-9)
    np.testing.assert_allclose(dh_pose(target)[:3, 3], PLAN.p[0], atol=1e-9)
    allowed = np.abs(np.stack((approach.plan.report.q_min, approach.plan.report.q_max))).max()
    assert allowed <= margin
    for joint in range(6):
        options = [PLAN.start_q[joint] + 2 * np.pi * k for k in (-2, -1, 0, 1, 2)]
        fitting = [
            option
            for option in options
            if max(
                abs(PLAN.report.q_min[joint] + option - PLAN.start_q[joint]),
                abs(PLAN.report.q_max[joint] + option - PLAN.start_q[joint]),
            )
            <= margin
        ]
        assert (
            abs(target[joint] - q_now[joint]) <= min(abs(option - q_now[joint]) for option in fitting) + 1e-9
        )


def test_already_there_it_takes_no_time():
    approach = plan_approach(PLAN, PLAN.start_q, model=UR3)
    assert approach.duration == pytest.approx(0.0, abs=1e-9)
    assert len(approach.waypoints) == 1


def test_when_the_direct_line_is_not_clear_the_arm_is_raised_first():
    # Wrist 2 is bent to the side on which wrist 1 would swing the flange into the forearm.
    q_now = np.radians((-30, -100, 90, 10, -90, -130))
    approach = plan_approach(PLAN, q_now, model=UR3)
    line = q_now + np.linspace(0, 1, 400)[:, None] * (approach.plan.start_q - q_now)
    hulls = clearance_model(UR3)
    assert hulls.along(line).own.least.min() < OWN_MARGIN
    assert len(approach.waypoints) == 2
    np.testing.assert_array_equal(approach.waypoints[-1], approach.plan.start_q)
    fine = hulls.along(np.array(list(path(approach))))
    assert fine.own.least.min() >= OWN_MARGIN - 1e-3
    assert approach.clearance.own == pytest.approx(fine.own.least.min(), abs=1e-3)
    assert approach.clearance.floor == pytest.approx(fine.floor.least.min(), abs=2e-3)
    assert_above_the_plane(approach)
    np.testing.assert_array_equal(approach.motion.at(approach.duration)[0], approach.plan.start_q)


def test_the_elbow_takes_the_longer_route_where_the_shorter_one_is_folded():
    # 80 deg is nearer to -127 deg by way of 180, where the arm is folded onto itself.
    q_now = np.radians((-110, -140, 80, -140, -10, 170))
    approach = plan_approach(PLAN, q_now, model=UR3)
    np.testing.assert_allclose(approach.plan.start_q[2], PLAN.start_q[2])
    assert approach.clearance.own >= OWN_MARGIN


@pytest.mark.parametrize("turns", [(-6.2, -6.2), (6.2, 6.2), (-6.2, 6.2), (0.1, -0.1)])
def test_raised_postures_stay_within_the_joint_ranges(turns):
    q = np.array((0.4, turns[0], turns[1], turns[0], turns[1], 0.5))
    raised = _raised(q)
    assert np.abs(raised).max() < 2 * np.pi
    np.testing.assert_array_equal(raised[[0, 5]], q[[0, 5]])
    # Straight up, by the DH table alone: both links above the shoulder.
    chain = frames(raised)
    assert chain[2][2, 3] == pytest.approx(0.1519 + 0.24365 + 0.21325, abs=1e-9)


@settings(max_examples=12)
@given(st.integers(0, 10**6))
def test_from_any_clear_posture_the_route_found_is_clear(seed):
    rng = np.random.default_rng(seed)
    q_now = np.radians(rng.uniform((-180, -200, -150, -200, -180, -180), (180, 20, 150, 20, 180, 180)))
    turned = q_now + 2 * np.pi * rng.integers(-1, 2, 6)
    q_now = np.where(np.abs(turned) < 2 * np.pi, turned, q_now)
    try:
        approach = plan_approach(PLAN, q_now, model=UR3)
    except PlanningError as error:
        assert "not clear" in str(error)  # noqa: PT017 - one of two allowed outcomes
        return
    np.testing.assert_array_equal(approach.waypoints[-1], approach.plan.start_q)
    assert np.abs(approach.waypoints).max() <= 2 * np.pi
    assert_above_the_plane(approach)
    assert approach.clearance.floor >= FLOOR_MARGIN
    assert approach.clearance.own >= OWN_MARGIN


def test_an_arm_that_lies_on_the_table_is_refused_before_anything_moves():
    with pytest.raises(PlanningError, match="the present posture is not clear") as caught:
        plan_approach(PLAN, np.radians((0, 12, 0, -90, 0, 0)), model=UR3)
    assert caught.value.joint is not None
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("q_now", "joint"),
    [((0, 0, 0, 0, 0, 7.0), 5), ((-6.5, 0, 0, 0, 0, 0), 0), ((0, 0, np.nan, 0, 0, 0), 2)],
)
def test_a_present_posture_outside_the_ranges_is_refused_with_its_joint(q_now, joint):
    with pytest.raises(PlanningError, match="outside its range") as caught:
        plan_approach(PLAN, q_now, model=UR3)
    assert caught.value.joint == joint


def test_five_joints_are_not_an_arm():
    with pytest.raises(PlanningError, match="six joint angles"):
        plan_approach(PLAN, np.zeros(5), model=UR3)


@pytest.mark.parametrize(("name", "reach"), [("ur3", 0.5), ("ur5", 0.85), ("ur10", 1.3)])
def test_during_the_approach_the_flange_of_any_arm_is_slow(name, reach):
    model = robot_model(name)
    centre = ROBOTS[name].working_box.centre
    plan = plan_movement(StraightStrokes([centre, centre + np.array((0.0, 0.1, 0.0))], 2.0), model=model)
    approach = plan_approach(plan, HOME, model=model)
    assert approach.v * reach == pytest.approx(0.25)
    assert approach.a * reach == pytest.approx(0.4)
    np.testing.assert_array_equal(approach.waypoints[-1], approach.plan.start_q)
