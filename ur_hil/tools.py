"""The tools that an arm can carry: those of the table, by name, and one's own, by a file.

The emulated box hangs them on its flange; the client compares TCP and payload of the robot with them. Each
number has its evidence beside it, with the letters of docs/fidelity.md: D maker's document, O seen in the
maker's software, S several independent clients agree, I inferred, C chosen, ? open. Axes of a tool are those
of the flange: z away from the arm, fingers along x.
"""

from dataclasses import dataclass, fields, replace
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from ur_hil.input_files import MIB, FileKind
from ur_hil.records import checked, number, record, text, whole, word

Vector3 = tuple[float, float, float]


ToolKind = Literal["robotiq", "onrobot", "vacuum"]


class Linkage(NamedTuple):
    """The arms of an OnRobot gripper, which turn; its metal tips are `root + 2 arm sin(angle)` apart.

    Lengths and the thickness of a fingertip on the metal [m], the angle of the least voltage [rad], the unit
    of the force in words by tool outputs [N], and the product code.
    """

    arm: float
    root: float
    tip: float
    least_angle: float
    force_step: float
    product: int


@dataclass(frozen=True, slots=True)
class ToolModel:
    """A gripper with two fingers, which move along x, one to each side, or with a suction cup.

    Attributes:
        name: as `--tool` takes it.
        title: of the maker.
        kind: what drives it, and how it is reached.
        mass: of the whole tool, fingers included [kg].
        cog: centre of mass [m].
        inertia: xx, yy, zz about it [kg m²].
        length: from the flange to the middle of the pads, or to the end of the cup [m].
        stroke: largest width between the pads [m]; 0 of a cup.
        counts: positions of the open and of the closed fingers, of 0 to 255; of Robotiq.
        speed: slowest and fastest speed of the width [m/s].
        force: least and greatest force at a pad; the second of a cup: with which it holds [N].
        friction: of the pads or of the cup.
        pad: half extents of a pad, across and along the fingers; radius and height of a cup [m].
        body: radius of the housing [m].
        output: bit of the digital output that turns the suction of a cup on (0 to 7 standard, 8 to 15
            configurable, 16 and 17 tool).
        input: bit of the digital input that reports its vacuum.
        tilt: angle of the tool's z axis from that of the flange, about the tool's x axis [rad].
        turn: of the tilted tool about the z axis of the flange [rad].
        linkage: of OnRobot.
    """

    name: str
    title: str
    kind: ToolKind
    mass: float
    cog: Vector3
    inertia: Vector3
    length: float
    stroke: float = 0.0
    counts: tuple[int, int] = (0, 255)
    speed: tuple[float, float] = (0.02, 0.15)
    force: tuple[float, float] = (20.0, 235.0)
    friction: float = 0.7
    pad: tuple[float, float] = (0.011, 0.0094)
    body: float = 0.04
    output: int = 16
    input: int = 16
    tilt: float = 0.0
    turn: float = 0.0
    linkage: Linkage | None = None

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Orientation of the tool's axes in those of the flange: w, x, y, z."""
        ct, st, cz, sz = cos(self.tilt / 2), sin(self.tilt / 2), cos(self.turn / 2), sin(self.turn / 2)
        return (ct * cz, st * cz, st * sz, ct * sz)

    def at_flange(self, point: Vector3) -> Vector3:
        """A point of the tool [m] in the axes of the flange."""
        x, y, z = point
        y, z = cos(self.tilt) * y - sin(self.tilt) * z, sin(self.tilt) * y + cos(self.tilt) * z
        return (cos(self.turn) * x - sin(self.turn) * y, sin(self.turn) * x + cos(self.turn) * y, z)

    def width_of(self, count: int) -> float:
        """The width [m] at a position of 0 to 255: 0 and the stroke beyond the ends of the fingers."""
        opened, closed = self.counts
        return self.stroke * min(1.0, max(0.0, (closed - count) / (closed - opened)))

    def count_of(self, width: float) -> int:
        """The position of 0 to 255 at a width [m]."""
        opened, closed = self.counts
        share = min(1.0, max(0.0, width / self.stroke))
        return round(closed - share * (closed - opened))

    def speed_of(self, count: int) -> float:
        """The speed [m/s] of 0 to 255."""
        slow, fast = self.speed
        return slow + (fast - slow) * count / 255

    def force_of(self, count: int) -> float:
        """The force at a pad [N] of 0 to 255."""
        weak, strong = self.force
        return weak + (strong - weak) * count / 255


