"""ScriptWriter: the script of a program file while its nodes are written; and the kinds of nodes."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError, UndefinedError, UnknownNodeError
from ur_emulator.program_files.installation import ExternalControlPc, Installation
from ur_emulator.program_files.urp_nodes import Node, ProgramNodes
from urscript.values import to_script_text


@dataclass(frozen=True, slots=True)
class Gap:
    """A place for what a PC sends when the program is played; `indent` blanks before each line."""

    pc: ExternalControlPc
    indent: str


@dataclass(frozen=True, slots=True)
class Header:
    """A place for what the installation declares; its variables change while a program is loaded."""


Part = str | Gap | Header
NodeWriter = Callable[["ScriptWriter", Node], None]


@dataclass(frozen=True, slots=True)
class NodeKind:
    """A kind of nodes that stand in programs: what writes one, and what it is in the script."""

    write: NodeWriter
    becomes: str


KINDS: dict[str, NodeKind] = {}  # by the tag of their elements


def writes(tag: str, becomes: str) -> Callable[[NodeWriter], NodeWriter]:
    """Add the kind of nodes that the decorated function writes."""

    def add(write: NodeWriter) -> NodeWriter:
        KINDS[tag] = NodeKind(write, becomes)
        return write

    return add


class ScriptWriter:
    """Writes the nodes of a program, and has the script so far.

    Attributes:
        parts: texts of whole lines, and places for others, in order.
        declarations: lines that stand before all nodes, by what they declare, in the order of first use.
        timers: names, in the order of first use.
        last_motions: numbers of the motions at which a path of MoveP ends.
        switches: how many were written.
        left_out: what is not known and was left out; one line each.
        undefined: what somebody has to fill in before the program can be played; one line each.
    """

    def __init__(self, program: ProgramNodes, installation: Installation, *, skip_unknown: bool) -> None:
        """Begin with nothing; `skip_unknown` leaves out what is not known, instead of an error."""
        self.program = program
        self.installation = installation
        self._skip_unknown = skip_unknown
        self.parts: list[Part] = []
        self.declarations: dict[str, tuple[str, ...]] = {}
        self.timers: dict[str, None] = {}
        self.last_motions: set[int] = set()
        self.switches = 0
        self.left_out: list[str] = []
        self.undefined = list(program.undefined)
        self._depth = 0
        self._size = 0
        self._gaps = 0

    def write(self, node: Node) -> None:
        """Write one node; UnknownNodeError if it, or something in it, is not known."""
        with self.leaving_out(node):
            kind = KINDS.get(node.kind)
            if kind is None:
                raise node.tree.unknown(f"a <{node.kind}> node")
            kind.write(self, node)

    def write_children(self, node: Node) -> None:
        """Write the nodes inside a node."""
        for child in node.children:
            self.write(child)

    @contextmanager
    def leaving_out(self, node: Node) -> Iterator[None]:
        """Do something for a node; what is written for it is removed if the node is undefined.

        So it is if there is something that is not known and may be left out; UnknownNodeError if that must
        not be.
        """
        length, depth = len(self.parts), self._depth
        try:
            yield
        except (UndefinedError, UnknownNodeError) as error:
            if isinstance(error, UndefinedError):
                self.undefined.append(f"{error} (label {node.number})")
            elif self._skip_unknown:
                self.left_out.append(str(error))
            else:
                raise
            del self.parts[length:]
            self._depth = depth

    @contextmanager
    def aside(self) -> Iterator[list[Part]]:
        """Write into a list of its own, which belongs to another place of the script."""
        script, self.parts = self.parts, []
        yield self.parts
        self.parts = script

    def declare(self, what: str, *lines: str) -> None:
        """Declare something before all nodes, unless it is declared already."""
        self.declarations.setdefault(what, lines)

    def add(self, *texts: str) -> None:
        """Write lines, one character a byte; a text of several lines is written as it is, each one indented.

        ProgramFileError if the script becomes longer than a box takes.
        """
        indent = "  " * self._depth
        for text in texts:
            plain = to_script_text(text).replace("\r\n", "\n").rstrip("\n")
            self._size += len(plain) + (1 + plain.count("\n")) * (len(indent) + 1)
            if self._size > MAX_PROGRAM:
                raise ProgramFileError(f"a script of more than {MAX_PROGRAM} bytes comes of the program")
            self.parts.append(indent + plain.replace("\n", "\n" + indent))

    def put(self, node: Node, label: str, *lines: str, mark: str = "") -> None:
        """Write the label of a node as PolyScope does, and the lines behind it.

        `mark`: "breakAfter", "noBreak" or nothing; that of the node stands in its place.
        """
        name = " ".join(label.splitlines()).replace('"', "'")
        mark = node.mark or mark
        self.add(f'$ {node.number} "{name}"' + (f' "{mark}"' if mark else ""), *lines)

    def gap(self, pc: ExternalControlPc) -> None:
        """Add a gap for a program that comes later; ProgramFileError if there are too many."""
        self._gaps += 1
        if self._gaps > BUDGETS.external_control_nodes:
            raise ProgramFileError(
                f"the program has more than {BUDGETS.external_control_nodes} nodes of External Control"
            )
        self.parts.append(Gap(pc, "  " * self._depth))

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Write a block, `head` being its first line."""
        with self.branch(head):
            yield
        self.add("end")

    @contextmanager
    def branch(self, head: str) -> Iterator[None]:
        """Write a branch of a block: `head` and the indented lines, without `end`."""
        self.add(head)
        self._depth += 1
        yield
        self._depth -= 1

    def repeated(self, node: Node) -> AbstractContextManager[None]:
        """Write a loop without end around what follows, unless the node runs once."""
        return self.block("while (True):") if node.repeats else nullcontext()
