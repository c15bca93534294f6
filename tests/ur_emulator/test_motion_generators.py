import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.robot_model import ZERO6
from ur_emulator.models.robots import robot_by_name
from ur_emulator.motion.arm_motion import ArmMotion, OwnershipError
from ur_emulator.motion.generators import JointTarget, SpeedJ, StopJ
from ur_emulator.motion.leg import move_j
from ur_emulator.motion.move import Move
from ur_emulator.motion.tool import Tool

DT = 0.008
TOOL = Tool(ArmModel(robot_by_name("ur3")), ZERO6)
joints = st.tuples(*[st.floats(-3.0, 3.0)] * 6)


def joint_move(start, goal, *, a, v):
    return Move(move_j(start, goal, TOOL, a=a, v=v))


def run(generator, target, cycles, scale=1.0):
    targets = [target]
    for _ in range(cycles):
        targets.append(generator.step(targets[-1], DT, scale))
    return targets


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


def test_speedj_reaches_the_velocity_exactly_and_keeps_it():
    qd = (0.1, -0.2, 0.3, 0.0, 0.5, -0.6)
    generator = SpeedJ(qd, 1.4)
    targets = run(generator, JointTarget(ZERO6), 60)
    assert generator.done
    assert targets[-1].qd == qd
    assert targets[-1].qdd == ZERO6


def test_stopj_decelerates_at_a_and_ends_at_exact_rest():
    generator = StopJ(2.0)
    targets = run(generator, JointTarget(ZERO6, (0.48, 0.24, 0.0, 0.0, 0.0, -0.12)), 40)
    assert generator.done
    assert targets[-1].qd == ZERO6
    stopped_after = next(k for k, t in enumerate(targets) if t.qd == ZERO6)
    assert stopped_after == pytest.approx(0.48 / (2.0 * DT), abs=1)
    assert targets[-1].q[0] == pytest.approx(0.48**2 / (2 * 2.0), abs=1e-9)


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


def test_movej_is_a_straight_line_in_joint_space():
    start, goal = (0.0,) * 6, (1.0, -2.0, 0.5, 0.0, 0.25, 3.0)
    generator = joint_move(start, goal, a=1.4, v=1.05)
    for target in run(generator, JointTarget(start), 100)[1:]:
        share = target.q[5] / 3.0
        assert target.q == pytest.approx([share * g for g in goal], abs=1e-12)


def test_speed_slider_stretches_time_on_the_path():
    full, half = (joint_move(ZERO6, (1.0,) * 6, a=1.4, v=1.05) for _ in range(2))
    fast = run(full, JointTarget(ZERO6), 50)
    slow = run(half, JointTarget(ZERO6), 100, scale=0.5)
    assert slow[100].q == pytest.approx(fast[50].q)
    assert slow[100].qd == pytest.approx([0.5 * x for x in fast[50].qd])


def test_only_the_owner_moves_the_arm_until_it_rests():
    motion = ArmMotion(ZERO6, 20.0)
    first, second = object(), object()
    motion.command(first, SpeedJ((0.1,) * 6, 10.0))
    with pytest.raises(OwnershipError):
        motion.command(second, StopJ(2.0))
    motion.release(first)
    motion.command(second, StopJ(2.0))
    assert motion.owner is second


def test_a_velocity_lives_only_while_it_is_renewed():
    motion = ArmMotion(ZERO6, 20.0)
    owner = object()
    for _ in range(20):
        motion.command(owner, SpeedJ((0.2,) * 6, 5.0))
        motion.step(DT, 1.0)
    assert motion.target.qd == (0.2,) * 6
    motion.step(DT, 1.0)  # nobody renewed it: the arm begins to stop, at the acceleration of the last command
    assert motion.target.qd[0] == pytest.approx(0.2 - 5.0 * DT)
    motion.command(owner, SpeedJ((0.2,) * 6, 5.0))
    motion.step(DT, 1.0)
    assert motion.target.qd[0] == pytest.approx(0.2)


def test_the_end_of_the_owner_stops_the_arm_with_a_ramp():
    motion = ArmMotion(ZERO6, 20.0)
    owner = object()
    for _ in range(50):
        motion.command(owner, SpeedJ((1.0,) * 6, 5.0))
        motion.step(DT, 1.0)
    motion.release(owner)
    speeds = [motion.step(DT, 1.0).qd[0] for _ in range(20)]
    drops = [a - b for a, b in itertools.pairwise([1.0, *speeds])]
    assert max(drops) <= 20.0 * DT * (1 + 1e-9)
    assert speeds[-1] == 0.0
    assert not motion.is_moving
