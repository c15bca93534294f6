"""The table of arms that the emulator can be. A new arm is one file of numbers and one row here."""

from __future__ import annotations

from ur_emulator.errors import ModelError
from ur_emulator.models.robot_model import RobotModel
from ur_emulator.models.ur3 import UR3
from ur_emulator.models.ur3e import UR3E
from ur_emulator.models.ur5 import UR5
from ur_emulator.models.ur5e import UR5E
from ur_emulator.models.ur7e import UR7E
from ur_emulator.models.ur10 import UR10
from ur_emulator.models.ur10e import UR10E
from ur_emulator.models.ur12e import UR12E
from ur_emulator.models.ur16e import UR16E
from ur_emulator.models.ur20 import UR20
from ur_emulator.models.ur30 import UR30

# The first of each generation runs its software where no arm is named.
_CB3 = (UR3, UR5, UR10)
_E_SERIES = (UR5E, UR3E, UR7E, UR10E, UR12E, UR16E, UR20, UR30)

ROBOTS: dict[str, RobotModel] = {robot.name: robot for robot in (*_CB3, *_E_SERIES)}


def robot_by_name(name: str) -> RobotModel:
    """Look an arm up by its name, in any letter case.

    Raises:
        ModelError: when no arm has that name.
    """
    robot = ROBOTS.get(name.lower())
    if robot is None:
        raise ModelError(f"unknown robot {name!r}: choose one of {', '.join(ROBOTS)}")
    return robot
