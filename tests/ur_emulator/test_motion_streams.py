"""Motions that scripts renew in every cycle (speedj, servoj, speedl), stops, and who has the arm."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_support import ARM, DT, HOME, START, TOOL, tool_accelerations, tool_velocities

from protocol.pose import pose_sub
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.motion.generators import JointTarget, ServoJ, SpeedJ, StopJ
from ur_emulator.machine.motion.leg import move_j
from ur_emulator.machine.motion.move import Move
from ur_emulator.machine.motion.tool import Tool
from ur_emulator.machine.motion.tool_streams import SpeedL, StopL

FAST = (math.inf,) * 6  # no joint is too slow

twists = st.tuples(*[st.floats(-0.1, 0.1)] * 3, *[st.floats(-0.3, 0.3)] * 3)


def run(generator, target, cycles, scale=1.0):
    targets = [target]
    for _ in range(cycles):
        targets.append(generator.step(targets[-1], DT, scale))
    return targets


def test_servoj_follows_a_goal_that_is_too_fast_at_the_rated_speed_and_arrives():
    """As the maker's tests do: a cubic that peaks above the rated speed, streamed to its end."""
    goals = [1.5 * (3 * s**2 - 2 * s**3) for s in np.linspace(0.0, 1.0, 75)] + [1.5] * 100
    targets = [JointTarget(ZERO6)]
    for goal in goals:
        targets.append(ServoJ((goal,) * 6, 0.03, 2000.0, (3.0,) * 6).step(targets[-1], DT, 1.0))
    assert max(np.diff(goals)) / DT > 3.5
    assert max(target.qd[0] for target in targets) == pytest.approx(3.0)
    assert max(np.diff([target.q[0] for target in targets])) <= 3.0 * DT * (1 + 1e-9)
    assert targets[-1].q[0] == pytest.approx(1.5, abs=1e-4)


@pytest.mark.parametrize(("lookahead", "gain"), [(0.1, 300), (0.1, 2000), (0.05, 1000), (0.2, 300)])
def test_servoj_follows_a_slow_sine_with_the_lag_of_its_lookahead_time(lookahead, gain):
    omega = 2 * math.pi * 0.5
    targets = [JointTarget(ZERO6)]
    for k in range(1000):
        goal = math.sin(omega * k * DT)
        targets.append(ServoJ((goal,) * 6, lookahead, gain, FAST).step(targets[-1], DT, 1.0))
    times = np.arange(250, 1001) * DT
    q = np.array([t.q[0] for t in targets])[250:]
    sine, cosine = (2 * np.mean(q[:750] * f(omega * times[:750])) for f in (np.sin, np.cos))
    # The target of cycle k holds at its end: one cycle after the goal was given.
    lag = math.atan2(-cosine, sine) / omega
    # At low frequencies the lag is the lookahead time itself.
    expected = math.atan2(omega * lookahead * gain, gain - omega**2) / omega
    assert lag == pytest.approx(expected + DT, abs=0.003)
    assert lag == pytest.approx(lookahead + DT, abs=0.02)
    size = gain / math.hypot(gain - omega**2, omega * lookahead * gain)
    assert math.hypot(sine, cosine) == pytest.approx(size, abs=0.01)


@given(st.floats(0.03, 0.2), st.floats(100, 2000), st.floats(-1, 1))
def test_servoj_settles_at_its_goal_for_every_gain_and_lookahead(lookahead, gain, goal):
    targets = run(ServoJ((goal,) * 6, lookahead, gain, FAST), JointTarget(ZERO6), 800)
    assert targets[-1].q == pytest.approx((goal,) * 6, abs=1e-3)
    for before, after in itertools.pairwise(targets):
        assert after.q[0] - before.q[0] == pytest.approx(0.5 * DT * (before.qd[0] + after.qd[0]), abs=1e-12)


def test_a_long_lookahead_prevents_overshoot():
    def highest(lookahead):
        return max(t.q[0] for t in run(ServoJ((1.0,) * 6, lookahead, 300, FAST), JointTarget(ZERO6), 300))

    assert highest(0.03) > 1.2
    assert highest(0.2) <= 1.0


def test_servoj_is_slowed_down_by_the_speed_slider():
    fast = run(ServoJ((1.0,) * 6, 0.1, 300, FAST), JointTarget(ZERO6), 100)
    slow = run(ServoJ((1.0,) * 6, 0.1, 300, FAST), JointTarget(ZERO6), 200, scale=0.5)
    assert slow[40].q[0] == pytest.approx(fast[20].q[0], abs=0.03)


