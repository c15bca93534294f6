"""ur_rtde's interfaces for control, I/O and receiving: moves, stops, set-points, answers, programs, outputs, registers."""

import csv
import time
from contextlib import ExitStack

import numpy as np
import pytest
from clients_support import free_port, served_box, wait_until
from dashboard_support import external_control, urp
from ur_rtde_support import (
    ACCELERATION,
    CLOSE_X,
    GAIN,
    HOME,
    LOOKAHEAD,
    PERIOD,
    RTDEIO,
    SPEED,
    Arm,
    Dashboard,
    RTDEControl,
    RTDEReceive,
    connected,
    home,
    rtde_control,
    servo_along_a_sine,
    shifted,
)

PathEntry, Path = rtde_control.PathEntry, rtde_control.Path


def test_moves_and_paths_end_where_they_lead(arm):
    control, start = arm.control, arm.receive.getTargetTCPPose()
    up = shifted(start, 0, 0, 0.04)
    assert control.moveJ(home(0.3, 0.1), SPEED, ACCELERATION)
    assert arm.is_at(home(0.3, 0.1))
    assert control.moveJ_IK(start, SPEED, ACCELERATION)
    assert control.moveL(up, 0.5, 3.0)
    assert arm.is_at_pose(up)
    assert control.moveL_FK(list(HOME), 1.0, 5.0)
    assert arm.is_at(HOME)
    corners = [home(0.3), home(0.3, 0.25), home(0, 0.25), list(HOME)]
    blends = (0.0, 0.02, 0.02, 0.0)
    assert control.moveJ([[*q, 2.0, 8.0, blend] for q, blend in zip(corners, blends, strict=True)])
    assert arm.is_at(HOME)
    steps = ((0.0, 0.0, 0.05), (0.0, 0.05, 0.05), (0.0, 0.05, 0.0), (0.0, 0.0, 0.0))
    assert control.moveL([[*shifted(start, *step), 0.5, 3.0, 0.01 * any(step)] for step in steps])
    assert arm.is_at_pose(start)


def test_move_path_with_every_kind_of_entry(arm):
    pose, joints, tool = arm.receive.getTargetTCPPose(), PathEntry.PositionJoints, PathEntry.PositionTcpPose
    entries = (
        (PathEntry.MoveJ, joints, [*home(0.1), 2.0, 8.0, 0.0]),
        (PathEntry.MoveJ, tool, [*pose, 2.0, 8.0, 0.0]),
        (PathEntry.MoveL, tool, [*shifted(pose, 0, 0, 0.04), 0.5, 3.0, 0.005]),
        (PathEntry.MoveL, joints, [*HOME, 0.5, 3.0, 0.0]),
        (PathEntry.MoveP, tool, [*shifted(pose, 0, 0.03), 0.2, 2.0, 0.005]),
    )
    path = Path()
    for entry in entries:
        path.addEntry(PathEntry(*entry))
    assert arm.control.movePath(path)
    assert arm.is_at_pose(shifted(pose, 0, 0.03))


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
    assert 0.0 < arm.receive.getTargetQ()[0] - HOME[0] < 0.8
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
    for _ in range(2):  # the second one while the script runs
        arm.restart()
    wait_until(lambda: arm.control.moveJ(home(0.1), SPEED, ACCELERATION))
    assert arm.is_at(home(0.1))


# --- answers


def test_kinematics_and_safety_limits(arm):
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
    for ask, good, bad in (
        (control.getInverseKinematicsHasSolution, pose, [2.0, 0, 0, 0, 0, 0]),
        (control.isPoseWithinSafetyLimits, pose, [2.0, 0, 0, 0, 0, 0]),
        (control.isJointsWithinSafetyLimits, list(HOME), [7.0, 0, 0, 0, 0, 0]),
    ):
        assert ask(good)
        assert not ask(bad)


