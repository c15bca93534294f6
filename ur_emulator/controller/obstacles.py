"""Obstacles as commands of the box: they are checked when they are made, so nothing absurd gets further."""

from __future__ import annotations

from dataclasses import dataclass

from ur_emulator.models.robot_model import Vector6
from ur_emulator.plant.obstacles import check_obstacle


@dataclass(frozen=True, slots=True)
class AddObstacle:
    """Put a fixed obstacle somewhere; one of the same name gives way. It is refused where the arm is.

    Attributes:
        name: to remove it by.
        shape: "box", "sphere", "capsule" or "plane".
        size: box: three edges; sphere: radius; capsule: radius and length along z without the ends; plane:
            none, it has no end and its z points away from it [m].
        pose: of its middle in the base frame [m, rad].

    Raises:
        PlantError: that is no obstacle.
    """

    name: str
    shape: str
    size: tuple[float, ...]
    pose: Vector6

    def __post_init__(self) -> None:
        check_obstacle(self.name, self.shape, self.size, self.pose)


@dataclass(frozen=True, slots=True)
class RemoveObstacle:
    """Take an obstacle away; one that does not stand there is none."""

    name: str
