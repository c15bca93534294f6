"""ur_rtde's RTDEControlInterface: moves, paths, stops."""

import numpy as np
import pytest
from clients_support import wait_until
from ur_rtde_support import ACCELERATION, CLOSE_X, HOME, SPEED, home, rtde_control, shifted

PathEntry, Path = rtde_control.PathEntry, rtde_control.Path


def test_move_j(arm):
    assert arm.control.moveJ(home(0.3, 0.1), SPEED, ACCELERATION)
    assert arm.is_at(home(0.3, 0.1))


def test_move_l_goes_straight(arm):
    start = arm.receive.getTargetTCPPose()
    end = shifted(start, 0.03, 0.04, 0.05)
    assert arm.control.moveL(end, 0.15, 1.0, True)
    arm.until(lambda r: any(r.getTargetQd()))
    _, poses, speeds = arm.trace(lambda: any(arm.receive.getTargetQd()), "TargetTCPPose", "TargetTCPSpeed")
    assert arm.is_at_pose(end)
    along = np.subtract(end, start)[:3] / np.linalg.norm(np.subtract(end, start)[:3])
    offsets = poses[:, :3] - start[:3]
    travelled = offsets @ along
    assert np.abs(offsets - np.outer(travelled, along)).max() < 1e-5
    assert (np.diff(travelled) >= -1e-9).all()
    assert np.linalg.norm(speeds[:, :3], axis=1).max() == pytest.approx(0.15, abs=1e-3)


def test_move_j_to_a_pose_and_move_l_to_joints(arm):
    pose = arm.receive.getTargetTCPPose()
    up = shifted(pose, 0, 0, 0.04)
    assert arm.control.moveJ_IK(up, SPEED, ACCELERATION)
    assert arm.is_at_pose(up)
    assert arm.control.moveL_FK(list(HOME), 1.0, 5.0)
    assert arm.is_at(HOME)


def test_a_joint_path_with_blends_ends_where_it_began(arm):
    corners = [home(0.3), home(0.3, 0.25), home(0, 0.25), list(HOME)]
    path = [[*corner, 2.0, 8.0, blend] for corner, blend in zip(corners, (0.0, 0.02, 0.02, 0.0), strict=True)]
    assert arm.control.moveJ(path)
    assert arm.is_at(HOME)


def test_a_linear_path_with_blends_ends_where_it_began(arm):
    start = arm.receive.getTargetTCPPose()
    steps = ((0.0, 0.0, 0.05), (0.0, 0.05, 0.05), (0.0, 0.05, 0.0), (0.0, 0.0, 0.0))
    path = [[*shifted(start, *step), 0.5, 3.0, 0.01] for step in steps]
    path[-1][-1] = 0.0
    assert arm.control.moveL(path)
    assert arm.is_at_pose(start)


def test_move_path_with_every_kind_of_entry(arm):
    pose = arm.receive.getTargetTCPPose()
    path = Path()
    path.addEntry(PathEntry(PathEntry.MoveJ, PathEntry.PositionJoints, [*home(0.1), 2.0, 8.0, 0.0]))
    path.addEntry(PathEntry(PathEntry.MoveJ, PathEntry.PositionTcpPose, [*pose, 2.0, 8.0, 0.0]))
    path.addEntry(
        PathEntry(PathEntry.MoveL, PathEntry.PositionTcpPose, [*shifted(pose, 0, 0, 0.04), 0.5, 3.0, 0.005])
    )
    path.addEntry(PathEntry(PathEntry.MoveL, PathEntry.PositionJoints, [*HOME, 0.5, 3.0, 0.0]))
    path.addEntry(
        PathEntry(PathEntry.MoveP, PathEntry.PositionTcpPose, [*shifted(pose, 0, 0.03), 0.2, 2.0, 0.005])
    )
    assert path.size() == 5
    assert arm.control.movePath(path)
    assert arm.is_at_pose(shifted(pose, 0, 0.03))


def test_an_asynchronous_path_reports_its_waypoints(arm):
    path = [[*home(0.2 * (1 + n % 2)), 2.0, 8.0, 0.0] for n in range(3)]
    assert arm.control.moveJ(path, True)
    seen = []

    def is_over():
        seen.append(arm.control.getAsyncOperationProgress())
        return seen[-1] < 0 and max(seen) == 2

    wait_until(is_over, "the third waypoint")
    steps = [n for n in seen if n >= 0]
    assert steps == sorted(steps)
    assert set(steps) == {0, 1, 2}
    assert arm.is_at(home(0.2))


def test_an_asynchronous_move_can_be_stopped_and_replaced(arm):
    before = arm.control.getAsyncOperationProgressEx()
    assert arm.control.moveJ(home(1.0), 0.8, 4.0, True)
    arm.until(lambda r: r.getTargetQd()[0] > 0.3)
    during = arm.control.getAsyncOperationProgressEx()
    assert during.isAsyncOperationRunning()
    assert during.changeCount() != before.changeCount()
    arm.control.stopJ(8.0)
    wait_until(lambda: arm.control.getAsyncOperationProgress() < 0)
    arm.still()
    stopped = arm.receive.getTargetQ()[0] - HOME[0]
    assert 0.0 < stopped < 0.8
    assert arm.control.moveL(shifted(arm.receive.getTargetTCPPose(), 0, 0, 0.2), 0.1, 1.0, True)
    arm.until(lambda r: r.getTargetTCPSpeed()[2] > 0.08)
    arm.control.stopL(3.0)
    arm.still()
    assert arm.control.moveJ(home(-0.1), SPEED, ACCELERATION)
    assert arm.is_at(home(-0.1))


