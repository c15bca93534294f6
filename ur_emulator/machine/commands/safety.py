"""Commands for the safety system: its buttons, inputs, settings and planes; the buttons of the pendant.

Clients of a real box cannot send most of these; they are for tests and for people at the emulator.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, pi, radians
from typing import Literal

from protocol.primary.messages import ReportLevel
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import SafetyMode
from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.machine.commands.operation import CommandOperation, parameter
from ur_emulator.machine.commands.power import change_mode, needs_operational_modes
from ur_emulator.machine.controller.command import BoxParts
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.controller.robot_mode import ModeCommand
from ur_emulator.machine.controller.safety import boundaries, inputs, modes
from ur_emulator.machine.models.robot_model import Vector3


class PressEmergencyStop(CommandOperation):
    """Press an emergency stop button."""

    kind: Literal["robot", "system"] = parameter(
        "the pendant's button, or that of the surroundings", default="robot"
    )

    def apply(self, box: BoxParts) -> None:
        box.safety.inputs.press(self.kind)


class ReleaseEmergencyStop(CommandOperation):
    """Release all emergency stop buttons; the power stays off."""

    def apply(self, box: BoxParts) -> None:
        box.safety.inputs.release()


GuardName = Literal["permanent", "automatic mode"]


def _guard_of(box: BoxParts, name: GuardName) -> inputs.Guard:
    """Return a safeguard; RefusedError if the box does not have it."""
    if inputs.Guard(name) is inputs.Guard.AUTOMATIC:
        needs_operational_modes(box.state)
    return inputs.Guard(name)


class SafeguardStop(CommandOperation):
    """Open a safeguard, or close it again."""

    active: bool = parameter("begin, or end it", default=True)
    safeguard: GuardName = parameter("which; that of automatic mode acts in no other", default="permanent")

    def apply(self, box: BoxParts) -> None:
        box.safety.inputs.guard(_guard_of(box, self.safeguard), self.active)


class ReducedMode(CommandOperation):
    """Switch reduced mode on or off, as its input does."""

    active: bool = parameter("begin, or end it", default=True)

    def apply(self, box: BoxParts) -> None:
        box.safety.inputs.reduce(self.active)


class TriggerProtectiveStop(CommandOperation):
    """Stop the arm as a safety function would."""

    def apply(self, box: BoxParts) -> None:
        safety = box.state.safety
        if not (safety.is_watched or safety.has(SafetyMode.PROTECTIVE_STOP)):
            raise RefusedError(f"no protective stop: the arm is stopped already, by {safety.mode.name}")
        box.state.requests.protective_stop = True


class UnlockProtectiveStop(CommandOperation):
    """End a protective stop at once, without the dashboard's 5 s."""

    def apply(self, box: BoxParts) -> None:
        safety = box.state.safety
        if not safety.has(SafetyMode.PROTECTIVE_STOP):
            raise RefusedError(
                f"there is no protective stop to unlock: the safety mode is {safety.mode.name}"
            )
        box.safety.handle(modes.SafetyEvent.UNLOCK)


class TriggerViolation(CommandOperation):
    """Let the safety system find a violation."""

    text: str = parameter("for log and clients", default="Safety violation requested")

    def apply(self, box: BoxParts) -> None:
        if box.state.safety.has(SafetyMode.FAULT):
            raise RefusedError("no violation: the safety system has a fault, restart it")
        box.state.events.append(ErrorReported(0, 0, ReportLevel.VIOLATION, self.text))
        box.safety.handle(modes.SafetyEvent.VIOLATION)


class TriggerFault(CommandOperation):
    """Let the safety system find a fault in itself."""

    text: str = parameter("for log and clients", default="Safety fault requested")

    def apply(self, box: BoxParts) -> None:
        box.state.events.append(ErrorReported(0, 0, ReportLevel.FAULT, self.text))
        box.safety.handle(modes.SafetyEvent.FAULT)


class RestartSafety(CommandOperation):
    """Restart the safety system; the power is off then."""

    def apply(self, box: BoxParts) -> None:
        box.safety.handle(modes.SafetyEvent.RESTART)


class RequireSafeguardReset(CommandOperation):
    """Set up whether a closed safeguard also needs a reset before the program continues."""

    required: bool = parameter("a reset is needed")
    safeguard: GuardName = parameter("which", default="permanent")

    def apply(self, box: BoxParts) -> None:
        box.safety.inputs.require_reset(_guard_of(box, self.safeguard), self.required)


class ResetSafeguard(CommandOperation):
    """Press the reset button of a safeguard; it has an effect once the safeguard is closed."""

    safeguard: GuardName = parameter("which", default="permanent")

    def apply(self, box: BoxParts) -> None:
        box.safety.inputs.reset(_guard_of(box, self.safeguard))


