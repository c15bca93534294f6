"""urx from PyPI, as it is, against a box with software 3.4: from 3.5 on it reads the robot's mode wrongly, there as here.

`urx.Robot` needs math3d; its version 3 needs Python 3.9 or older, its version 4 breaks urx's moves to poses. What
works is tried with it, and moves to poses with `URRobot`, the class below it, which takes lists.
"""

from contextlib import contextmanager

import numpy as np
import pytest
from clients_support import TIMEOUT, connect, served_box, wait_until

urx = pytest.importorskip("urx")

# Its threads call what newer Pythons deprecate.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

CLOSE_Q, CLOSE_X = 2e-3, 2e-3  # rad, m
SPEED, ACCELERATION = 2.0, 8.0


@contextmanager
def connected(kind, *arguments, **options):
    """A client of urx; its threads end before its box does."""
    client = kind(*arguments, **options)
    try:
        yield client
    finally:
        client.close()
        for thread in (client.secmon, client.rtmon):
            if thread is not None:
                thread.join(TIMEOUT)


@pytest.fixture(scope="module")
def old_box(tmp_path_factory):
    """A CB3 with software 3.4 and a gripper."""
    options = ("--software", "3.4.0", "--tool", "robotiq-2f85")
    with served_box(tmp_path_factory.mktemp("old_box"), *options) as served:
        yield served


@pytest.fixture(scope="module")
def robot(old_box):
    with connected(urx.Robot, old_box.host, use_rt=True) as client:
        yield client


@pytest.fixture(scope="module")
def plain(old_box):
    with connected(urx.urrobot.URRobot, old_box.host) as client:
        yield client


def at_rest(robot):
    """Wait until no program runs and the joints rest; return them."""
    last = [robot.getj()]

    def rests():
        last.append(robot.getj(wait=True))
        return not robot.is_program_running() and np.allclose(last[-1], last[-2], atol=1e-4)

    wait_until(rests)
    return np.array(last[-1])


def test_joint_moves(robot):
    start = at_rest(robot)
    robot.movej(np.add(start, [0.3, 0, 0, 0, 0, 0]), acc=ACCELERATION, vel=SPEED)
    assert np.allclose(at_rest(robot), np.add(start, [0.3, 0, 0, 0, 0, 0]), atol=CLOSE_Q)
    robot.movej([-0.3, 0, 0, 0, 0, 0.1], acc=ACCELERATION, vel=SPEED, relative=True)
    assert np.allclose(at_rest(robot), np.add(start, [0, 0, 0, 0, 0, 0.1]), atol=CLOSE_Q)


def test_moves_to_poses(plain):
    start = np.array(plain.getl(wait=True))
    up = np.add(start, [0, 0, 0.05, 0, 0, 0])
    plain.movel(up.tolist(), acc=2.0, vel=0.3)
    at_rest(plain)
    assert np.allclose(plain.getl(wait=True), up, atol=CLOSE_X)
    plain.movep(start.tolist(), acc=2.0, vel=0.3)
    at_rest(plain)
    assert np.allclose(plain.getl(wait=True), start, atol=CLOSE_X)
    corners = [
        np.add(pose, [0, y, 0, 0, 0, 0]).tolist() for pose, y in ((up, 0.04), (start, 0.04), (start, 0))
    ]
    plain.movels(corners, 2.0, 0.3, 0.01)
    at_rest(plain)
    assert np.allclose(plain.getl(wait=True), start, atol=CLOSE_X)


def test_stops(robot):
    start = at_rest(robot)
    robot.movej(np.add(start, [1.0, 0, 0, 0, 0, 0]), acc=ACCELERATION, vel=0.5, wait=False)
    wait_until(lambda: robot.getj()[0] - start[0] > 0.05)
    assert robot.is_program_running()
    robot.stopj(4.0)
    here = at_rest(robot)
    assert 0.05 < here[0] - start[0] < 1.0
    robot.movej(start, acc=ACCELERATION, vel=SPEED)


