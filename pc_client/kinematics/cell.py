"""The bodies around the arm and its tool: the geometry of a cell, in metres and radians.

The TCP stays at the flange: the tool is a shape that must not touch anything, and a load, not a new TCP.
"""

from __future__ import annotations

from dataclasses import dataclass

Three = tuple[float, float, float]


NOUNS = {"boxes": "box", "cylinders": "cylinder", "spheres": "sphere", "capsules": "capsule"}
"""The kinds of solids by the name of their table in a cell file.

Cylinders and capsules lie along their own z axis; the length of a capsule is that of its straight part,
without the two half spheres.
"""


@dataclass(frozen=True, slots=True)
class Solid:
    """A convex body.

    Attributes:
        name: for messages.
        kind: a key of NOUNS.
        sizes: x, y, z of a box; the radius, and the length of a cylinder or capsule [m].
        centre: in `base`, or in the flange's frame for a part of a tool [m].
        rpy: roll, pitch, yaw: turns about the fixed x, y and z axis, in this order [rad].
    """

    name: str
    kind: str
    sizes: tuple[float, ...]
    centre: Three
    rpy: Three = (0.0, 0.0, 0.0)

    @property
    def title(self) -> str:
        """What it is and how it is called, e.g. `box 'press'`."""
        return f"{NOUNS[self.kind]} '{self.name}'"


@dataclass(frozen=True, slots=True)
class Wall:
    """A half space: the arm must stay at normal . p > offset.

    Attributes:
        name: for messages.
        normal: unit vector from the wall to the arm, in `base`.
        offset: normal . p of the wall's points [m]; below 0, since the base stands on the free side.
    """

    name: str
    normal: Three
    offset: float


@dataclass(frozen=True, slots=True)
class Tool:
    """What the flange carries.

    Attributes:
        solids: its shape, in the flange's frame.
        mass: [kg]; the payload that must be set in PolyScope.
        centre_of_gravity: in the flange's frame [m].
    """

    solids: tuple[Solid, ...] = ()
    mass: float = 0.0
    centre_of_gravity: Three = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Cell:
    """An arm's surroundings and its tool.

    Attributes:
        name: for messages; empty: nothing is known, the bare arm stands on a plane.
        floor_z: height of the surface under the arm in `base`; forearm, wrists and tool stay above it [m].
        walls: half spaces.
        solids: bodies, in `base`.
        tool: what the flange carries.
        text: the file that it was read from.
    """

    name: str = ""
    floor_z: float = 0.0
    walls: tuple[Wall, ...] = ()
    solids: tuple[Solid, ...] = ()
    tool: Tool = Tool()
    text: str = ""

    @property
    def summary(self) -> str:
        """What is known of the surroundings, in one line for someone who stands beside the arm."""
        if not self.name:
            return f"no cell file: bare arm on a plane z = {self.floor_z:g}"
        around = [f"wall '{wall.name}'" for wall in self.walls] + [solid.title for solid in self.solids]
        tool = ", ".join(solid.title for solid in self.tool.solids)
        return (
            f"'{self.name}': floor at z = {self.floor_z:g} m, {', '.join(around) or 'nothing else around'};"
            f" tool of {self.tool.mass:g} kg, {tool or 'without a shape'}"
        )


NO_CELL = Cell()
"""Nothing is known: the bare arm on a plane z = 0."""
