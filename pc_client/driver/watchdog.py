"""What a robot must report for the arm to move and to go on moving, and when the arm rests. Pure checks.

A `Condition` is one thing that a robot must fulfil: what it reports, what is needed, what to do.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from pc_client.errors import DriverError, RobotStoppedError
from protocol.primary.layout import RobotModeData
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import ControlMode, ProgramState, RobotMode, SafetyMode, SoftwareVersion


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition, held against what the robot reports.

    Attributes:
        name: of the quantity, as on the pendant or in UR's manuals.
        reported: what it is; empty when the robot does not report it.
        holds: whether it is; None when the robot does not report it.
    """

    name: str
    reported: str
    needed: str
    remedy: str
    holds: bool | None

    @property
    def complaint(self) -> str:
        """The one line that refuses the robot: what is, what must be, what to do."""
        return f"the robot's {self.name} is {self.reported}, must be {self.needed}; {self.remedy}"

    @property
    def verdict(self) -> str:
        """In a word or two."""
        return {True: "ok", False: "NOT OK", None: "not reported"}[self.holds]


def conditions_text(conditions: Iterable[Condition]) -> str:
    """All conditions as a table, one a line: name, what the robot reports, what is needed, the verdict."""
    rows = [(c.name, c.reported or "-", f"must be {c.needed}", c.verdict) for c in conditions]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


RUNNING = float(RobotMode.RUNNING)
PLAYING = float(ProgramState.PLAYING)
_SAFE_MODES = (float(SafetyMode.NORMAL), float(SafetyMode.REDUCED))

_FARTHEST = 100.0
"""No joint angle is larger [rad]; joints turn by two turns at most."""

REST_SPEED = 0.01
"""Below this joint speed [rad/s] the arm rests: 0.6 deg/s, above the noise of a standing joint."""

_OLDEST = SoftwareVersion(3, 2)
"""The first software whose frames report the program state."""

_FULL_SPEED = 0.999
"""Speed slider and speed scaling count as 1 from here on; the pendant shows whole percents."""

_HOW_TO_GO_ON = {
    SafetyMode.PROTECTIVE_STOP: "find the cause, then unlock the protective stop on the pendant, or "
    "after 5 s by 'unlock protective stop' on the dashboard port",
    SafetyMode.SAFEGUARD_STOP: "leave the guarded area, then reset the safeguard",
    SafetyMode.SYSTEM_EMERGENCY_STOP: "release the emergency stop and start the robot again",
    SafetyMode.ROBOT_EMERGENCY_STOP: "release the emergency stop and start the robot again",
    SafetyMode.RECOVERY: "move the arm back within its limits by hand",
}


class ProgramEndedError(RobotStoppedError):
    """The program that follows our velocities does not run any more."""


def software(version: SoftwareVersion) -> Condition:
    """The controller is of a generation that this client was made for."""
    major = version.major
    generation = "CB2" if major < 3 else "CB3" if major < 5 else "e-Series" if major < 10 else "PolyScope X"
    return Condition(
        "software",
        f"{version}, {generation}",
        f"{_OLDEST.major}.{_OLDEST.minor} or later, CB3 or e-Series",
        "this client was made for CB3 and e-Series controllers only",
        version >= _OLDEST and generation in ("CB3", "e-Series"),
    )


def control(remote: bool | None, *, obeys_in_local: bool = False) -> Condition:
    """Programs from the network have an effect.

    Args:
        remote: the robot is in remote control; None when it does not report it.
        obeys_in_local: they have one in local control, too.
    """
    return Condition(
        "control",
        "" if remote is None else "remote" if remote else "local",
        "remote or local (simulator)" if obeys_in_local else "remote",
        "in local control it ignores programs from the network: enable remote control in its settings, "
        "and switch to it on the pendant",
        None if remote is None else remote or obeys_in_local,
    )


def safety_mode(frame: RealtimeFrame) -> Condition:
    """The safety system lets the arm move."""
    value = frame.safety_mode
    remedy = _HOW_TO_GO_ON.get(SafetyMode(int(value)), "") if value in list(SafetyMode) else ""
    return Condition(
        "safety mode",
        _name(SafetyMode, value),
        "NORMAL or REDUCED",
        remedy or "look at the pendant",
        value in _SAFE_MODES,
    )


def robot_mode(frame: RealtimeFrame) -> Condition:
    """The arm has power and its brakes are open."""
    mode, remedy = _name(RobotMode, frame.robot_mode), "power it on and release the brakes"
    return Condition("mode", mode, "RUNNING", remedy, frame.robot_mode == RUNNING)