# Masses, centres and lengths: reference grippers.md 6; stroke, speed, force and counts: 1.4.
TOOLS: dict[str, ToolModel] = {
    tool.name: tool
    for tool in (
        ToolModel(
            name="robotiq-2f85",
            title="Robotiq 2F-85",
            kind="robotiq",
            mass=0.90,  # I, from the maker's rows of sensor and gripper together
            cog=(0.0, 0.0, 0.058),  # I
            inertia=(1.3e-3, 1.2e-3, 5e-4),  # I: body of MJ (S1), fingers at their place
            length=0.15,  # I, open; closed 13.5 mm more
            stroke=0.085,  # D
            counts=(3, 230),  # D, S
            speed=(0.020, 0.150),  # D
            force=(20.0, 235.0),  # D
            friction=0.7,  # S1 (MJ)
        ),
        ToolModel(
            name="robotiq-2f140",
            title="Robotiq 2F-140",
            kind="robotiq",
            mass=0.98,  # I
            cog=(0.0, 0.0, 0.066),  # I
            inertia=(2.2e-3, 2.0e-3, 8e-4),  # I
            length=0.23,  # ?
            stroke=0.140,  # D
            counts=(3, 230),  # ?, as the 2F-85
            speed=(0.030, 0.250),  # S1
            force=(10.0, 125.0),  # ?
            friction=0.7,
            pad=(0.0135, 0.0325),
        ),
        ToolModel(
            name="robotiq-hande",
            title="Robotiq Hand-E",
            kind="robotiq",
            mass=0.864 + 0.119 + 2 * 0.038,  # S1 (AGH): gripper, coupling, fingers
            cog=(0.0, 0.0, 0.05),  # ?
            inertia=(1.6e-3, 1.6e-3, 6e-4),  # I
            length=0.011 + 0.099 + 0.0465,  # S1
            stroke=0.050,  # D
            counts=(3, 250),  # O
            speed=(0.020, 0.150),  # S1
            force=(20.0, 185.0),  # ?
            friction=0.3,  # D: silicone on oiled steel
            pad=(0.011, 0.0125),
            body=0.0375,
        ),
        ToolModel(
            name="onrobot-rg2",
            title="OnRobot RG2",
            kind="onrobot",
            mass=0.78,  # D
            cog=(0.0, 0.0, 0.069),  # O
            inertia=(1.9e-3, 1.7e-3, 6e-4),  # I: a bar of this mass and length
            length=0.218,  # S1
            stroke=0.110 - 2 * 0.00445,  # D between the metal tips, less the fingertips
            speed=(0.020, 0.129),  # I: 67.35 degrees/s (D) of an arm
            force=(3.0, 40.0),  # C, D
            friction=0.4,  # D: silicone
            linkage=Linkage(0.055, 0.005, 0.00445, radians(5.0), 2.0, 0x20),  # D, O
        ),
        ToolModel(
            name="onrobot-rg6",
            title="OnRobot RG6",
            kind="onrobot",
            mass=1.25,  # D
            cog=(0.0, 0.0, 0.085),  # ?
            inertia=(4.2e-3, 3.9e-3, 1.2e-3),  # I
            length=0.258,  # O
            stroke=0.160 - 2 * 0.005,  # D
            speed=(0.020, 0.136),  # I: 48.65 degrees/s (D)
            force=(25.0, 120.0),  # O
            friction=0.4,
            linkage=Linkage(0.080, 0.0084, 0.005, radians(5.4), 5.0, 0x21),  # D, O
        ),
        ToolModel(
            name="vacuum",
            title="vacuum gripper",
            kind="vacuum",
            mass=0.5,  # C: one cup, its ejector and its holder
            cog=(0.0, 0.0, 0.04),  # C
            inertia=(6e-4, 6e-4, 3e-4),  # C
            length=0.12,  # C
            force=(0.0, 60.0),  # C: a cup of 40 mm at 50 kPa
            friction=0.6,  # C: rubber
            pad=(0.02, 0.012),
            body=0.03,
        ),
    )
}

