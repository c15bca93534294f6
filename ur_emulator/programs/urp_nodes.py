"""The nodes of a program file as frozen records, numbered as PolyScope numbers its labels.

`urp_node_reader` makes them of a file. References are followed: a node has the content of the element that it
stands for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ur_emulator.errors import ProgramFileError, UnknownNodeError
from ur_emulator.programs.folder import FoundFile
from ur_emulator.programs.script_names import Names
from ur_emulator.programs.xml_tree import XmlTree

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

CB3 = 3
"""Series of the software of CB3; that of the e-Series is 5."""


@dataclass(frozen=True, slots=True)
class Source:
    """A file that nodes are in.

    Attributes:
        file: where it lies.
        tree: its content.
        series: first number of the software that saved it.
    """

    file: FoundFile
    tree: XmlTree
    series: int

    def error(self, problem: str) -> ProgramFileError:
        """Return the error that says what is wrong with this file."""
        return ProgramFileError(f"{self.tree.name}: {problem}")

    def unknown(self, what: str) -> UnknownNodeError:
        """Return the error that names what is not known."""
        return UnknownNodeError(
            f"{self.tree.name}: {what} cannot be turned into a script; "
            "put the .script that PolyScope saved with the program beside it, "
            "or leave it out (--skip-unknown-nodes)"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node of a program.

    Attributes:
        kind: its tag.
        number: of its label.
        element: its content, with references followed.
        source: the file that it is in.
        children: the nodes inside it, without suppressed ones; branches stand with their `<If>`.
        branches: of an `<If>`: the `ElseIf` and `Else` behind it.
    """

    kind: str
    number: int
    element: Element
    source: Source
    children: tuple[Node, ...]
    branches: tuple[Node, ...] = ()

    def get(self, attribute: str) -> str:
        """Return an attribute, "" if it is missing."""
        return self.element.get(attribute, "")

    def text(self, tag: str) -> str:
        """Return the text of an element inside, without blanks around; "" if it is missing."""
        return (self.element.findtext(tag) or "").strip()

    def find(self, tag: str) -> Element | None:
        """Return the first element inside of that tag, with its reference followed."""
        found = self.element.find(tag)
        return None if found is None else self.source.tree.resolve(found)


@dataclass(frozen=True, slots=True)
class SubProgram:
    """A sub-program.

    Attributes:
        name: of its function.
        node: its label's number and its nodes.
    """

    name: str
    node: Node


@dataclass(frozen=True, slots=True)
class ProgramNodes:
    """All nodes of a program.

    Attributes:
        source: the file of the program.
        variables: the element with the first values of variables, if there is one.
        before_start: the sequence before the start, if there is one.
        main: the main program.
        others: threads, events, and what has no name here.
        sub_programs: in the order of their numbers.
        functions: names of the functions of sub-programs by the element that defines each.
        names: of functions, threads and variables.
    """

    source: Source
    variables: Element | None
    before_start: Node | None
    main: Node
    others: tuple[Node, ...]
    sub_programs: tuple[SubProgram, ...]
    functions: Mapping[Element, str]
    names: Names
