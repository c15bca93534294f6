"""Commands for power, brakes, freedrive, the operational mode and remote control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from protocol.ur_types import RobotMode
from ur_emulator.errors import RefusedError
from ur_emulator.machine.commands.operation import CommandOperation, parameter
from ur_emulator.machine.controller.command import BoxParts, refuse
from ur_emulator.machine.controller.events import LogAdded
from ur_emulator.machine.controller.robot_mode import TRANSITIONS, ModeCommand
from ur_emulator.machine.controller.safety.inputs import EnablingAct, ModeSource, OperationalMode
from ur_emulator.machine.controller.safety.modes import ROW

if TYPE_CHECKING:
    from ur_emulator.machine.controller.state import ControllerState


class PowerOn(CommandOperation):
    """Power the joints; the brakes stay closed."""

    def apply(self, box: BoxParts) -> None:
        _give_power(box, ModeCommand.POWER_ON)


class PowerOff(CommandOperation):
    """Close the brakes and cut the power."""

    def apply(self, box: BoxParts) -> None:
        box.safety.cut_power()


class ReleaseBrakes(CommandOperation):
    """Go to RUNNING, powering on first if need be."""

    def apply(self, box: BoxParts) -> None:
        box.state.compliance.end_freedrive("client")
        _give_power(box, ModeCommand.BRAKE_RELEASE)


@dataclass(frozen=True, slots=True)
class StartFreedrive:
    """Go into freedrive, as `set robotmode freedrive` asks; `set robotmode run` ends it."""

    def apply(self, box: BoxParts) -> None:
        state = box.state
        if not state.operational.allows.allows_freedrive:
            refuse(state, "freedrive refused: the operational mode is AUTOMATIC: choose manual mode")
        if state.mode.mode is not RobotMode.RUNNING or state.safety.is_stopped:
            modes = f"{state.mode.mode.name}, {state.safety.mode.name}"
            refuse(state, f"freedrive refused: the robot must be RUNNING and not stopped, it is in {modes}")
        state.compliance.start_freedrive("client")


def _give_power(box: BoxParts, command: ModeCommand) -> None:
    mode = box.state.safety.mode
    if not ROW[mode].may_have_power:
        refuse(box.state, f"{command.value} refused: the robot is in {mode.name}: {ROW[mode].remedy}")
    change_mode(box.state, command)


def change_mode(state: ControllerState, command: ModeCommand) -> None:
    """Change the robot mode; refused in modes in which the command has no effect."""
    if not state.mode.command(command):
        possible = " or ".join(mode.name for mode, given in TRANSITIONS if given is command)
        refuse(state, f"{command.value} refused: the robot is in {state.mode.mode.name}, not in {possible}")


class SetOperationalMode(CommandOperation):
    """Choose the operational mode at the pendant; a wired selector and the dashboard override it."""

    mode: Literal["none", "manual", "automatic"] = parameter("the mode; none: no password is set")

    def apply(self, box: BoxParts) -> None:
        _choose(box, ModeSource.PENDANT, None if self.mode == "none" else OperationalMode(self.mode))


@dataclass(frozen=True, slots=True)
class ChooseModeByDashboard:
    """Choose the operational mode as `set operational mode` does; None: as `clear operational mode`."""

    mode: OperationalMode | None

    def apply(self, box: BoxParts) -> None:
        _choose(box, ModeSource.DASHBOARD, self.mode)


class MoveEnablingDevice(CommandOperation):
    """Press or release the three-position enabling device, which acts in manual mode."""

    position: Literal["none", "released", "pressed", "fully pressed"] = parameter(
        "pressed is its middle position; none: no device is connected"
    )

    def apply(self, box: BoxParts) -> None:
        needs_operational_modes(box.state)
        box.safety.inputs.act_on_device(EnablingAct(self.position))


class SwitchRemoteControl(CommandOperation):
    """Switch to remote control, or to local control, in which clients may not command the box.

    PolyScope X has no remote control in manual mode. Clients of the dashboard and of the script ports must
    connect again after the switch to remote control.
    """

    on: bool = parameter("remote control, or local", default=True)

    def apply(self, box: BoxParts) -> None:
        generation = box.state.robot.generation
        if not generation.has_remote_control:
            raise RefusedError(f"a box of the {generation.name} has no remote control")
        if (
            self.on
            and box.state.operational.mode is OperationalMode.MANUAL
            and not generation.has_remote_in_manual
        ):
            raise RefusedError(
                f"a box of {generation.name} has no remote control in manual mode: choose automatic"
            )
        box.state.pendant.set_remote_control(self.on)
        box.state.events.append(LogAdded("Controller", f"{'Remote' if self.on else 'Local'} control"))


def needs_operational_modes(state: ControllerState) -> None:
    """Raise RefusedError on a box without operational modes."""
    generation = state.robot.generation
    if not generation.has_operational_modes:
        raise RefusedError(f"a box of the {generation.name} has no operational modes")


def _choose(box: BoxParts, source: ModeSource, mode: OperationalMode | None) -> None:
    needs_operational_modes(box.state)
    decides = box.state.operational.source
    if mode is not None and decides < source:
        raise RefusedError(
            f"the operational mode stays {box.state.operational.mode.name}: "
            f"the {decides.name.lower()} decides, which comes before the {source.name.lower()}"
        )
    box.safety.inputs.choose_mode(source, mode)
