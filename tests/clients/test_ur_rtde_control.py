"""ur_rtde's RTDEControlInterface: moves, paths, stops; programs of its users, its upper range, its URCap mode.

Then RTDEIOInterface beside the other interfaces: outputs, slider, registers, and who may have them; and set-points
at 125 Hz, speeds, forces, hand guiding.
"""

import gzip
import time

import numpy as np
import pytest
from clients_support import free_port, served_box, wait_until
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


STOP = 255  # the client's command for its script to end


def test_a_custom_function_runs_and_the_control_script_returns(arm):
    function = (
        f"movej({home(0.2)}, a=12, v=3)\n"
        "q = get_actual_joint_positions()\n"
        "write_output_float_register(12, q[0])\n"
        "write_output_integer_register(12, 4711)\n"
    )
    assert arm.control.sendCustomScriptFunction("mine", function)
    arm.until(lambda r: r.getOutputIntRegister(12) == 4711)
    arm.until(lambda r: r.getOutputDoubleRegister(12) == pytest.approx(HOME[0] + 0.2, abs=0.01))
    assert arm.is_at(home(0.2))
    # Whether the client still sees its custom program or the control script again is a matter of a moment.
    wait_until(lambda: arm.control.moveJ(list(HOME), 3.0, 12.0))


def test_a_custom_script_and_a_script_file(arm, tmp_path):
    script = (
        "def whole():\n  write_output_integer_register(13, {})\n  write_output_integer_register(0, 2)\nend\n"
    )
    assert arm.control.sendCustomScript(script.format(11))
    arm.until(lambda r: r.getOutputIntRegister(13) == 11)
    path = tmp_path / "whole.script"
    path.write_text(script.format(12))
    assert arm.control.sendCustomScriptFile(str(path))
    arm.until(lambda r: r.getOutputIntRegister(13) == 12)
    wait_until(lambda: arm.control.moveJ(home(0.05), 3.0, 12.0))


def test_another_control_script(arm, tmp_path):
    path = tmp_path / "control.script"
    path.write_text(
        "def rtde_control():\n"
        "  write_output_integer_register(14, 77)\n"
        "  write_output_integer_register(0, 1)\n"
        f"  while read_input_integer_register(0) != {STOP}:\n    sync()\n  end\nend\n"
    )
    arm.control.setCustomScriptFile(str(path))
    arm.until(lambda r: r.getOutputIntRegister(14) == 77)
    wait_until(arm.control.isProgramRunning)
    arm.control.setCustomScriptFile("")
    wait_until(lambda: arm.control.isProgramRunning() and arm.control.moveJ(home(0.05), 3.0, 12.0))


@pytest.mark.slow
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


def test_a_client_that_left_its_script_running_leaves_the_box_to_the_next(arm):
    arm.control.disconnect()
    with connected(RTDEControl, arm.box.host) as second:
        assert second.moveJ(home(0.1), 3.0, 12.0)
    assert arm.control.reconnect()
    arm.get_ready()
    assert arm.is_at(HOME)


def external_control(port):
    """A program with one External Control node, as PolyScope would save it, that asks this PC."""
    data = f'<data key="host_ip" value="127.0.0.1"/><data key="port_nr" value="{port}"/>'
    node = (
        '<Contributed strategyClass="com.fzi.externalcontrol.ExternalControlNode" '
        'strategyProgramNodeType="External Control" strategyURCapName="External Control">'
        f"<dataModel>{data}</dataModel></Contributed>"
    )
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><URProgram name="external_control" installation="default">'
        '<children><MainProgram runOnlyOnce="true"><children>'
        f"{node}</children></MainProgram></children></URProgram>"
    )
    return gzip.compress(text.encode(), mtime=0)


@pytest.mark.slow
def test_the_box_fetches_the_control_script_itself(tmp_path):
    """The URCap's way: the client uploads nothing, the box asks it for its script when its program is played."""
    programs = tmp_path / "programs"
    programs.mkdir()

    def port():
        number = free_port()
        (programs / "external_control.urp").write_bytes(external_control(number))
        return number

    flags = RTDEControl.FLAG_USE_EXT_UR_CAP | RTDEControl.FLAG_NO_WAIT
    with (
        served_box(tmp_path, "--programs", programs) as box,
        connected(RTDEReceive, box.host) as receive,
        connected(RTDEControl, box.host, -1.0, flags, port=port) as control,
    ):
        dashboard = Dashboard(box.host)
        dashboard.connect(
            20_000
        )  # ms; the usual two seconds may pass until a busy machine has compiled the script
        dashboard.loadURP("external_control.urp")
        dashboard.play()
        wait_until(control.isProgramRunning, "the program")
        assert dashboard.programState() == "PLAYING external_control.urp"
        arm = Arm(box=box, control=control, receive=receive, home=HOME)
        assert control.moveJ(home(0.1), 3.0, 12.0)
        assert arm.is_at(home(0.1))
        dashboard.stop()
        dashboard.disconnect()


