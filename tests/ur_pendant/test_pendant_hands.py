"""What a window reads of a robot, and what it may do to it."""

import time
from dataclasses import replace

import numpy as np
import pytest

from protocol.ur_types import Ports
from ur_emulator import ControlBox
from ur_emulator.errors import EmulatorError
from ur_pendant import hands as hands_module
from ur_pendant.hands import HandError, Hands
from ur_pendant.robot import Address, Robot

LIMIT = 20.0  # s, for hangs


def until(condition, what):
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < LIMIT, what
        time.sleep(0.01)


def address_of(box):
    return Address(box.host, box.ports, box.control_port)


@pytest.fixture(scope="module")
def box():
    with ControlBox("ur5e", pace="lockstep", port_base=None, control_port=0, seed=7) as box:
        yield box


@pytest.fixture
def robot(box):
    robot = Robot(address_of(box))
    until(lambda: robot.values and robot.state is not None, "the robot")
    yield robot
    robot.close()


def test_a_robot_is_read_by_rtde_the_primary_port_and_the_control_api(box, robot):
    assert (robot.title, robot.problem) == (f"UR5e 5.15.0 at {box.host}", "")
    assert robot.values["actual_q"] == box.state.q
    assert robot.kinematics.dh_a[1] == pytest.approx(-0.425, abs=0.005)
    box.run_program('def asks():\n  request_integer_from_primary_client("how many?")\nend\n')
    until(lambda: robot.questions, "the question")
    assert (robot.questions[0].text, robot.program) == ("how many?", "asks")
    box.stop_program()
    until(lambda: not robot.questions and robot.program == "", "the end of the question")
    until(lambda: any("asks" in text for _, text in robot.log), "its line in the log")
    box.run_program("def counts():\n  global n = 7\n  sync()\nend\n")
    until(lambda: {name: str(value) for name, value in robot.variables.items()} == {"n": "7"}, "the variable")
    assert [client.partition(" at ")[2].split()[0] for client in robot.state.clients] == ["rtde", "primary"]


def test_without_the_control_api_the_primary_port_tells_of_programs_popups_and_questions(box):
    robot = Robot(address_of(box)._replace(control_port=0))
    until(lambda: robot.values, "the robot")
    box.run_program('def says():\n  popup("look")\n  request_string_from_primary_client("who?")\nend\n')
    until(lambda: robot.popups and robot.questions, "popup and question")
    assert (robot.popups, robot.questions[0].kind, robot.program) == (("Popup: look",), "STRING", "says")
    box.stop_program()
    box.close_popups()
    until(lambda: not robot.questions, "the end of the question")
    robot.close()


def test_a_robot_that_does_not_answer_has_a_problem_and_is_not_held():
    robot = Robot(Address("127.0.0.1", Ports.of({"primary": 1, "rtde": 1})))
    until(lambda: "refuses" in robot.problem, "the problem")
    assert "simulated" in robot.refusal
    robot.close()


@pytest.mark.parametrize("has_dashboard", [True, False])
def test_keys_are_lines_of_the_dashboard_or_operations_where_there_is_none(box, robot, has_dashboard):
    hands = Hands(robot)
    if not has_dashboard:
        robot.address = robot.address._replace(ports=replace(robot.address.ports, dashboard=0))
    assert hands.press("power off", "power_off") == ("Powering off" if has_dashboard else "")
    box.wait_until(robot_mode="POWER_OFF")
    with pytest.raises(HandError if has_dashboard else EmulatorError, match=r"(?i)fail|no program"):
        hands.press("play", "resume_program")
    hands.press("brake release", "release_brakes")
    box.wait_until(robot_mode="RUNNING")


def test_operations_say_what_the_box_says(box, robot):
    hands = Hands(robot)
    hands.operate("add_obstacle", name="wall", shape="box", size=(0.1, 1, 1), pose=(0.9, 0, 0.5, 0, 0, 0))
    assert box.state.obstacles == ("wall",)
    hands.operate("remove_obstacle", name="wall")
    with pytest.raises(EmulatorError, match="there is no obstacle 'wall'"):
        hands.operate("remove_obstacle", name="wall")


def test_time_in_lockstep_passes_by_steps(box, robot):
    before = box.state.tick
    Hands(robot).let_pass(robot.info.period)
    assert before < box.state.tick <= before + 3


