"""The table of arms that the emulator can be. A new arm is one file of numbers and one row here."""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.errors import ModelError
from ur_emulator.models.e_series import E_SERIES
from ur_emulator.models.polyscope_x import POLYSCOPE_X
from ur_emulator.models.robot_model import RobotModel
from ur_emulator.models.ur3 import UR3
from ur_emulator.models.ur3e import UR3E
from ur_emulator.models.ur5 import UR5
from ur_emulator.models.ur5e import UR5E
from ur_emulator.models.ur7e import UR7E
from ur_emulator.models.ur8long import UR8LONG
from ur_emulator.models.ur10 import UR10
from ur_emulator.models.ur10e import UR10E
from ur_emulator.models.ur12e import UR12E
from ur_emulator.models.ur15 import UR15
from ur_emulator.models.ur16e import UR16E
from ur_emulator.models.ur18 import UR18
from ur_emulator.models.ur20 import UR20
from ur_emulator.models.ur30 import UR30

# The first of each generation runs its software where no arm is named.
_CB3 = (UR3, UR5, UR10)
_E_SERIES = (UR5E, UR3E, UR7E, UR10E, UR12E, UR16E, UR8LONG, UR15, UR18, UR20, UR30)

ROBOTS: dict[str, RobotModel] = {robot.name: robot for robot in (*_CB3, *_E_SERIES)}


# Software of another generation that the same arms run.
_ALSO = {E_SERIES: POLYSCOPE_X}


def robot_by_name(name: str, version: str | None = None) -> RobotModel:
    """Look an arm up by its name, in any letter case.

    Args:
        name: of the arm.
        version: software that it shall run; an arm of the e-Series may run PolyScope X.

    Raises:
        ModelError: when no arm has that name.
    """
    robot = ROBOTS.get(name.lower())
    if robot is None:
        raise ModelError(f"unknown robot {name!r}: choose one of {', '.join(ROBOTS)}")
    also = _ALSO.get(robot.generation)
    if also is not None and version is not None and version.strip().startswith(f"{also.major}."):
        return replace(robot, generation=also, first_version=None)
    return robot
