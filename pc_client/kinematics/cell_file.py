"""Cell files: TOML, read strictly. `examples/cell.toml` shows every field, `docs/real-arm.md` explains."""

from __future__ import annotations

from math import hypot, pi
from pathlib import Path

from pc_client.errors import CellError
from pc_client.input_files import parse_toml, read_text
from pc_client.kinematics.cell import SHAPES, Cell, Solid, Three, Tool, Wall
from pc_client.toml_tables import TableReader

_FORMAT = 1

MOST_BODIES = 100
"""More walls and solids than this in one file is refused: plans would take minutes."""

MOST_LENGTH = 100.0
"""No size and no distance is longer [m]: the number was probably meant in millimetres."""

_SIDES = {f"{axis}_{side}": (k, side) for k, axis in enumerate("xyz") for side in ("min", "max")}
_FIELDS = "format, name, floor, walls, boxes, cylinders, spheres, capsules, tool"
_TOOL_FIELDS = "mass, centre_of_gravity, boxes, cylinders, spheres, capsules"


def load_cell(path: str | Path) -> Cell:
    """Read a cell file.

    Raises:
        CellError: unreachable file, or content that makes no sense, naming file and field.
    """
    return parse_cell(read_text(Path(path), "cell"), str(path))


def parse_cell(text: str, source: str) -> Cell:
    """Make a cell of the text of its file.

    Args:
        text: TOML.
        source: the file's name, for messages.

    Raises:
        CellError: the content makes no sense; names file and field.
    """
    table = TableReader(parse_toml(text, source, "cell"), source, error_type=CellError)
    if (version := table.number("format")) != _FORMAT:
        raise table.error("format", f"{version:g}; this program reads format {_FORMAT}")
    name = _name(table)
    floor_z = _floor(table)
    walls = tuple(map(_wall, table.tables("walls"))) if "walls" in table else ()
    solids = _solids(table)
    tool = _tool(table.table("tool")) if "tool" in table else Tool()
    table.finish(_FIELDS)
    names = [wall.name for wall in walls] + [solid.name for solid in (*solids, *tool.solids)]
    if len(names) > MOST_BODIES:
        raise CellError(f"{source}: {len(names)} walls and solids; give at most {MOST_BODIES}")
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise CellError(f"{source}: two bodies are called {twice!r}; give each a name of its own")
    return Cell(name, floor_z, walls, solids, tool, text)


def _name(table: TableReader) -> str:
    name = table.text("name")
    if not name.isprintable() or len(name) > 60:
        raise table.error("name", f"{name[:60]!r}; give at most 60 characters on one line")
    return name


def _floor(table: TableReader) -> float:
    if "floor" not in table:
        return 0.0
    floor = table.table("floor")
    z = _length(floor, "z")
    floor.finish("z")
    return z


def _wall(table: TableReader) -> Wall:
    """Read a wall: one of x_min ... z_max, or a point of it and its normal."""
    name = _name(table)
    sides = [side for side in _SIDES if side in table]
    if len(sides) + ("point" in table) != 1:
        raise table.error("point", f"give one of {', '.join(_SIDES)}, or a point and a normal")
    if sides:
        axis, side = _SIDES[sides[0]]
        sign = 1.0 if side == "min" else -1.0
        normal = [0.0, 0.0, 0.0]
        normal[axis] = sign
        offset = sign * _length(table, sides[0])
    else:
        point, normal = _lengths(table, "point"), list(_three(table, "normal"))
        length = hypot(*normal)
        if not 1e-6 <= length <= 1e6:
            raise table.error("normal", f"{normal}; give a direction, such as [0, 1, 0]")
        normal = [x / length for x in normal]
        offset = sum(n * p for n, p in zip(normal, point, strict=True))
    table.finish(f"name, {', '.join(_SIDES)}, point, normal")
    if offset >= 0.0:
        raise table.error(
            sides[0] if sides else "normal",
            "the robot's base stands behind this wall; a normal points from the wall to the robot",
        )
    return Wall(name, (normal[0], normal[1], normal[2]), offset)


def _solids(table: TableReader) -> tuple[Solid, ...]:
    return tuple(_solid(one, kind) for kind in SHAPES if kind in table for one in table.tables(kind))


def _solid(table: TableReader, kind: str) -> Solid:
    shape = SHAPES[kind]
    name, centre = _name(table), _lengths(table, "centre")
    sizes: list[float] = []
    for field, count in shape.sizes:
        values = [_length(table, field)] if count == 1 else _lengths(table, field)
        if min(values) <= 0.0:
            raise table.error(field, f"{min(values):g}; give more than 0 m")
        sizes += values
    rpy = _three(table, "rpy") if "rpy" in table else (0.0, 0.0, 0.0)
    if max(map(abs, rpy)) > 2.0 * pi:
        raise table.error("rpy", f"{list(rpy)}; give radians, at most one turn")
    table.finish(", ".join(("name", "centre", *(field for field, _ in shape.sizes), "rpy")))
    return Solid(name, kind, tuple(sizes), centre, rpy)


def _tool(table: TableReader) -> Tool:
    mass = table.number("mass", 0.0)
    if not 0.0 <= mass <= 100.0:
        raise table.error("mass", f"{mass:g}; give 0 to 100 kg")
    centre = (0.0, 0.0, 0.0)
    if "centre_of_gravity" in table:
        centre = _lengths(table, "centre_of_gravity")
    solids = _solids(table)
    table.finish(_TOOL_FIELDS)
    return Tool(solids, mass, centre)


def _three(table: TableReader, key: str) -> Three:
    values = table.numbers(key)
    if len(values) != 3:
        raise table.error(key, f"{values}; give three numbers [x, y, z]")
    return (values[0], values[1], values[2])


def _lengths(table: TableReader, key: str) -> Three:
    values = _three(table, key)
    for value in values:
        _refuse_far(table, key, value)
    return values


def _length(table: TableReader, key: str) -> float:
    value = table.number(key)
    _refuse_far(table, key, value)
    return value


def _refuse_far(table: TableReader, key: str, value: float) -> None:
    if abs(value) > MOST_LENGTH:
        raise table.error(key, f"{value:g}; give metres, at most {MOST_LENGTH:g}")
