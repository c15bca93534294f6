"""The bodies around the arm and its tool: the geometry of a cell, in metres and radians, and its file.

The client plans around them; the emulated box puts them around its arm.

The tool is a shape that must not touch anything, and a load. The TCP is the flange, or `length` beyond it.

A cell file is TOML, read strictly; `examples/cell.toml` shows every field, `docs/real-arm.md` explains them.
"""

from dataclasses import astuple, dataclass
from math import hypot, pi
from pathlib import Path
from typing import Annotated, Literal

from ur_hil.input_files import FileKind
from ur_hil.records import Finite, Items, checked, number, record
from ur_hil.records import text as text_field

Three = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Solid:
    """A convex body.

    Attributes:
        shape: "box", "cylinder" or "capsule" (along z), "sphere".
        sizes: x, y, z of a box; the radius, and the length of a cylinder or capsule, without its half spheres
            [m].
        centre: in `base`, or in the flange's frame for a part of a tool [m].
        rpy: roll, pitch, yaw: turns about the fixed x, y and z axis, in this order [rad].
        mass: of a thing that can be gripped and pushed [kg]; 0: it stands still.
        friction: coefficient of its surface.
    """

    name: str
    shape: str
    sizes: tuple[float, ...]
    centre: Three
    rpy: Three = (0.0, 0.0, 0.0)
    mass: float = 0.0
    friction: float = 0.5

    @property
    def title(self) -> str:
        """What it is and how it is called, e.g. `box 'press'`."""
        return f"{self.shape} '{self.name}'"


@dataclass(frozen=True, slots=True)
class Wall:
    """A half space: the arm must stay at normal . p > offset.

    Attributes:
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
        length: from the flange to the TCP, along the flange's z axis [m].
    """

    solids: tuple[Solid, ...] = ()
    mass: float = 0.0
    centre_of_gravity: Three = (0.0, 0.0, 0.0)
    length: float = 0.0

    @property
    def tcp_text(self) -> str:
        """Where the TCP is, for people."""
        return f"TCP {1e3 * self.length:g} mm beyond the flange" if self.length else "TCP at the flange"


@dataclass(frozen=True, slots=True)
class Cell:
    """An arm's surroundings and its tool.

    Attributes:
        name: for messages; empty: nothing is known, the bare arm stands on a plane.
        floor_z: height of the surface under the arm in `base`; forearm, wrists and tool stay above it [m].
        solids: bodies that stand still, in `base`.
        things: bodies that can be gripped and pushed, in `base`; a plan may touch them.
        text: the file that it was read from.
    """

    name: str = ""
    floor_z: float = 0.0
    walls: tuple[Wall, ...] = ()
    solids: tuple[Solid, ...] = ()
    tool: Tool = Tool()
    text: str = ""
    things: tuple[Solid, ...] = ()

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
            + (f", {self.tool.tcp_text}" if self.tool.length else "")
        )


NO_CELL = Cell()
"""Nothing is known: the bare arm on a plane z = 0."""


MOST_BODIES = 100
"""More walls and solids than this in one file is refused: plans would take minutes."""

Name = Annotated[str, text_field(60)]
# No size and no distance is longer than 100 m: the number was probably meant in millimetres.
Length = Annotated[float, number(-100.0, 100.0, "m")]
Size = Annotated[float, number(1e-6, 100.0, "m")]
_Angle = Annotated[float, number(-2.0 * pi, 2.0 * pi, "rad")]
Point = tuple[Length, Length, Length]


@record
class _Floor:
    z: Length


_SIDES: dict[str, Three] = {
    "x_min": (1.0, 0.0, 0.0),
    "x_max": (-1.0, 0.0, 0.0),
    "y_min": (0.0, 1.0, 0.0),
    "y_max": (0.0, -1.0, 0.0),
    "z_min": (0.0, 0.0, 1.0),
    "z_max": (0.0, 0.0, -1.0),
}