def test_tool_and_payload(arm):
    control, receive = arm.control, arm.receive
    flange, offset = receive.getTargetTCPPose(), [0.0, 0.02, 0.1, 0.0, 0.0, 0.0]
    assert control.setTcp(offset)
    assert np.allclose(control.getTCPOffset(), offset, atol=1e-9)
    tool = control.poseTrans(flange, offset)
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), tool, atol=1e-6))
    assert control.setTcp([0.0] * 6)
    assert control.setPayload(1.25, [0.01, 0.0, 0.05])
    arm.until(lambda r: r.getPayload() == 1.25)
    assert np.allclose(receive.getPayloadCog(), [0.01, 0.0, 0.05])
    assert control.setPayload(0.0, [0.0, 0.0, 0.0])
    assert control.setGravity([0.0, 0.0, 9.82])


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_the_box_fetches_the_control_script_itself(tmp_path):
    """The URCap's way: the client uploads nothing, the box asks it for its script when its program is played."""
    programs = tmp_path / "programs"
    programs.mkdir()

    def port():
        number = free_port()
        (programs / "external_control.urp").write_bytes(urp(external_control("127.0.0.1", number)))
        return number

    flags = RTDEControl.FLAG_USE_EXT_UR_CAP | RTDEControl.FLAG_NO_WAIT
    with (
        served_box(tmp_path, "--programs", programs) as box,
        connected(RTDEReceive, box.host) as receive,
        connected(RTDEControl, box.host, -1.0, flags, port=port) as control,
    ):
        dashboard = Dashboard(box.host)
        # ms; the usual two seconds may pass until a busy machine has compiled the script
        dashboard.connect(20_000)
        dashboard.loadURP("external_control.urp")
        dashboard.play()
        wait_until(control.isProgramRunning, "the program")
        assert dashboard.programState() == "PLAYING external_control.urp"
        arm = Arm(box=box, control=control, receive=receive, home=HOME)
        assert control.moveJ(home(0.1), 3.0, 12.0)
        assert arm.is_at(home(0.1))
        dashboard.stop()
        dashboard.disconnect()


@pytest.mark.nightly
def test_steadiness_and_torques(arm):
    arm.still()
    wait_until(arm.control.isSteady, "steadiness")
    # The client reads the register before the script has answered: the first answer is an older one.
    for ask, wanted, close in (
        (arm.control.getJointTorques, [0.0] * 6, 3.0),
        (arm.control.getActualToolFlangePose, arm.receive.getActualTCPPose(), CLOSE_X),
    ):
        ask()
        arm.after(0.05)
        assert np.allclose(ask(), wanted, atol=close)
    assert arm.control.getRobotStatus() == 0b11


STOP = 255  # the client's command for its script to end


@pytest.mark.nightly
def test_custom_functions_scripts_and_files(arm, tmp_path):
    function = (
        f"movej({home(0.2)}, a=12, v=3)\n"
        "q = get_actual_joint_positions()\n"
        "write_output_float_register(12, q[0])\n"
        "write_output_integer_register(12, 4711)\n"
    )
    assert arm.control.sendCustomScriptFunction("mine", function)
    arm.until(lambda r: r.getOutputIntRegister(12) == 4711)
    arm.until(lambda r: r.getOutputDoubleRegister(12) == pytest.approx(HOME[0] + 0.2, abs=0.01))
    # Whether the client still sees its custom program or the control script again is a matter of a moment.
    wait_until(lambda: arm.control.moveJ(list(HOME), 3.0, 12.0))
    script = (
        "def whole():\n  write_output_integer_register(13, {})\n  write_output_integer_register(0, 2)\nend\n"
    )
    assert arm.control.sendCustomScript(script.format(11))
    arm.until(lambda r: r.getOutputIntRegister(13) == 11)
    path = tmp_path / "whole.script"
    path.write_text(script.format(12))
    assert arm.control.sendCustomScriptFile(str(path))
    arm.until(lambda r: r.getOutputIntRegister(13) == 12)
    path.write_text(
        "def rtde_control():\n"
        "  write_output_integer_register(14, 77)\n"
        "  write_output_integer_register(0, 1)\n"
        f"  while read_input_integer_register(0) != {STOP}:\n    sync()\n  end\nend\n"
    )
    wait_until(arm.control.isProgramRunning)
    arm.control.setCustomScriptFile(str(path))
    arm.until(lambda r: r.getOutputIntRegister(14) == 77)
    wait_until(arm.control.isProgramRunning)
    arm.control.setCustomScriptFile("")
    wait_until(lambda: arm.control.isProgramRunning() and arm.control.moveJ(home(0.05), 3.0, 12.0))