VOLTAGE_RANGE, CURRENT_RANGE = 10.0, (0.004, 0.020)  # V, A
DIGITAL_OUTPUTS = 18


@pytest.fixture
def pair(box):
    """An I/O interface and a receiver that sees what it does."""
    with connected(RTDEIO, box.host) as io, connected(RTDEReceive, box.host) as receive:
        yield io, receive


def test_every_digital_output_goes_on_and_off(pair):
    io, receive = pair
    setters = (
        [(io.setStandardDigitalOut, n) for n in range(8)]
        + [(io.setConfigurableDigitalOut, n) for n in range(8)]
        + [(io.setToolDigitalOut, n) for n in range(2)]
    )
    assert len(setters) == DIGITAL_OUTPUTS
    for bit, (setter, n) in enumerate(setters):
        assert setter(n, True)
        wait_until(lambda bit=bit: receive.getActualDigitalOutputBits() == (2 << bit) - 1, f"output {bit}")
        assert receive.getDigitalOutState(bit)
    for bit, (setter, n) in enumerate(setters):
        assert setter(n, False)
        wait_until(lambda bit=bit: not receive.getDigitalOutState(bit), f"the end of output {bit}")
    assert receive.getActualDigitalOutputBits() == 0


def test_analog_outputs_in_both_domains(pair):
    io, receive = pair
    getters = receive.getStandardAnalogOutput0, receive.getStandardAnalogOutput1
    for n, getter in enumerate(getters):
        other = getters[1 - n]()
        assert io.setAnalogOutputVoltage(n, 0.25)
        wait_until(lambda getter=getter: getter() == pytest.approx(0.25 * VOLTAGE_RANGE))
        assert getters[1 - n]() == other, "the channel that is not selected carries rubbish"
        assert io.setAnalogOutputCurrent(n, 0.5)
        wait_until(lambda getter=getter: getter() == pytest.approx(sum(CURRENT_RANGE) / 2))
        assert io.setAnalogOutputCurrent(n, 0.0)
        wait_until(lambda getter=getter: getter() == pytest.approx(CURRENT_RANGE[0]))


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


def test_registers_reach_a_program(arm):
    """Written by the I/O interface, copied by a program of ours to where the receiver sees them."""
    numbers = range(18, 23)
    with connected(RTDEIO, arm.box.host) as io:
        for n in numbers:
            assert io.setInputIntRegister(n, 100 + n)
            assert io.setInputDoubleRegister(n, n / 8)
        assert arm.control.sendCustomScriptFunction("copy_registers", copying(*numbers, by=6))
    for n in numbers:
        wait_until(lambda n=n: arm.receive.getOutputIntRegister(n - 6) == 100 + n)
        wait_until(lambda n=n: arm.receive.getOutputDoubleRegister(n - 6) == n / 8)


def test_reconnecting(pair):
    io, receive = pair
    io.disconnect()
    assert not io.isConnected()
    assert io.reconnect()
    assert io.setStandardDigitalOut(3, True)
    wait_until(lambda: receive.getDigitalOutState(3))
    assert io.setStandardDigitalOut(3, False)
    wait_until(lambda: not receive.getDigitalOutState(3))


def test_only_one_client_has_an_input(arm):
    """As on the real box: the second of two like clients is told that the registers are in use."""
    with pytest.raises(RuntimeError, match="in use"):
        RTDEControl(arm.box.host)
    with connected(RTDEIO, arm.box.host), pytest.raises(RuntimeError, match="in use"):
        RTDEIO(arm.box.host)
    with connected(RTDEIO, arm.box.host) as later:
        assert later.isConnected()
    assert arm.control.moveJ(home(0.05), 2.0, 8.0)


def test_the_upper_registers_are_free_beside_the_lower(arm):
    with (
        connected(RTDEIO, arm.box.host, False, True) as io,
        connected(RTDEReceive, arm.box.host, 125.0, [], False, True) as receive,
    ):
        for n in (42, 43):
            assert io.setInputIntRegister(n, n + 7)
            assert io.setInputDoubleRegister(n, n / 8)
        assert arm.control.sendCustomScriptFunction("copy_upper", copying(42, 43, by=6))
        for n in (42, 43):
            wait_until(lambda n=n: receive.getOutputIntRegister(n - 6) == n + 7)
            wait_until(lambda n=n: receive.getOutputDoubleRegister(n - 6) == n / 8)


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
