"""The safety modes as tables: safety events, and the effects of each mode.

Every mode but NORMAL has a cause of its own: a button that is pressed, an input, or something that has
happened and stays until somebody deals with it. Several causes may stand at a time; the mode is that of the
first of `MODES` whose cause stands, so that releasing an emergency stop leads back to the safeguard stop that
lies under it. `SafetyEvent` says which causes an event brings and takes.

Sources: UR3/CB3 user manual 3.13, safety chapters: stop categories (0: power is cut at once, 1: brake and
then cut the power, 2: brake and keep the power), safeguard stop with automatic resume or a reset button,
reduced mode and recovery mode; e-Series: UR5e hardware manual 2022, safety I/O; the dashboard server's
documents for unlocking and restarting. What is marked C in `why` is chosen because nothing is known.
"""

from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from enum import Enum

from protocol.ur_types import SafetyMode as Mode


class ArmEffect(Enum):
    """Effect on the arm when a mode begins."""

    NOTHING = "moves"
    SLOW = "moves, with limited joint speeds"
    PATH_STOP = "brakes on its path, keeps its power"
    STOP = "brakes, keeps its power"
    POWER_OFF = "brakes, then the power is cut"


class ProgramEffect(Enum):
    """Effect on the primary program when a mode begins."""

    NOTHING = "runs"
    PAUSE_FOR_A_WHILE = "paused, goes on when the mode ends"
    PAUSE_OR_END = "a loaded one paused until somebody resumes it, one from a socket ended"
    END = "ended"


@dataclass(frozen=True, slots=True)
class ModeRow:
    """A safety mode, and what it does to the arm and to the program.

    Attributes:
        latches: its cause is not a button or input that somebody releases.
        remedy: what to do about it, for messages.
        why: source of the above.
    """

    mode: Mode
    arm: ArmEffect
    program: ProgramEffect
    latches: bool
    remedy: str
    why: str

    @property
    def may_move(self) -> bool:
        """True when programs may move the arm."""
        return self.arm in (ArmEffect.NOTHING, ArmEffect.SLOW)

    @property
    def safety_mode(self) -> Mode:
        """The mode as `safety_mode` gives it; `safety_status` gives the mode itself."""
        return _GENERAL.get(self.mode, self.mode)

    @property
    def may_have_power(self) -> bool:
        """True when the joints may have power."""
        return self.arm is not ArmEffect.POWER_OFF


# What the dashboard's `safetymode` calls safeguard stops, `safetystatus` says why. Source: list of its words;
# that the number `safety_mode` of the other ports follows it is chosen.
_GENERAL = {
    Mode.AUTOMATIC_MODE_SAFEGUARD_STOP: Mode.SAFEGUARD_STOP,
    Mode.SYSTEM_THREE_POSITION_ENABLING_STOP: Mode.SAFEGUARD_STOP,
}

_A, _P = ArmEffect, ProgramEffect
_AGAIN = "then power on and brake release"

# The modes by rank, the first cause that stands counts.
MODES: tuple[ModeRow, ...] = (
    ModeRow(Mode.FAULT, _A.POWER_OFF, _P.END, True,
            f"restart safety, {_AGAIN}", "D; that the program ends C"),
    ModeRow(Mode.VIOLATION, _A.POWER_OFF, _P.END, True,
            f"restart safety, {_AGAIN}", "D; that the program ends C"),
    ModeRow(Mode.ROBOT_EMERGENCY_STOP, _A.POWER_OFF, _P.END, False,
            f"release the emergency stop, {_AGAIN}", "stop category 1 D; that the program ends I"),
    ModeRow(Mode.SYSTEM_EMERGENCY_STOP, _A.POWER_OFF, _P.END, False,
            f"release the emergency stop, {_AGAIN}", "stop category 1 D; that the program ends I"),
    ModeRow(Mode.PROTECTIVE_STOP, _A.STOP, _P.PAUSE_OR_END, True,
            "unlock the protective stop, on the dashboard 5 s after it",
            "stop category 2 D; that it leaves the path C; the program I"),
    ModeRow(Mode.SAFEGUARD_STOP, _A.PATH_STOP, _P.PAUSE_FOR_A_WHILE, False,
            "close the safeguard", "stop category 2 and automatic resume D"),
    ModeRow(Mode.AUTOMATIC_MODE_SAFEGUARD_STOP, _A.PATH_STOP, _P.PAUSE_FOR_A_WHILE, False,
            "close the safeguard of automatic mode", "e-Series; stop category 2 D; automatic resume I"),
    ModeRow(Mode.SYSTEM_THREE_POSITION_ENABLING_STOP, _A.PATH_STOP, _P.PAUSE_FOR_A_WHILE, False,
            "hold the enabling device in its middle position, after it was released",
            "e-Series; stop category 2 D; automatic resume C"),
    ModeRow(Mode.RECOVERY, _A.SLOW, _P.NOTHING, True, "move the joints into their range", "D; programs C"),
    ModeRow(Mode.REDUCED, _A.SLOW, _P.NOTHING, False, "end reduced mode", "D"),
    ModeRow(Mode.NORMAL, _A.NOTHING, _P.NOTHING, False, "", "D"),
)  # fmt: skip
ROW: dict[Mode, ModeRow] = {row.mode: row for row in MODES}
_RANK = {row.mode: rank for rank, row in enumerate(MODES)}

