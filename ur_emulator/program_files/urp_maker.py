"""UrpMaker: what the writers of nodes share while a program file becomes a script."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from ur_emulator.errors import UndefinedError, UnknownNodeError
from ur_emulator.program_files.installation import Installation
from ur_emulator.program_files.reader import ProgramReader
from ur_emulator.program_files.script_writer import ScriptWriter
from ur_emulator.program_files.urp_nodes import Node, ProgramNodes


@dataclass(frozen=True, slots=True)
class Around:
    """What is around a node: the `<Move>` that waypoints belong to, if there is one.

    `is_quiet`: labels say that the program does not stop at them.
    """

    move: Node | None = None
    is_quiet: bool = False

    @property
    def mark(self) -> str:
        """Mark of the label of a node."""
        return "noBreak" if self.is_quiet else ""


NodeWriter = Callable[["UrpMaker", Node, Around], None]


@dataclass(slots=True)
class UrpMaker:
    """Writes the nodes of a program.

    Attributes:
        writers: what writes each kind of node.
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
    writers: Mapping[str, NodeWriter]
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
        self.try_to(node, partial(self._write, node, around))

    def _write(self, node: Node, around: Around) -> None:
        write = self.writers.get(node.kind)
        if write is None:
            raise node.source.unknown(f"a <{node.kind}> node")
        write(self, node, around)

    def try_to(self, node: Node, action: Callable[[], None]) -> None:
        """Do something for a node; what it has written is removed if the node is undefined.

        So it is if it meets what is not known and may be left out; UnknownNodeError if that must not be.
        """
        place = self.writer.place
        try:
            action()
        except UndefinedError as error:
            self.writer.take(place)
            self.undefined.append(f"{error} (label {node.number})")
        except UnknownNodeError as error:
            if not self.skip_unknown:
                raise
            self.writer.take(place)
            self.left_out.append(str(error))

    def write_children(self, node: Node, around: Around) -> None:
        """Write the nodes inside a node."""
        for child in node.children:
            self.write(child, around)

    def declare(self, what: str, *lines: str) -> None:
        """Declare something before all nodes, unless it is declared already."""
        self.declarations.setdefault(what, lines)
