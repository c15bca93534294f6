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


class ScriptWriter:
    """The script so far.

    Attributes:
        parts: texts of whole lines, and places for others, in order.
    """

    def __init__(self) -> None:
        self.parts: list[Part] = []
        self._depth = 0
        self._labels = 0
        self._size = 0
        self._gaps = 0

    @property
    def depth(self) -> int:
        """Number of open blocks."""
        return self._depth

    def add(self, text: str) -> None:
        """Write a line, one character a byte; a text of several lines is written as it is, each one indented.

        Raises:
            ProgramFileError: the script becomes longer than a box takes.
        """
        indent = "  " * self._depth
        plain = to_script_text(text).replace("\r\n", "\n").rstrip("\n")
        self._size += len(plain) + (1 + plain.count("\n")) * (len(indent) + 1)
        if self._size > MAX_PROGRAM:
            raise ProgramFileError(f"a script of more than {MAX_PROGRAM} bytes comes of the program")
        self.parts.append(indent + plain.replace("\n", "\n" + indent))

    def label(self, text: str) -> None:
        """Write the label of a node, with the number and name that PolyScope shows."""
        self._labels += 1
        self.add(f'$ {self._labels} "{one_line(text)}"')

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
        self.add(head)
        with self.indented():
            yield
        self.add("end")

    @contextmanager
    def indented(self) -> Iterator[None]:
        """Indent the lines that are written inside."""
        self._depth += 1
        yield
        self._depth -= 1


def one_line(text: str) -> str:
    """Return a text for a string literal of a script; there are no escapes."""
    return " ".join(text.replace('"', "'").split())
