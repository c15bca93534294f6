"""Overlays: the joints get a displaced target, the program's path stays the same."""

import math

import numpy as np
import pytest
from motion_support import DT, HOME, START, TOOL, at, line

from protocol.pose import pose_trans
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.generators import SpeedJ
from ur_emulator.motion.move import Move


class Swing:
    """Displaces the tool along base z, smoothly from rest."""

    tool = TOOL

    def __init__(self, reach=0.02, rate=2.0):
        self.time, self.reach, self.rate = 0.0, reach, rate

    def displace(self, tool_pose, dt):
        self.time += dt
        lift = self.reach * (1.0 - math.cos(self.rate * self.time))
        return (tool_pose[0], tool_pose[1], tool_pose[2] + lift, *tool_pose[3:])


def run_cycles(motion, n):
    return [motion.step(DT, 1.0) for _ in range(n)]


def test_without_overlays_target_and_path_are_one_object():
    motion = ArmMotion(HOME, 20.0)
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


def test_speeds_of_a_displaced_target_are_those_of_its_positions():
    motion = ArmMotion(HOME, 20.0)
    motion.add_overlay(Swing(rate=4.0))
    targets = run_cycles(motion, 200)
    q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    central = (q[2:] - q[:-2]) / (2 * DT)
    assert np.abs(central - qd[1:-1]).max() < 0.01 * np.abs(qd).max()


def test_overlays_act_one_after_the_other():
    motion = ArmMotion(HOME, 20.0)
    swings = Swing(), Swing(reach=0.01, rate=3.0)
    for swing in swings:
        motion.add_overlay(swing)
    targets = run_cycles(motion, 100)
    lift = sum(s.reach * (1.0 - math.cos(s.rate * s.time)) for s in swings)
    assert TOOL.pose(targets[-1].q)[2] == pytest.approx(START[2] + lift, abs=1e-8)


def test_removal_lets_the_path_go_on_from_where_the_arm_is_and_ramps_it_to_rest():
    motion = ArmMotion(HOME, 20.0)
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


def test_a_move_under_way_keeps_the_displacement_of_a_removed_overlay_to_its_end():
    motion = ArmMotion(HOME, 20.0)
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


def test_a_stream_goes_on_from_the_displaced_target():
    motion = ArmMotion(HOME, 20.0)
    swing = Swing()
    motion.add_overlay(swing)
    motion.command("me", SpeedJ((0.1,) * 6, 2.0))
    for _ in range(60):
        motion.renew()
        motion.step(DT, 1.0)
    before = motion.target
    motion.remove_overlay(swing)
    motion.renew()
    after = motion.step(DT, 1.0)
    assert np.abs(np.subtract(after.qd, before.qd)).max() <= 2.0 * DT * 1.001


@pytest.mark.parametrize("end", ["stop", "place"])
def test_stops_end_all_overlays(end):
    motion = ArmMotion(HOME, 20.0)
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