@pytest.mark.nightly
def test_speeds_with_t_min_are_refused(robot, old_box):
    """urx writes `t_min=`, which 3.x does not know: no motion, one error, and the client lives on."""
    start = at_rest(robot)
    robot.speedj([0.3, 0, 0, 0, 0, 0], 1.0, 1.0)
    wait_until(lambda: "unexpected keyword argument 't_min'" in old_box.log.read_text())
    assert np.allclose(at_rest(robot), start, atol=CLOSE_Q)


def test_inputs_and_outputs(robot):
    for n in (0, 7):
        robot.set_digital_out(n, True)
        wait_until(lambda n=n: robot.get_digital_out(n))
        assert robot.get_digital_out_bits() == 1 << n
        robot.set_digital_out(n, False)
        wait_until(lambda n=n: not robot.get_digital_out(n))
    assert robot.get_digital_in_bits() == robot.get_digital_in(1) == 0
    robot.set_analog_out(0, 0.5)
    wait_until(lambda: robot.secmon.get_all_data()["MasterBoardData"]["analogOutput0"] != 0)
    assert robot.get_analog_in(0) == pytest.approx(0.0, abs=0.02)
    assert len(robot.get_analog_inputs()) == 2
    robot.set_tool_voltage(24)
    wait_until(lambda: robot.secmon.get_all_data()["ToolData"]["toolOutputVoltage"] == 24)
    robot.set_tool_voltage(0)


def test_settings_and_uploaded_programs(robot, old_box):
    flange = robot.get_pose().pos.array.copy()
    robot.set_tcp((0, 0, 0.1, 0, 0, 0))
    wait_until(lambda: abs(np.linalg.norm(robot.get_pose().pos.array - flange) - 0.1) < CLOSE_X)
    robot.set_tcp((0, 0, 0, 0, 0, 0))
    wait_until(lambda: np.linalg.norm(robot.get_pose().pos.array - flange) < CLOSE_X)
    robot.set_payload(0.5)
    robot.set_payload(0.0)
    robot.set_gravity([0, 0, 9.82])
    start = at_rest(robot)
    target = (np.add(start, [0.1, 0, 0, 0, 0, 0])).tolist()
    robot.send_program(f'def myProg():\n\ttextmsg("from urx")\n\tmovej({target}, a=8, v=2)\nend\n')
    wait_until(lambda: "from urx" in old_box.log.read_text())
    assert np.allclose(at_rest(robot), target, atol=CLOSE_Q)
    robot.movej(start, acc=ACCELERATION, vel=SPEED)


def test_the_realtime_monitor_sees_what_the_secondary_port_reports(robot):
    monitor = robot.get_realtime_monitor()
    joints = at_rest(robot)
    assert np.allclose(monitor.q_actual(wait=True), joints, atol=CLOSE_Q)
    assert np.allclose(monitor.q_target(), joints, atol=CLOSE_Q)
    pose = monitor.tcf_pose(wait=True)
    assert np.allclose(pose.pos.array, robot.get_pose().pos.array, atol=CLOSE_X)
    assert np.linalg.norm(monitor.tcf_force()[:3]) < 30
    assert robot.get_force() < 30
    robot.movej([0.2, 0, 0, 0, 0, 0], acc=ACCELERATION, vel=SPEED, relative=True, wait=False)
    wait_until(lambda: monitor.q_target()[0] - joints[0] > 0.15)
    stamps = [monitor.get_all_data(wait=True)["ctrltimestamp"].item() for _ in range(20)]
    assert stamps == sorted(stamps)
    cycles = np.diff(stamps) / 0.008
    assert np.allclose(cycles, np.round(cycles), atol=1e-3)
    at_rest(robot)


def test_a_gripper_follows_scripts(robot, old_box):
    """Each takes the voltage off the tool connector, activates the gripper and reads no answers."""
    from urx.robotiq_two_finger_gripper import Robotiq_Two_Finger_Gripper

    gripper = Robotiq_Two_Finger_Gripper(robot)
    with connect(old_box, "gripper") as watcher:

        def is_at(position):
            watcher.sendall(b"GET STA\nGET OBJ\nGET POS\n")
            return watcher.recv(100).decode() == f"STA 3\nOBJ 3\nPOS {position}\n"

        gripper.close_gripper()
        wait_until(lambda: is_at(230), "closed fingers")
        gripper.open_gripper()
        wait_until(lambda: is_at(3), "open fingers")
