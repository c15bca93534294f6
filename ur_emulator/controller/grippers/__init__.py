"""What drives the tools on the flange: a controller of its own for each kind, advanced once a cycle."""

from collections.abc import Sequence

from ur_emulator.controller.grippers.robotiq import RobotiqGripper
from ur_emulator.controller.grippers.vacuum import VacuumGripper
from ur_hil.tools import ToolModel

SUPPLY = 24
"""Voltage at the tool connector that grippers need [V]."""

Gripper = RobotiqGripper | VacuumGripper

_UNITS = (9, 2, 3, 4)
"""Addresses of the grippers 1 to 4 of programs. Source: reference `grippers.md` 1.1 (O)."""


def make_grippers(tools: Sequence[ToolModel], period: float) -> tuple[Gripper, ...]:
    """Return the controllers of tools, in their order; `period` is the cycle [s]."""
    units = iter(_UNITS)
    return tuple(
        VacuumGripper(tool, period) if tool.kind == "vacuum" else RobotiqGripper(tool, period, next(units))
        for tool in tools
    )
