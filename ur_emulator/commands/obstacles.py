"""Obstacles around the arm: sizes and poses are checked before they reach the physics."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Literal

from ur_emulator.commands.operation import CommandOperation
from ur_emulator.commands.parameters import parameter
from ur_emulator.controller.command import Box, inform
from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.models.robot_model import six

Shape = Literal["box", "sphere", "capsule", "plane"]
# What the sizes of each shape mean, in order [m]. A plane has no end; its z points away from it.
SIZES: dict[Shape, tuple[str, ...]] = {
    "box": ("edge along x", "edge along y", "edge along z"),
    "sphere": ("radius",),
    "capsule": ("radius", "length along z without the ends"),
    "plane": (),
}
# How far away, how small and how large [m].
FARTHEST, SMALLEST, LARGEST = 5.0, 0.001, 5.0


class AddObstacle(CommandOperation):
    """Put a fixed obstacle somewhere; one of the same name is replaced."""

    name: str = parameter("to remove it by")
    shape: Shape = parameter("what it is; a plane has no end")
    size: Sequence[float] = parameter(
        "box: three edges; sphere: radius; capsule: radius, length; plane: none", "m", lengths=(0, 3)
    )
    pose: Sequence[float] = parameter(
        "of its middle in the base frame, position in m and rotation vector in rad", lengths=(6, 6)
    )

    def check_together(self) -> None:
        if not self.name:
            raise ArgumentError("obstacle without a name given: it needs one, to be removed by")
        wanted = SIZES[self.shape]
        if len(self.size) != len(wanted) or not all(SMALLEST <= value <= LARGEST for value in self.size):
            raise ArgumentError(
                f"obstacle {self.name}: size {list(self.size)} given: a {self.shape} needs {len(wanted)} "
                f"numbers ({', '.join(wanted) or 'none'}), each {SMALLEST:g} to {LARGEST:g} m"
            )
        if hypot(*self.pose[:3]) > FARTHEST:
            raise ArgumentError(
                f"obstacle {self.name}: pose {list(self.pose)} given: six finite numbers x, y, z, rx, ry, rz "
                f"are needed, at most {FARTHEST:g} m away"
            )

    def apply(self, box: Box) -> None:
        try:
            box.plant.obstacles.put(self.name, self.shape, self.size, six(self.pose))
        except RefusedError as refusal:
            inform(box.state, str(refusal))
            raise


class RemoveObstacle(CommandOperation):
    """Take an obstacle away."""

    name: str = parameter("of the obstacle")

    def apply(self, box: Box) -> None:
        known = box.plant.obstacles.names
        if self.name not in known:
            there = f"are {', '.join(known)}" if known else "is none"
            raise RefusedError(f"there is no obstacle {self.name!r}: there {there}")
        box.plant.obstacles.remove(self.name)
