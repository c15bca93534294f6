"""The nodes of a program file as frozen records, numbered as PolyScope numbers its labels.

References are followed: a node has the content of the element that it stands for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError, ProgramFileError, UndefinedError, UnknownNodeError
from ur_emulator.program_files.folder import FoundFile
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.script_writer import Names

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


ROOT = "URProgram"
OLD_ROOT = "gui.program.ProgramRootNode"
"""Of programs of PolyScope 1.8: a dump of its objects."""

CB3 = 3
"""Series of the software of CB3; that of the e-Series is 5."""


@dataclass(frozen=True, slots=True)
class Source:
    """A file that nodes are in; `series` is the first number of the software that saved it."""

    file: FoundFile
    tree: XmlTree
    series: int

    def error(self, problem: str) -> ProgramFileError:
        """Return the error that says what is wrong with this file."""
        return ProgramFileError(f"{self.tree.name}: {problem}")

    def undefined(self, problem: str) -> UndefinedError:
        """Return the error that says what is missing in a node; the program is loaded, and not played."""
        return UndefinedError(f"{self.tree.name}: {problem}")

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

    @property
    def data(self) -> dict[str, str]:
        """What the URCap of a `<Contributed>` node has kept in it, by key."""
        return {item.get("key", ""): item.get("value", "") for item in self.element.findall("dataModel/data")}

    def find(self, tag: str) -> Element | None:
        """Return the first element inside of that tag, with its reference followed."""
        found = self.element.find(tag)
        return None if found is None else self.source.tree.resolve(found)


@dataclass(frozen=True, slots=True)
class SubProgram:
    """A sub-program: the number of its label, and its nodes."""

    name: str
    node: Node


@dataclass(frozen=True, slots=True)
class ProgramNodes:
    """All nodes of a program.

    Attributes:
        variables: the element with the first values of variables, if there is one.
        before_start: the sequence before the start, if there is one.
        others: threads, events, and what has no name here.
        sub_programs: in the order of their numbers.
        functions: names of the functions of sub-programs by the element that defines each.
        undefined: sub-programs whose files are missing; one line each.
    """

    source: Source
    variables: Element | None
    before_start: Node | None
    main: Node
    others: tuple[Node, ...]
    sub_programs: tuple[SubProgram, ...]
    functions: Mapping[Element, str]
    names: Names
    undefined: tuple[str, ...]


# --- from the tree of a program file to its nodes, with the numbers of their labels
#
# Numbers follow the tree: values of variables, BeforeStart, main program, threads, events, sub-programs, each
# depth first. Suppressed nodes have numbers too, and are left out. Source: program files and the scripts that
# PolyScope saved beside them.

_SUPPRESSED = frozenset({"SuppressedNode", "suppressedNode"})
# Elements that give a variable its name.
_VARIABLES = frozenset({"variable", "ProgramVariable"})


def read_nodes(file: FoundFile, tree: XmlTree, reader: ProgramReader) -> ProgramNodes:
    """Return the nodes of a program.

    UnknownNodeError for one of PolyScope 1.8, ProgramFileError without a main program, or beyond a limit.
    """
    source = _source(file, tree)
    if tree.root.tag == OLD_ROOT:
        raise source.unknown("a program of PolyScope 1.8")
    return _NodeReader(reader).program(source)


def _source(file: FoundFile, tree: XmlTree) -> Source:
    series = tree.root.get("lastSavedIn", "")[:1]
    return Source(file, tree, 5 if series == "5" else CB3)


@dataclass(slots=True)
class _NodeReader:
    reader: ProgramReader
    last: int = 0
    depth: int = 0
    names: Names = field(default_factory=Names)
    functions: dict[Element, str] = field(default_factory=dict)
    waiting: list[tuple[Source, Element]] = field(default_factory=list)
    undefined: list[str] = field(default_factory=list)

    def program(self, source: Source) -> ProgramNodes:
        self._reserve_names(source)
        top = source.tree.root.findall("children/*")
        first_values = source.tree.root.find("children/InitVariablesNode")
        self.last = 0 if first_values is None else 1  # its number, also when it is empty
        before = [self._node(source, one) for one in top if one.tag == "SpecialSequence"]
        for node in before:
            if node.get("type") != "BeforeStart":
                raise source.unknown(f"a sequence of type {node.get('type')!r}")
        main = [self._node(source, one) for one in top if one.tag == "MainProgram"]
        if not main:
            raise source.error("there is no <MainProgram> in it")
        known = ("InitVariablesNode", "SpecialSequence", "MainProgram", "Event", "SubProgram")
        others = [self._node(source, one) for one in top if one.tag not in known]
        others += [self._node(source, one) for one in top if one.tag == "Event"]
        for one in top:
            if one.tag == "SubProgram":
                self._call(source, one)
        return ProgramNodes(
            source,
            None if first_values is None else first_values.find("variables"),
            before[0] if before else None,
            main[0],
            tuple(node for node in others if node.kind not in _SUPPRESSED),
            tuple(self._sub_programs()),
            self.functions,
            self.names,
            tuple(self.undefined),
        )

    def _reserve_names(self, source: Source) -> None:
        for element in source.tree.root.iter():
            if element.tag in _VARIABLES and (name := element.get("name")):
                self.names.reserve(name)

    def _node(self, source: Source, element: Element, content: Element | None = None) -> Node:
        """Return the node that an element is; `content` is the element that has its nodes, if not itself."""
        self.last += 1
        if self.last > BUDGETS.program_marks:
            raise source.error(f"the program has more than {BUDGETS.program_marks} nodes")
        self.depth += 1
        if self.depth > BUDGETS.node_depth:
            raise source.error(f"nodes are nested more than {BUDGETS.node_depth} deep")
        number = self.last
        content = source.tree.resolve(element) if content is None else content
        path = "suppressedNode/children/*" if element.tag in _SUPPRESSED else "children/*"
        children = [self._node(source, child) for child in content.findall(path)]
        called = content.find("subprogram")
        if element.tag == "CallSubProgram" and called is not None:
            self._call(source, called)
        self.depth -= 1
        return Node(element.tag, number, content, source, tuple(_with_branches(children)))

    def _call(self, source: Source, element: Element) -> None:
        """Note that a sub-program has to be written; `element` defines it, or refers to what does."""
        definition = source.tree.resolve(element)
        if definition in self.functions:
            return
        if len(self.functions) >= BUDGETS.subprograms:
            raise source.error(f"there are more than {BUDGETS.subprograms} sub-programs")
        self.functions[definition] = self.names.new(definition.get("name") or "SubProgram")
        self.waiting.append((source, definition))

    def _sub_programs(self) -> Iterator[SubProgram]:
        for source, definition in self.waiting:  # it becomes longer with the calls in sub-programs
            own, body = self._body(source, definition)
            yield SubProgram(self.functions[definition], self._node(own, definition, body))

    def _body(self, source: Source, definition: Element) -> tuple[Source, Element]:
        """Return the element that has the nodes of a sub-program, and the file that it is in."""
        file_name = (definition.findtext("programFile") or "").strip()
        is_empty = definition.find("children/*") is None
        if not file_name or not (is_empty or definition.get("keepSynchronizedWithDisk") == "true"):
            return source, definition
        try:
            file = self.reader.folder.beside(source.file, file_name)
        except FileMissingError as error:
            if is_empty:
                name = self.functions[definition]
                self.undefined.append(f"{source.tree.name}: sub-program {name!r} is missing: {error}")
            return source, definition
        other = _source(file, self.reader.xml(file))
        self._reserve_names(other)
        main = other.tree.root.find("children/MainProgram")
        if main is None:
            raise other.error("there is no <MainProgram> in it")
        return other, main


def _with_branches(nodes: Iterable[Node]) -> list[Node]:
    """Return the nodes without suppressed ones, each `ElseIf` and `Else` in the `<If>` before it."""
    kept: list[Node] = []
    for node in nodes:
        if node.kind in _SUPPRESSED:
            continue
        before = kept[-1] if kept else None
        if _is_branch(node) and before is not None and before.kind == "If" and not _has_else(before):
            kept[-1] = replace(before, branches=(*before.branches, node))
        else:
            kept.append(node)
    return kept


def _is_branch(node: Node) -> bool:
    return node.kind == "If" and node.get("type") in ("ElseIf", "Else")


def _has_else(node: Node) -> bool:
    return any(branch.get("type") == "Else" for branch in node.branches)
