"""ur_rtde's RTDEControlInterface: set-points at 125 Hz, speeds, forces, hand guiding."""

import time

import numpy as np
import pytest
from clients_support import wait_until
from ur_rtde_support import GAIN, HOME, LOOKAHEAD, PERIOD, home, servo_along_a_sine, shifted


def test_speed_j_until_it_is_stopped(arm):
    assert arm.control.speedJ([0.4, 0, 0, 0, 0, -0.2], 4.0)
    arm.until(lambda r: r.getTargetQ()[0] - HOME[0] > 0.1)
    assert np.allclose(arm.receive.getTargetQd(), [0.4, 0, 0, 0, 0, -0.2], atol=1e-9)
    arm.until(lambda r: np.allclose(r.getActualQd(), [0.4, 0, 0, 0, 0, -0.2], atol=0.05))
    assert arm.control.speedStop(8.0)
    arm.still()
    q = np.subtract(arm.receive.getTargetQ(), HOME)
    assert q[0] == pytest.approx(-2 * q[5], abs=1e-3)
    assert not q[1:5].any()


def test_speed_l_moves_the_tool_along_a_line(arm):
    start = arm.receive.getTargetTCPPose()
    assert arm.control.speedL([0, 0.03, 0.04, 0, 0, 0], 1.0)
    arm.until(lambda r: r.getTargetTCPPose()[2] - start[2] > 0.02)
    assert np.allclose(arm.receive.getTargetTCPSpeed(), [0, 0.03, 0.04, 0, 0, 0], atol=1e-4)
    assert arm.control.speedStop(2.0)
    arm.still()
    moved = np.subtract(arm.receive.getTargetTCPPose(), start)
    assert moved[1] / moved[2] == pytest.approx(0.75, abs=0.01)
    assert np.allclose(moved[[0, 3, 4, 5]], 0, atol=1e-4)


def test_servo_j_follows_a_sine(arm):
    target, actual = servo_along_a_sine(arm, PERIOD)
    assert np.abs(actual - target).max() < 0.02


def test_servo_j_arrives_and_holds(arm):
    assert arm.control.servoJ(home(0.05, 0.02), 0.5, 0.5, PERIOD, LOOKAHEAD, GAIN)
    arm.until(lambda r: np.allclose(r.getTargetQ(), home(0.05, 0.02), atol=1e-4))
    assert arm.control.servoStop()
    assert arm.is_at(home(0.05, 0.02))


def test_servo_l_arrives(arm):
    goal = shifted(arm.receive.getTargetTCPPose(), 0, 0, 0.02)
    assert arm.control.servoL(goal, 0.5, 0.5, PERIOD, LOOKAHEAD, GAIN)
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), goal, atol=2e-4))
    assert arm.control.servoStop()
    assert arm.is_at_pose(goal)


@pytest.mark.slow
def test_servo_c_arrives_and_costs_the_next_call(arm):
    """The client does not wait for the script's answer and so loses the call after it, as on the real box."""
    goal = shifted(arm.receive.getTargetTCPPose(), 0, 0, 0.03)
    assert arm.control.servoC(goal, 0.25, 1.2, 0.0)
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), goal, atol=1e-4))
    assert not arm.control.isSteady()
    assert arm.control.servoStop()
    assert arm.is_at_pose(goal)


def test_jogging(arm):
    start = arm.receive.getTargetTCPPose()
    assert arm.control.jogStart([0, 0, 50, 0, 0, 0], arm.control.FEATURE_BASE)
    arm.until(lambda r: r.getTargetTCPPose()[2] - start[2] > 0.01)
    assert arm.control.jogStop()
    arm.still()
    assert np.allclose(arm.receive.getTargetTCPPose()[:2], start[:2], atol=1e-3)
    here = arm.receive.getTargetTCPPose()
    assert arm.control.jogStart([0, 0, -50, 0, 0, 0], arm.control.FEATURE_TOOL)
    arm.until(lambda r: np.linalg.norm(np.subtract(r.getTargetTCPPose(), here)[:3]) > 0.01)
    assert arm.control.jogStop()
    arm.still()


def test_force_mode_yields_along_its_axis(arm):
    start = arm.receive.getActualTCPPose()
    assert arm.control.zeroFtSensor()
    assert arm.control.forceModeSetDamping(0.01)
    frame, axes, limits = [0.0] * 6, [0, 0, 1, 0, 0, 0], [0.1, 0.1, 0.15, 0.3, 0.3, 0.3]
    assert arm.control.forceMode(frame, axes, [0, 0, -20.0, 0, 0, 0], 2, limits)
    arm.until(lambda r: r.getActualTCPPose()[2] < start[2] - 0.01)
    assert arm.control.forceMode(frame, axes, [0, 0, 20.0, 0, 0, 0], 2, limits)
    arm.until(lambda r: r.getActualTCPPose()[2] > start[2])
    assert arm.control.forceModeStop()
    arm.still()
    assert np.allclose(arm.receive.getActualTCPPose()[:2], start[:2], atol=0.01)
    assert arm.control.isProgramRunning()


def test_hand_guiding(arm):
    assert arm.control.teachMode()
    arm.after(0.3)
    assert arm.control.isProgramRunning()
    assert arm.control.endTeachMode()
    arm.still()
    assert np.allclose(arm.receive.getActualQ(), HOME, atol=0.1)


def test_a_watchdog_that_is_kicked_lets_the_script_live(arm):
    """Then it is not kicked any more and the script ends, 2 s later: a busy machine may kick late."""
    assert arm.control.setWatchdog(0.5)
    start = arm.receive.getTimestamp()
    while arm.receive.getTimestamp() < start + 0.6:
        assert arm.control.kickWatchdog()
        time.sleep(0.02)
    assert arm.control.isProgramRunning()
    wait_until(lambda: not arm.control.isProgramRunning(), "the end of the script")
    # The two interfaces have a connection each: the same cycle comes to the other one a little later.
    wait_until(lambda: arm.receive.getRuntimeState() == 1, "the end of the script in the other connection")
    arm.restart()


@pytest.mark.slow
def test_a_protective_stop_and_the_way_out(arm):
    """The script cannot go on; the client says so, and works again after unlocking and uploading."""
    assert arm.control.triggerProtectiveStop()
    arm.until(lambda r: r.isProtectiveStopped())
    assert arm.receive.getSafetyMode() == 3
    assert arm.receive.getSafetyStatusBits() & 0b100
    assert not arm.receive.isEmergencyStopped()
    assert not arm.control.moveJ(home(0.2), 1.0, 1.0)
    (refusal,) = arm.unlock()
    assert "until 5s after occurrence" in refusal
    arm.until(lambda r: r.getSafetyMode() == 1)
    arm.restart()
    assert arm.control.moveJ(home(0.1), 2.0, 8.0)
    assert arm.is_at(home(0.1))


@pytest.mark.slow
def test_a_package_that_is_too_short_is_survived(arm):
    """The client sends external forces with a recipe that has no place for them and needs four bytes more."""
    for _ in range(5):
        assert arm.control.setExternalForceTorque([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    assert arm.control.isProgramRunning()
    # The client takes the script's answer to the lost command for that to the next one.
    arm.after(0.1)
    arm.control.isSteady()
    wait_until(lambda: arm.control.moveJ(home(0.05), 2.0, 8.0))
    assert arm.is_at(home(0.05))
