"""The table of arms that the emulator can be. A new arm is its numbers in a file of arms and one row here."""

from __future__ import annotations

from dataclasses import replace

from ur_emulator.errors import ModelError
from ur_emulator.models.cb3_arms import UR3, UR5, UR10
from ur_emulator.models.e_series_arms import (
    UR3E,
    UR5E,
    UR7E,
    UR8LONG,
    UR10E,
    UR12E,
    UR15,
    UR16E,
    UR18,
    UR20,
    UR30,
)
from ur_emulator.models.generations import E_SERIES, POLYSCOPE_X
from ur_emulator.models.robot_model import RobotModel

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
