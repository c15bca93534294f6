"""What a frame must say for the arm to go on moving, and when the arm counts as at rest. Pure checks."""

from __future__ import annotations

from pc_client.errors import DriverError, RobotStoppedError
from protocol.realtime_layout import RealtimeFrame
from protocol.ur_types import ProgramState, RobotMode, SafetyMode

RUNNING = float(RobotMode.RUNNING)
PLAYING = float(ProgramState.PLAYING)
SAFE_MODES = (float(SafetyMode.NORMAL), float(SafetyMode.REDUCED))

REST_SPEED = 0.01
"""Below this joint speed [rad/s] the arm rests: 0.6 deg/s, above the noise of a standing joint."""

_HOW_TO_GO_ON = {
    SafetyMode.PROTECTIVE_STOP: "find the cause, then unlock the protective stop on the pendant",
    SafetyMode.SAFEGUARD_STOP: "leave the guarded area, then reset the safeguard",
    SafetyMode.SYSTEM_EMERGENCY_STOP: "release the emergency stop and start the robot again",
    SafetyMode.ROBOT_EMERGENCY_STOP: "release the emergency stop and start the robot again",
    SafetyMode.RECOVERY: "move the arm back within its limits by hand",
}


def check_safety(frame: RealtimeFrame) -> None:
    """Refuse a robot that may not move.

    Raises:
        RobotStoppedError: safety mode or robot mode forbids motion; says which and what to do.
    """
    if frame.safety_mode not in SAFE_MODES:
        mode = _name(SafetyMode, frame.safety_mode)
        what_next = _HOW_TO_GO_ON.get(SafetyMode(int(frame.safety_mode)), "") if mode.isidentifier() else ""
        raise RobotStoppedError(
            f"the robot's safety mode is {mode}, motion needs NORMAL or REDUCED; "
            f"{what_next or 'look at the pendant'}"
        )
    if frame.robot_mode != RUNNING:
        raise RobotStoppedError(
            f"the robot is {_name(RobotMode, frame.robot_mode)}, motion needs RUNNING; "
            "power it on and release the brakes"
        )


def check_idle(frame: RealtimeFrame) -> None:
    """Refuse a robot on which a program of somebody else runs.

    Raises:
        DriverError: a program is running or paused.
    """
    if frame.runtime_state != ProgramState.STOPPED:
        raise DriverError(
            f"a program is {_name(ProgramState, frame.runtime_state)} on the robot; stop it before streaming"
        )


def check_streaming(frame: RealtimeFrame) -> None:
    """Check a frame of a running stream.

    Raises:
        RobotStoppedError: the robot may not move any more, or its program has ended.
    """
    if frame.safety_mode in SAFE_MODES and frame.robot_mode == RUNNING and frame.runtime_state == PLAYING:
        return
    check_safety(frame)
    raise RobotStoppedError(
        f"the robot's program is {_name(ProgramState, frame.runtime_state)}: it ended before the movement did"
    )


def is_stopped(frame: RealtimeFrame) -> bool:
    """Return True when no program runs."""
    return bool(frame.runtime_state == ProgramState.STOPPED)


def has_ended(frame: RealtimeFrame) -> bool:
    """Return True when nothing moves the arm: no program, or a safety stop, which may only pause it."""
    return is_stopped(frame) or frame.safety_mode not in SAFE_MODES or frame.robot_mode != RUNNING


def is_at_rest(frame: RealtimeFrame) -> bool:
    """Return True when every joint reports less than `REST_SPEED`."""
    return all(-REST_SPEED < qd < REST_SPEED for qd in frame.actual_qd.tolist())


def _name(kind: type[SafetyMode] | type[RobotMode] | type[ProgramState], value: float) -> str:
    try:
        return kind(int(value)).name
    except ValueError:
        return f"{value:g} (unknown)"