def test_a_servoj_that_is_not_renewed_stops():
    motion = ArmMotion(ZERO6, 20.0)
    owner = object()
    for _ in range(10):
        motion.command(owner, ServoJ((0.5,) * 6, 0.1, 300, FAST))
        motion.step(DT, 1.0)
    before = motion.target.qd[0]
    motion.step(DT, 1.0)
    assert before - motion.target.qd[0] == pytest.approx(20.0 * DT)


@given(twists, st.floats(0.2, 2.0), st.floats(0.2, 3.0))
def test_speedl_gives_the_tool_the_twist_it_asks_for(twist, a, a_rot):
    targets = run(SpeedL(twist, a, a_rot, TOOL), JointTarget(HOME), 70)
    now = TOOL.twist(targets[-1].q, targets[-1].qd)
    gone = 70 * DT
    for part, limit in ((slice(0, 3), a), (slice(3, 6), a_rot)):
        size = math.hypot(*twist[part])
        share = min(1.0, limit * gone / size) if size > 0 else 1.0
        assert now[part] == pytest.approx([share * x for x in twist[part]], abs=2e-3)


def test_speedl_accelerates_on_a_straight_line():
    targets = run(SpeedL((0.1, 0.05, 0.0, 0.0, 0.0, 0.0), 0.5, 0.5, TOOL), JointTarget(HOME), 100)
    assert tool_accelerations(targets).max() <= 0.5 * 1.01
    v = tool_velocities(targets)[1:]
    assert np.abs(v[:, 1] - 0.5 * v[:, 0]).max() < 1e-3
    assert np.abs(v[:, 2]).max() < 1e-3


@pytest.mark.parametrize("renewed", [1250, 25, 1])
def test_speedl_stays_on_its_line_for_ten_seconds_and_through_the_stop(renewed):
    """One command of 10 s, and the same motion in many commands."""
    motion = ArmMotion(HOME, 20.0)
    owner = object()
    v = np.array([0.004, 0.012, 0.016, 0.0, 0.0, 0.03])
    for k in range(1250):
        if k % renewed == 0:
            command = motion.command(owner, SpeedL(tuple(v), 1.0, 1.0, TOOL))
        command.is_renewed = True
        motion.step(DT, 1.0)
    half = TOOL.pose(motion.target.q)
    motion.command(owner, StopL(1.0, 1.0, TOOL))
    while motion.is_moving:
        motion.step(DT, 1.0)
    for pose, t in ((half, 1250 * DT), (TOOL.pose(motion.target.q), 1251 * DT)):
        moved = pose_sub(pose, START)
        along = np.dot(moved[:3], v[:3]) / np.dot(v[:3], v[:3])
        assert along == pytest.approx(t, abs=0.03)
        assert moved[:3] == pytest.approx(v[:3] * along, abs=1e-6)
        assert moved[3:] == pytest.approx(v[3:] * along, abs=1e-3)


@given(twists, st.floats(0.2, 2.0))
def test_stopl_decelerates_the_tool_at_a_and_ends_at_exact_rest(twist, a):
    moving = JointTarget(HOME, TOOL.rates(HOME, twist))
    stop = StopL(a, a, TOOL)
    targets = [moving]
    while not stop.done:
        targets.append(stop.step(targets[-1], DT, 1.0))
        assert len(targets) < 1000
    assert targets[-1].qd == ZERO6
    slowest = max(math.hypot(*twist[:3]), math.hypot(*twist[3:])) / a
    assert len(targets) - 1 == pytest.approx(slowest / DT, abs=2 + 0.03 * slowest / DT)


def test_stopl_at_rest_does_nothing():
    stop = StopL(1.0, 1.0, TOOL)
    assert stop.step(JointTarget(HOME), DT, 1.0) == JointTarget(HOME)
    assert stop.done


FLANGE = Tool(ARM, ZERO6)
joints = st.tuples(*[st.floats(-3.0, 3.0)] * 6)


def joint_move(start, goal, *, a, v):
    return Move(move_j(start, goal, FLANGE, a=a, v=v))


