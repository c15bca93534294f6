"""The tools that an arm can carry: those of the table, by name, and one's own, by a file.

Each number has its evidence beside it, with the letters of docs/fidelity.md: D maker's document, S several
independent clients agree, I inferred. Axes are those of the flange: z away from the arm, fingers along x.
"""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

from ur_emulator.errors import ModelError
from ur_emulator.models.robot_model import Vector3
from ur_hil.input_files import MIB, FileKind
from ur_hil.records import checked, number, record, text, whole, word


@dataclass(frozen=True, slots=True)
class ToolModel:
    """A gripper of Robotiq with two fingers, which move along x, one to each side.

    Attributes:
        name: as `--tool` takes it.
        title: of the maker.
        mass: of the whole tool, fingers included [kg].
        cog: centre of mass [m].
        inertia: xx, yy, zz about it [kg m²].
        length: from the flange to the middle of the pads [m].
        stroke: largest width between the pads [m].
        counts: positions of the open and of the closed fingers, of 0 to 255.
        speed: slowest and fastest speed of the width [m/s].
        force: least and greatest force at a pad [N].
        friction: of the pads.
        pad: half extents of a pad, across and along the fingers [m].
        body: radius of the housing [m].
    """

    name: str
    title: str
    mass: float
    cog: Vector3
    inertia: Vector3
    length: float
    stroke: float
    counts: tuple[int, int] = (0, 255)
    speed: tuple[float, float] = (0.02, 0.15)
    force: tuple[float, float] = (20.0, 235.0)
    friction: float = 0.7
    pad: tuple[float, float] = (0.011, 0.0094)
    body: float = 0.04

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
    )
}

_FILE = FileKind(MIB, ModelError, "all fields have less than 0.01 MiB")

_Length = Annotated[float, number(0.001, 1.0, "m")]
_Place = Annotated[float, number(-1.0, 1.0, "m")]
_Moment = Annotated[float, number(1e-7, 10.0, "kg m²")]
_Speed = Annotated[float, number(0.001, 1.0, "m/s")]
_Force = Annotated[float, number(0.0, 10_000.0, "N")]
_Count = Annotated[int, whole(0, 255)]


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


def tool_by_name(name: str) -> ToolModel | None:
    """Look a tool up by its name; a name that ends in .toml is a file; "none" is no tool.

    Raises:
        ModelError: no tool has that name, or the file is wrong.
    """
    if name == "none":
        return None
    tool = _read_tool(Path(name)) if name.endswith(".toml") else TOOLS.get(name.lower())
    if tool is None:
        raise ModelError(f"unknown tool {name!r}: choose one of none, {', '.join(TOOLS)}, or give FILE.toml")
    return tool


def _read_tool(path: Path) -> ToolModel:
    file = checked(ToolFile, _FILE.read_toml(path), str(path), ModelError)
    given = {field.name: value for field in fields(file) if (value := getattr(file, field.name)) is not None}
    tool = replace(TOOLS[given.pop("based_on")], name=path.stem, **given)
    for name in ("counts", "speed", "force"):
        least, most = getattr(tool, name)
        if not least < most:
            raise ModelError(f"{path}: {name}: {least:g} is not below {most:g}; give the smaller one first")
    return tool