@pytest.mark.nightly
def test_a_second_control_interface_in_the_upper_range(arm):
    """Its registers belong to nobody, the force input does: it connects, and its script replaces the first one's."""
    flags = RTDEControl.FLAG_UPPER_RANGE_REGISTERS | RTDEControl.FLAG_UPLOAD_SCRIPT
    with pytest.raises(RuntimeError, match="in use"):
        RTDEControl(arm.box.host, -1.0, flags)
    with connected(RTDEControl, arm.box.host, -1.0, flags | RTDEControl.FLAG_NO_EXT_FT) as second:
        assert second.moveJ(home(0.1), 3.0, 12.0)
        assert arm.is_at(home(0.1))
        second.stopScript()
    arm.get_ready()
    assert arm.is_at(HOME)


# --- inputs and outputs


VOLTAGE_RANGE, CURRENT_RANGE = 10.0, (0.004, 0.020)  # V, A


@pytest.fixture
def pair(box):
    """An I/O interface and a receiver that sees what it does."""
    with connected(RTDEIO, box.host) as io, connected(RTDEReceive, box.host) as receive:
        yield io, receive


def test_digital_outputs_go_on_and_off_also_after_reconnecting(pair):
    io, receive = pair
    io.disconnect()
    assert not io.isConnected()
    assert io.reconnect()
    kinds = (io.setStandardDigitalOut, 8), (io.setConfigurableDigitalOut, 8), (io.setToolDigitalOut, 2)
    setters = [(setter, n) for setter, count in kinds for n in range(count)]
    for level in (True, False):
        for setter, n in setters:
            assert setter(n, level)
        wait_until(lambda level=level: receive.getActualDigitalOutputBits() == level * ((1 << 18) - 1))
    assert io.setConfigurableDigitalOut(3, True)
    wait_until(lambda: receive.getDigitalOutState(11))
    assert io.setConfigurableDigitalOut(3, False)
    wait_until(lambda: receive.getActualDigitalOutputBits() == 0)


def test_analog_outputs_in_both_domains(pair):
    io, receive = pair
    getters = receive.getStandardAnalogOutput0, receive.getStandardAnalogOutput1
    for n, getter in enumerate(getters):
        other = getters[1 - n]()
        assert io.setAnalogOutputVoltage(n, 0.25)
        wait_until(lambda getter=getter: getter() == pytest.approx(0.25 * VOLTAGE_RANGE))
        assert getters[1 - n]() == other, "the channel that is not selected carries rubbish"
        for share, current in ((0.5, sum(CURRENT_RANGE) / 2), (0.0, CURRENT_RANGE[0])):
            assert io.setAnalogOutputCurrent(n, share)
            wait_until(lambda getter=getter, current=current: getter() == pytest.approx(current))


def test_the_speed_slider_slows_the_arm(arm):
    with connected(RTDEIO, arm.box.host) as io:
        try:
            assert io.setSpeedSlider(0.3)
            arm.until(lambda r: r.getTargetSpeedFraction() == pytest.approx(0.3))
            assert arm.control.moveJ(home(0.25), 1.0, 8.0, True)
            _, rates, combined = arm.trace(
                lambda: arm.control.getAsyncOperationProgress() >= 0, "TargetQd", "SpeedScalingCombined"
            )
            assert rates[:, 0].max() == pytest.approx(0.3, abs=1e-3)
            assert combined[-1] == pytest.approx(0.3, abs=0.02)
        finally:
            assert io.setSpeedSlider(1.0)
            arm.until(lambda r: r.getTargetSpeedFraction() == 1.0)


