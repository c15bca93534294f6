"""The robot mode as a table: which command leads where, through which modes, and how long each lasts.

Source: UR dashboard server documents (power on, brake release) and the public client library's tests: power
on goes POWER_OFF -> POWER_ON -> IDLE within 5 s, brake release IDLE -> BACKDRIVE -> RUNNING, and no
transition is instantaneous. The durations are chosen, not measured.
"""

from __future__ import annotations

from enum import Enum

from protocol.ur_types import JointMode, RobotMode

# How long the box stays in a passing mode before the next one of its way [s].
PASSING_TIME = {RobotMode.POWER_ON: 1.0, RobotMode.BACKDRIVE: 0.4}


class ModeCommand(Enum):
    """What may change the robot mode."""

    POWER_ON = "power on"
    POWER_OFF = "power off"
    BRAKE_RELEASE = "brake release"


# (mode, command) -> the modes to pass through, the last one to stay in. A pair that is not listed changes
# nothing.
TRANSITIONS: dict[tuple[RobotMode, ModeCommand], tuple[RobotMode, ...]] = {
    (RobotMode.POWER_OFF, ModeCommand.POWER_ON): (RobotMode.POWER_ON, RobotMode.IDLE),
    (RobotMode.POWER_OFF, ModeCommand.BRAKE_RELEASE): (
        RobotMode.POWER_ON,
        RobotMode.IDLE,
        RobotMode.BACKDRIVE,
        RobotMode.RUNNING,
    ),
    (RobotMode.POWER_ON, ModeCommand.BRAKE_RELEASE): (
        RobotMode.POWER_ON,
        RobotMode.IDLE,
        RobotMode.BACKDRIVE,
        RobotMode.RUNNING,
    ),
    (RobotMode.IDLE, ModeCommand.BRAKE_RELEASE): (RobotMode.BACKDRIVE, RobotMode.RUNNING),
    (RobotMode.POWER_ON, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
    (RobotMode.IDLE, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
    (RobotMode.BACKDRIVE, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
    (RobotMode.RUNNING, ModeCommand.POWER_OFF): (RobotMode.POWER_OFF,),
}

# What every joint reports in each robot mode (inferred from captures and from the joint mode names).
JOINT_MODE = {
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


class RobotModeMachine:
    """The robot mode and the way it is still to go."""

    def __init__(self, mode: RobotMode, period_s: float) -> None:
        self.mode = mode
        self._period_s = period_s
        self._ahead: list[RobotMode] = []
        self._cycles_left = 0

    @property
    def is_changing(self) -> bool:
        """True while the mode is on its way to another one."""
        return bool(self._ahead)

    def command(self, command: ModeCommand) -> None:
        """Start the way that the table gives for `command`; nothing happens if it gives none."""
        way = TRANSITIONS.get((self.mode, command))
        if way is not None:
            self._enter(way[0], list(way[1:]))

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
