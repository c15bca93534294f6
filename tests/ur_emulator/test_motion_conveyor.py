"""Conveyor tracking: moves follow a belt; a program sets the counts of its encoder."""

import math

import numpy as np
import pytest
from box_support import Bench
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_support import DT, HOME, START, TOOL, at, line

from protocol.pose import pose_inv, pose_trans
from ur_emulator.commands.programs import StopProgram
from ur_emulator.controller.events import ScriptFailed
from ur_emulator.controller.io.encoders import RANGES, Encoder
from ur_emulator.motion.arm_motion import ArmMotion
from ur_emulator.motion.move import Move
from ur_emulator.motion.overlay import (
    CATCH_UP_ACCELERATION,
    BeltEstimate,
    CircularBelt,
    Conveyor,
    LinearBelt,
)

PLACE = "p[0.25,-0.25,0.25,2.2,-2.2,0]"


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
def test_a_move_on_a_running_belt_is_a_move_in_the_frame_of_the_belt(speed, range_id):
    motion = ArmMotion(HOME, 20.0)
    belt = linear(motion, speed, range_id=range_id)
    for _ in range(150):
        belt.step()
    motion.command("me", move := Move(line(START, at(0.03, 0.0, -0.02), v=0.1)))
    while not move.done:
        target = belt.step()
        offset = np.subtract(TOOL.pose(target.q)[:3], TOOL.pose(motion.path.q)[:3])
        assert offset == pytest.approx((0.0, belt.way, 0.0), abs=1e-3)
    assert TOOL.pose(motion.path.q) == pytest.approx(at(0.03, 0.0, -0.02), abs=1e-9)


@settings(max_examples=15)
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


def test_targets_of_a_carried_arm_are_consistent():
    motion = ArmMotion(HOME, 20.0)
    belt = linear(motion, 0.1)
    targets = [belt.step() for _ in range(120)]
    q, qd = np.array([t.q for t in targets]), np.array([t.qd for t in targets])
    assert np.abs((q[2:] - q[:-2]) / (2 * DT) - qd[1:-1]).max() < 0.02
    assert motion.path.q == HOME


@pytest.mark.parametrize("rotate_tool", [False, True])
def test_a_turning_conveyor_carries_the_tool_around_its_axis(rotate_tool):
    motion = ArmMotion(HOME, 20.0)
    centre = (START[0] - 0.05, START[1] - 0.1, 0.0, 0.0, 0.0, 0.4)
    per_turn = 5000.0
    belt = RunningBelt(
        motion,
        CircularBelt(centre, per_turn, rotate_tool),
        0.4 / (2 * math.pi),  # turns per second
        density=per_turn,
    )
    for _ in range(150):
        target = belt.step()
    pose = TOOL.pose(target.q)
    turn = (0.0, 0.0, 0.0, 0.0, 0.0, 2.0 * math.pi * belt.way)
    expected = pose_trans(pose_trans(centre, turn), pose_trans(pose_inv(centre), START))
    assert pose[:3] == pytest.approx(expected[:3], abs=1e-3)
    assert pose[3:] == pytest.approx(expected[3:] if rotate_tool else START[3:], abs=3e-3)


def test_a_pause_stands_still_and_catches_up_afterwards():
    motion = ArmMotion(HOME, 20.0)
    belt = linear(motion, 0.05, range_id=1)
    targets = [belt.step() for _ in range(100)]
    motion.pause()
    targets += [belt.step() for _ in range(100)]
    assert motion.is_paused
    motion.resume()
    targets += [belt.step() for _ in range(150)]
    carried = TOOL.pose(targets[-1].q)[1] - START[1]
    assert carried == pytest.approx(belt.way, abs=2e-3)
    speed = np.array([TOOL.twist(t.q, t.qd)[1] for t in targets])
    assert np.abs(np.diff(speed)).max() < 2.5 * CATCH_UP_ACCELERATION * DT
    assert speed.max() < 0.35


@given(st.floats(-1e6, 1e6), st.floats(0.5, 50.0))
def test_the_estimate_of_a_steady_belt_has_no_lag(first, speed):
    estimate = BeltEstimate(first, 0.0)
    for k in range(1, 400):
        estimate.update(first + speed * k * DT, k * DT)
    assert estimate.position == pytest.approx(first + speed * 399 * DT, abs=1e-6 * max(1.0, speed))
    assert estimate.speed == pytest.approx(speed, rel=1e-3)


# --- from scripts