def copying(*numbers, by):
    """Return lines that copy input registers, once the last has come, to output registers with lower numbers."""
    last = numbers[-1]
    return f"while read_input_float_register({last}) != {last / 8}:\n  sync()\nend\n" + "".join(
        f"write_output_integer_register({n - by}, read_input_integer_register({n}))\n"
        f"write_output_float_register({n - by}, read_input_float_register({n}))\n"
        for n in numbers
    )


@pytest.mark.parametrize("numbers", [(18, 20, 22), (42, 43)], ids=["lower", "upper"])
def test_registers_reach_a_program(arm, numbers):
    """Written by the I/O interface, copied by a program of ours to where the receiver sees them."""
    is_upper = numbers[0] >= 24
    with (
        connected(RTDEIO, arm.box.host, False, is_upper) as io,
        connected(RTDEReceive, arm.box.host, 125.0, [], False, is_upper) as receive,
    ):
        for n in numbers:
            assert io.setInputIntRegister(n, 100 + n)
            assert io.setInputDoubleRegister(n, n / 8)
        assert arm.control.sendCustomScriptFunction("copy_registers", copying(*numbers, by=6))
        for n in numbers:
            wait_until(lambda n=n: receive.getOutputIntRegister(n - 6) == 100 + n)
            wait_until(lambda n=n: receive.getOutputDoubleRegister(n - 6) == n / 8)


def test_only_one_client_has_an_input(arm):
    """As on the real box: the second of two like clients is told that the registers are in use."""
    with pytest.raises(RuntimeError, match="in use"):
        RTDEControl(arm.box.host)
    with connected(RTDEIO, arm.box.host), pytest.raises(RuntimeError, match="in use"):
        RTDEIO(arm.box.host)
    with connected(RTDEIO, arm.box.host) as later:
        assert later.isConnected()
    assert arm.control.moveJ(home(0.05), 2.0, 8.0)


# --- speeds, set-points, forces, hand guiding


def test_speeds_until_they_are_stopped(arm):
    assert arm.control.speedJ([0.4, 0, 0, 0, 0, -0.2], 4.0)
    arm.until(lambda r: r.getTargetQ()[0] - HOME[0] > 0.1)
    assert np.allclose(arm.receive.getTargetQd(), [0.4, 0, 0, 0, 0, -0.2], atol=1e-9)
    assert arm.control.speedStop(8.0)
    arm.still()
    q = np.subtract(arm.receive.getTargetQ(), HOME)
    assert q[0] == pytest.approx(-2 * q[5], abs=1e-3)
    assert not q[1:5].any()
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


@pytest.mark.nightly
def test_servo_l_and_c_arrive_and_the_latter_costs_the_next_call(arm):
    """The client does not wait for the script's answer to it and so loses the call after it, as on the real box."""
    goal = shifted(arm.receive.getTargetTCPPose(), 0, 0, 0.02)
    assert arm.control.servoL(goal, 0.5, 0.5, PERIOD, LOOKAHEAD, GAIN)
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), goal, atol=2e-4))
    assert arm.control.servoStop()
    assert arm.is_at_pose(goal)
    goal = shifted(arm.receive.getTargetTCPPose(), 0, 0, 0.03)
    assert arm.control.servoC(goal, 0.25, 1.2, 0.0)
    arm.until(lambda r: np.allclose(r.getTargetTCPPose(), goal, atol=1e-4))
    assert not arm.control.isSteady()
    assert arm.control.servoStop()
    assert arm.is_at_pose(goal)


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


