"""What drives the tools on the flange: a controller of its own for each kind, advanced once a cycle."""

from collections.abc import Sequence
from itertools import count

from ur_emulator.machine.tools.gripper import Gripper
from ur_emulator.machine.tools.onrobot import FIRST_UNIT, OnRobotGripper
from ur_emulator.machine.tools.robotiq import RobotiqGripper
from ur_emulator.machine.tools.vacuum import VacuumGripper
from ur_hil.tools import ToolModel

SUPPLY = 24  # V; at the tool connector, that grippers need
# Addresses of the grippers 1 to 4 of programs. Source: reference `grippers.md` 1.1 (O).
_UNITS = (9, 2, 3, 4)


def make_grippers(tools: Sequence[ToolModel], period: float, has_tool_line: bool) -> tuple[Gripper, ...]:
    """Return the controllers of tools, in their order.

    Args:
        period: of the control cycle [s].
        has_tool_line: the tool connector has a serial line; where it has none, a cable leads from the control
            box to the grippers that need one.
    """
    units = iter(_UNITS)
    # One of OnRobot that is alone is the first; several are counted from the next one on.
    several = sum(tool.kind == "onrobot" for tool in tools) > 1
    onrobot_units = count(FIRST_UNIT + several)
    grippers: list[Gripper] = []
    for tool in tools:
        match tool.kind:
            case "robotiq":
                grippers.append(RobotiqGripper(tool, period, next(units), has_cable=not has_tool_line))
            case "onrobot":
                grippers.append(OnRobotGripper(tool, period, next(onrobot_units)))
            case "vacuum":
                grippers.append(VacuumGripper(tool, period))
    return tuple(grippers)
