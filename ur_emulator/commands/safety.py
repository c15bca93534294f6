"""What people and wiring do to the safety system and to the pendant.

No client of a real box can send most of these; they are for tests and for people at the emulator.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from protocol.primary.messages import ReportLevel
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import SafetyMode
from ur_emulator.commands.operation import CommandOperation
from ur_emulator.commands.parameters import parameter
from ur_emulator.controller.command import Box
from ur_emulator.controller.events import ErrorReported
from ur_emulator.controller.robot_mode import ModeCommand
from ur_emulator.controller.safety.inputs import N_INPUT_PAIRS, SafetyInput
from ur_emulator.controller.safety.modes import SafetyEvent
from ur_emulator.errors import ArgumentError, RefusedError


class PressEmergencyStop(CommandOperation):
    """Press an emergency stop button."""

    kind: Literal["robot", "system"] = parameter(
        "the pendant's button, or that of the surroundings", default="robot"
    )

    def apply(self, box: Box) -> None:
        box.safety.inputs.press(self.kind)


class ReleaseEmergencyStop(CommandOperation):
    """Release all emergency stop buttons; the power stays off."""

    def apply(self, box: Box) -> None:
        box.safety.inputs.release()


class SafeguardStop(CommandOperation):
    """Open the safeguard, or close it again."""

    active: bool = parameter("begin, or end it", default=True)

    def apply(self, box: Box) -> None:
        box.safety.inputs.guard(self.active)


class ReducedMode(CommandOperation):
    """Switch reduced mode on or off, as its input does."""

    active: bool = parameter("begin, or end it", default=True)

    def apply(self, box: Box) -> None:
        box.safety.inputs.reduce(self.active)


class TriggerProtectiveStop(CommandOperation):
    """Stop the arm as a safety function would."""

    def apply(self, box: Box) -> None:
        box.state.requests.protective_stop()


class UnlockProtectiveStop(CommandOperation):
    """End a protective stop at once, without the dashboard's 5 s."""

    def apply(self, box: Box) -> None:
        safety = box.state.safety
        if not safety.has(SafetyMode.PROTECTIVE_STOP):
            raise RefusedError(
                f"there is no protective stop to unlock: the safety mode is {safety.mode.name}"
            )
        box.safety.handle(SafetyEvent.UNLOCK)


class TriggerViolation(CommandOperation):
    """Let the safety system find a violation."""

    text: str = parameter("for log and clients", default="Safety violation requested")

    def apply(self, box: Box) -> None:
        box.state.events.append(ErrorReported(0, 0, ReportLevel.VIOLATION, self.text))
        box.safety.handle(SafetyEvent.VIOLATION)


class TriggerFault(CommandOperation):
    """Let the safety system find a fault in itself."""

    text: str = parameter("for log and clients", default="Safety fault requested")

    def apply(self, box: Box) -> None:
        box.state.events.append(ErrorReported(0, 0, ReportLevel.FAULT, self.text))
        box.safety.handle(SafetyEvent.FAULT)


class RestartSafety(CommandOperation):
    """Restart the safety system; the power is off then."""

    def apply(self, box: Box) -> None:
        box.safety.handle(SafetyEvent.RESTART)


# --- what no operation of the control API does


@dataclass(frozen=True, slots=True)
class RequireSafeguardReset:
    """Set up whether a safeguard that was closed needs a reset too, or lets the program go on at once."""

    required: bool

    def apply(self, box: Box) -> None:
        box.safety.inputs.require_reset(self.required)


@dataclass(frozen=True, slots=True)
class ResetSafeguard:
    """Press the safeguard's reset button; it counts once the safeguard is closed."""

    def apply(self, box: Box) -> None:
        box.safety.inputs.reset()


@dataclass(frozen=True, slots=True)
class AssignSafetyInput:
    """Set up configurable inputs 2 * pair and 2 * pair + 1 as a safety input; None frees them.

    Safety inputs have two channels: one that is low is enough to stop.

    Raises:
        ArgumentError: there is no such pair.
    """

    pair: int
    function: SafetyInput | None

    def __post_init__(self) -> None:
        if not 0 <= self.pair < N_INPUT_PAIRS:
            raise ArgumentError(f"input pair {self.pair} given: allowed are 0 to {N_INPUT_PAIRS - 1}")

    def apply(self, box: Box) -> None:
        box.safety.assign_input(self.pair, self.function)


@dataclass(frozen=True, slots=True)
class ChangeSafetySettings:
    """Touch the safety settings: the power goes off and CONFIRM_SAFETY begins."""

    def apply(self, box: Box) -> None:
        box.safety.cut_power()
        box.state.mode.command(ModeCommand.ASK_TO_CONFIRM)


@dataclass(frozen=True, slots=True)
class ConfirmSafety:
    """Confirm the safety settings, as `confirm user safety parameters` does."""

    def apply(self, box: Box) -> None:
        box.state.mode.command(ModeCommand.CONFIRM)


class Button(Enum):
    """Buttons of the pendant, beside the emergency stop, with their bits of the robot status."""

    TEACH = int(RobotStatusBits.TEACH_BUTTON_PRESSED)
    POWER = int(RobotStatusBits.POWER_BUTTON_PRESSED)


@dataclass(frozen=True, slots=True)
class PressButton:
    """Press a button of the pendant, or let it go; the teach button asks for hand guiding."""

    button: Button
    pressed: bool

    def apply(self, box: Box) -> None:
        box.state.operator.press(self.button.value, self.pressed)
        if self.button is Button.TEACH:
            box.state.compliance.press_teach_button(self.pressed)
