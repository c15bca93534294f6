"""Moves from waypoint to waypoint, cycle by cycle: limits, path, arrival, blends; then moves in scripts.

What each builtin does is shown by the chunks `motion_*`.
"""

import math

import numpy as np
import pytest
from box_support import Bench
from hypothesis import assume, given, settings
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

from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator.machine.commands.programs import SetSpeedSlider
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.motion.leg import move_j
from ur_emulator.machine.motion.move import Follow, Move

offsets = st.tuples(*[st.floats(-0.08, 0.08)] * 3, *[st.floats(-0.3, 0.3)] * 3)
V, A = 0.25, 1.2


@settings(max_examples=15)
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


@settings(max_examples=15)
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


PLACE = "p[0.25,-0.25,0.25,2.2,-2.2,0]"
POSE = (0.25, -0.25, 0.25, 2.2, -2.2, 0.0)


@pytest.fixture
def bench():
    bench = Bench(fidelity="exact")
    bench.run(f"movej({PLACE}, a=8, v=3)\n")
    bench.events.clear()
    bench.snapshots.clear()
    return bench


def shifted(x, y=0.0, z=0.0):
    return f"pose_add({PLACE},p[{x},{y},{z},0,0,0])"


def distances(bench):
    return np.linalg.norm(np.subtract([s.target_tcp_pose[:3] for s in bench.snapshots], POSE[:3]), axis=1)


def errors(bench):
    return [e for e in bench.events if isinstance(e, ErrorReported)]


@pytest.mark.parametrize("late", [0, 20, 40, 50])
def test_an_arc_behind_a_waypoint_that_overlaps_is_the_programmed_one_however_late_it_comes(bench, late):
    bench.run(
        f"def f():\n  movel({shifted(0.1)}, v=0.1, r=0.03)\n  movel({shifted(0.1, 0.04)}, v=0.1, r=0.03)\n  i = 0\n"
        f"  while i < {late}:\n    sync()\n    i = i + 1\n  end\n"
        f"  movec({shifted(0.13, 0.07)}, {shifted(0.1, 0.1)}, v=0.1)\nend\n"
    )
    assert [e.text for e in errors(bench)] == ["Overlapping Blends"]
    points = np.array([s.target_tcp_pose[:3] for s in bench.snapshots])
    assert points[-1] == pytest.approx((0.35, -0.15, 0.25), abs=1e-9)
    right = points[points[:, 1] > -0.19]
    assert np.linalg.norm(right - (0.35, -0.18, 0.25), axis=1) == pytest.approx(0.03, abs=1e-6)


def test_servoc_may_be_called_with_the_same_pose_all_the_time(bench):
    bench.start(f"def f():\n  while True:\n    servoc({shifted(0.1)}, 1.2, 0.25, 0.02)\n  end\nend\n")
    bench.tick(150)
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.35, -0.25, 0.25), abs=1e-9)
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert not bench.events[1:]


@pytest.mark.parametrize(
    ("robot", "generation", "r"), [("ur3", CB3, 0.0), ("ur5", CB3, 0.05), ("ur5e", E_SERIES, 0.05)]
)
def test_a_duration_that_the_arm_cannot_keep_is_made_longer(robot, generation, r):
    """As the maker's live tests ask: no stop."""
    bench = Bench(robot=robot, generation=generation)
    bench.run("set_pos([-1.57,-1.57,0,-1.57,1.57,0])\n")
    bench.run(
        f"def f():\n  movej([1.57,-1.57,0,-1.57,1.57,0], t=0.1, r={r})\n  movej([1.2,-1.4,-1.9,-1.4,1.57,0], t=0.1)\n"
        "  p = get_target_tcp_pose()\n  p[2] = p[2] - 0.1\n  movel(p, t=0.05)\nend\n"
    )
    assert not errors(bench)
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert bench.now.target_q[0] == pytest.approx(1.2, abs=0.05)
    fastest = max(max(map(abs, s.target_qd)) for s in bench.snapshots)
    qd_max = robot_by_name(robot).qd_max
    assert 0.9 * qd_max[0] < fastest <= max(qd_max)


def test_an_absurd_duration_is_just_slow(bench):
    bench.start(f"movel({shifted(0.1)}, t=1e15)\n")
    bench.tick(20)
    assert bench.now.runtime_state == ProgramState.PLAYING
    assert distances(bench).max() < 1e-9


def test_a_chain_of_all_kinds_of_moves_never_rests_between(bench):
    bench.run(
        f"def f():\n  movej({shifted(0.08)}, r=0.02)\n  movel({shifted(0.08, 0.08)}, r=0.02)\n"
        f"  movep({shifted(0.0, 0.08)}, r=0.02)\n  movec({shifted(-0.04, 0.04)}, {shifted(0.0, 0.0)}, r=0.02)\n"
        f"  movej({shifted(0.05)})\nend\n"
    )
    assert not errors(bench)
    moving = [k for k, s in enumerate(bench.snapshots) if any(s.target_qd)]
    assert moving == list(range(moving[0], moving[-1] + 1))
    speed = np.array([np.linalg.norm(s.target_tcp_speed[:3]) for s in bench.snapshots])
    assert speed[moving[0] + 40 : moving[-1] - 30].min() > 0.05
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.30, -0.25, 0.25), abs=1e-9)


def test_the_speed_slider_is_taken_on_without_a_jump(bench):
    bench.start(f"movel({shifted(0.1)}, v=0.1)\n")
    bench.tick(40)
    bench.snapshots.clear()
    bench.tick(1, SetSpeedSlider(0.1))
    bench.tick(60)
    speed = np.array([s.target_tcp_speed[0] for s in bench.snapshots])
    assert speed[-1] == pytest.approx(0.01, abs=1e-6)
    assert np.abs(np.diff(speed)).max() <= 1.2 * 0.008 * 1.01


@pytest.mark.parametrize("slider", [0.25, 0.3, 1.0])
@pytest.mark.parametrize("generation", [CB3, E_SERIES])
def test_a_spline_of_short_speedj_keeps_its_path_at_any_speed(slider, generation):
    """As the maker's driver script streams splines; its live test sets 25 %."""
    bench = Bench(fidelity="exact", generation=generation)
    bench.tick(1, SetSpeedSlider(slider))
    bench.tick(200)
    bench.snapshots.clear()
    bench.run(
        "def spline():\n  qd = [0,0,0,0,0,0]\n  k = 0\n  dt = get_steptime()\n  while k * dt < 1:\n    k = k + 1\n"
        "    s = k * dt\n    last = qd[5]\n    qd[5] = 12 * s * (1 - s) * (1 - 2 * s)\n"
        "    write_output_float_register(1, s)\n    speedj(qd, norm(qd[5] - last) / dt, dt)\n  end\nend\n"
    )
    start = bench.snapshots[0].target_q[5]
    assert bench.now.target_q[5] == pytest.approx(start, abs=2e-3)
    rows = [(s.registers.output_floats[1], s.target_q[5] - start) for s in bench.snapshots]
    assert max(q for _, q in rows) == pytest.approx(6 * 0.0625, abs=2e-3)
    # The register is ahead of the target by at most one call.
    dt = bench.controller.period_s
    assert (
        max(min(abs(q - 6 * (x * (1 - x)) ** 2) for x in (s, s - 0.5 * dt, s - dt)) for s, q in rows) < 5e-3
    )
