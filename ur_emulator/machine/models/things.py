"""Things around an arm, as people put them there and as they are now; shapes; contacts."""

from dataclasses import dataclass
from typing import Literal

from ur_emulator.machine.models.robot_model import Vector3, Vector6

# What the sizes of each shape mean, in order [m]. A plane has no end; its z points away from it.
SIZES: dict[str, tuple[str, ...]] = {
    "box": ("edge along x", "edge along y", "edge along z"),
    "sphere": ("radius",),
    "capsule": ("radius", "length along z without the ends"),
    "plane": (),
    "cylinder": ("radius", "length along z"),
}

# Of what has no friction of its own: arm, table, obstacles; assumed: a tool of metal or plastic on a table.
SLIDING_FRICTION = 0.3


@dataclass(frozen=True, slots=True)
class Thing:
    """A body that can be moved, or an obstacle, which stands.

    Attributes:
        shape: a key of SIZES; a thing that can be moved is no capsule and no plane.
        size: see SIZES [m].
        mass: evenly distributed [kg]; 0: it is an obstacle.
        friction: coefficient of its surface; of two surfaces the greater counts, of a tool's pads their own.
        pose: of its middle in the base frame [m, rad].
    """

    name: str
    shape: str
    size: tuple[float, ...]
    mass: float
    friction: float
    pose: Vector6

    @property
    def kind(self) -> Literal["thing", "obstacle"]:
        """What it is called in messages."""
        return "thing" if self.mass else "obstacle"


@dataclass(frozen=True, slots=True)
class ThingNow:
    """A thing around the arm, as it is now; in the base frame.

    Attributes:
        name: by which it is moved and removed.
        pose: of its middle [m, rotation vector in rad].
        speed: [m/s, rad/s].
        touches_tool: it touches the arm or its tool.
    """

    name: str
    pose: Vector6
    speed: Vector6
    touches_tool: bool


@dataclass(frozen=True, slots=True)
class BodyShape:
    """A shape around the arm, or on its flange, for those who draw it; the links of the arm are none.

    Attributes:
        name: of the body that it is a part of: a tool, an obstacle, a thing, "table" or "scene"; of a plane.
        is_carried: it hangs on the flange.
        shape: "box" (also around a mesh), "cylinder" or "capsule" (along z), "sphere", "plane" (z points away
            from it) or "safety plane" (z points to the allowed side).
        size: three edges; radius and length, of a capsule without its ends; radius [m].
        pose: of its middle in the base frame, of one that is carried in the flange frame [m, rad].
    """

    name: str
    is_carried: bool
    shape: str
    size: tuple[float, ...]
    pose: Vector6


@dataclass(frozen=True, slots=True)
class Contact:
    """A point in which two bodies press on each other.

    Attributes:
        first, second: names of bodies: a link, a tool, an obstacle, a thing, "table", "base" or "scene".
        position: in the base frame [m].
        force: on the second body, in the base frame [N].
    """

    first: str
    second: str
    position: Vector3
    force: Vector3
