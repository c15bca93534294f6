"""The table of arms that the emulator can be. A new arm is one file of numbers and one row here."""

from __future__ import annotations

from ur_emulator.errors import ModelError
from ur_emulator.models.robot_model import RobotModel
from ur_emulator.models.ur3 import UR3
from ur_emulator.models.ur5 import UR5
from ur_emulator.models.ur5e import UR5E
from ur_emulator.models.ur10 import UR10

ROBOTS: dict[str, RobotModel] = {robot.name: robot for robot in (UR3, UR5, UR10, UR5E)}


def robot_by_name(name: str) -> RobotModel:
    """Look an arm up by its name, in any letter case.

    Raises:
        ModelError: when no arm has that name.
    """
    robot = ROBOTS.get(name.lower())
    if robot is None:
        raise ModelError(f"unknown robot {name!r}: choose one of {', '.join(ROBOTS)}")
    return robot
