"""What people and wiring do to the safety system and to the pendant, as commands of the box.

No client of a real box can send them; they are for tests and for people at the emulator.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from ur_emulator.errors import EmulatorError

N_INPUT_PAIRS = 4


class Button(Enum):
    """Buttons of the pendant, beside the emergency stop."""

    TEACH = "teach"
    POWER = "power"


class SafetyInput(Enum):
    """What a pair of configurable inputs can be set up for. Source: UR3/CB3 manual, configurable I/O."""

    EMERGENCY_STOP = "emergency stop"  # low presses the system emergency stop
    REDUCED = "reduced"  # low switches reduced mode on
    SAFEGUARD_RESET = "safeguard reset"  # a rising edge resets


@dataclass(frozen=True, slots=True)
class PressEmergencyStop:
    """Press an emergency stop: the pendant's button (robot) or that of the surroundings (system)."""

    kind: Literal["robot", "system"] = "robot"

    def __post_init__(self) -> None:
        if self.kind not in ("robot", "system"):
            raise EmulatorError(f"emergency stop {self.kind!r} given: choose robot or system")


@dataclass(frozen=True, slots=True)
class ReleaseEmergencyStop:
    """Release all emergency stops that were pressed by command; the power stays off."""


@dataclass(frozen=True, slots=True)
class SafeguardStop:
    """Open the safeguard, or close it again."""

    active: bool


@dataclass(frozen=True, slots=True)
class RequireSafeguardReset:
    """Set up whether a safeguard that was closed needs a reset too, or lets the program go on at once."""

    required: bool


@dataclass(frozen=True, slots=True)
class ResetSafeguard:
    """Press the safeguard's reset button; it counts once the safeguard is closed."""


@dataclass(frozen=True, slots=True)
class ReducedMode:
    """Switch reduced mode on or off."""

    active: bool


@dataclass(frozen=True, slots=True)
class TriggerViolation:
    """Let the safety system find a violation; `text` goes to log and clients."""

    text: str = "Safety violation requested"


@dataclass(frozen=True, slots=True)
class TriggerFault:
    """Let the safety system find a fault in itself; `text` goes to log and clients."""

    text: str = "Safety fault requested"


@dataclass(frozen=True, slots=True)
class ChangeSafetySettings:
    """Touch the safety settings: the power goes off and CONFIRM_SAFETY begins."""


@dataclass(frozen=True, slots=True)
class ConfirmSafety:
    """Confirm the safety settings, as `confirm user safety parameters` does."""


@dataclass(frozen=True, slots=True)
class PressButton:
    """Press a button of the pendant, or let it go; the teach button asks for hand guiding."""

    button: Button
    pressed: bool


@dataclass(frozen=True, slots=True)
class AssignSafetyInput:
    """Set up configurable inputs 2 * pair and 2 * pair + 1 as a safety input; None frees them.

    Safety inputs have two channels: one that is low is enough to stop.

    Raises:
        EmulatorError: there is no such pair.
    """

    pair: int
    function: SafetyInput | None

    def __post_init__(self) -> None:
        if not 0 <= self.pair < N_INPUT_PAIRS:
            raise EmulatorError(f"input pair {self.pair} given: allowed are 0 to {N_INPUT_PAIRS - 1}")


SafetyCommand = (
    PressEmergencyStop
    | ReleaseEmergencyStop
    | SafeguardStop
    | RequireSafeguardReset
    | ResetSafeguard
    | ReducedMode
    | TriggerViolation
    | TriggerFault
    | ChangeSafetySettings
    | ConfirmSafety
    | PressButton
    | AssignSafetyInput
)
