"""Stops of an e-Series arm: as hard as asked for, but no harder than its drives can brake what it carries."""

from itertools import pairwise

import pytest
from box_support import Bench
from e_series_support import DT, ESeriesBench, program

from protocol.ur_types import SafetyMode
from ur_emulator.commands.safety import TriggerProtectiveStop
from ur_emulator.models.robots import ROBOTS, robot_by_name

# Stretched; the shoulder turns down, from upright to some 40 degrees above the horizontal.
START = {0: (-1.2, -0.35, 0.0, -1.57, 0.0, 0.0), 1: (0.0, -1.57, 0.0, -1.57, 0.0, 0.0)}
ACCELERATION = 2.0  # rad/s², which the drives can give
LARGE = [
    name for name, robot in ROBOTS.items() if min(robot.tau_max[:2]) >= 330 and robot.generation.major == 5
]


def turning(robot, joint, *, payload=0.0, stop="stopj(100)", limited=True):
    """A bench whose arm turns one joint, stretched, at three quarters of its speed, and stops in this cycle."""
    speed = 0.75 * robot_by_name(robot).qd_max[joint]
    qd = [speed * (i == joint) for i in range(6)]
    bench = ESeriesBench(robot=robot)
    bench.run(program(f"set_payload({payload}, [0, 0, 0.05])", f"movej({list(START[joint])}, 1, 0.7)"))
    bench.snapshots.clear()
    if not limited:
        bench.controller.state.motion.braking = None
    bench.start(program(f"speedj({qd}, {ACCELERATION}, {speed / ACCELERATION})", stop, "sleep(0.1)"))
    while bench.now.target_qd[joint] < 0.999 * speed:
        bench.tick()
    return bench


def greatest_deceleration(bench, joint):
    """Of the target, from the fastest speed to rest."""
    speeds = [frame.target_qd[joint] for frame in bench.snapshots]
    return max((before - after) / DT for before, after in pairwise(speeds))


def stands_still(bench):
    return not any(bench.now.target_qd) and max(map(abs, bench.now.actual_qd)) < 1e-3


@pytest.mark.parametrize(("joint", "share"), [(0, 1.0), (1, 0.0)], ids=["base, loaded", "shoulder"])
@pytest.mark.parametrize("robot", LARGE)
def test_a_large_arm_that_is_to_stop_at_once_stops_as_hard_as_it_can(robot, joint, share):
    bench = turning(robot, joint, payload=share * robot_by_name(robot).payload_max)
    bench.tick(round(0.5 / DT))
    assert {frame.safety_mode for frame in bench.snapshots} == {SafetyMode.NORMAL}
    assert stands_still(bench)
    assert 5.0 < greatest_deceleration(bench, joint) < 25.0


def test_a_stop_beyond_the_drives_would_be_a_protective_stop():
    bench = turning("ur20", 0, payload=20.0, limited=False)
    bench.tick(round(0.5 / DT))
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP


@pytest.mark.parametrize("robot", ["ur20", "ur30"])
def test_a_protective_stop_is_no_reason_for_a_second_one(robot):
    bench = turning(robot, 0, payload=robot_by_name(robot).payload_max, stop="stopj(0.1)")
    bench.tick(1, TriggerProtectiveStop())
    bench.tick(round(0.6 / DT))
    assert stands_still(bench)
    assert len(bench.errors) == 1


def test_a_stop_that_the_drives_can_give_is_as_hard_as_asked_for():
    bench = turning("ur5e", 0, stop="stopj(5)")
    bench.tick(round(0.6 / DT))
    assert greatest_deceleration(bench, 0) == pytest.approx(5.0)


def test_a_cb3_arm_brakes_as_asked_for():
    bench = Bench(robot="ur10")
    bench.run(program(f"movej({list(START[0])}, 1, 0.7)", "speedj([1, 0, 0, 0, 0, 0], 2, 0.8)", "stopj(100)"))
    speeds = [frame.target_qd[0] for frame in bench.snapshots]
    assert max(before - after for before, after in pairwise(speeds)) == pytest.approx(100 * 0.008)
