"""What connections may ask of the controller: frozen records, applied at the start of a cycle in order."""

from __future__ import annotations

from dataclasses import dataclass

from protocol.rtde_types import RtdeValue
from ur_emulator.controller.hands import GuideByHand, HangLoad, Push
from ur_emulator.controller.obstacles import AddObstacle, RemoveObstacle
from ur_emulator.controller.operator import Answer
from ur_emulator.controller.safety_commands import SafetyCommand
from ur_emulator.controller.wires import WireCommand
from urscript import CompiledProgram


@dataclass(frozen=True, slots=True)
class StartProgram:
    """Run a compiled program; a primary program replaces the one that runs, a `sec` runs beside it."""

    program: CompiledProgram


@dataclass(frozen=True, slots=True)
class StopProgram:
    """End the running program, as the `stop program` line and the dashboard's `stop` do."""


@dataclass(frozen=True, slots=True)
class PauseProgram:
    """Let the running program stand still: the arm comes to rest on its path, threads wait."""


@dataclass(frozen=True, slots=True)
class ResumeProgram:
    """Let a paused program go on; refused while the robot may not move."""


@dataclass(frozen=True, slots=True)
class PowerOn:
    """Power the joints: POWER_OFF to IDLE; nothing happens when they are powered already."""


@dataclass(frozen=True, slots=True)
class PowerOff:
    """Apply the brakes and cut the power from any mode."""


@dataclass(frozen=True, slots=True)
class ReleaseBrakes:
    """Go to RUNNING, powering on first if need be."""


@dataclass(frozen=True, slots=True)
class UnlockProtectiveStop:
    """Return from a protective stop to normal."""


@dataclass(frozen=True, slots=True)
class SetSpeedSlider:
    """Set the speed slider.

    Attributes:
        fraction: 0..1.
    """

    fraction: float


@dataclass(frozen=True, slots=True)
class TriggerProtectiveStop:
    """Stop the arm as a safety function would."""


@dataclass(frozen=True, slots=True)
class WriteInputs:
    """Write input variables of RTDE.

    Attributes:
        values: names of `protocol.rtde_fields.INPUTS` with their values, in order.
    """

    values: tuple[tuple[str, RtdeValue], ...]


@dataclass(frozen=True, slots=True)
class WriteModbus:
    """Write neighbouring addresses of the robot's Modbus map; what cannot be written is left out.

    Attributes:
        is_coils: coils, otherwise registers.
        first: lowest address.
        values: 0 or 1 for a coil, 0 to 65535 for a register.
    """

    is_coils: bool
    first: int
    values: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AnswerRequest:
    """Answer a question of a program (`request_integer_from_primary_client` and its kin).

    An answer to a question that does not stand, or of another type, changes nothing.

    Attributes:
        value: the answer; its type must be the one asked for.
        request_id: number of the question; None answers the oldest of that type.
    """

    value: Answer
    request_id: int | None = None


@dataclass(frozen=True, slots=True)
class ShowPopup:
    """Show a popup for which nobody waits; it stays until it is closed."""

    text: str


@dataclass(frozen=True, slots=True)
class RestartSafety:
    """Restart the safety system: what had stopped the robot is forgotten, its power is off."""


@dataclass(frozen=True, slots=True)
class ClosePopup:
    """Press the button of all popups, so that programs that wait for it go on."""


Command = (
    StartProgram
    | StopProgram
    | PauseProgram
    | ResumeProgram
    | PowerOn
    | PowerOff
    | ReleaseBrakes
    | UnlockProtectiveStop
    | SetSpeedSlider
    | TriggerProtectiveStop
    | WriteInputs
    | WriteModbus
    | AnswerRequest
    | ClosePopup
    | ShowPopup
    | RestartSafety
    | GuideByHand
    | Push
    | HangLoad
    | SafetyCommand
    | AddObstacle
    | RemoveObstacle
    | WireCommand
)
