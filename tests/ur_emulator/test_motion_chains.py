"""Chains of moves: many waypoints close together, sharp corners, singularities, random chains."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from motion_support import (
    ARM,
    DT,
    HOME,
    START,
    TOOL,
    at,
    distance_to_polyline,
    positions,
    run_chain,
    run_to_end,
    tool_accelerations,
    tool_velocities,
)

from ur_emulator.machine.controller.safety.limit_checks import SetpointCheck
from ur_emulator.machine.controller.safety.safety_state import limits_of
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.motion.leg import move_j, move_tool
from ur_emulator.machine.motion.move import Follow, Move
from ur_emulator.machine.motion.path import PoseLine, arc_through
from ur_emulator.machine.motion.path_samples import JOINT_ACCELERATION
from ur_emulator.machine.motion.tool import UnreachableError

V, A = 0.25, 1.2
# Moves close to a singularity at the least speed take longer [s]; they are not tested.
LONGEST = 60.0

LIMITS = limits_of(ARM.robot)
CHECK = SetpointCheck(ARM.robot, DT)


def straight(goal, **limits):
    return lambda q, pose: move_tool(PoseLine(pose, goal), q, TOOL, **({"a": A, "v": V} | limits))


def arc(via, goal, *, fixed=False, **limits):
    return lambda q, pose: move_tool(
        arc_through(pose, via, goal, fixed=fixed), q, TOOL, process=True, **({"a": A, "v": V} | limits)
    )


def joints(goal, **limits):
    return lambda q, pose: move_j(q, goal, TOOL, **({"a": 1.4, "v": 1.05} | limits))


def joints_to(pose, **limits):
    def make(q, _):
        goal = TOOL.joints(pose, q)
        if goal is None:
            raise UnreachableError
        return move_j(q, goal, TOOL, **({"a": 1.4, "v": 1.05} | limits))

    return make


def circle(n, radius=0.05):
    return [
        at(radius * (1.0 - math.cos(2 * math.pi * k / n)), radius * math.sin(2 * math.pi * k / n), 0.0)
        for k in range(1, n + 1)
    ]


def speeds(targets):
    return np.linalg.norm(tool_velocities(targets), axis=1)


# --- many waypoints


@pytest.mark.parametrize(("spacing", "process"), [(0.002, False), (0.005, True)])
def test_waypoints_close_together_do_not_slow_the_tool_down(spacing, process):
    corners = [at(spacing * k, 0.0, 0.0) for k in range(1, round(0.12 / spacing) + 1)]
    makers = [straight(p, r=0.4 * spacing, process=process) for p in corners[:-1]]
    targets, legs, _ = run_chain([*makers, straight(corners[-1], process=process)])
    assert len(legs) == len(corners)
    plain = run_to_end(Move(straight(corners[-1])(HOME, START)))
    # As fast as the whole way in one move.
    assert len(targets) <= len(plain) + 2
    assert speeds(targets).max() <= V * (1 + 1e-6)
    assert tool_accelerations(targets).max() <= A * (1 + 1e-3) + 1e-6
    assert TOOL.pose(targets[-1].q) == pytest.approx(corners[-1], abs=1e-9)


def test_a_polygon_that_is_nearly_a_circle_has_the_speed_of_one():
    corners = circle(60)
    side = math.dist(corners[0][:3], corners[1][:3])
    makers = [straight(p, r=0.45 * side, process=True) for p in corners[:-1]]
    targets, legs, outcomes = run_chain([*makers, straight(corners[-1], process=True)])
    assert set(outcomes) == {Follow.BLENDED}
    speed = speeds(targets)
    # A circle of this radius allows sqrt(a R) = 0.245 m/s; the blends are a little tighter.
    assert speed[45:-45].min() > 0.2
    assert tool_accelerations(targets).max() <= A * 1.001
    points = positions(targets)
    assert distance_to_polyline(points, [START[:3], *(p[:3] for p in corners)]).max() < 0.3 * side
    for leg in legs:
        assert np.linalg.norm(points - leg.goal_pose[:3], axis=1).min() < 0.45 * side


def test_waypoints_whose_blends_overlap_are_left_out_without_a_stop():
    corners = [at(0.003 * k, 0.0, 0.0) for k in range(1, 41)]
    makers = [straight(p, r=0.004) for p in corners]
    targets, _, outcomes = run_chain([*makers, straight(at(0.126, 0, 0))])
    assert outcomes.count(Follow.SKIPPED) == 26
    assert Follow.REFUSED not in outcomes
    assert len(targets) <= len(run_to_end(Move(straight(at(0.126, 0, 0))(HOME, START)))) + 2


@pytest.mark.parametrize("fixed", [False, True])
def test_an_arc_begins_at_the_waypoint_before_it_also_where_blends_overlap(fixed):
    near, via, goal = at(0.08, 0.03, 0.0), at(0.11, 0.06, 0.0), at(0.08, 0.09, 0.0)
    makers = [
        straight(at(0.08, 0.0, 0.0), r=0.02),
        straight(near, r=0.02),
        arc(via, goal, fixed=fixed, v=0.1),
    ]
    targets, legs, outcomes = run_chain(makers)
    assert outcomes == [Follow.SKIPPED, Follow.BLENDED]
    assert len(legs) == 3
    # The blends take at most half of the way between the waypoints; from there on it is the circle.
    points = positions(targets)
    assert np.linalg.norm(points - near[:3], axis=1).min() < 0.015
    on_arc = points[np.linalg.norm(points - via[:3], axis=1) < 0.03]
    assert np.linalg.norm(on_arc - at(0.08, 0.06, 0.0)[:3], axis=1) == pytest.approx(0.03, abs=1e-6)


@pytest.mark.parametrize("t", [0.3, 1.0])
def test_moves_with_a_duration_keep_it_in_a_chain(t):
    makers = [straight(at(0.03 * k, 0.0, 0.0), t=t, r=0.004) for k in range(1, 4)]
    targets, _, outcomes = run_chain([*makers, straight(at(0.12, 0.0, 0.0), t=t)])
    assert outcomes == [Follow.BLENDED] * 3
    assert (len(targets) - 1) * DT == pytest.approx(4 * t, rel=0.03)
    # From rest, and to rest, the tool needs the middle speed of the way to be faster at the other end.
    assert speeds(targets).max() < 2.0 * 0.03 / t


# --- bends


@pytest.mark.parametrize("v", [0.25, 0.8])
@pytest.mark.parametrize("r", [0.001, 0.01])
def test_corners_of_process_moves_keep_the_acceleration(r, v):
    corners = [at(0.08, 0, 0), at(0.08, 0.08, 0), at(0.0, 0.08, 0)]
    makers = [straight(p, r=r, v=v, process=True) for p in corners[:-1]]
    targets, _, outcomes = run_chain([*makers, straight(corners[-1], v=v, process=True)])
    assert outcomes == [Follow.BLENDED] * 2
    assert tool_accelerations(targets).max() <= A * 1.001
    # Through the arc as fast as its radius, here r, allows.
    assert speeds(targets)[40:-40].min() == pytest.approx(min(v, math.sqrt(A * r)), rel=0.03)


@settings(max_examples=15)
@given(st.floats(0.005, 0.05), st.floats(0.1, 2.0), st.booleans())
def test_arcs_keep_the_acceleration(radius, v, fixed):
    via, goal = at(radius, radius, 0.0), at(2 * radius, 0.0, 0.0)
    targets, _, _ = run_chain([arc(via, goal, fixed=fixed, v=v)])
    assert tool_accelerations(targets).max() <= A * 1.001
    assert speeds(targets).max() <= min(v, math.sqrt(A * radius)) * 1.001


def test_a_turn_in_a_small_blend_keeps_the_acceleration():
    corner = at(0.05, 0, 0, 1.0, 0, 0)
    targets, _, outcomes = run_chain(
        [straight(corner, r=0.003, v=0.5), straight(at(0.1, 0, 0, 1.0, 0.8, 0), v=0.5)]
    )
    assert outcomes == [Follow.BLENDED]
    turning = np.array([TOOL.twist(t.q, t.qd)[3:] for t in targets])
    # A turn counts like the way of a point 0.1 m away.
    assert np.linalg.norm(np.diff(turning, axis=0), axis=1).max() / DT <= A / 0.1 * 1.05


# --- singularities

WRIST = (0.0, -1.4, -1.9, -1.4, 0.12, 0.3)  # joint 5 close to where axes 4 and 6 are parallel


def test_near_a_singularity_the_tool_slows_down_for_the_joints():
    start = TOOL.pose(WRIST)
    goal = (start[0], start[1] + 0.1, start[2], *start[3:])
    move = Move(move_tool(PoseLine(start, goal), WRIST, TOOL, a=A, v=1.0))
    targets = run_to_end(move, WRIST)
    qd = np.array([t.qd for t in targets])
    limits = np.array(ARM.robot.qd_max)
    assert (np.abs(qd) / limits).max() <= 1.0
    assert np.abs(np.diff(qd, axis=0)).max() / DT <= 1.3 * JOINT_ACCELERATION
    assert TOOL.pose(targets[-1].q) == pytest.approx(goal, abs=1e-9)
    assert distance_to_polyline(positions(targets), [start[:3], goal[:3]]).max() < 1e-4
    for before, after in itertools.pairwise(targets):
        assert CHECK.find_invalid(LIMITS, before, after) is None


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["q", "qd"])
def test_a_set_point_that_is_not_a_finite_number_is_invalid(joint, value, field):
    before = JointTarget(HOME)
    values = list(getattr(before, field))
    values[joint] = value
    found = CHECK.find_invalid(LIMITS, before, before._replace(**{field: tuple(values)}))
    assert found is not None
    assert (found.error.code, found.error.argument) == (204, joint)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("q", "qd", "is_valid"),
    [
        (6.2, 2.0, True),  # from 2 rad/s the arm stops within 0.1 rad
        (6.3, 2.0, False),  # it would come to rest beyond 363 degrees
        (6.3, -2.0, True),
        (6.4, 0.1, False),
        (6.4, -0.1, True),  # what was pushed beyond the range may move back
        (0.0, 3.34, True),
        (0.0, 3.35, False),  # faster than 191.5 degrees a second
    ],
)
def test_a_set_point_leaves_the_way_to_rest_within_the_range(side, q, qd, is_valid):
    before = JointTarget((side * (q - qd * DT), *HOME[1:]))
    found = CHECK.find_invalid(LIMITS, before, JointTarget((side * q, *HOME[1:]), (side * qd, *ZERO6[1:])))
    assert (found is None) is is_valid


def test_a_set_point_that_jumps_is_invalid_at_any_speed():
    found = CHECK.find_invalid(LIMITS, JointTarget(HOME), JointTarget((HOME[0] + 0.03, *HOME[1:])))
    assert found is not None
    assert found.error.argument == 0


# --- random chains

places = st.builds(at, *[st.floats(-0.08, 0.08)] * 3, *[st.floats(-0.6, 0.6)] * 3)
angles = st.tuples(*[st.floats(-0.5, 0.5)] * 6).map(
    lambda d: tuple(q + x for q, x in zip(HOME, d, strict=True))
)
radii = st.sampled_from([0.0, 0.002, 0.01, 0.03])
tool_limits = {"v": st.sampled_from([0.05, 0.25, 1.0]), "a": st.sampled_from([0.3, 1.2, 5.0])}
joint_limits = {"v": st.sampled_from([0.3, 1.05, 3.0]), "a": st.sampled_from([0.5, 1.4, 10.0])}
moves = st.one_of(
    st.builds(straight, places, r=radii, process=st.booleans(), **tool_limits),
    st.builds(arc, places, places, r=radii, fixed=st.booleans(), **tool_limits),
    st.builds(joints, angles, r=radii, **joint_limits),
    st.builds(joints_to, places, r=radii, **joint_limits),
)


def is_accepted(targets):
    pairs = itertools.pairwise(targets)
    return all(CHECK.find_invalid(LIMITS, a, b) is None for a, b in pairs)


def can_be_executed_one_by_one(makers):
    q = HOME
    try:
        for make in makers:
            move = Move(make(q, TOOL.pose(q)))
            if move.duration > LONGEST:
                return False
            alone = run_to_end(move, q, limit=2 * round(LONGEST / DT))
            if not is_accepted(alone):
                return False
            q = alone[-1].q
    except UnreachableError:
        return False
    return True


def check_chain(makers):
    targets, legs, outcomes = run_chain(makers, limit=100_000)
    assert is_accepted(targets)
    at_q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    assert np.abs(np.diff(qd, axis=0)).max(initial=0.0) / DT <= 1.6 * JOINT_ACCELERATION
    assert np.abs(np.diff(at_q, axis=0) / DT - 0.5 * (qd[1:] + qd[:-1])).max(initial=0.0) < 0.25
    assert targets[-1].q == pytest.approx(legs[-1].goal, abs=1e-8)
    assert targets[-1] == JointTarget(targets[-1].q)
    return targets, legs, outcomes


@settings(max_examples=15)
@given(st.lists(moves, min_size=2, max_size=5))
def test_moves_that_can_be_executed_one_by_one_can_be_executed_as_a_chain(makers):
    assume(can_be_executed_one_by_one(makers))
    check_chain(makers)


# Chains that random search has found, in round numbers.
FOUND = {
    "an arc behind a waypoint that overlaps, from another start too fast for the shoulder": [
        joints_to(at(0.009, -0.029, 0.0, -0.579, -0.486, 0.104), r=0.03, v=3.0, a=10.0),
        straight(at(-0.019, -0.027, 0.01, -0.465, -0.3, -0.484), r=0.03, process=True),
        arc(at(0.04, -0.04, 0.062), at(-0.005, -0.014, 0.079), r=0.01, fixed=True, v=1.0),
    ],
    "an arc behind a waypoint that overlaps, from another start out of reach": [
        arc(at(-0.04, -0.062, 0.036), at(0.01, 0.0, -0.015, 0.113, 0.421, -0.043), r=0.01, v=0.05, a=0.3),
        straight(at(0.0, 0.0, -0.027, -0.321, 0.0, 0.0), r=0.01, v=0.05, a=0.3),
        arc(at(0.069, 0.008, -0.027), at(-0.063, -0.044, 0.0, 0.0, -0.194, 0.3), r=0.03, v=1.0, a=0.3),
    ],
    "a line behind a waypoint that overlaps, from another start beyond the range of wrist 3": [
        joints_to(at(0.0, -0.08, 0.007, 0.137, -0.181, -0.323), a=10.0),
        arc(at(0.043, 0.01, -0.045), at(-0.027, 0.018, -0.001), r=0.01, fixed=True),
        joints((0.0, -1.269, -2.008, -1.422, 1.57, 0.796), a=0.5, r=0.03),
        straight(at(-0.04, 0.068, 0.08, 0.327, 0.173, 0.6), r=0.01, v=0.05, process=True),
    ],
    "an arc through the point where the arm has just stopped": [
        straight(at(0, 0, 0, 0, 0.014798705392518471, 0.359375), r=0.002, v=0.05),
        straight(at(0, 0, 0), v=0.05, a=0.3),
        arc(at(0, 0, 0), at(0.03125, 0.0625, 0.0), v=0.05, a=0.3),
    ],
    "a turn and a turn back left out before an arc": [
        joints_to(at(0.0625, 0, 0, 0, 0.5, 0), r=0.002, v=0.3, a=0.5),
        joints_to(at(0.0625, 0, 0, 0, 0.0, 0), r=0.002, v=0.3, a=0.5),
        joints_to(at(0.0625, 0, 0, 0, 0.5, 0), r=0.002, v=0.3, a=0.5),
        arc(at(0, 0, 0), at(0, 0.046875, 0.0625), fixed=True, v=0.05, a=0.3),
    ],
    "a turn of less than rounding behind a blend": [
        joints((0.0, -1.4, -1.9, -1.4, 1.57, 0.77), r=0.01, a=0.5),
        joints((1e-238, -1.4, -1.9, -1.4, 1.57, 0.77), r=0.01, a=10.0),
        arc(at(0.02, 0.04, 0.0), at(0.05, 0.04, 0.0), fixed=True),
    ],
    "an arc that nearly stretches the elbow": [
        arc(at(0.0515, 0.0515, 0.0662), at(0, -0.0244, -0.0533, -0.0522, -0.2713, -0.5921), r=0.03, v=0.05),
        joints((-0.39, -1.9, -1.9, -1.9, 1.094, 0.301)),
    ],
}


@pytest.mark.parametrize("name", FOUND)
def test_chains_that_random_search_has_found_can_be_executed(name):
    assert can_be_executed_one_by_one(FOUND[name])
    check_chain(FOUND[name])


@settings(max_examples=12)
@given(
    st.lists(st.tuples(places, radii), min_size=2, max_size=5),
    st.sampled_from([0.1, 0.25, 0.5]),
    st.booleans(),
)
def test_chains_of_the_tool_keep_to_their_path_and_limits(waypoints, v, process):
    makers = [straight(p, r=r, v=v, process=process) for p, r in waypoints]
    assume(can_be_executed_one_by_one(makers))
    targets, legs, _ = run_chain(makers)
    assert speeds(targets).max() <= v * (1 + 1e-6)
    assert tool_accelerations(targets).max(initial=0.0) <= A * (1 + 5e-3) + 1e-6
    points = positions(targets)
    off_path = distance_to_polyline(points, [START[:3], *(leg.goal_pose[:3] for leg in legs)]) > 1e-4
    for point in points[off_path]:
        assert any(math.dist(point, leg.goal_pose[:3]) <= leg.r + 1e-6 for leg in legs[:-1])
    assert TOOL.pose(targets[-1].q) == pytest.approx(legs[-1].goal_pose, abs=1e-9)


# --- programs and other tools


def test_the_waypoint_is_that_of_the_move_under_way_also_when_more_are_known():
    corners = [at(0.004 * k, 0.0, 0.0) for k in range(1, 25)]
    move = Move(straight(corners[0], r=0.0015)(HOME, START))
    rest = corners[1:]
    target, seen, ahead = JointTarget(HOME), [], 0
    while not move.done:
        while rest and move.open and not move.done:
            r = 0.0015 if len(rest) > 1 else 0.0
            assert (
                move.follow(straight(rest.pop(0), r=r)(move.leg.goal, move.leg.goal_pose)) is Follow.BLENDED
            )
            ahead = max(ahead, len(corners) - len(rest) - len(seen))
        target = move.step(target, DT, 1.0)
        if not seen or move.goal != seen[-1]:
            seen.append(move.goal)
    assert ahead > 3
    goals = [TOOL.joints(p, HOME) for p in corners]
    order = [np.abs(np.subtract(goals, q)).max(axis=1).argmin() for q in seen]
    assert order == sorted(set(order))
    assert order[-1] == len(corners) - 1
