"""Power, brakes and freedrive: the buttons of the initialisation screen, and their text commands."""

from __future__ import annotations

from dataclasses import dataclass

from ur_emulator.commands.operation import CommandOperation
from ur_emulator.controller.command import Box, inform
from ur_emulator.controller.robot_mode import ModeCommand
from ur_emulator.controller.safety.modes import ROW


class PowerOn(CommandOperation):
    """Power the joints; the brakes stay closed."""

    def apply(self, box: Box) -> None:
        _give_power(box, ModeCommand.POWER_ON)


class PowerOff(CommandOperation):
    """Close the brakes and cut the power."""

    def apply(self, box: Box) -> None:
        box.safety.cut_power()


class ReleaseBrakes(CommandOperation):
    """Go to RUNNING, powering on first if need be."""

    def apply(self, box: Box) -> None:
        box.state.compliance.end_freedrive_by_client()
        _give_power(box, ModeCommand.BRAKE_RELEASE)


@dataclass(frozen=True, slots=True)
class StartFreedrive:
    """Go into freedrive, as `set robotmode freedrive` asks; `set robotmode run` ends it."""

    def apply(self, box: Box) -> None:
        if box.state.operational.allows.allows_freedrive:
            box.state.compliance.start_freedrive(by_client=True)
        else:
            inform(box.state, "freedrive refused: the operational mode is AUTOMATIC: choose manual mode")


def _give_power(box: Box, command: ModeCommand) -> None:
    """Power the joints or open their brakes, if the safety mode allows it; clients get a message if not."""
    mode = box.state.safety.mode
    if ROW[mode].may_have_power:
        box.state.mode.command(command)
    else:
        inform(box.state, f"{command.value} refused: the robot is in {mode.name}: {ROW[mode].remedy}")
