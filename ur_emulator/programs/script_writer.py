"""ScriptWriter: writes a script line by line, with indentation, labels, and gaps for programs of PCs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.installation import ExternalControlPc


@dataclass(frozen=True, slots=True)
class Gap:
    """A place for the program that a PC sends when the program is played.

    Attributes:
        pc: who sends it.
        indent: blanks before each of its lines.
    """

    pc: ExternalControlPc
    indent: str


class ScriptWriter:
    """The script so far.

    Attributes:
        parts: lines and gaps, in order.
    """

    def __init__(self) -> None:
        self.parts: list[str | Gap] = []
        self._depth = 0
        self._labels = 0
        self._size = 0

    @property
    def depth(self) -> int:
        """Number of open blocks."""
        return self._depth

    def add(self, text: str) -> None:
        """Write a line; a text of several lines is written as it is, each one indented.

        Raises:
            ProgramFileError: the script becomes longer than a box takes.
        """
        self._size += len(text)
        if self._size > MAX_PROGRAM:
            raise ProgramFileError(f"a script of more than {MAX_PROGRAM} bytes comes of the program")
        indent = "  " * self._depth
        self.parts.extend(indent + line for line in text.replace("\r\n", "\n").rstrip("\n").split("\n"))

    def label(self, text: str) -> None:
        """Write the label of a node, with the number and name that PolyScope shows."""
        self._labels += 1
        self.add(f'$ {self._labels} "{one_line(text)}"')

    def gap(self, pc: ExternalControlPc) -> None:
        """Add a gap for a program that comes later."""
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