@pytest.mark.nightly
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


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_jogging(arm):
    for speed, feature in ((50, arm.control.FEATURE_BASE), (-50, arm.control.FEATURE_TOOL)):
        start = np.array(arm.receive.getTargetTCPPose()[:3])
        assert arm.control.jogStart([0, 0, speed, 0, 0, 0], feature)
        arm.until(lambda r, start=start: np.linalg.norm(r.getTargetTCPPose()[:3] - start) > 0.01)
        assert arm.control.jogStop()
        arm.still()
        if feature == arm.control.FEATURE_BASE:
            assert np.allclose(arm.receive.getTargetTCPPose()[:2], start[:2], atol=1e-3)


@pytest.mark.nightly
def test_hand_guiding(arm):
    assert arm.control.teachMode()
    arm.after(0.3)
    assert arm.control.isProgramRunning()
    assert arm.control.endTeachMode()
    arm.still()
    assert np.allclose(arm.receive.getActualQ(), HOME, atol=0.1)


@pytest.mark.nightly
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


@pytest.mark.nightly
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


# --- RTDEReceiveInterface: every getter, rates, recordings, recipes


RUNNING_ROBOT, NORMAL_SAFETY, RUNNING_JOINT, PLAYING = 7, 1, 253, 2


# What an arm at rest shows while the control script runs: together every getter that CB3 software 3.15 can fill.
AT_REST = {
    "TargetQd": [0.0] * 6, "TargetQdd": [0.0] * 6, "ActualDigitalInputBits": 0, "ActualDigitalOutputBits": 0,
    "RobotMode": RUNNING_ROBOT, "JointMode": [RUNNING_JOINT] * 6, "SafetyMode": NORMAL_SAFETY, "RuntimeState": PLAYING,
    "SpeedScaling": 1.0, "TargetSpeedFraction": 1.0, "SpeedScalingCombined": 1.0, "Payload": 0.0, "PayloadCog": [0.0] * 3,
    "PayloadInertia": [0.0] * 6, "SafetyStatusBits": 0b1,  # normal
    "RobotStatus": 0b11,  # power is on, a program runs
}  # fmt: skip
# Shape, the least and the most.
WITHIN = {
    "Timestamp": ((), 40.0, 1e6),  # s; above 40, or URCL takes the box for one that boots
    "ActualExecutionTime": ((), 0, 8), "ActualMomentum": ((), 0, 0.1), "ActualMainVoltage": ((), 46, 50),
    "ActualRobotVoltage": ((), 46, 50), "ActualRobotCurrent": ((), 0.1, 4), "StandardAnalogInput0": ((), 0, 10),
    "StandardAnalogInput1": ((), 0, 10), "StandardAnalogOutput0": ((), 0, 10), "StandardAnalogOutput1": ((), 0, 10),
    "TargetQ": ((6,), -6.3, 6.3), "ActualQ": ((6,), -6.3, 6.3), "ActualQd": ((6,), -2e-3, 2e-3),
    "TargetCurrent": ((6,), -4, 4), "ActualCurrent": ((6,), -4, 4), "JointControlOutput": ((6,), -4, 4),
    "TargetMoment": ((6,), -20, 20), "ActualTCPPose": ((6,), -3.2, 3.2), "TargetTCPPose": ((6,), -3.2, 3.2),
    "ActualTCPSpeed": ((6,), -2e-3, 2e-3), "TargetTCPSpeed": ((6,), -1e-9, 1e-9), "ActualTCPForce": ((6,), -25, 25),
    "JointTemperatures": ((6,), 15, 60), "ActualJointVoltage": ((6,), 44, 50), "ActualToolAccelerometer": ((3,), -12, 12),
}  # fmt: skip
# e-Series only; the others take an argument.
OTHERS = {"FtRawWrench", "DigitalInState", "DigitalOutState", "OutputIntRegister", "OutputDoubleRegister"}


