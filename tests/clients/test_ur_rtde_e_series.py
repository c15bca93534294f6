"""ur_rtde as it is on a UR5e: 500 Hz, what only e-Series software has, remote control."""

import numpy as np
import pytest
from clients_support import served_box
from ur_rtde_support import RTDEIO, Dashboard, RTDEControl, RTDEReceive, connected, sample, wait_until

PERIOD = 0.002  # s
HOME = (0.2238, -1.7062, -1.8784, -0.3550, 1.4132, 1.7304)  # rad
LOOKAHEAD, GAIN = 0.1, 300


@pytest.fixture(scope="module", params=["5.12.0"])
def box(request, tmp_path_factory):
    options = ("--robot", "ur5e", "--software", request.param, "--fidelity", "ideal")
    with served_box(tmp_path_factory.mktemp("ur5e"), *options) as served:
        yield served


@pytest.fixture(scope="module")
def receive(box):
    with connected(RTDEReceive, box.host) as client:
        yield client


@pytest.fixture(scope="module")
def connected_control(box):
    with connected(RTDEControl, box.host) as client:
        yield client


@pytest.fixture
def control(connected_control, receive):
    """The control script runs and the arm is at its start."""
    if not connected_control.isProgramRunning():
        assert connected_control.reuploadScript()
        wait_until(connected_control.isProgramRunning, "the control script")
    wait_until(lambda: connected_control.moveJ(list(HOME), 3.0, 12.0), "the start")
    # The answer may overtake the last packages of the move.
    wait_until(lambda: np.allclose(receive.getTargetQ(), HOME, rtol=0, atol=1e-9), "the start is seen")
    return connected_control


def still(receive):
    wait_until(lambda: not any(receive.getTargetQd()) and np.abs(receive.getActualQd()).max() < 2e-3, "rest")


def test_a_package_comes_every_two_milliseconds(receive):
    stamps = []
    while len(stamps) < 200:
        stamp = receive.getTimestamp()
        if not stamps or stamp != stamps[-1]:
            stamps.append(stamp)
    steps = np.diff(stamps) / PERIOD
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    assert steps.min() == pytest.approx(1.0)


def test_what_only_e_series_software_sends(receive):
    raw, force = receive.getFtRawWrench(), receive.getActualTCPForce()
    assert len(raw) == len(force) == 6
    assert receive.getPayload() == 0.0
    assert receive.getPayloadInertia() == [0.0] * 6


def test_joint_and_tool_moves(control, receive):
    wait_until(lambda: control.getStepTime() == PERIOD, "the answer")
    goal = [HOME[0] + 0.2, *HOME[1:]]
    assert control.moveJ(goal, 3.0, 12.0)
    still(receive)
    assert receive.getActualQ() == pytest.approx(goal, abs=5e-4)
    pose = receive.getTargetTCPPose()
    pose[2] += 0.05
    assert control.moveL(pose, 0.5, 3.0)
    still(receive)
    assert receive.getActualTCPPose() == pytest.approx(pose, abs=1e-3)


def test_servo_j_streams_at_500_hz(control, receive):
    amplitude, frequency, duration = 0.1, 0.5, 2.0  # rad, Hz, s
    start = receive.getTimestamp()
    rows = []
    while (now := receive.getTimestamp() - start) < duration:
        begin = control.initPeriod()
        offset = amplitude * (1 - np.cos(2 * np.pi * frequency * now)) / 2
        assert control.servoJ([HOME[0] + offset, *HOME[1:]], 0.5, 0.5, PERIOD, LOOKAHEAD, GAIN)
        rows.append(sample(receive, "Timestamp", "TargetQ", "ActualQ")[1])
        control.waitPeriod(begin)
    assert control.servoStop(5.0)
    still(receive)
    target, actual = (np.array([row[k][0] for row in rows]) for k in (1, 2))
    assert len(rows) > 50
    assert np.ptp(target) > 0.8 * amplitude
    assert np.abs(actual - target).max() < 2e-3


def test_speed_j_is_followed(control, receive):
    assert control.speedJ([0.4, 0, 0, 0, 0, 0], 4.0)
    wait_until(lambda: receive.getActualQ()[0] - HOME[0] > 0.1, "the motion")
    assert receive.getTargetQd() == pytest.approx([0.4, 0, 0, 0, 0, 0], abs=1e-9)
    assert receive.getActualQd() == pytest.approx([0.4, 0, 0, 0, 0, 0], abs=0.02)
    assert control.speedStop(8.0)
    still(receive)


def test_jog_until_it_is_stopped(control, receive):
    start = receive.getTargetTCPPose()
    assert control.jogStart([0, 0, 0.05, 0, 0, 0], 0)
    wait_until(lambda: receive.getTargetTCPPose()[2] - start[2] > 0.01, "the motion")
    assert control.jogStop()
    still(receive)
    moved = np.subtract(receive.getTargetTCPPose(), start)
    assert moved[:2] == pytest.approx([0, 0], abs=1e-4)


def test_a_contact_with_the_table_ends_the_motion(control, receive):
    assert control.moveUntilContact([0, 0, -0.1, 0, 0, 0])
    still(receive)
    assert not receive.isProtectiveStopped()
    assert receive.getActualTCPPose()[2] < 0.1


def test_force_mode_pushes_the_tool(control, receive):
    start = receive.getActualTCPPose()[2]
    assert control.zeroFtSensor()
    frame, free = [0.0] * 6, [0, 0, 1, 0, 0, 0]
    wait_until(
        lambda: (
            control.forceMode(frame, free, [0, 0, 8, 0, 0, 0], 2, [0.1] * 6)
            and receive.getActualTCPPose()[2] > start + 0.01
        ),
        "the motion",
    )
    assert control.forceModeStop()
    still(receive)