def at(box, q):
    return np.abs(np.subtract(box.state.q, q)).max() < 5e-3


def test_a_box_in_lockstep_goes_to_the_last_posture(box, robot):
    hands, begin = Hands(robot), np.array(box.state.q)
    for k in range(1, 6):
        hands.follow(begin + 0.1 * k)
    until(lambda: at(box, begin + 0.5), "the last posture")


@pytest.mark.parametrize("why", ["view only", "real arm", "unknown"])
def test_a_robot_that_is_not_simulated_takes_nothing(robot, why):
    if why == "view only":
        robot.view_only = True
    else:
        robot.info = replace(robot.info, simulated=False if why == "real arm" else None)
    hands = Hands(robot)
    for do in (
        lambda: hands.press("play", "resume_program"),
        lambda: hands.tell_dashboard("play"),
        lambda: hands.run("movej([0,0,0,0,0,0])"),
        lambda: hands.operate("power_off"),
        lambda: hands.follow([0.0] * 6),
    ):
        with pytest.raises(HandError, match=r"only shown|does not say"):
            do()


@pytest.fixture(scope="module")
def followed():
    """A box that keeps real time, in which a follower counts how long nothing has come; and its robot."""
    with ControlBox("ur5e", port_base=None, control_port=0, seed=7) as box:
        robot = Robot(address_of(box))
        until(lambda: robot.values and robot.state is not None, "the robot")
        yield box, robot
        robot.close()


def rtde_clients(box):
    return sum(client.partition(" at ")[2].startswith("rtde") for client in box.state.clients)


def test_no_goal_is_lost_while_a_follower_ends_and_its_end_is_clean(followed, monkeypatch):
    monkeypatch.setattr(hands_module, "_REST", 0.1)
    box, robot = followed
    hands, begin = Hands(robot), np.array(box.state.q)
    hands.follow(begin)
    for k in range(1, 4):
        follower = hands._follower
        until(lambda follower=follower: follower._is_ending, "the end of the one before")
        hands.follow(begin + 0.01 * k)
        until(lambda k=k: at(box, begin + 0.01 * k), "the goal")
    # The follower sees its end on its own stream; that of the robot and the list of clients come later.
    until(lambda: hands.goal is None, "the end")
    until(
        lambda: (robot.values["runtime_state"], rtde_clients(box)) == (1, 1), "the end of program and client"
    )


def test_a_follower_that_cannot_begin_leaves_nothing_open(followed, monkeypatch):
    box, robot = followed
    hands = Hands(robot)

    def refuse(_):
        raise HandError("no program is taken")

    monkeypatch.setattr(hands, "run", refuse)
    with pytest.raises(HandError, match="no program is taken"):
        hands.follow(box.state.q)
    until(lambda: rtde_clients(box) == 1, "the end of its stream")


@pytest.mark.parametrize(
    "software",
    [{"robot": "ur3", "version": "3.5.0"}, pytest.param({"robot": "ur5e"}, marks=pytest.mark.nightly)],
    ids=str,
)
def test_the_arm_follows_a_hand_and_stops_when_the_hand_is_lost(software, monkeypatch):
    """In real time: the program in the box counts how long no target has come."""
    monkeypatch.setattr(hands_module, "_REST", 0.3)
    with ControlBox(**software, port_base=None, control_port=0, seed=7) as box:
        robot = Robot(address_of(box))
        until(lambda: robot.values and robot.state is not None, "the robot")
        hands, begin = Hands(robot), np.array(box.state.q)
        far = np.add(begin, (1.5, 0, 0, 0, 0, 0))
        hands.follow(far)
        until(lambda: robot.values["actual_qd"][0] > 0.3, "speed")
        with pytest.raises(HandError, match="a program runs"):
            Hands(robot).follow(begin)
        hands._follower._stream.close()  # as when the process of the window is killed
        state = box.wait_until(program_state="STOPPED", steady=True, timeout=LIMIT)
        assert begin[0] + 0.05 < state.q[0] < far[0] - 0.1
        until(lambda: robot.values["runtime_state"] == 1, "the end")
        hands.follow(begin)
        until(lambda: hands.goal is None, "the end, as nobody has moved it for long")
        assert box.state.q == pytest.approx(begin, abs=0.01)
        robot.close()