MOST_TOOLS = 4
"""On one flange: as many as programs of Robotiq address."""

_SPREAD = pi / 4
"""Angle from the axis of the flange of each of several tools [rad], as a bracket for two holds them."""

_Length = Annotated[float, number(0.001, 1.0, "m")]
_Place = Annotated[float, number(-1.0, 1.0, "m")]
_Moment = Annotated[float, number(1e-7, 10.0, "kg m²")]
_Speed = Annotated[float, number(0.001, 1.0, "m/s")]
_Force = Annotated[float, number(0.0, 10_000.0, "N")]
_Count = Annotated[int, whole(0, 255)]
_Bit = Annotated[int, whole(0, 17)]


@record
class ToolFile:
    """What a file may say of a tool: fields as in `ToolModel`; None: that of the tool `based_on`."""

    based_on: Annotated[str, word(TOOLS)]
    title: Annotated[str, text(40)] | None = None
    mass: Annotated[float, number(0.001, 100.0, "kg")] | None = None
    cog: tuple[_Place, _Place, _Place] | None = None
    inertia: tuple[_Moment, _Moment, _Moment] | None = None
    length: _Length | None = None
    stroke: _Length | None = None
    counts: tuple[_Count, _Count] | None = None
    speed: tuple[_Speed, _Speed] | None = None
    force: tuple[_Force, _Force] | None = None
    friction: Annotated[float, number(0.0, 10.0)] | None = None
    output: _Bit | None = None
    input: _Bit | None = None


def tools_by_name(names: str, error: type[Exception]) -> tuple[ToolModel, ...]:
    """Look tools up by their names, separated by commas.

    A name that ends in .toml is a file, "none" is no tool. Several hang on a bracket that spreads them around
    the axis of the flange.

    Raises:
        Exception: of the type `error`: no tool has that name, a file is wrong, or there are too many.
    """
    if names == "none":
        return ()
    tools = [_tool_by_name(name.strip(), error) for name in names.split(",")]
    if len(tools) == 1:
        return tuple(tools)
    if len(tools) > MOST_TOOLS:
        raise error(f"{len(tools)} tools given: at most {MOST_TOOLS} have room on a flange")
    turn = 2.0 * pi / len(tools)
    return tuple(replace(tool, tilt=_SPREAD, turn=i * turn) for i, tool in enumerate(tools))


def _tool_by_name(name: str, error: type[Exception]) -> ToolModel:
    tool = _read_tool(Path(name), error) if name.endswith(".toml") else TOOLS.get(name.lower())
    if tool is None:
        raise error(f"unknown tool {name!r}: choose one of none, {', '.join(TOOLS)}, or give FILE.toml")
    return tool


def _read_tool(path: Path, error: type[Exception]) -> ToolModel:
    kind = FileKind(MIB, error, "all fields have less than 0.01 MiB")
    file = checked(ToolFile, kind.read_toml(path), str(path), error)
    given = {field.name: value for field in fields(file) if (value := getattr(file, field.name)) is not None}
    tool = replace(TOOLS[given.pop("based_on")], name=path.stem, **given)
    for name in ("counts", "speed", "force"):
        least, most = getattr(tool, name)
        if not least < most:
            raise error(f"{path}: {name}: {least:g} is not below {most:g}; give the smaller one first")
    return tool