class AssignSafetyInput(CommandOperation):
    """Set up a pair of configurable inputs as a safety input, or as plain inputs again.

    Safety inputs have two channels: one that is low is enough to stop.
    """

    pair: int = parameter("inputs 2 * pair and 2 * pair + 1", low=0, high=inputs.N_INPUT_PAIRS - 1)
    function: str = parameter("of the pair", choices=("none", *(it.value for it in inputs.SafetyInput)))

    def apply(self, box: BoxParts) -> None:
        function = None if self.function == "none" else inputs.SafetyInput(self.function)
        if function is not None and function.needs_operational_modes:
            needs_operational_modes(box.state)
        box.safety.inputs.assign(self.pair, function)


class ChangeSafetySettings(CommandOperation):
    """Change the safety settings: the power goes off and the robot mode becomes CONFIRM_SAFETY."""

    def apply(self, box: BoxParts) -> None:
        box.safety.cut_power()
        change_mode(box.state, ModeCommand.ASK_TO_CONFIRM)


class ConfirmSafety(CommandOperation):
    """Confirm the safety settings, as `confirm user safety parameters` does."""

    def apply(self, box: BoxParts) -> None:
        change_mode(box.state, ModeCommand.CONFIRM)


Button = Literal["teach", "power"]
# Bits of the robot status by the buttons of the pendant, beside the emergency stop.
BUTTON_BITS: dict[Button, int] = {
    "teach": RobotStatusBits.TEACH_BUTTON_PRESSED,
    "power": RobotStatusBits.POWER_BUTTON_PRESSED,
}


class PressButton(CommandOperation):
    """Press or release a button of the pendant; the teach button requests freedrive."""

    button: Button = parameter("which button")
    pressed: bool = parameter("pressed, or released")

    def apply(self, box: BoxParts) -> None:
        box.state.pendant.press(BUTTON_BITS[self.button], self.pressed)
        if self.button == "teach":
            box.state.compliance.is_teach_pressed = self.pressed


_LEAST_LENGTH = 1e-6


class SetSafetyPlane(CommandOperation):
    """Set up a safety plane; one of the same name is replaced, and all when an installation is loaded."""

    name: str = parameter("of the plane")
    position: Sequence[float] = parameter("of a point of the plane in the base frame", "m")
    normal: Sequence[float] = parameter("towards the allowed side, in the base frame, of any length")
    mode: Literal["disabled", "normal", "reduced", "normal and reduced", "trigger reduced mode"] = parameter(
        "where it is a strict limit, or that it triggers reduced mode", default="normal"
    )
    restrict_elbow: bool = parameter("it holds the elbow, too", default=False)

    def check_together(self) -> None:
        if not self.name:
            raise ArgumentError("safety plane without a name given: it needs one, to be replaced by")
        _unit(self.normal)

    def apply(self, box: BoxParts) -> None:
        x, y, z = self.position
        plane = boundaries.SafetyPlane(
            self.name, (x, y, z), _unit(self.normal), boundaries.BoundaryMode(self.mode), self.restrict_elbow
        )
        before = box.state.safety.limits.boundaries
        planes = (*(other for other in before.planes if other.name != self.name), plane)
        if len(planes) > (most := boundaries.MOST_PLANES):
            raise RefusedError(
                f"safety plane {self.name!r}: there are {most} planes, no more are possible: "
                f"give the name of one of them, {', '.join(other.name for other in before.planes)}"
            )
        _set(box, replace(before, planes=planes))


class LimitToolDirection(CommandOperation):
    """Limit the direction of the tool, the z axis of the TCP, to a cone."""

    axis: Sequence[float] = parameter("of the cone in the base frame, of any length")
    deviation: float = parameter("largest angle from the axis", "rad", low=radians(3.0), high=pi)
    mode: Literal["disabled", "normal", "reduced", "normal and reduced"] = parameter(
        "where it is a strict limit", default="normal"
    )

    def check_together(self) -> None:
        _unit(self.axis)

    def apply(self, box: BoxParts) -> None:
        cone = boundaries.ToolDirection(_unit(self.axis), self.deviation, boundaries.BoundaryMode(self.mode))
        _set(box, replace(box.state.safety.limits.boundaries, tool_direction=cone))


def _set(box: BoxParts, wanted: boundaries.Boundaries) -> None:
    box.safety.set_limits(replace(box.state.safety.limits, boundaries=wanted))


def _unit(vector: Sequence[float]) -> Vector3:
    x, y, z = vector
    length = hypot(x, y, z)
    if length < _LEAST_LENGTH:
        raise ArgumentError(f"direction {list(vector)} given: its length must be at least {_LEAST_LENGTH:g}")
    return x / length, y / length, z / length
