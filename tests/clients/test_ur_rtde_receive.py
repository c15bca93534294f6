"""ur_rtde's RTDEReceiveInterface: every getter, rates, recordings, recipes, registers."""

import csv
from contextlib import ExitStack

import numpy as np
import pytest
from clients_support import wait_until
from ur_rtde_support import HOME, PERIOD, RTDEIO, RTDEControl, RTDEReceive, connected

RUNNING_ROBOT, NORMAL_SAFETY, RUNNING_JOINT, PLAYING = 7, 1, 253, 2


def within(low, high):
    return lambda value: (
        np.all(np.isfinite(value)) and np.all((np.asarray(value) >= low) & (np.asarray(value) <= high))
    )


def vector(low, high, size=6):
    return lambda value: len(value) == size and within(low, high)(value)


def exactly(wanted):
    return lambda value: value == wanted


# What an arm at rest shows while the control script runs: every getter that CB3 software 3.15 can fill.
AT_REST = {
    "Timestamp": within(40.0, 1e6),  # s; above 40, or URCL takes the box for one that boots
    "TargetQ": vector(-6.3, 6.3),
    "TargetQd": exactly([0.0] * 6),
    "TargetQdd": exactly([0.0] * 6),
    "TargetCurrent": vector(-4, 4),
    "TargetMoment": vector(-20, 20),
    "ActualQ": vector(-6.3, 6.3),
    "ActualQd": vector(-2e-3, 2e-3),
    "ActualCurrent": vector(-4, 4),
    "JointControlOutput": vector(-4, 4),
    "ActualTCPPose": vector(-3.2, 3.2),
    "ActualTCPSpeed": vector(-2e-3, 2e-3),
    "ActualTCPForce": vector(-25, 25),
    "TargetTCPPose": vector(-3.2, 3.2),
    "TargetTCPSpeed": vector(-1e-9, 1e-9),
    "ActualDigitalInputBits": exactly(0),
    "JointTemperatures": vector(15, 60),
    "ActualExecutionTime": within(0, 8),
    "RobotMode": exactly(RUNNING_ROBOT),
    "JointMode": exactly([RUNNING_JOINT] * 6),
    "SafetyMode": exactly(NORMAL_SAFETY),
    "ActualToolAccelerometer": vector(-12, 12, 3),
    "SpeedScaling": exactly(1.0),
    "TargetSpeedFraction": exactly(1.0),
    "SpeedScalingCombined": exactly(1.0),
    "ActualMomentum": within(0, 0.1),
    "ActualMainVoltage": within(46, 50),
    "ActualRobotVoltage": within(46, 50),
    "ActualRobotCurrent": within(0.1, 4),
    "ActualJointVoltage": vector(44, 50),
    "ActualDigitalOutputBits": exactly(0),
    "RuntimeState": exactly(PLAYING),
    "StandardAnalogInput0": within(0, 10),
    "StandardAnalogInput1": within(0, 10),
    "StandardAnalogOutput0": within(0, 10),
    "StandardAnalogOutput1": within(0, 10),
    "RobotStatus": exactly(0b11),  # power is on, a program runs
    "SafetyStatusBits": exactly(0b1),  # normal
    "Payload": exactly(0.0),
    "PayloadCog": exactly([0.0] * 3),
    "PayloadInertia": exactly([0.0] * 6),
}


def test_every_getter_is_plausible_at_rest(arm):
    assert arm.control.setPayload(0.0, [0.0, 0.0, 0.0])
    assert arm.is_at(HOME)
    odd = {
        name: value
        for name, fits in AT_REST.items()
        if not fits(value := getattr(arm.receive, "get" + name)())
    }
    assert odd == {}
    known = {name[3:] for name in dir(arm.receive) if name.startswith("get")}
    # e-Series only; the others take an argument
    others = {"FtRawWrench", "DigitalInState", "DigitalOutState", "OutputIntRegister", "OutputDoubleRegister"}
    assert known - AT_REST.keys() == others
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
