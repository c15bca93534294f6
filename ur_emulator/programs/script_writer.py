"""ScriptWriter: writes a script line by line, with indentation, labels, and gaps for programs of PCs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.installation import ExternalControlPc
from urscript.values import to_script_text


@dataclass(frozen=True, slots=True)
class Gap:
    """A place for the program that a PC sends when the program is played.

    Attributes:
        pc: who sends it.
        indent: blanks before each of its lines.
    """

    pc: ExternalControlPc
    indent: str


@dataclass(frozen=True, slots=True)
class Header:
    """A place for what the installation declares; its variables change while a program is loaded."""


Part = str | Gap | Header


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a script.

    Attributes:
        parts: number of parts before it.
        depth: number of open blocks.
    """

    parts: int
    depth: int


class ScriptWriter:
    """The script so far.

    Attributes:
        parts: texts of whole lines, and places for others, in order.
    """

    def __init__(self) -> None:
        self.parts: list[Part] = []
        self._depth = 0
        self._size = 0
        self._gaps = 0

    @property
    def place(self) -> Place:
        """The end of the script so far."""
        return Place(len(self.parts), self._depth)

    def take(self, place: Place) -> list[Part]:
        """Remove what was written since a place, and return it; it may be put into another place."""
        taken = self.parts[place.parts :]
        del self.parts[place.parts :]
        self._depth = place.depth
        return taken

    def add(self, *texts: str) -> None:
        """Write lines, one character a byte; a text of several lines is written as it is, each one indented.

        Raises:
            ProgramFileError: the script becomes longer than a box takes.
        """
        indent = "  " * self._depth
        for text in texts:
            plain = to_script_text(text).replace("\r\n", "\n").rstrip("\n")
            self._size += len(plain) + (1 + plain.count("\n")) * (len(indent) + 1)
            if self._size > MAX_PROGRAM:
                raise ProgramFileError(f"a script of more than {MAX_PROGRAM} bytes comes of the program")
            self.parts.append(indent + plain.replace("\n", "\n" + indent))

    def label(self, number: int, text: str, mark: str = "") -> None:
        """Write the label of a node, with the number, the name and the mark that PolyScope shows.

        Args:
            number: of the node.
            text: its name.
            mark: "breakAfter", "noBreak" or nothing.
        """
        name = " ".join(text.splitlines()).replace('"', "'")
        self.add(f'$ {number} "{name}"' + (f' "{mark}"' if mark else ""))

    def gap(self, pc: ExternalControlPc) -> None:
        """Add a gap for a program that comes later.

        Raises:
            ProgramFileError: there are too many.
        """
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


def one_line(text: str) -> str:
    """Return a text for a string literal of a script; there are no escapes."""
    return " ".join(text.replace('"', "'").split())
