"""Elements and values of an installation file: numbers, lists, vectors, with errors that name the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ur_emulator.errors import ProgramFileError
from ur_emulator.models.robot_model import Vector3, Vector6, six
from ur_emulator.programs.urp_values import number
from ur_emulator.programs.xml_tree import XmlTree

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


class InstallationValues:
    """Values of one file.

    Attributes:
        tree: of the file.
        first: the first element of each kind.
    """

    def __init__(self, tree: XmlTree) -> None:
        self.tree = tree
        self.first: dict[str, Element] = {}
        for element in tree.root.iter():
            self.first.setdefault(element.tag.rpartition(".")[2], element)

    def attribute(self, kind: str, name: str) -> str:
        """Return an attribute of the first element of a kind; "" without one."""
        return self.first[kind].get(name, "") if kind in self.first else ""

    def value(self, element: Element, name: str) -> str:
        """Return a list of an element: of its attribute, or of the child of that name."""
        child = element.find(name)
        if child is None:
            return element.get(name, "")
        return self.tree.resolve(child).get("value", "")

    def items(self, kind: str) -> list[str]:
        """Return the items of the list that the first element of a kind holds."""
        given = self.attribute(kind, "value")
        return [item.strip() for item in given.split(",")] if given else []

    def number(self, text: str | None, what: str) -> float:
        """Return a finite number; `what` names it in the error."""
        return number(self.tree, text, what)

    def numbers(self, text: str | None, count: int, what: str) -> list[float]:
        """Return so many numbers, which commas separate."""
        parts = (text or "").split(",")
        if len(parts) != count:
            raise ProgramFileError(f"{self.tree.name}: {what} has {len(parts)} values, it needs {count}")
        return [self.number(part, what) for part in parts]

    def vector3(self, text: str | None, what: str) -> Vector3:
        """Return three numbers."""
        x, y, z = self.numbers(text, 3, what)
        return (x, y, z)

    def vector6(self, text: str | None, what: str) -> Vector6:
        """Return six numbers."""
        return six(self.numbers(text, 6, what))