def test_every_getter_is_plausible_at_rest(arm):
    assert arm.control.setPayload(0.0, [0.0, 0.0, 0.0])
    assert arm.is_at(HOME)
    arm.after(0.5)  # what is left of the motion fades
    names = {name[3:] for name in dir(arm.receive) if name.startswith("get")}
    assert names == AT_REST.keys() | WITHIN.keys() | OTHERS
    shown = {name: getattr(arm.receive, f"get{name}")() for name in names - OTHERS}
    assert {name: shown[name] for name in AT_REST} == AT_REST
    for name, (shape, least, most) in WITHIN.items():
        value = np.array(shown[name])
        assert value.shape == shape, name
        assert ((value >= least) & (value <= most)).all(), name
    with pytest.raises(RuntimeError):
        arm.receive.getFtRawWrench()


def test_a_slower_stream_comes_in_whole_multiples_of_a_cycle(box):
    with connected(RTDEReceive, box.host, 25.0) as receive:
        seen = {receive.getTimestamp()}
        wait_until(lambda: seen.add(receive.getTimestamp()) or len(seen) >= 12)
    gaps = np.diff(sorted(seen)) / (5 * PERIOD)
    assert np.allclose(gaps, np.round(gaps), atol=1e-3)
    assert np.round(gaps).min() >= 1


def test_recording_has_a_row_for_what_was_asked(arm, tmp_path):
    path = tmp_path / "arm.csv"
    assert arm.receive.startFileRecording(
        str(path), ["timestamp", "actual_q", "actual_TCP_pose", "robot_mode"]
    )
    arm.after(0.5)
    assert arm.receive.stopFileRecording()
    header, *rows = list(csv.reader(path.read_text().splitlines()))
    assert header[:2] == ["timestamp", "actual_q_0"]
    assert len(header) == 14
    stamps = np.array([float(row[0]) for row in rows[:-1]])
    assert len(set(stamps)) > 10
    assert (np.diff(stamps) >= 0).all()
    assert {row[13] for row in rows[:-1]} == {"7"}


def test_a_recipe_of_ones_own(box):
    names = ["timestamp", "actual_tool_accelerometer", "target_q", "robot_mode"]
    with connected(RTDEReceive, box.host, -1.0, names) as receive:
        assert receive.getRobotMode() == RUNNING_ROBOT
        assert len(receive.getTargetQ()) == 6
        with pytest.raises(RuntimeError):
            receive.getActualQ()
    with pytest.raises(RuntimeError, match="actual_nothing"):
        RTDEReceive(box.host, -1.0, ["timestamp", "actual_nothing"])


@pytest.mark.nightly
def test_three_receivers_and_a_reconnect(box):
    with ExitStack() as stack:
        receivers = [stack.enter_context(connected(RTDEReceive, box.host)) for _ in range(3)]
        before = [r.getTimestamp() for r in receivers]
        wait_until(lambda: all(r.getTimestamp() > t for r, t in zip(receivers, before, strict=True)))
        receivers[0].disconnect()
        assert not receivers[0].isConnected()
        assert receivers[0].reconnect()
        assert receivers[0].isConnected()
        stamp = receivers[0].getTimestamp()
        wait_until(lambda: receivers[0].getTimestamp() > stamp)


@pytest.mark.nightly
@pytest.mark.ur(pace="realtime", standard_ports=True)
def test_all_three_interfaces_work_with_the_fixture_of_the_plug_in(ur_box):
    """They hold Python's lock while they wait: a box in a thread of this process could never answer."""
    with (
        connected(RTDEReceive, ur_box.host) as receive,
        connected(RTDEIO, ur_box.host) as io,
        connected(RTDEControl, ur_box.host) as control,
    ):
        assert receive.getActualQ() == pytest.approx(ur_box.state.q, abs=1e-3)
        assert io.setStandardDigitalOut(1, True)
        assert control.moveJ([0.5, -1.5, -1.8, 0.0, 1.2, 1.5], 2.0, 4.0)
        assert ur_box.state.q == pytest.approx([0.5, -1.5, -1.8, 0.0, 1.2, 1.5], abs=0.01)
        assert ur_box.state.digital_outputs["standard"][1]
