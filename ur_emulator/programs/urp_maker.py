"""UrpMaker: writes the nodes of a file into a script, with the names and the files that they need."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.folder import FoundFile
from ur_emulator.programs.installation import Installation
from ur_emulator.programs.reading import ProgramReader
from ur_emulator.programs.script_writer import ScriptWriter
from ur_emulator.programs.urp_values import identifier
from ur_emulator.programs.xml_tree import XmlTree

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Elements that give a variable its name.
_VARIABLES = ("variable", "ProgramVariable")

NodeWriter = Callable[["UrpMaker", "Element"], None]


@dataclass(frozen=True, slots=True)
class SubProgram:
    """A sub-program that is called somewhere.

    Attributes:
        name: of its function.
        maker: of the file that it is written in.
        body: the element whose children it consists of.
    """

    name: str
    maker: UrpMaker
    body: Element


@dataclass(slots=True)
class Shared:
    """What the files of one program share.

    Attributes:
        nodes: what writes each kind of node.
        reader: reads the files of the program.
        installation: of the program: its TCPs, features, names of lines.
        writer: takes the script.
        subprograms: by the element that defines each, in the order of the first calls.
        names: of variables, functions and threads, so that each is unique; with the number tried last.
    """

    nodes: Mapping[str, NodeWriter]
    reader: ProgramReader
    installation: Installation
    writer: ScriptWriter = field(default_factory=ScriptWriter)
    subprograms: dict[Element, SubProgram] = field(default_factory=dict)
    names: dict[str, int] = field(default_factory=dict)

    def new_name(self, wanted: str) -> str:
        """Return a name like the wanted one that no function or thread has yet."""
        plain = name = identifier(wanted)
        while name in self.names:
            self.names[plain] += 1
            name = f"{plain}_{self.names[plain]}"
        self.names[name] = 1
        return name


class UrpMaker:
    """Writes the nodes of one file.

    Attributes:
        file: of the program.
        tree: its content.
        shared: with the files of its sub-programs.
        move: the `<Move>` node around the one that is being written.
        previous: the node before it, in the same node.
    """

    def __init__(self, file: FoundFile, tree: XmlTree, shared: Shared) -> None:
        self.file = file
        self.tree = tree
        self.shared = shared
        for element in tree.root.iter():
            if element.tag in _VARIABLES and (name := element.get("name")):
                shared.names.setdefault(name, 1)
        self.move: Element | None = None
        self.previous: Element | None = None
        self._depth = 0

    @property
    def writer(self) -> ScriptWriter:
        """Takes the script."""
        return self.shared.writer

    def error(self, problem: str) -> ProgramFileError:
        """Return the error that says what is wrong with this file."""
        return ProgramFileError(f"{self.tree.name}: {problem}")

    def write(self, element: Element) -> None:
        """Write one node.

        Raises:
            ProgramFileError: the node is not known.
        """
        node_writer = self.shared.nodes.get(element.tag)
        if node_writer is None:
            raise self.error(
                f"a <{element.tag}> node cannot be turned into a script; "
                "put the .script that PolyScope saved with the program beside it"
            )
        node_writer(self, element)

    def write_children(self, element: Element) -> None:
        """Write the nodes inside a node."""
        self._depth += 1
        if self._depth > BUDGETS.node_depth:
            raise self.error(f"nodes are nested more than {BUDGETS.node_depth} deep")
        outer, self.previous = self.previous, None
        for child in element.findall("children/*"):
            self.write(child)
            self.previous = child
        self.previous = outer
        self._depth -= 1

    def name_of_subprogram(self, element: Element) -> str:
        """Return the name of a sub-program's function, and note that it has to be written.

        Args:
            element: that defines it, or stands for the one that does.
        """
        definition = self.tree.resolve(element)
        known = self.shared.subprograms.get(definition)
        if known is not None:
            return known.name
        if len(self.shared.subprograms) >= BUDGETS.subprograms:
            raise self.error(f"there are more than {BUDGETS.subprograms} sub-programs")
        name = self.shared.new_name(definition.get("name") or "SubProgram")
        maker, body = self, definition
        file_name = (definition.findtext("programFile") or "").strip()
        if file_name and definition.find("children/*") is None:
            reader = self.shared.reader
            file = reader.folder.beside(self.file, file_name)
            maker = UrpMaker(file, reader.xml(file), self.shared)
            main = maker.tree.root.find("children/MainProgram")
            if main is None:
                raise maker.error("there is no <MainProgram> in it")
            body = main
        self.shared.subprograms[definition] = SubProgram(name, maker, body)
        return name
