"""The nodes of a program file as frozen records, numbered as PolyScope numbers its labels.

References are followed: a node has the content of the element that it stands for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError
from ur_emulator.program_files.reader import ProgramReader, XmlTree
from ur_emulator.program_files.script_writer import Names

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


ROOT = "URProgram"
OLD_ROOT = "gui.program.ProgramRootNode"
"""Of programs of PolyScope 1.8: a dump of its objects."""


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node of a program.

    Attributes:
        tree: the file that it is in.
        children: the nodes inside it, without suppressed ones; branches stand with their `<If>`.
        branches: of an `<If>`: the `ElseIf` and `Else` behind it.
    """

    kind: str
    number: int
    element: Element
    tree: XmlTree
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
        return None if found is None else self.tree.resolve(found)


_SUPPRESSED = frozenset({"SuppressedNode", "suppressedNode"})
# Elements that give a variable its name.
_VARIABLES = frozenset({"variable", "ProgramVariable"})


class ProgramNodes:
    """All nodes of a program, with the numbers of their labels.

    Numbers follow the tree: values of variables, BeforeStart, main program, threads, events, sub-programs,
    each depth first. Suppressed nodes have numbers too, and are left out. Source: program files and the
    scripts that PolyScope saved beside them.

    Attributes:
        variables: the elements with the first values of variables.
        before_start: the sequence before the start, if there is one.
        others: threads, events, and what has no name here.
        sub_programs: names of their functions, and their nodes; in the order of the numbers of their labels.
        functions: names of the functions of sub-programs by the element that defines each.
        undefined: sub-programs whose files are missing; one line each.
    """

    def __init__(self, tree: XmlTree, reader: ProgramReader) -> None:
        """Read the nodes of a program.

        UnknownNodeError for one of PolyScope 1.8, ProgramFileError without a main program, or beyond a limit.
        """
        if tree.root.tag == OLD_ROOT:
            raise tree.unknown("a program of PolyScope 1.8")
        self.tree = tree
        self.names = Names()
        self.functions: dict[Element, str] = {}
        self.undefined: list[str] = []
        self._reader = reader
        self._depth = 0
        self._waiting: list[tuple[XmlTree, Element]] = []
        self._reserve_names(tree)
        top = tree.root.findall("children/*")
        first_values = tree.root.find("children/InitVariablesNode")
        variables = None if first_values is None else first_values.find("variables")
        self.variables = () if variables is None else tuple(variables)
        self._last = 0 if first_values is None else 1  # its number, also when it is empty
        before = [self._node(tree, one) for one in top if one.tag == "SpecialSequence"]
        for node in before:
            if node.get("type") != "BeforeStart":
                raise tree.unknown(f"a sequence of type {node.get('type')!r}")
        self.before_start = before[0] if before else None
        main = [self._node(tree, one) for one in top if one.tag == "MainProgram"]
        if not main:
            raise tree.error("there is no <MainProgram> in it")
        self.main = main[0]
        known = ("InitVariablesNode", "SpecialSequence", "MainProgram", "Event", "SubProgram")
        others = [self._node(tree, one) for one in top if one.tag not in known]
        others += [self._node(tree, one) for one in top if one.tag == "Event"]
        self.others = [node for node in others if node.kind not in _SUPPRESSED]
        for one in top:
            if one.tag == "SubProgram":
                self._call(tree, one)
        self.sub_programs = list(self._sub_programs())

    def _reserve_names(self, tree: XmlTree) -> None:
        for element in tree.root.iter():
            if element.tag in _VARIABLES and (name := element.get("name")):
                self.names.reserve(name)

    def _node(self, tree: XmlTree, element: Element, content: Element | None = None) -> Node:
        """Return the node that an element is; `content` is the element that has its nodes, if not itself."""
        self._last += 1
        if self._last > BUDGETS.program_marks:
            raise tree.error(f"the program has more than {BUDGETS.program_marks} nodes")
        self._depth += 1
        if self._depth > BUDGETS.node_depth:
            raise tree.error(f"nodes are nested more than {BUDGETS.node_depth} deep")
        number = self._last
        content = tree.resolve(element) if content is None else content
        path = "suppressedNode/children/*" if element.tag in _SUPPRESSED else "children/*"
        children = [self._node(tree, child) for child in content.findall(path)]
        called = content.find("subprogram")
        if element.tag == "CallSubProgram" and called is not None:
            self._call(tree, called)
        self._depth -= 1
        return Node(element.tag, number, content, tree, tuple(_with_branches(children)))

    def _call(self, tree: XmlTree, element: Element) -> None:
        """Note that a sub-program has to be written; `element` defines it, or refers to what does."""
        definition = tree.resolve(element)
        if definition in self.functions:
            return
        if len(self.functions) >= BUDGETS.subprograms:
            raise tree.error(f"there are more than {BUDGETS.subprograms} sub-programs")
        self.functions[definition] = self.names.new(definition.get("name") or "SubProgram")
        self._waiting.append((tree, definition))

    def _sub_programs(self) -> Iterator[tuple[str, Node]]:
        for tree, definition in self._waiting:  # it becomes longer with the calls in sub-programs
            own, body = self._body(tree, definition)
            yield self.functions[definition], self._node(own, definition, body)

    def _body(self, tree: XmlTree, definition: Element) -> tuple[XmlTree, Element]:
        """Return the element that has the nodes of a sub-program, and the file that it is in."""
        file_name = (definition.findtext("programFile") or "").strip()
        is_empty = definition.find("children/*") is None
        if not file_name or not (is_empty or definition.get("keepSynchronizedWithDisk") == "true"):
            return tree, definition
        try:
            file = self._reader.folder.beside(tree.file, file_name)
        except FileMissingError as error:
            if is_empty:
                name = self.functions[definition]
                self.undefined.append(f"{tree.file.name}: sub-program {name!r} is missing: {error}")
            return tree, definition
        other = self._reader.xml(file)
        self._reserve_names(other)
        main = other.root.find("children/MainProgram")
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
        is_branch = node.kind == "If" and node.get("type") in ("ElseIf", "Else")
        if is_branch and before is not None and before.kind == "If" and not _has_else(before):
            kept[-1] = replace(before, branches=(*before.branches, node))
        else:
            kept.append(node)
    return kept


def _has_else(node: Node) -> bool:
    return any(branch.get("type") == "Else" for branch in node.branches)