@pytest.mark.slow
@pytest.mark.parametrize("robot", [("ur5",), ("ur5e", "--software", "5.25.1")], ids=["ur5", "ur5e"])
def test_the_force_mode_check_of_its_own_suite(robot, tmp_path):
    """Two seconds down with 10 N, two up: its pose is a UR5e's 1.3 mm below the start, 5 % of 1 m and itself allowed."""
    frame, free, limits = [0.0] * 6, [0, 0, 1, 0, 0, 0], [2, 2, 1.5, 1, 1, 1]
    options = ("--robot", *robot, "--fidelity", "ideal")
    with (
        served_box(tmp_path, *options) as box,
        connected(RTDEReceive, box.host) as receive,
        connected(RTDEControl, box.host) as control,
    ):
        assert control.moveJ([-1.54, -1.83, -2.28, -0.59, 1.60, 0.023])
        still(receive)
        goal = np.array(receive.getActualTCPPose())
        goal[2] -= 0.0013
        for force in (-10.0, 10.0):
            end = receive.getTimestamp() + 2.0
            while receive.getTimestamp() < end:
                begin = control.initPeriod()
                assert control.forceMode(frame, free, [0, 0, force, 0, 0, 0], 2, limits)
                control.waitPeriod(begin)
        assert control.forceModeStop()
        still(receive)
        assert receive.getActualTCPPose() == pytest.approx(goal, abs=0.05)


def test_payload_history_and_contact_questions(control, receive):
    assert control.setPayload(1.5, [0, 0, 0.05])
    wait_until(lambda: receive.getPayload() == 1.5, "the payload")
    assert receive.getPayloadCog() == [0, 0, 0.05]
    wait_until(lambda: np.allclose(control.getActualJointPositionsHistory(10), HOME, atol=5e-4), "the answer")
    wait_until(lambda: control.toolContact([0, 0, 1, 0, 0, 0]) == 0, "the answer")
    assert control.setPayload(0.0, [0, 0, 0])


def test_kinematics_and_settings(control, receive):
    pose = receive.getTargetTCPPose()
    tool = [0, 0, 0.1, 0, 0, 0]
    assert control.getForwardKinematics(list(HOME), tool) == pytest.approx(
        control.poseTrans(pose, tool), abs=1e-6
    )
    assert control.getInverseKinematics(pose, list(HOME)) == pytest.approx(HOME, abs=1e-6)
    assert control.getInverseKinematicsHasSolution(pose, list(HOME))
    assert not control.getInverseKinematicsHasSolution([3.0, 0, 0, 0, 0, 0], list(HOME))
    wait_until(lambda: np.allclose(control.getActualToolFlangePose(), pose, atol=1e-3), "the answer")
    assert control.setTcp(tool)
    assert control.getTCPOffset() == tool
    assert control.setTcp([0.0] * 6)
    assert control.setTargetPayload(1.0, [0, 0, 0.05], [0.01, 0.01, 0.01, 0, 0, 0])
    wait_until(lambda: receive.getPayloadInertia()[:3] == [0.01] * 3, "the inertia")
    assert control.setPayload(0.0, [0, 0, 0])


def test_contact_detection_and_freedrive(control):
    assert control.startContactDetection([0, 0, 1, 0, 0, 0])
    assert not control.readContactDetection()
    assert not control.stopContactDetection()
    assert control.freedriveMode([1, 1, 0, 0, 0, 0], [0.0] * 6)
    wait_until(lambda: control.getFreedriveStatus() == 0, "the answer")
    assert control.endFreedriveMode()
    assert control.isProgramRunning()


@pytest.mark.slow
def test_dynamics_of_newer_software(tmp_path):
    options = ("--robot", "ur5e", "--software", "5.25.1", "--fidelity", "ideal")
    with served_box(tmp_path, *options) as newer, connected(RTDEControl, newer.host) as control:

        def answer(question, *arguments):
            wait_until(lambda: any(question(*arguments)), "the answer")  # the first shows what was before
            return np.array(question(*arguments))

        mass = answer(control.getMassMatrix, list(HOME), True).reshape(6, 6)
        assert mass == pytest.approx(mass.T)
        assert np.linalg.eigvalsh(mass).min() > -1e-9  # wrist 3 has a point mass on its axis
        jacobian = answer(control.getJacobian, list(HOME), [0.0] * 6).reshape(6, 6)
        assert jacobian[:, 0][5] == pytest.approx(1.0) or jacobian[0][5] == pytest.approx(1.0)
        # The client's script asks for those of the moment: the arm rests.
        zeros = [0.0] * 6
        wait_until(lambda: control.getCoriolisAndCentrifugalTorques(list(HOME), zeros) == zeros, "the answer")


def test_outputs(box, receive):
    with connected(RTDEIO, box.host) as io:
        assert io.setStandardDigitalOut(3, True)
        wait_until(lambda: receive.getDigitalOutState(3), "the output")
        assert io.setSpeedSlider(0.5)
        wait_until(lambda: receive.getTargetSpeedFraction() == 0.5, "the slider")
        assert io.setSpeedSlider(1.0)
        assert io.setStandardDigitalOut(3, False)


def test_dashboard(box):
    dashboard = Dashboard(box.host)
    dashboard.connect()
    try:
        assert dashboard.isInRemoteControl()
        assert dashboard.getSerialNumber() == box.serial_number
        assert dashboard.getRobotModel() == "UR5"
        assert dashboard.safetystatus() == "Safetystatus: NORMAL"
        assert dashboard.polyscopeVersion().startswith("5.12.0")
    finally:
        dashboard.disconnect()
