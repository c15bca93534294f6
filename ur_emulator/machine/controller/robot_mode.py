"""The robot mode as a table: commands, the modes that each passes through, and the duration of each.

Source: UR dashboard server documents (power on, brake release) and the public client library's tests: power
on goes POWER_OFF -> POWER_ON -> IDLE within 5 s, brake release IDLE -> BACKDRIVE -> RUNNING, and no
transition is instantaneous. The durations are chosen, not measured.
"""

from enum import Enum

from protocol.ur_types import JointMode, RobotMode, SafetyMode

# How long the box stays in a passing mode before the next one of its sequence [s].
PASSING_TIME = {
    RobotMode.NO_CONTROLLER: 0.5,
    RobotMode.DISCONNECTED: 0.5,
    RobotMode.BOOTING: 1.0,
    RobotMode.POWER_ON: 1.0,
    RobotMode.BACKDRIVE: 0.4,
}


class ModeCommand(Enum):
    """Commands that change the robot mode."""

    BOOT = "boot"
    ASK_TO_CONFIRM = "change safety settings"
    CONFIRM = "confirm safety settings"
    POWER_ON = "power on"
    POWER_OFF = "power off"
    BRAKE_RELEASE = "brake release"


# (mode, command) -> the modes to pass through, the last one to stay in. Any other pair changes nothing.
_TO_RUNNING = (RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING)
TRANSITIONS: dict[tuple[RobotMode, ModeCommand], tuple[RobotMode, ...]] = {
    (RobotMode.POWER_OFF, ModeCommand.POWER_ON): (RobotMode.POWER_ON, RobotMode.IDLE),
    (RobotMode.POWER_OFF, ModeCommand.BRAKE_RELEASE): _TO_RUNNING,
    (RobotMode.POWER_ON, ModeCommand.BRAKE_RELEASE): _TO_RUNNING,
    (RobotMode.IDLE, ModeCommand.BRAKE_RELEASE): (RobotMode.BACKDRIVE, RobotMode.RUNNING),
    (RobotMode.NO_CONTROLLER, ModeCommand.BOOT): (
        RobotMode.NO_CONTROLLER,
        RobotMode.DISCONNECTED,
        RobotMode.BOOTING,
        RobotMode.POWER_OFF,
    ),
    (RobotMode.POWER_OFF, ModeCommand.ASK_TO_CONFIRM): (RobotMode.CONFIRM_SAFETY,),
    (RobotMode.CONFIRM_SAFETY, ModeCommand.CONFIRM): (RobotMode.POWER_OFF,),
    (RobotMode.POWER_ON, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
    (RobotMode.IDLE, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
    (RobotMode.BACKDRIVE, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
    (RobotMode.RUNNING, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
}

# What every joint reports in each robot mode (inferred from captures and from the joint mode names), unless
# the safety mode says more.
_BY_ROBOT_MODE = {
    RobotMode.NO_CONTROLLER: JointMode.NOT_RESPONDING,
    RobotMode.DISCONNECTED: JointMode.NOT_RESPONDING,
    RobotMode.CONFIRM_SAFETY: JointMode.POWER_OFF,
    RobotMode.BOOTING: JointMode.POWER_OFF,
    RobotMode.POWER_OFF: JointMode.POWER_OFF,
    RobotMode.POWER_ON: JointMode.BOOTING,
    RobotMode.IDLE: JointMode.IDLE,
    RobotMode.BACKDRIVE: JointMode.BACKDRIVE,
    RobotMode.RUNNING: JointMode.RUNNING,
    RobotMode.UPDATING_FIRMWARE: JointMode.BOOTLOADER,
}

# Modes in which the joints have power.
POWERED = frozenset({RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING})
# Modes in which that holds, or comes, which a command asks for.
_FULFILLED = {
    ModeCommand.POWER_ON: POWERED,
    ModeCommand.BRAKE_RELEASE: frozenset({RobotMode.BACKDRIVE, RobotMode.RUNNING}),
    ModeCommand.ASK_TO_CONFIRM: frozenset({RobotMode.CONFIRM_SAFETY}),
}

# What joints that have power report in a safety mode; inferred from the names: 240 was EMERGENCY_STOPPED.
_BY_SAFETY_MODE = {
    SafetyMode.ROBOT_EMERGENCY_STOP: JointMode.READY_FOR_POWER_OFF,
    SafetyMode.SYSTEM_EMERGENCY_STOP: JointMode.READY_FOR_POWER_OFF,
    SafetyMode.VIOLATION: JointMode.VIOLATION,
    SafetyMode.FAULT: JointMode.FAULT,
}
# These two say so without power too, until safety is restarted (chosen).
_LASTING = frozenset({SafetyMode.VIOLATION, SafetyMode.FAULT})


def _joint_mode(robot: RobotMode, safety: SafetyMode) -> JointMode:
    if robot in POWERED or (safety in _LASTING and robot is RobotMode.POWER_OFF):
        return _BY_SAFETY_MODE.get(safety, _BY_ROBOT_MODE[robot])
    return _BY_ROBOT_MODE[robot]


# (robot mode, safety mode) -> what every joint reports.
JOINT_MODES = {
    (robot, safety): _joint_mode(robot, safety) for robot in _BY_ROBOT_MODE for safety in SafetyMode
}
# The same for all six joints, as it is published in every cycle.
JOINT_VECTORS = {modes: (int(joint),) * 6 for modes, joint in JOINT_MODES.items()}


class RobotModeMachine:
    """The robot mode, and the modes that it still passes through."""

    def __init__(self, mode: RobotMode, period_s: float) -> None:
        self.mode = mode
        self._period_s = period_s
        self._ahead: list[RobotMode] = []
        self._cycles_left = 0

    @property
    def is_changing(self) -> bool:
        """True while more modes follow."""
        return bool(self._ahead)

    def command(self, command: ModeCommand) -> bool:
        """Start the transition that the table gives for `command`; return whether what it asks for comes."""
        modes = TRANSITIONS.get((self.mode, command))
        if modes is None:
            return self.mode in _FULFILLED.get(command, ())
        self._enter(modes[0], list(modes[1:]))
        return True

    def step(self) -> None:
        """Advance one cycle."""
        if self._ahead:
            self._cycles_left -= 1
            if self._cycles_left <= 0:
                self._enter(self._ahead[0], self._ahead[1:])

    def _enter(self, mode: RobotMode, ahead: list[RobotMode]) -> None:
        self.mode = mode
        self._ahead = ahead
        self._cycles_left = max(1, round(PASSING_TIME.get(mode, 0.0) / self._period_s))
