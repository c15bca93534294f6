"""The streamed way to a start on a robot in memory: it arrives, or ends with one line and a stopped arm."""

from __future__ import annotations

import numpy as np
import pytest
from fake_robot import PERIOD, FakeRobot

from pc_client.driver.session import UrDriver
from pc_client.errors import DriverError, RobotStoppedError
from pc_client.experiment.runner import run_approach
from pc_client.kinematics.robot_model import robot_model
from pc_client.planning.approach import Approach
from protocol.velocity_stream import VelocityMode

BETWEEN = np.array([0.05, -0.15, 0.0, 0.2, 0.0, 0.3])
GOAL = np.array([0.1, -0.3, -0.2, 0.2, 0.1, 0.2])
UR3 = robot_model("ur3")

SPEED = 0.5  # rad/s


def approach_to(*waypoints):
    return Approach(None, np.zeros(6), waypoints, SPEED, 0.8, 1.0, 1.0, 1.0)


def move(robot, *waypoints):
    with UrDriver("robot", network=robot) as driver:
        run_approach(driver, approach_to(*(waypoints or (BETWEEN, GOAL))), UR3)


@pytest.mark.parametrize("delay", [0, 3, 12])
@pytest.mark.parametrize("lockstep", [True, False])
def test_it_arrives_whatever_the_loop_delay(lockstep, delay):
    robot = FakeRobot(lockstep=lockstep, delay=delay)
    move(robot)
    assert robot.q == pytest.approx(GOAL, abs=5e-4)
    assert [text.splitlines()[0] for text in robot.programs] == ["def velocity_receiver():"]
    assert robot.at_rest


def test_it_follows_the_checked_lines_slowly():
    postures, robot = [], FakeRobot()
    robot.on_tick = lambda r: postures.append(list(r.q))
    move(robot)
    q = np.array(postures)
    assert np.abs(np.diff(q, axis=0)).max() <= 1.1 * SPEED * PERIOD
    lines = [np.linspace(a, b, 400) for a, b in ((np.zeros(6), BETWEEN), (BETWEEN, GOAL))]
    off = [min(np.abs(line - posture).max(axis=1).min() for line in lines) for posture in q]
    assert max(off) < 5e-3


def test_an_arm_that_is_there_already_is_not_moved():
    robot = FakeRobot()
    move(robot, np.full(6, 5e-5))
    assert robot.programs == []


def spoil_in_motion(action):
    def on_tick(robot):
        if len(robot.received) == 40:
            action(robot)

    return on_tick


def test_a_protective_stop_on_the_way_is_reported_and_nothing_left_moving():
    robot = FakeRobot(on_tick=spoil_in_motion(lambda r: setattr(r, "safety_mode", 3)))
    with pytest.raises(RobotStoppedError, match="PROTECTIVE_STOP"):
        move(robot)
    assert robot.at_rest


def test_an_arm_that_does_not_follow_is_stopped_soon():
    robot = FakeRobot()
    robot.follow = lambda: robot.commands and robot.commands.popleft()
    with pytest.raises(DriverError, match=r"the tool is 1\d\.\d\d mm .* off its path"):
        move(robot)
    assert "stopj" in robot.programs[-1]


def test_an_arm_that_stops_elsewhere_is_reported():
    robot = FakeRobot()
    follow = robot.follow

    def slip():
        follow()
        if robot.program is None:
            robot.q = [0.02, *robot.q[1:]]

    robot.follow = slip
    with pytest.raises(DriverError, match="is it blocked"):
        move(robot)


def test_ctrl_c_on_the_way_stops_the_arm():
    def interrupt(robot):
        robot.on_tick = None
        raise KeyboardInterrupt

    robot = FakeRobot(on_tick=spoil_in_motion(interrupt))
    with pytest.raises(KeyboardInterrupt):
        move(robot)
    assert robot.received[-1].mode is VelocityMode.STOP_PROGRAM
    assert len(robot.programs) == 1
    assert robot.at_rest