FEED = (
    "  encoder_enable_set_tick_count(0, 2)\n  n = 0\n"
    "  thread belt():\n    while True:\n      n = n + 1\n"
    "      encoder_set_tick_count(0, (n * 0.8 + 65000) % 65536)\n      sync()\n    end\n  end\n"
    "  encoder_set_tick_count(0, 65000)\n"
)


@pytest.fixture
def bench():
    bench = Bench(fidelity="ideal")
    bench.run(f"movej({PLACE}, a=8, v=3)\n")
    bench.events.clear()
    bench.snapshots.clear()
    return bench


def failures(bench):
    return [e.text for e in bench.events if isinstance(e, ScriptFailed)]


def test_a_program_tracks_moves_and_stops(bench):
    said = bench.run(
        f"def f():\n{FEED}  run belt()\n  track_conveyor_linear(p[0,1,0,0,0,0], 1000)\n  sleep(1)\n"
        f"  movel(pose_add({PLACE}, p[0.05,0,0,0,0,0]))\n"
        f"  textmsg(pose_dist(get_target_tcp_pose_along_path(), pose_add({PLACE}, p[0.05,0,0,0,0,0])) < 0.000001)\n"
        f"  textmsg(get_target_tcp_pose()[1] > get_target_tcp_pose_along_path()[1] + 0.1)\n"
        f"  textmsg(get_target_tcp_speed_along_path() == p[0,0,0,0,0,0])\n"
        f"  textmsg(get_target_tcp_speed()[1] > 0.09)\n"
        f"  stop_conveyor_tracking(8)\n"
        f"  textmsg(get_target_joint_speeds() == [0,0,0,0,0,0])\n"
        f"  textmsg(get_target_tcp_pose() == get_target_tcp_pose_along_path())\n"
        f"  movel({PLACE})\nend\n"
    )
    assert not failures(bench)
    assert said == ["True"] * 6
    assert bench.now.target_tcp_pose[:3] == pytest.approx((0.25, -0.25, 0.25), abs=1e-9)


@pytest.mark.parametrize("how", ["end", "stop"])
def test_tracking_ends_with_the_program(bench, how):
    wait = "sleep(1)" if how == "end" else "sleep(10)"
    bench.start(
        f"def f():\n{FEED}  run belt()\n  track_conveyor_linear(p[0,1,0,0,0,0], 1000)\n  {wait}\nend\n"
    )
    bench.tick(120)
    if how == "stop":
        bench.tick(1, StopProgram())
    bench.tick(30)
    assert bench.now.target_qd == (0.0,) * 6
    assert bench.now.target_tcp_pose[1] > -0.2
    assert not bench.controller.state.motion.is_moving


def test_a_secondary_program_leaves_the_tracking_alone(bench):
    bench.start(
        f"def f():\n{FEED}  run belt()\n  track_conveyor_linear(p[0,1,0,0,0,0], 1000)\n  sleep(10)\nend\n"
    )
    bench.tick(80)
    bench.start("sec s():\n  textmsg(1)\nend\n")
    bench.tick(5)
    assert bench.now.target_tcp_speed[1] > 0.09


@pytest.mark.parametrize(
    "call",
    [
        "track_conveyor_linear(p[1,0,0,0,0,0], 0)",
        "track_conveyor_linear(p[1,0,0,0,0,0], pow(10, 300) * pow(10, 300))",
        "track_conveyor_linear(p[1,0,0,0,0,0], 0.0000001)",
        "track_conveyor_linear(p[0,0,0,0,0,1], 1000)",
        "track_conveyor_circular(p[0,0,0,0,0,0], 0)",
        "stop_conveyor_tracking(-1)",
    ],
)
def test_absurd_arguments_are_runtime_errors(bench, call):
    bench.run(f"def f():\n  {call}\nend\n")
    (text,) = failures(bench)
    assert "\n" not in text


def test_a_count_that_jumps_never_makes_the_arm_jump(bench):
    bench.start(
        "def f():\n  encoder_enable_set_tick_count(0, 0)\n  track_conveyor_linear(p[0,1,0,0,0,0], 1000)\n"
        "  sleep(0.1)\n  encoder_set_tick_count(0, 2000000000)\n  sleep(5)\nend\n"
    )
    bench.tick(400)
    velocity = np.array([s.target_tcp_speed[:3] for s in bench.snapshots])
    assert bench.now.target_qd == (0.0,) * 6  # out of reach: protective stop
    assert np.isfinite(velocity).all()
    qd = np.array([s.target_qd for s in bench.snapshots])
    assert np.abs(qd).max() <= 2 * math.pi