@given(joints, st.floats(0.1, 40.0))
def test_speedj_accelerates_the_leading_axis_at_a_and_all_joints_arrive_together(qd, a):
    generator = SpeedJ(qd, a)
    targets = run(generator, JointTarget(ZERO6), 5)
    for before, after in itertools.pairwise(targets):
        change = [y - x for x, y in zip(before.qd, after.qd, strict=True)]
        assert max(map(abs, change)) <= a * DT * (1 + 1e-9)
        # Position is the integral of a velocity that is linear within the cycle.
        for p0, p1, v0, v1 in zip(before.q, after.q, before.qd, after.qd, strict=True):
            assert p1 - p0 == pytest.approx(0.5 * (v0 + v1) * DT, abs=1e-12)
    last = targets[-1].qd
    largest = max(map(abs, qd))
    share = 1.0 if largest <= 5 * a * DT else 5 * a * DT / largest
    assert last == pytest.approx([share * x for x in qd], abs=1e-9)


@given(joints, joints, st.floats(0.2, 3.0), st.floats(0.2, 10.0))
def test_movej_arrives_exactly_and_keeps_the_limits_of_the_leading_axis(start, goal, v, a):
    generator = joint_move(start, goal, a=a, v=v)
    cycles = int(generator.duration / DT) + 2
    targets = run(generator, JointTarget(start), cycles)
    assert generator.done
    assert targets[-1].q == goal
    assert targets[-1].qd == ZERO6
    assert max(abs(x) for t in targets for x in t.qd) <= v * (1 + 1e-9)
    assert max(abs(x) for t in targets for x in t.qdd) <= a * (1 + 1e-9)


# What a program does in a cycle: it streams a speed, lets the stream lapse, or commands a stop.
STREAMED = st.lists(st.one_of(joints, st.none(), st.just("stop")), min_size=1, max_size=40)


def streamed(asked, cycles, scale=1.0):
    """The targets of an arm that gets these commands, then nothing."""
    motion, owner, targets = ArmMotion(ZERO6, 20.0, dead_cycles=cycles), object(), []
    for what in [*asked, *[None] * 200]:
        if what == "stop":
            motion.command(owner, StopJ(2.0))
        elif what is not None:
            motion.command(owner, SpeedJ(what, 5.0))
        targets.append(motion.step(DT, scale))
    return targets


@given(joints, st.lists(st.one_of(joints, st.none()), max_size=30), st.integers(1, 4))
def test_a_dead_time_shifts_a_stream_its_gaps_and_its_end(first, asked, n):
    plain, late = streamed([first, *asked], (0,)), streamed([first, *asked], (n,))
    assert late[:n] == [JointTarget(ZERO6)] * n
    assert late[n:] == plain[:-n]


def test_a_stop_that_the_program_commands_has_the_dead_time_of_its_stream():
    asked = [(0.3,) * 6] * 20 + ["stop"]
    assert streamed(asked, (2,))[2:] == streamed(asked, (0,))[:-2]


def test_a_stop_of_the_safety_system_acts_at_once():
    motion, owner = ArmMotion(ZERO6, 20.0, dead_cycles=(3,)), object()
    for _ in range(20):
        motion.command(owner, SpeedJ((0.5,) * 6, 5.0))
        motion.step(DT, 1.0)
    before = motion.target.qd[0]
    motion.interrupt()
    assert before - motion.step(DT, 1.0).qd[0] == pytest.approx(20.0 * DT)


@given(STREAMED, st.lists(st.integers(0, 3), min_size=1, max_size=9), st.sampled_from([1.0, 0.4]))
def test_a_dead_time_that_wanders_keeps_speeds_continuous_and_brings_the_arm_to_rest(asked, cycles, scale):
    targets = streamed(asked, cycles, scale)
    speeds = np.array([target.qd for target in targets])
    assert np.abs(np.diff(speeds, axis=0, prepend=np.zeros((1, 6)))).max() <= 5.0 * DT * (1 + 1e-9)
    assert not speeds[-1].any()


def test_one_program_after_the_other_is_one_stream():
    """As drivers of old send it: a program of one line in each cycle, each of its own thread."""

    def targets(cycles):
        motion, owner = ArmMotion(ZERO6, 20.0, dead_cycles=cycles), None
        for _ in range(30):
            motion.release(owner)
            owner = object()
            motion.command(owner, SpeedJ((0.2,) * 6, 5.0))
            yield motion.step(DT, 1.0)
        motion.release(owner)
        for _ in range(30):
            yield motion.step(DT, 1.0)

    plain, late = list(targets((0,))), list(targets((2,)))
    assert late[2:] == plain[:-2]
    assert plain[28].qd == (0.2,) * 6
    assert not any(late[-1].qd)