def program_state(frame: RealtimeFrame) -> Condition:
    """No program of somebody else runs, or stands paused."""
    state = _name(ProgramState, frame.runtime_state)
    return Condition("program", state, "STOPPED", "stop it before streaming", is_stopped(frame))


def control_mode(mode: RobotModeData | None) -> Condition:
    """The arm holds its position: nobody guides it by hand, and no force or torque drives it."""
    reported, holds = "", None
    if mode is not None:
        reported, holds = _name(ControlMode, mode.control_mode), mode.control_mode == ControlMode.POSITION
    remedy = "end freedrive (TEACH), force or torque control before streaming"
    return Condition("control mode", reported, "POSITION", remedy, holds)


def speed_slider(mode: RobotModeData | None) -> Condition:
    """The speed slider stands at its end."""
    reported, holds = "", None
    if mode is not None:
        reported = _percent(mode.target_speed_fraction)
        holds = mode.target_speed_fraction >= _FULL_SPEED  # NaN is not
    remedy = "set it to 100 % on the pendant and leave it there"
    return Condition("speed slider", reported, "100 %", remedy, holds)


def speed_scaling(frame: RealtimeFrame) -> Condition:
    """The controller does not slow the arm down; 0 without a program is allowed."""
    scaling = frame.speed_scaling
    holds = is_at_full_speed(frame) or (scaling == 0.0 and is_stopped(frame))
    remedy = "end reduced mode on the robot, or give the movement more time"
    return Condition("speed scaling", _percent(scaling), "100 %", remedy, holds)


def refusal(conditions: Iterable[Condition]) -> str:
    """The line that refuses a robot: the first condition that fails; empty when none does."""
    return next((condition.complaint for condition in conditions if condition.holds is False), "")


def require(conditions: Iterable[Condition], error: type[DriverError] = DriverError) -> None:
    """Raise an error for the first condition that a robot fails: what is, what must be, what to do."""
    if complaint := refusal(conditions):
        raise error(complaint)


def check_safety(frame: RealtimeFrame) -> None:
    """Raise RobotStoppedError if safety mode or robot mode forbids motion."""
    require((safety_mode(frame), robot_mode(frame)), RobotStoppedError)


def check_angles(frame: RealtimeFrame) -> None:
    """Raise DriverError for a joint angle that is no number, or more than any joint turns."""
    q = frame.actual_q.tolist()
    if not all(-_FARTHEST < value < _FARTHEST for value in q):  # NaN is not
        raise DriverError(
            f"the robot reports joint angles of {q} rad, possible are +-{_FARTHEST:g} rad: "
            "restart the control box"
        )


def check_streaming(frame: RealtimeFrame) -> None:
    """Check a frame of a running stream.

    Raises:
        RobotStoppedError: the robot may not move any more.
        ProgramEndedError: its program has ended.
        DriverError: the robot slows the arm down.
    """
    if frame.safety_mode in _SAFE_MODES and frame.robot_mode == RUNNING and frame.runtime_state == PLAYING:
        if not is_at_full_speed(frame):
            raise DriverError(speed_scaling(frame).complaint)
        return
    check_safety(frame)
    raise ProgramEndedError(
        f"the robot's program is {_name(ProgramState, frame.runtime_state)}: it ended before the movement did"
    )


def is_at_full_speed(frame: RealtimeFrame) -> bool:
    """Whether the controller does not slow the arm down."""
    return bool(frame.speed_scaling >= _FULL_SPEED)


def is_stopped(frame: RealtimeFrame) -> bool:
    """Whether no program runs."""
    return bool(frame.runtime_state == ProgramState.STOPPED)


def has_ended(frame: RealtimeFrame) -> bool:
    """Whether nothing moves the arm: no program, or a safety stop, which may only pause it."""
    return is_stopped(frame) or frame.safety_mode not in _SAFE_MODES or frame.robot_mode != RUNNING


def is_at_rest(frame: RealtimeFrame) -> bool:
    """Whether every joint reports less than `REST_SPEED`."""
    return all(-REST_SPEED < qd < REST_SPEED for qd in frame.actual_qd.tolist())


def _name(kind: type[IntEnum], value: float) -> str:
    try:
        return kind(int(value)).name
    except (ValueError, OverflowError):
        return f"{value:g} (unknown)"


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.3g} %"