# Modes in which programs may move the arm.
MOVING_MODES = frozenset(row.mode for row in MODES if row.may_move)
EMERGENCY_MODES = frozenset({Mode.ROBOT_EMERGENCY_STOP, Mode.SYSTEM_EMERGENCY_STOP})
# Modes in which the arm is watched: it has power, and a protective stop would be something new.
WATCHED_MODES = frozenset(row.mode for row in MODES if _RANK[row.mode] > _RANK[Mode.PROTECTIVE_STOP])


@dataclass(frozen=True, slots=True)
class EventRow:
    """What an event is and does.

    Attributes:
        title: what it is called.
        brings: the mode whose cause it brings, or None. One that latches is not noted in a mode above it.
        cuts_power: the joints lose their power, whatever the mode.
    """

    title: str
    brings: Mode | None
    takes: frozenset[Mode]
    meaning: str
    cuts_power: bool = False


def _brings(title: str, mode: Mode, meaning: str) -> EventRow:
    return EventRow(title, mode, frozenset(), meaning)


def _takes(title: str, meaning: str, *modes: Mode, cuts_power: bool = False) -> EventRow:
    return EventRow(title, None, frozenset(modes), meaning, cuts_power)


class SafetyEvent(Enum):
    """Events of the safety system."""

    # fmt: off
    PROTECTIVE_STOP = _brings("protective stop", Mode.PROTECTIVE_STOP,
        "physics, a set-point, a script, a client; only while the robot is RUNNING")
    UNLOCK = _takes("unlock protective stop",
        "dashboard, 5 s after the stop; port 30001 at once", Mode.PROTECTIVE_STOP)
    SAFEGUARD_OPENED = _brings("safeguard opened", Mode.SAFEGUARD_STOP, "safeguard input SI")
    SAFEGUARD_RESTORED = _takes("safeguard restored",
        "safeguard input SI; where a reset button is set up, that button once SI is closed",
        Mode.SAFEGUARD_STOP)
    AUTOMATIC_SAFEGUARD_OPENED = _brings("automatic-mode safeguard opened",
        Mode.AUTOMATIC_MODE_SAFEGUARD_STOP, "e-Series: configurable input, or automatic mode begins")
    AUTOMATIC_SAFEGUARD_RESTORED = _takes("automatic-mode safeguard restored",
        "e-Series: configurable input, its reset where one is set up, or automatic mode ends",
        Mode.AUTOMATIC_MODE_SAFEGUARD_STOP)
    NOT_ENABLED = _brings("enabling device released or fully pressed",
        Mode.SYSTEM_THREE_POSITION_ENABLING_STOP, "e-Series: configurable input, or manual mode begins")
    ENABLED = _takes("enabling device in its middle position",
        "e-Series: configurable input, or manual mode ends", Mode.SYSTEM_THREE_POSITION_ENABLING_STOP)
    ROBOT_EMERGENCY_PRESSED = _brings("robot emergency stop pressed", Mode.ROBOT_EMERGENCY_STOP,
        "button on the pendant, input EI")
    SYSTEM_EMERGENCY_PRESSED = _brings("system emergency stop pressed", Mode.SYSTEM_EMERGENCY_STOP,
        "configurable input")
    ROBOT_EMERGENCY_RELEASED = _takes("robot emergency stop released",
        "button on the pendant, input EI", Mode.ROBOT_EMERGENCY_STOP)
    SYSTEM_EMERGENCY_RELEASED = _takes("system emergency stop released",
        "configurable input", Mode.SYSTEM_EMERGENCY_STOP)
    REDUCED_ON = _brings("reduced mode on", Mode.REDUCED, "configurable input; a plane that triggers it")
    REDUCED_OFF = _takes("reduced mode off", "configurable input; 20 mm back behind the plane", Mode.REDUCED)
    RANGE_LEFT = _brings("joint or tool out of range when the brakes open", Mode.RECOVERY,
        "the controller, when the brakes open; also beyond a plane")
    RANGE_KEPT = _takes("joints and tool back in range",
        "the controller, in every cycle of recovery", Mode.RECOVERY)
    VIOLATION = _brings("violation", Mode.VIOLATION,
        "a safety plane or the tool's cone is crossed; the control API")
    FAULT = _brings("fault", Mode.FAULT, "the control API")
    RESTART = _takes("restart safety", "dashboard",
        Mode.FAULT, Mode.VIOLATION, Mode.PROTECTIVE_STOP, Mode.RECOVERY, cuts_power=True)
    POWERED_OFF = _takes("power off", "the power is off, for whatever reason", Mode.RECOVERY)
    # fmt: on


def mode_of(causes: AbstractSet[Mode]) -> Mode:
    """Return the mode when these causes stand."""
    return next((row.mode for row in MODES if row.mode in causes), Mode.NORMAL)


def after(causes: frozenset[Mode], event: SafetyEvent) -> frozenset[Mode]:
    """Return the causes that stand after an event."""
    row = event.value
    causes -= row.takes
    if row.brings is not None and not (
        ROW[row.brings].latches and _RANK[mode_of(causes)] < _RANK[row.brings]
    ):
        causes |= {row.brings}
    return causes
