"""UrpMaker: what the writers of nodes share while a program file becomes a script."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field

from ur_emulator.errors import UndefinedError, UnknownNodeError
from ur_emulator.program_files.installation import Installation
from ur_emulator.program_files.reader import ProgramReader
from ur_emulator.program_files.script_writer import ScriptWriter
from ur_emulator.program_files.urp_nodes import Node, ProgramNodes


@dataclass(frozen=True, slots=True)
class Around:
    """What is around a node: the `<Move>` that waypoints belong to, if there is one.

    `mark`: of the labels of nodes; "noBreak" says that the program does not stop at them.
    """

    move: Node | None = None
    mark: str = ""


NodeWriter = Callable[["UrpMaker", Node, Around], None]


@dataclass(frozen=True, slots=True)
class NodeKind:
    """A kind of nodes that stand in programs, and what writes one; `becomes` is what it is in the script."""

    tag: str
    write: NodeWriter
    becomes: str


class NodeKinds(dict[str, NodeKind]):
    """Kinds of nodes by tag."""

    def writes(self, tag: str, becomes: str) -> Callable[[NodeWriter], NodeWriter]:
        """Add the kind of nodes that the decorated function writes."""

        def add(write: NodeWriter) -> NodeWriter:
            self[tag] = NodeKind(tag, write, becomes)
            return write

        return add


@dataclass(slots=True)
class UrpMaker:
    """Writes the nodes of a program.

    Attributes:
        kinds: of the nodes that can be written, by tag.
        skip_unknown: leaves out what is not known, instead of an error.
        declarations: lines that stand before all nodes, by what they declare, in the order of first use.
        timers: names, in the order of first use.
        last_motions: numbers of the motions at which a path of MoveP ends.
        switches: how many were written.
        left_out: what is not known and was left out.
        undefined: what somebody has to fill in before the program can be played.
    """

    program: ProgramNodes
    installation: Installation
    reader: ProgramReader
    kinds: Mapping[str, NodeKind]
    skip_unknown: bool = False
    writer: ScriptWriter = field(default_factory=ScriptWriter)
    declarations: dict[str, tuple[str, ...]] = field(default_factory=dict)
    timers: dict[str, None] = field(default_factory=dict)
    last_motions: set[int] = field(default_factory=set)
    switches: int = 0
    left_out: list[str] = field(default_factory=list)
    undefined: list[str] = field(default_factory=list)

    def write(self, node: Node, around: Around) -> None:
        """Write one node; UnknownNodeError if it, or something in it, is not known."""
        with self.leaving_out(node):
            kind = self.kinds.get(node.kind)
            if kind is None:
                raise node.tree.unknown(f"a <{node.kind}> node")
            kind.write(self, node, around)

    @contextmanager
    def leaving_out(self, node: Node) -> Iterator[None]:
        """Do something for a node; what is written for it is removed if the node is undefined.

        So it is if there is something that is not known and may be left out; UnknownNodeError if that must
        not be.
        """
        place = self.writer.place
        try:
            yield
        except UndefinedError as error:
            self.writer.take(place)
            self.undefined.append(f"{error} (label {node.number})")
        except UnknownNodeError as error:
            if not self.skip_unknown:
                raise
            self.writer.take(place)
            self.left_out.append(str(error))

    def put(self, node: Node, around: Around, label: str, *lines: str) -> None:
        """Write the label of a node, and the lines behind it."""
        self.writer.label(node.number, label, around.mark)
        self.writer.add(*lines)

    def write_children(self, node: Node, around: Around) -> None:
        """Write the nodes inside a node."""
        for child in node.children:
            self.write(child, around)

    def write_block(self, head: str, node: Node, around: Around) -> None:
        """Write a block with the nodes inside a node."""
        with self.writer.block(head):
            self.write_children(node, around)

    def repeated(self, node: Node) -> AbstractContextManager[None]:
        """Write a loop without end around what follows, unless the node says that it runs once."""
        return nullcontext() if node.get("runOnlyOnce") == "true" else self.writer.block("while (True):")

    def declare(self, what: str, *lines: str) -> None:
        """Declare something before all nodes, unless it is declared already."""
        self.declarations.setdefault(what, lines)
