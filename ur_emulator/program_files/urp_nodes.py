"""The nodes of a program file, numbered as PolyScope numbers its labels.

References are followed: a node has the content of the element that it stands for.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import FileMissingError
from ur_emulator.program_files.names import Names
from ur_emulator.program_files.reader import ProgramReader, XmlTree

ROOT = "URProgram"
OLD_ROOT = "gui.program.ProgramRootNode"  # of programs of PolyScope 1.8: a dump of its objects


@dataclass(slots=True, eq=False)
class Node:
    """A node of a program.

    Attributes:
        tree: the file that it is in.
        depth: how many nodes are around it, with itself.
        move: the node around it that has the parameters of its motions, a `<Move>` as a rule.
        mark: of its label; "noBreak" says that the program does not stop there.
        children: the nodes inside it, without suppressed ones; branches stand with their `<If>`.
        branches: of an `<If>`: the `ElseIf` and `Else` behind it.
    """

    kind: str
    number: int
    element: Element
    tree: XmlTree
    depth: int
    move: Node | None
    mark: str
    children: list[Node] = field(default_factory=list)
    branches: tuple[Node, ...] = ()

    @property
    def repeats(self) -> bool:
        """True for a part of a program that begins again at its end."""
        return self.kind in ("MainProgram", "Thread") and self.get("runOnlyOnce") != "true"

    def add(self, node: Node) -> None:
        """Add a node behind those inside it; an `ElseIf` or `Else` belongs to the `<If>` before it."""
        if node.kind == "If" and node.get("type") in ("ElseIf", "Else") and self.children:
            before = self.children[-1]
            has_else = before.branches and before.branches[-1].get("type") == "Else"
            if before.kind == "If" and not has_else:
                before.branches += (node,)
                return
        self.children.append(node)

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

    def value(self, tag: str, attribute: str) -> str:
        """Return an attribute of the first element inside of that tag, "" if one of them is missing."""
        found = self.find(tag)
        return "" if found is None else found.get(attribute, "")


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
        before_start: the sequence before the start; none or one.
        others: threads, and what has no name here.
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
        self.reader = reader
        self._waiting: list[tuple[XmlTree, Element]] = []
        self._reserve_names(tree)
        top = tree.root.findall("children/*")
        self.variables = tree.root.findall("children/InitVariablesNode/variables/*")
        has_values = any(one.tag == "InitVariablesNode" for one in top)
        self._last = int(has_values)  # its number, also when it is empty
        before = [self._node(tree, one) for one in top if one.tag == "SpecialSequence"]
        for node in before:
            if node.get("type") != "BeforeStart":
                raise tree.unknown(f"a sequence of type {node.get('type')!r}")
        self.before_start = before[:1]
        main = [self._node(tree, one) for one in top if one.tag == "MainProgram"]
        if not main:
            raise tree.error("there is no <MainProgram> in it")
        self.main = main[0]
        known = ("InitVariablesNode", "SpecialSequence", "MainProgram", "Event", "SubProgram")
        others = [self._node(tree, one) for one in top if one.tag not in known]
        self.others = [node for node in others if node.kind not in _SUPPRESSED]
        self.events = [self._node(tree, one) for one in top if one.tag == "Event"]
        for one in top:
            if one.tag == "SubProgram":
                self._call(tree, one)
        self.sub_programs = list(self._sub_programs())

    def _reserve_names(self, tree: XmlTree) -> None:
        for element in tree.root.iter():
            if element.tag in _VARIABLES and (name := element.get("name")):
                self.names.reserve(name)

    def _node(
        self, tree: XmlTree, element: Element, around: Node | None = None, content: Element | None = None
    ) -> Node:
        """Return the node that an element is; `content` is the element that has its nodes, if not itself."""
        self._last += 1
        if self._last > BUDGETS.program_marks:
            raise tree.error(f"the program has more than {BUDGETS.program_marks} nodes")
        depth, move, mark = 1, None, ""
        if around is not None:
            # Software up to 3.6 has waypoints outside of moves: the program has their parameters.
            depth = around.depth + 1
            move = around if around.get("motionType") else around.move
            mark = "noBreak" if around.kind == "Force" else around.mark
        if depth > BUDGETS.node_depth:
            raise tree.error(f"nodes are nested more than {BUDGETS.node_depth} deep")
        content = tree.resolve(element) if content is None else content
        node = Node(element.tag, self._last, content, tree, depth, move, mark)
        path = "suppressedNode/children/*" if element.tag in _SUPPRESSED else "children/*"
        for child in content.findall(path):
            inner = self._node(tree, child, node)
            if inner.kind not in _SUPPRESSED:
                node.add(inner)
        called = content.find("subprogram")
        if element.tag == "CallSubProgram" and called is not None:
            self._call(tree, called)
        return node

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
            yield self.functions[definition], self._node(own, definition, content=body)

    def _body(self, tree: XmlTree, definition: Element) -> tuple[XmlTree, Element]:
        """Return the element that has the nodes of a sub-program, and the file that it is in."""
        file_name = (definition.findtext("programFile") or "").strip()
        is_empty = definition.find("children/*") is None
        if not file_name or not (is_empty or definition.get("keepSynchronizedWithDisk") == "true"):
            return tree, definition
        try:
            file = self.reader.folder.beside(tree.file, file_name)
        except FileMissingError as error:
            if is_empty:
                name = self.functions[definition]
                self.undefined.append(f"{tree.file.name}: sub-program {name!r} is missing: {error}")
            return tree, definition
        other = self.reader.xml(file)
        self._reserve_names(other)
        main = other.root.find("children/MainProgram")
        if main is None:
            raise other.error("there is no <MainProgram> in it")
        return other, main
