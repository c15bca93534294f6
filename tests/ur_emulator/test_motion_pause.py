"""Pauses: the arm comes to rest on its path and goes on from there."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_support import (
    DT,
    HOME,
    START,
    TOOL,
    Swing,
    at,
    distance_to_polyline,
    line,
    positions,
    renew,
    run_cycles,
)

from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.motion.generators import PAUSE_DECELERATION, JointTarget, ServoJ, SpeedJ
from ur_emulator.machine.motion.leg import move_j, move_tool
from ur_emulator.machine.motion.move import Move
from ur_emulator.machine.motion.ownership import Fate
from ur_emulator.machine.motion.path import arc_through

CORNERS = [START, at(0.06, 0, 0), at(0.06, 0.06, 0)]


@pytest.fixture
def motion():
    return ArmMotion(HOME, 20.0)


def straight():
    return Move(line(START, at(0.06, 0.05, -0.03, 0.2, 0.1, 0.3))), []


def arc():
    path = arc_through(START, at(0.03, 0.03, 0), at(0.06, 0, 0.01, 0, 0, 0.3), fixed=False)
    return Move(move_tool(path, HOME, TOOL, a=1.2, v=0.25)), []


def joints():
    return Move(move_j(HOME, (0.7, -1.2, -1.9, -1.2, 1.3, 0.0), TOOL, a=1.4, v=1.05)), []


def corner():
    first = line(CORNERS[0], CORNERS[1], r=0.02)
    return Move(first), [line(CORNERS[1], CORNERS[2], first.goal)]


def travel(make, pauses=(), limit=5000):
    """All targets of a move, paused at some cycles for some cycles; and the arm."""
    motion = ArmMotion(HOME, 20.0)
    move, legs = make()
    motion.command("me", move)
    changes = {}
    for begin, length in pauses:
        changes[begin] = motion.pause
        changes[begin + length] = motion.resume
    targets = [motion.target]
    for k in range(limit):
        if k > max(changes, default=0) and not motion.is_moving:
            return targets, motion

        changes.get(k, lambda: None)()
        if legs and move.open and not move.done:
            move.follow(legs.pop(0))
        targets.append(motion.step(DT, 1.0))
    raise AssertionError("it does not end")


@settings(max_examples=12)
@given(
    st.sampled_from([straight, arc, joints, corner]),
    st.lists(st.tuples(st.integers(0, 60), st.integers(1, 60)), min_size=1, max_size=2),
)
def test_with_and_without_pauses_the_path_is_the_same(make, pauses):
    plain, _ = travel(make)
    first, *others = pauses
    paused, _ = travel(make, [first, *((first[0] + first[1] + 1 + b, n) for b, n in others)])
    assert paused[-1].q == pytest.approx(plain[-1].q, abs=1e-9)
    assert distance_to_polyline(positions(paused), positions(plain)).max() < 1e-4
    q, qd = np.array([t.q for t in paused]), np.array([t.qd for t in paused])
    largest = max(np.abs(t.qd).max() for t in plain)
    assert np.abs(qd).max() <= largest * 1.01  # sampled at other points
    # The ramp of a pause adds to the accelerations of the path.
    own = np.abs(np.diff([t.qd for t in plain], axis=0)).max()
    assert np.abs(np.diff(qd, axis=0)).max() <= own + largest * 4.0 * DT * 1.02 + 1e-9
    steps = np.diff(q, axis=0) / DT
    assert np.abs(steps - 0.5 * (qd[1:] + qd[:-1])).max() <= own + largest * 4.0 * DT


def test_a_pause_rests_after_a_quarter_of_a_second_and_lasts_as_long_as_it_is_asked_for(motion):
    motion.command("me", straight()[0])
    run_cycles(motion, 20)
    motion.pause()
    assert not motion.is_paused
    run_cycles(motion, 32)
    assert motion.is_paused
    assert not motion.is_moving
    held = motion.target
    assert held.qd == ZERO6
    for _ in range(100):
        assert motion.step(DT, 1.0) == JointTarget(held.q)
    motion.resume()
    assert motion.is_moving
    assert motion.owner == "me"
    while motion.is_moving:
        motion.step(DT, 1.0)
    assert TOOL.pose(motion.target.q) == pytest.approx(at(0.06, 0.05, -0.03, 0.2, 0.1, 0.3), abs=1e-9)


@pytest.mark.parametrize(
    "stream", [SpeedJ((0.5,) * 6, 2.0), ServoJ((0.5, *HOME[1:]), 0.1, 300.0, (3.0,) * 6)]
)
def test_a_stream_ramps_to_rest_and_goes_on_if_it_is_renewed(motion, stream):
    command = motion.command("me", stream)
    renew(motion, command, 40)
    motion.pause()
    before = motion.target
    while not motion.is_paused:
        after = motion.step(DT, 1.0)
        change = np.abs(np.subtract(after.qd, before.qd)).max()
        assert change <= PAUSE_DECELERATION * DT * 1.001
        before = after
    motion.resume()
    renew(motion, command, 200)
    if isinstance(stream, SpeedJ):
        assert motion.target.qd == pytest.approx((0.5,) * 6)
    else:
        assert motion.target.q[0] == pytest.approx(0.5, abs=1e-3)
    run_cycles(motion, 100)
    assert not motion.is_moving


def test_a_stream_that_nobody_renews_after_the_pause_stays_at_rest(motion):
    command = motion.command("me", SpeedJ((0.5,) * 6, 2.0))
    renew(motion, command, 20)
    motion.pause()
    run_cycles(motion, 60)
    q = motion.target.q
    motion.resume()
    run_cycles(motion, 60)
    assert not motion.is_moving
    assert motion.target.q == pytest.approx(q, abs=1e-3)


@pytest.mark.parametrize("pushed", [False, True])
def test_an_interrupted_move_goes_back_to_its_path_and_on_to_its_goal(motion, pushed):
    move, _ = straight()
    motion.command("me", move)
    run_cycles(motion, 20)
    left_at = motion.path.q
    motion.interrupt()
    while not motion.is_paused:
        motion.step(DT, 1.0)
    assert motion.target.q != left_at
    if pushed:
        motion.place(tuple(x + 0.1 for x in motion.target.q))
    motion.resume()
    targets = [motion.target]
    while motion.is_moving:
        targets.append(motion.step(DT, 1.0))
        assert len(targets) < 3000
    assert move.done
    q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    back = np.abs(q - left_at).max(axis=1).argmin()
    assert q[back] == pytest.approx(left_at, abs=1e-9)
    goal = at(0.06, 0.05, -0.03, 0.2, 0.1, 0.3)
    assert distance_to_polyline(positions(targets[back:]), [START[:3], goal[:3]]).max() < 1e-4
    assert TOOL.pose(targets[-1].q) == pytest.approx(goal, abs=1e-9)
    assert np.abs(np.diff(q, axis=0)).max() <= (np.abs(qd).max() + 0.05) * DT
    assert np.abs(qd[:back]).max() <= 0.25 * (1 + 1e-9)


def test_a_move_that_was_not_accepted_is_taken_back(motion):
    move, _ = straight()
    motion.command("me", move)
    run_cycles(motion, 20)
    before = motion.target
    motion.step(DT, 1.0)
    motion.retract(before)
    motion.interrupt()
    run_cycles(motion, 30)
    motion.resume()
    targets = [motion.target]
    while motion.is_moving:
        targets.append(motion.step(DT, 1.0))
    assert np.abs(np.diff([t.qd for t in targets], axis=0)).max() < 0.05
    assert move.done


def test_a_program_that_ends_in_a_pause_leaves_nothing_behind(motion):
    command = motion.command("me", straight()[0])
    run_cycles(motion, 20)
    motion.pause()
    run_cycles(motion, 10)
    motion.stop()
    run_cycles(motion, 30)
    assert not motion.is_moving
    assert not motion.is_paused
    assert motion.owner is None
    assert command.fate is Fate.TAKEN
    assert motion.target.qd == ZERO6


def test_overlays_stand_still_in_a_pause(motion):
    lift = Swing()
    motion.add_overlay(lift)
    targets = run_cycles(motion, 60)
    motion.pause()
    targets += run_cycles(motion, 60)
    assert motion.is_paused
    held = targets[-1]
    assert motion.step(DT, 1.0) == held
    motion.resume()
    targets += run_cycles(motion, 60)
    assert TOOL.pose(motion.target.q)[2] == pytest.approx(
        START[2] + 0.02 * (1.0 - math.cos(2.0 * lift.time)), abs=1e-8
    )
    assert np.abs(np.diff([t.qd for t in targets], axis=0)).max() < 0.02


def test_a_stream_under_an_overlay_comes_to_rest_without_a_jump(motion):
    motion.add_overlay(Swing())
    command = motion.command("me", SpeedJ((1.5, 0, 0, 0, 0, 0), 4.0))
    renew(motion, command, 60)
    targets = [motion.target]
    motion.pause()
    while not motion.is_paused:
        targets.append(motion.step(DT, 1.0))
    targets += run_cycles(motion, 10)
    motion.resume()
    targets += run_cycles(motion, 60)
    assert np.abs(np.diff([t.qd for t in targets], axis=0)).max() < 0.06
    assert np.abs(np.diff([t.q for t in targets], axis=0)).max() < 1.6 * DT
