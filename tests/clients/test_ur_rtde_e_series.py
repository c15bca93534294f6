"""ur_rtde as it is on a UR5e: 500 Hz, what only e-Series software has, remote control."""

import numpy as np
import pytest
from clients_support import served_box, wait_until
from ur_rtde_support import RTDEIO, Dashboard, connected, servo_along_a_sine, shifted

pytestmark = pytest.mark.nightly

PERIOD = 0.002  # s
HOME = (0.2238, -1.7062, -1.8784, -0.3550, 1.4132, 1.7304)  # rad


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    options = ("--robot", "ur5e", "--software", "5.25.1", "--fidelity", "ideal")
    with served_box(tmp_path_factory.mktemp("ur5e"), *options) as served:
        yield served


@pytest.fixture(scope="module")
def home_q():
    return HOME


def test_a_package_comes_every_two_milliseconds(arm):
    stamps = []
    while len(stamps) < 200:
        stamp = arm.receive.getTimestamp()
        if not stamps or stamp != stamps[-1]:
            stamps.append(stamp)
    steps = np.diff(stamps) / PERIOD
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    assert steps.min() == pytest.approx(1.0)


def test_joint_and_tool_moves(arm):
    wait_until(lambda: arm.control.getStepTime() == PERIOD, "the answer")
    goal = [HOME[0] + 0.2, *HOME[1:]]
    assert arm.control.moveJ(goal, 3.0, 12.0)
    assert arm.is_at(goal)
    pose = shifted(arm.receive.getTargetTCPPose(), 0, 0, 0.05)
    assert arm.control.moveL(pose, 0.5, 3.0)
    assert arm.is_at_pose(pose)


def test_servo_j_streams_at_500_hz(arm):
    target, actual = servo_along_a_sine(arm, PERIOD)
    assert np.abs(actual - target).max() < 2e-3


def test_speed_j_and_jogging(arm):
    assert arm.control.speedJ([0.4, 0, 0, 0, 0, 0], 4.0)
    arm.until(lambda r: r.getTargetQ()[0] - HOME[0] > 0.1)
    assert arm.control.speedStop(8.0)
    arm.still()
    start = arm.receive.getTargetTCPPose()
    assert arm.control.jogStart([0, 0, 0.05, 0, 0, 0], 0)
    arm.until(lambda r: r.getTargetTCPPose()[2] - start[2] > 0.01)
    assert arm.control.jogStop()
    arm.still()
    assert arm.receive.getTargetTCPPose()[:2] == pytest.approx(start[:2], abs=1e-4)


def test_a_contact_with_the_table_ends_the_motion(arm):
    assert arm.control.moveUntilContact([0, 0, -0.1, 0, 0, 0])
    arm.still()
    assert not arm.receive.isProtectiveStopped()
    assert arm.receive.getActualTCPPose()[2] < 0.1


def test_force_mode_pushes_the_tool(arm):
    start = arm.receive.getActualTCPPose()[2]
    assert arm.control.zeroFtSensor()
    frame, free = [0.0] * 6, [0, 0, 1, 0, 0, 0]
    wait_until(
        lambda: (
            arm.control.forceMode(frame, free, [0, 0, 8, 0, 0, 0], 2, [0.1] * 6)
            and arm.receive.getActualTCPPose()[2] > start + 0.01
        ),
        "the motion",
    )
    assert arm.control.forceModeStop()
    arm.still()


def test_payload_history_and_contact_questions(arm):
    control, receive = arm.control, arm.receive
    assert len(receive.getFtRawWrench()) == 6
    assert control.setPayload(1.5, [0, 0, 0.05])
    wait_until(lambda: receive.getPayload() == 1.5, "the payload")
    assert receive.getPayloadCog() == [0, 0, 0.05]
    assert control.setTargetPayload(1.0, [0, 0, 0.05], [0.01, 0.01, 0.01, 0, 0, 0])
    wait_until(lambda: receive.getPayloadInertia()[:3] == [0.01] * 3, "the inertia")
    assert control.setPayload(0.0, [0, 0, 0])
    wait_until(lambda: np.allclose(control.getActualJointPositionsHistory(10), HOME, atol=5e-4), "the answer")
    wait_until(lambda: control.toolContact([0, 0, 1, 0, 0, 0]) == 0, "the answer")


def test_contact_detection_and_freedrive(arm):
    control = arm.control
    assert control.startContactDetection([0, 0, 1, 0, 0, 0])
    assert not control.readContactDetection()
    assert not control.stopContactDetection()
    assert control.freedriveMode([1, 1, 0, 0, 0, 0], [0.0] * 6)
    wait_until(lambda: control.getFreedriveStatus() == 0, "the answer")
    assert control.endFreedriveMode()
    assert control.isProgramRunning()


def test_dynamics(arm):
    control = arm.control

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


def test_kinematics_of_a_tool_and_the_flange(arm):
    control, pose, tool = arm.control, arm.receive.getTargetTCPPose(), [0, 0, 0.1, 0, 0, 0]
    with_tool = control.poseTrans(pose, tool)
    assert control.getForwardKinematics(list(HOME), tool) == pytest.approx(with_tool, abs=1e-6)
    assert control.getInverseKinematics(pose, list(HOME)) == pytest.approx(HOME, abs=1e-6)
    assert control.getInverseKinematicsHasSolution(pose, list(HOME))
    assert not control.getInverseKinematicsHasSolution([3.0, 0, 0, 0, 0, 0], list(HOME))
    wait_until(lambda: np.allclose(control.getActualToolFlangePose(), pose, atol=1e-3), "the answer")


def test_an_output_and_the_speed_slider(arm):
    with connected(RTDEIO, arm.box.host) as io:
        assert io.setStandardDigitalOut(3, True)
        arm.until(lambda r: r.getDigitalOutState(3))
        assert io.setSpeedSlider(0.5)
        arm.until(lambda r: r.getTargetSpeedFraction() == 0.5)
        assert io.setSpeedSlider(1.0)


def test_dashboard(box):
    dashboard = Dashboard(box.host)
    dashboard.connect()
    try:
        assert dashboard.isInRemoteControl()
        assert dashboard.getSerialNumber() == box.serial_number
        assert dashboard.getRobotModel() == "UR5"
        assert dashboard.safetystatus() == "Safetystatus: NORMAL"
        assert dashboard.polyscopeVersion().startswith("5.25.1")
    finally:
        dashboard.disconnect()
