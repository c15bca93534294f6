"""Overlays: the joints get a displaced target, the program's path stays the same; scripts: `chunks/watched/overlays.script`.

A conveyor moves the tool with a belt, whose encoder a program may feed; a path offset displaces the tool in
each of the frames, within limits and through a filter.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_support import DT, HOME, START, TOOL, Swing, at, line, renew, run_cycles

from protocol.pose import pose_trans
from ur_emulator.machine.controller.io.encoders import RANGES, Encoder
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.motion.conveyor import CATCH_UP_ACCELERATION, BeltEstimate, Conveyor, LinearBelt
from ur_emulator.machine.motion.generators import SpeedJ
from ur_emulator.machine.motion.move import Move


@pytest.fixture
def motion():
    return ArmMotion(HOME, 20.0)


def test_without_overlays_target_and_path_are_one_object(motion):
    motion.command("me", Move(line(START, at(0.05, 0, 0))))
    for _ in range(100):
        motion.step(DT, 1.0)
        assert motion.target is motion.path


def test_a_move_under_an_overlay_is_displaced_and_the_path_is_not():
    plain, displaced = ArmMotion(HOME, 20.0), ArmMotion(HOME, 20.0)
    swing = Swing()
    displaced.add_overlay(swing)
    for motion in (plain, displaced):
        motion.command("me", Move(line(START, at(0.05, 0, 0))))
    for _ in range(60):
        plain.step(DT, 1.0)
        displaced.step(DT, 1.0)
        assert displaced.path == plain.path
        lift = swing.reach * (1.0 - math.cos(swing.rate * swing.time))
        expected = np.add(TOOL.pose(plain.path.q)[:3], (0, 0, lift))
        assert TOOL.pose(displaced.target.q)[:3] == pytest.approx(expected, abs=1e-8)


def test_speeds_of_a_displaced_target_are_those_of_its_positions(motion):
    motion.add_overlay(Swing(rate=4.0))
    targets = run_cycles(motion, 200)
    q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    central = (q[2:] - q[:-2]) / (2 * DT)
    assert np.abs(central - qd[1:-1]).max() < 0.01 * np.abs(qd).max()


def test_overlays_act_one_after_the_other(motion):
    swings = Swing(), Swing(reach=0.01, rate=3.0)
    for swing in swings:
        motion.add_overlay(swing)
    targets = run_cycles(motion, 100)
    lift = sum(s.reach * (1.0 - math.cos(s.rate * s.time)) for s in swings)
    assert TOOL.pose(targets[-1].q)[2] == pytest.approx(START[2] + lift, abs=1e-8)


def test_removal_lets_the_path_go_on_from_where_the_arm_is_and_ramps_it_to_rest(motion):
    swing = Swing()
    motion.add_overlay(swing)
    assert motion.is_moving
    targets = run_cycles(motion, 90)
    speed = np.abs(targets[-1].qd).max()
    assert speed > 0.01
    motion.remove_overlay(swing)
    assert motion.path is motion.target
    after = [targets[-1], *run_cycles(motion, 50)]
    assert not motion.is_moving
    qd = np.array([t.qd for t in after])
    assert np.abs(np.diff(qd, axis=0)).max() <= 20.0 * DT * 1.001
    assert np.abs(np.diff([t.q for t in after], axis=0)).max() <= speed * DT * 1.01


def test_a_move_under_way_keeps_the_displacement_of_a_removed_overlay_to_its_end(motion):
    swing = Swing()
    motion.add_overlay(swing)
    motion.command("me", move := Move(line(START, at(0.05, 0, 0))))
    run_cycles(motion, 30)
    motion.remove_overlay(swing)
    targets = [motion.target]
    while motion.is_moving:
        targets.append(motion.step(DT, 1.0))
        assert len(targets) < 300
    assert move.done
    assert motion.path is motion.target
    speed = [TOOL.twist(t.q, t.qd)[2] for t in targets]
    assert np.abs(np.diff(speed)).max() < 0.03
    x, y, z = TOOL.pose(motion.path.q)[:3]
    assert (x, y) == pytest.approx(at(0.05, 0, 0)[:2], abs=1e-8)
    assert z > START[2] + 0.002


def test_a_stream_goes_on_from_the_displaced_target(motion):
    swing = Swing()
    motion.add_overlay(swing)
    command = motion.command("me", SpeedJ((0.1,) * 6, 2.0))
    renew(motion, command, 60)
    before = motion.target
    motion.remove_overlay(swing)
    command.is_renewed = True
    after = motion.step(DT, 1.0)
    assert np.abs(np.subtract(after.qd, before.qd)).max() <= 2.0 * DT * 1.001


@pytest.mark.parametrize("end", ["stop", "place"])
def test_stops_end_all_overlays(motion, end):
    motion.add_overlay(Swing())
    run_cycles(motion, 40)
    if end == "stop":
        before = motion.target.qd
        motion.stop()
        assert np.abs(np.subtract(motion.step(DT, 1.0).qd, before)).max() <= 20.0 * DT * 1.001
    else:
        motion.place(HOME)
    run_cycles(motion, 30)
    assert not motion.is_moving
    assert motion.target is motion.path


def test_a_changed_tool_does_not_make_the_arm_jump():
    swing = Swing()
    motion = ArmMotion(HOME, 20.0)
    motion.add_overlay(swing)
    run_cycles(motion, 50)
    before = TOOL.pose(motion.target.q)
    swing.tool = type(TOOL)(TOOL.arm, (0.0, 0.05, 0.1, 0.3, 0.0, 0.0))
    after = TOOL.pose(motion.step(DT, 1.0).q)
    assert np.subtract(after[:3], before[:3]) == pytest.approx(0.0, abs=1e-3)
    assert pose_trans(before, (0, 0, 0, 0, 0, 0))[3:] == pytest.approx(after[3:], abs=1e-6)


class RunningBelt:
    """A belt that runs at a constant speed, and its encoder with whole ticks."""

    def __init__(self, motion, belt, speed, *, density=1000.0, range_id=0):
        self.motion, self.speed, self.density = motion, speed, density
        self.time = self.way = 0.0
        self.encoder = Encoder()
        self.encoder.feed(range_id)
        self.conveyor = Conveyor(belt, TOOL, lambda: self.encoder.travel, lambda: self.time)
        motion.add_overlay(self.conveyor)

    def step(self):
        self.time += DT
        self.way += self.speed * DT
        low, size = RANGES[self.encoder.range_id]
        self.encoder.set_count(float((math.floor(self.way * self.density) - low) % size + low))
        return self.motion.step(DT, 1.0)


def linear(motion, speed, direction=(0.0, 1.0, 0.0), density=1000.0, **kwargs):
    return RunningBelt(motion, LinearBelt(direction, density), speed, density=density, **kwargs)


@pytest.mark.parametrize("range_id", [0, 1, 2])
@pytest.mark.parametrize("speed", [0.08, -0.05])
def test_a_move_on_a_running_belt_is_a_move_in_the_frame_of_the_belt(motion, speed, range_id):
    belt = linear(motion, speed, range_id=range_id)
    for _ in range(150):
        belt.step()
    motion.command("me", move := Move(line(START, at(0.03, 0.0, -0.02), v=0.1)))
    while not move.done:
        target = belt.step()
        offset = np.subtract(TOOL.pose(target.q)[:3], TOOL.pose(motion.path.q)[:3])
        assert offset == pytest.approx((0.0, belt.way, 0.0), abs=1e-3)
    assert TOOL.pose(motion.path.q) == pytest.approx(at(0.03, 0.0, -0.02), abs=1e-9)


@given(st.floats(-0.15, 0.15), st.sampled_from([200.0, 1000.0, 20000.0]))
def test_the_arm_catches_up_with_bounded_acceleration_and_without_a_jump(speed, density):
    motion = ArmMotion(HOME, 20.0)
    belt = linear(motion, speed, density=density)
    start = np.array(TOOL.pose(HOME)[:3])
    carried = np.array([(TOOL.pose(belt.step().q)[:3] - start)[1] for _ in range(110)])
    velocity = np.diff(carried, prepend=0.0) / DT
    assert np.abs(np.diff(velocity, prepend=0.0)).max() <= CATCH_UP_ACCELERATION * DT * 1.001 + 1e-9
    # The count itself is only known to a tick.
    assert abs(carried[-1] - belt.way) <= 1e-3 + 1.0 / density


def test_targets_of_a_carried_arm_are_consistent(motion):
    belt = linear(motion, 0.1)
    targets = [belt.step() for _ in range(120)]
    q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    assert np.abs((q[2:] - q[:-2]) / (2 * DT) - qd[1:-1]).max() < 0.02
    assert motion.path.q == HOME


def test_a_pause_stands_still_and_catches_up_afterwards(motion):
    belt = linear(motion, 0.1, range_id=1)
    targets = [belt.step() for _ in range(50)]
    motion.pause()
    targets += [belt.step() for _ in range(160)]
    assert motion.is_paused
    motion.resume()
    targets += [belt.step() for _ in range(150)]
    carried = TOOL.pose(targets[-1].q)[1] - START[1]
    assert carried == pytest.approx(belt.way, abs=2e-3)
    speed = np.array([TOOL.twist(t.q, t.qd)[1] for t in targets])
    assert np.abs(np.diff(speed)).max() < 2.5 * CATCH_UP_ACCELERATION * DT
    assert speed.max() < 0.1 + 0.27  # of the belt, and 0.25 m/s to catch up with it


@given(st.floats(-1e6, 1e6), st.floats(0.5, 50.0))
def test_the_estimate_of_a_steady_belt_has_no_lag(first, speed):
    estimate = BeltEstimate(first, 0.0)
    for k in range(1, 400):
        estimate.update(first + speed * k * DT, k * DT)
    assert estimate.position == pytest.approx(first + speed * 399 * DT, abs=1e-6 * max(1.0, speed))
    assert estimate.speed == pytest.approx(speed, rel=1e-3)
