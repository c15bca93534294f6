"""A gripper of the table (`ur_hil.tools`) on the flange: the tool of a cell, with TCP, payload and shape."""

from dataclasses import replace
from json import dumps
from pathlib import Path

from pc_client.errors import CellError
from pc_client.files import FILE_KINDS
from ur_hil.cell import NO_CELL, Cell, Solid, Tool, load_cell
from ur_hil.tools import TOOLS, ToolModel, tools_by_name

_FINGER = 0.015
"""Thickness of a finger beside its pad [m]; assumed."""


def gripper_model(name: str) -> ToolModel:
    """A gripper by its name or its file; CellError if it is wrong, or no single gripper of Robotiq."""
    tools = tools_by_name(name, CellError)
    if len(tools) != 1 or tools[0].kind != "robotiq":
        known = ", ".join(tool.name for tool in TOOLS.values() if tool.kind == "robotiq")
        raise CellError(f"tool {name!r}: the client moves an arm with one of {known}, or a FILE.toml of one")
    return tools[0]


def surroundings(cell: Cell | str | Path | None, tool: str | None = None) -> Cell:
    """What stands around an arm and what it carries, of a cell or its file and a gripper's name or file.

    CellError if one of them is wrong, or both have a tool.
    """
    known = load_cell(cell, FILE_KINDS["cell"]) if isinstance(cell, str | Path) else cell or NO_CELL
    return known if tool is None else _carrying(known, gripper_model(tool))


def _carrying(cell: Cell, tool: ToolModel) -> Cell:
    """Put a gripper into a cell, and into its text: recordings keep it."""
    if cell.tool != Tool():
        raise CellError(f"cell {cell.name!r} has a tool, and {tool.name} is given: give only one of them")
    # A cylinder around housing and open fingers: a capsule that holds the tips would reach beyond them.
    radius, end = max(tool.body, 0.5 * tool.stroke + _FINGER), tool.length + tool.pad[1]
    shape = Solid(tool.title, "cylinder", (radius, end), (0.0, 0.0, 0.5 * end))
    name, text = cell.name or "no cell file", cell.text
    if cell == NO_CELL:
        text = f"format = 1\nname = {dumps(name)}\n"
    if text:
        text += (
            f"\n[tool]\nmass = {tool.mass}\ncentre_of_gravity = {list(tool.cog)}\nlength = {tool.length}\n"
            f"[[tool.cylinders]]\nname = {dumps(tool.title, ensure_ascii=False)}\n"
            f"centre = {list(shape.centre)}\nradius = {radius}\nlength = {end}\n"
        )
    return replace(cell, name=name, tool=Tool((shape,), tool.mass, tool.cog, tool.length), text=text)