@record
class _Wall:
    name: Name
    x_min: Length | None = None
    x_max: Length | None = None
    y_min: Length | None = None
    y_max: Length | None = None
    z_min: Length | None = None
    z_max: Length | None = None
    point: Point | None = None
    normal: tuple[Finite, Finite, Finite] | None = None

    def __post_init__(self) -> None:
        self.wall()

    def wall(self) -> Wall:
        """The half space: of one of x_min ... z_max, or of a point of the wall and its normal."""
        given = ((side, getattr(self, side)) for side in _SIDES)
        planes = [(side, (x, x, x), _SIDES[side]) for side, x in given if x is not None]
        if self.point is not None and self.normal is not None:
            planes.append(("normal", self.point, self.normal))
        if len(planes) != 1 or (self.point is None) != (self.normal is None):
            raise ValueError("point", f"give one of {', '.join(_SIDES)}, or a point and a normal")
        ((field, point, normal),) = planes
        length = hypot(*normal)
        if not 1e-6 <= length <= 1e6:
            raise ValueError("normal", f"{list(normal)}; give a direction, such as [0, 1, 0]")
        x, y, z = (component / length for component in normal)
        offset = x * point[0] + y * point[1] + z * point[2]
        if offset >= 0.0:
            raise ValueError(
                field, "the robot's base stands behind this wall; a normal points from the wall to the robot"
            )
        return Wall(self.name, (x, y, z), offset)


@record
class _Body:
    name: Name
    centre: Point
    rpy: tuple[_Angle, _Angle, _Angle] = (0.0, 0.0, 0.0)
    mass: Annotated[float, number(0.001, 100.0, "kg")] = 0.0
    friction: Annotated[float, number(0.0, 2.0)] = 0.5

    def solid(self, shape: str) -> Solid:
        """The body with the shape of its table in the file."""
        name, centre, rpy, mass, friction, *sizes = astuple(self)
        return Solid(name, shape, sizes[0] if shape == "box" else tuple(sizes), centre, rpy, mass, friction)


@record
class _Box(_Body):
    size: tuple[Size, Size, Size]


@record
class _Sphere(_Body):
    radius: Size


@record
class _Rod(_Sphere):
    length: Size


_Bodies = Items(0, MOST_BODIES)


@record
class _Solids:
    boxes: Annotated[tuple[_Box, ...], _Bodies] = ()
    cylinders: Annotated[tuple[_Rod, ...], _Bodies] = ()
    spheres: Annotated[tuple[_Sphere, ...], _Bodies] = ()
    capsules: Annotated[tuple[_Rod, ...], _Bodies] = ()

    @property
    def solids(self) -> tuple[Solid, ...]:
        """All bodies, shape by shape."""
        kinds = {
            "box": self.boxes,
            "cylinder": self.cylinders,
            "sphere": self.spheres,
            "capsule": self.capsules,
        }
        return tuple(body.solid(shape) for shape, bodies in kinds.items() for body in bodies)


@record
class _Tool(_Solids):
    mass: Annotated[float, number(0.0, 100.0, "kg")] = 0.0
    centre_of_gravity: Point = (0.0, 0.0, 0.0)
    length: Annotated[float, number(0.0, 2.0, "m")] = 0.0


@record
class _Cell(_Solids):
    format: Literal[1]
    name: Name
    floor: _Floor = _Floor(z=0.0)
    walls: Annotated[tuple[_Wall, ...], _Bodies] = ()
    tool: _Tool = _Tool()

    def __post_init__(self) -> None:
        if heavy := next((solid for solid in self.tool.solids if solid.mass), None):
            raise ValueError("tool", f"{heavy.title} has a mass; give that of the whole tool")
        names = [wall.name for wall in self.walls]
        names += [solid.name for solid in (*self.solids, *self.tool.solids)]
        if len(names) > MOST_BODIES:
            raise ValueError(f"{len(names)} walls and solids; give at most {MOST_BODIES}")
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ValueError(f"two bodies are called {twice!r}; give each a name of its own")


def load_cell(path: str | Path, kind: FileKind) -> Cell:
    """Read a cell file.

    Raises:
        Exception: the error of its kind, naming file and field: it is out of reach or makes no sense.
    """
    return parse_cell(kind.read_text(Path(path)), str(path), kind)


def parse_cell(text: str, source: str, kind: FileKind) -> Cell:
    """Make a cell of the text (TOML) of its file; errors as `load_cell`."""
    file = checked(_Cell, kind.parse_toml(text, source), source, kind.error)
    return Cell(
        file.name,
        file.floor.z,
        tuple(wall.wall() for wall in file.walls),
        tuple(solid for solid in file.solids if not solid.mass),
        Tool(file.tool.solids, file.tool.mass, file.tool.centre_of_gravity, file.tool.length),
        text,
        tuple(solid for solid in file.solids if solid.mass),
    )
