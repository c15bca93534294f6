"""Stops of an e-Series arm: as hard as asked for, but no harder than its drives can brake what it carries.

At rest its high holding torque lets it give way further than a moving arm before it is stopped.
"""

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


STRONG = (-80.0, 340.0, 0.0)  # more than the base joint can hold


def pushed(*lines, until=0.2, limit=600):
    """An arm that is pushed away until a joint is so far off, or it is stopped."""
    bench = ESeriesBench(fidelity="ideal")
    bench.start(program(*lines, "sleep(100)"))
    bench.tick(100)
    bench.controller.plant.push(STRONG)
    for _ in range(limit):
        bench.tick()
        if bench.errors or max(map(abs, bench.controller.plant.sense().position_error)) > until:
            return bench
    raise AssertionError("the push is too weak")


def test_a_resting_arm_gives_way_and_returns():
    bench = pushed()
    assert bench.errors == []
    bench.controller.plant.push((0.0, 0.0, 0.0))
    bench.tick(1000)
    assert bench.errors == []
    assert max(map(abs, bench.now.position_error)) < 1e-3


def test_it_is_stopped_in_the_end():
    bench = pushed(until=0.5)
    assert bench.errors[0][0] == 153
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP


@pytest.mark.parametrize(
    "lines",
    [("high_holding_torque_disable()",), ("high_holding_torque_enable()", "high_holding_torque_disable()")],
)
def test_disabled_it_is_stopped_as_a_moving_arm(lines):
    bench = pushed(*lines, until=0.16)
    assert bench.errors[0][0] in (153, 157)


def test_it_stays_disabled_for_other_programs():
    bench = ESeriesBench(fidelity="ideal")
    bench.run(program("high_holding_torque_disable()"))
    assert not bench.controller.state.error_settings.holds_high
    bench.run(program("high_holding_torque_enable()"))
    assert bench.controller.state.error_settings.holds_high


def test_without_a_program_there_is_none():
    bench = ESeriesBench(fidelity="ideal")
    bench.tick(100)
    bench.controller.plant.push(STRONG)
    bench.tick(200)
    assert bench.errors[0][0] in (153, 157)
