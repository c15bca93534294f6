"""Moves from waypoint to waypoint, cycle by cycle: limits, path, arrival, blends. Scripts: chunks `motion_*`, `watched/moves`."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from motion_support import (
    DT,
    HOME,
    START,
    TOOL,
    at,
    distance_to_polyline,
    follow_when_open,
    line,
    positions,
    run_to_end,
    tool_accelerations,
    tool_velocities,
)

from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.motion.leg import move_j
from ur_emulator.machine.motion.move import Follow, Move

offsets = st.tuples(*[st.floats(-0.08, 0.08)] * 3, *[st.floats(-0.3, 0.3)] * 3)
V, A = 0.25, 1.2


@given(offsets, st.floats(0.05, 0.3), st.floats(0.3, 3.0))
def test_movel_keeps_its_limits_stays_on_the_line_and_arrives_exactly(way, v, a):
    assume(math.dist(way[:3], (0, 0, 0)) > 0.045)
    goal = at(*way)
    move = Move(line(START, goal, v=v, a=a))
    targets = run_to_end(move)
    speed = np.linalg.norm(tool_velocities(targets), axis=1)
    assert speed.max() <= v * (1 + 1e-6)
    # The last cycle is cut short; the change of speed in it is not larger, but falls into less time.
    assert tool_accelerations(targets)[:-1].max() <= a * (1 + 1e-3) + 1e-6
    assert tool_accelerations(targets)[-1] <= a * (1 + 1e-3) + 1e-6
    assert distance_to_polyline(positions(targets), [START[:3], goal[:3]]).max() < 1e-4
    assert TOOL.pose(targets[-1].q) == pytest.approx(goal, abs=1e-9)
    assert targets[-1].qd == ZERO6


def test_positions_are_the_integral_of_velocities():
    targets = run_to_end(Move(line(START, at(0.06, 0.05, -0.04, 0.2, 0.1, 0.3))))
    q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    steps = np.diff(q, axis=0) / DT
    assert np.abs(steps - 0.5 * (qd[1:] + qd[:-1]))[:-1].max() < 5e-3


@pytest.mark.parametrize("make", [lambda: line(START, at(0.08, 0, 0)), lambda: _joints(0.8)])
def test_half_the_speed_takes_twice_the_time_on_the_same_path(make):
    fast, slow = run_to_end(Move(make())), run_to_end(Move(make()), scale=0.5)
    assert len(slow) - 1 == pytest.approx(2 * (len(fast) - 1), abs=1)
    assert slow[60].q == pytest.approx(fast[30].q, abs=1e-9)
    assert slow[60].qd == pytest.approx([0.5 * x for x in fast[30].qd], abs=1e-9)


def corner_moves(second, r=0.02, **limits):
    corner = at(0.08, 0.0, 0.0)
    first = line(START, corner, r=r, **limits)
    return first, line(corner, second, first.goal, **limits), corner


@given(st.floats(0.0, 3.1), st.floats(0.002, 0.035), st.floats(0.1, 0.3))
def test_a_blend_of_movels_keeps_limits_and_stays_within_r(angle, r, v):
    first, second, corner = corner_moves(
        at(0.08 + 0.07 * math.cos(angle), 0.07 * math.sin(angle), 0.0), r=r, v=v
    )
    targets, outcomes = follow_when_open(Move(first), [second])
    assert outcomes == [Follow.BLENDED]
    assert np.linalg.norm(tool_velocities(targets), axis=1).max() <= v * (1 + 1e-6)
    assert tool_accelerations(targets).max() <= A * (1 + 1e-3) + 1e-6
    points = positions(targets)
    off_path = distance_to_polyline(points, [START[:3], corner[:3], second.goal_pose[:3]]) > 1e-4
    assert np.linalg.norm(points[off_path] - corner[:3], axis=1).max(initial=0.0) <= r
    assert TOOL.pose(targets[-1].q) == pytest.approx(second.goal_pose, abs=1e-9)


def test_a_blend_does_not_stop():
    first, second, _ = corner_moves(at(0.08, 0.08, 0.0))
    targets, _ = follow_when_open(Move(first), [second])
    speed = np.linalg.norm(tool_velocities(targets), axis=1)
    # The parabola's apex is slower than its ends by the cosine of half the corner.
    assert speed[30:-30].min() > 0.12


def _joints(angle, **limits):
    return move_j(HOME, (HOME[0] + angle, *HOME[1:]), TOOL, **({"a": 1.4, "v": 1.05} | limits))


def test_joint_moves_blend_into_tool_moves_and_back():
    there = _joints(0.5, r=0.04)
    back = line(there.goal_pose, START, there.goal, r=0.04)
    again = move_j(back.goal, there.goal, TOOL, a=1.4, v=1.05)
    targets, outcomes = follow_when_open(Move(there), [back, again])
    assert outcomes == [Follow.BLENDED] * 2
    assert targets[-1].q == pytest.approx(there.goal, abs=1e-9)
    qd = np.array([t.qd for t in targets])
    assert np.abs(qd[25:-40]).max(axis=1).min() > 0.02  # never at rest between
    steps = np.abs(np.diff(qd, axis=0)).max(axis=1) / DT
    assert steps.max() < 15.0  # no jump of the velocity: a wrist that turns back needs that much here
    points = positions(targets)
    for waypoint in (there.goal_pose, back.goal_pose):
        assert np.linalg.norm(points - waypoint[:3], axis=1).min() < 0.04


def test_a_waypoint_is_left_out_only_if_the_arm_gets_to_the_next_one_without_it():
    near, goal = at(-0.08, 0.02, 0.0), at(-0.14, 0.0, 0.0)
    first = line(START, at(-0.08, 0.0, 0.0), r=0.02)
    q = TOOL.joints(near, HOME)
    turn = move_j(first.goal, (*q[:5], q[5] - 2 * math.pi), TOOL, a=1.4, v=1.05, r=0.02)
    last = line(near, goal, turn.goal)
    targets, outcomes = follow_when_open(Move(first), [turn, last])
    assert outcomes == [Follow.SKIPPED, Follow.BLENDED]
    # Without the waypoint wrist 3 would not make its turn.
    assert targets[-1].q == pytest.approx(last.goal, abs=1e-8)
    assert targets[-1].q[5] < -5.0
    assert np.abs(np.diff([t.q for t in targets], axis=0)).max() < 3.2 * DT


def test_a_late_follower_gets_a_smaller_blend_or_none_but_never_a_jump():
    first, second, _ = corner_moves(START, r=0.03)
    for late in range(0, 40, 4):
        move = Move(first)
        targets = [JointTarget(HOME)]
        waited = 0
        followed = None
        while not move.done:
            targets.append(move.step(targets[-1], DT, 1.0))
            if move.open and not move.done and followed is None:
                waited += 1
                if waited > late:
                    followed = move.follow(second)
        assert tool_accelerations(targets).max() <= A * (1 + 1e-3)