def test_stop_script_ends_the_program_and_reupload_begins_it_anew(arm):
    arm.control.stopScript()
    arm.until(lambda r: r.getRuntimeState() == 1)
    assert not arm.control.isProgramRunning()
    assert not arm.control.moveJ(home(0.5), SPEED, ACCELERATION)
    assert arm.is_at(HOME)
    arm.restart()
    assert arm.control.moveJ(home(0.1), SPEED, ACCELERATION)
    assert arm.is_at(home(0.1))


def test_reupload_while_the_script_runs(arm):
    arm.restart()
    wait_until(arm.control.isProgramRunning)
    wait_until(lambda: arm.control.moveJ(home(0.1), SPEED, ACCELERATION))
    assert arm.is_at(home(0.1))


def test_kinematics_agree_with_the_arm(arm):
    control, receive = arm.control, arm.receive
    pose = receive.getTargetTCPPose()
    close = {"rtol": 0, "atol": 1e-6}
    with_tool = control.getForwardKinematics(list(HOME), [0, 0, 0.1, 0, 0, 0])
    assert np.allclose(control.poseTrans(pose, [0, 0, 0.1, 0, 0, 0]), with_tool, **close)
    # For an all-zero tool the client writes 12 numbers into a recipe of 6: the rest is what an earlier call left.
    assert np.allclose(control.getForwardKinematics(list(HOME), [0.0] * 6), with_tool, **close)
    assert np.allclose(control.getForwardKinematics(), receive.getActualTCPPose(), rtol=0, atol=CLOSE_X)
    assert np.allclose(control.getInverseKinematics(pose, list(HOME)), HOME, **close)
    assert np.allclose(control.getInverseKinematics(pose), HOME, **close)
    assert control.getInverseKinematicsHasSolution(pose)
    assert not control.getInverseKinematicsHasSolution([2.0, 0, 0, 0, 0, 0])


def test_safety_limits_of_poses_and_joints(arm):
    control = arm.control
    assert control.isPoseWithinSafetyLimits(arm.receive.getTargetTCPPose())
    assert not control.isPoseWithinSafetyLimits([2.0, 0, 0, 0, 0, 0])
    assert control.isJointsWithinSafetyLimits(list(HOME))
    assert not control.isJointsWithinSafetyLimits([7.0, 0, 0, 0, 0, 0])


def test_tool_and_payload(arm):
    control, receive = arm.control, arm.receive
    flange = receive.getTargetTCPPose()
    assert control.setTcp([0.0, 0.02, 0.1, 0.0, 0.0, 0.0])
    assert np.allclose(control.getTCPOffset(), [0.0, 0.02, 0.1, 0.0, 0.0, 0.0], atol=1e-9)
    tool = control.poseTrans(flange, [0.0, 0.02, 0.1, 0.0, 0.0, 0.0])
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), tool, atol=1e-6))
    assert control.setTcp([0.0] * 6)
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), flange, atol=1e-6))
    assert control.setPayload(1.25, [0.01, 0.0, 0.05])
    arm.until(lambda r: r.getPayload() == 1.25)
    assert np.allclose(receive.getPayloadCog(), [0.01, 0.0, 0.05])
    assert control.setPayload(0.0, [0.0, 0.0, 0.0])
    assert control.setGravity([0.0, 0.0, 9.82])
    assert control.zeroFtSensor()


def test_steadiness_and_torques(arm):
    arm.still()
    wait_until(arm.control.isSteady, "steadiness")
    # The client reads the register before the script has answered: the first answer is an older one.
    arm.control.getJointTorques()
    arm.after(0.05)
    torques = arm.control.getJointTorques()
    assert np.allclose(torques, [0.0] * 6, atol=3.0)
    arm.control.getActualToolFlangePose()
    arm.after(0.05)
    assert np.allclose(arm.control.getActualToolFlangePose(), arm.receive.getActualTCPPose(), atol=CLOSE_X)
    assert arm.control.getRobotStatus() == 0b11


def test_functions_of_newer_robots_do_nothing_here(arm):
    """The client leaves them out of its script on a CB3; the script must live on."""
    control = arm.control
    control.getStepTime()
    control.toolContact([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    control.getTargetWaypoint()
    control.getActualJointPositionsHistory(2)
    control.moveUntilContact([0.0, 0.0, -0.05, 0.0, 0.0, 0.0])
    control.forceModeSetGainScaling(1.0)
    control.getFreedriveStatus()
    control.ftRtdeInputEnable(False)
    assert arm.is_at(HOME)
    assert control.moveJ(home(0.05), SPEED, ACCELERATION)
    assert control.isProgramRunning()
