"""Program text with positions: `Source` (the text, its name, its lines) and `Span` (a stretch of it).

Lines and columns count from 1, as a controller reports them; line 1 is the first line of the text that
was handed in, on the wire the `def` line. Source: primary interface captures of runtime exceptions.
This module renders carets; it must not know what is wrong or why.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, NamedTuple


class Span(NamedTuple):
    """A stretch of program text; `end_column` is the column just after the last character."""

    line: int
    column: int
    end_line: int
    end_column: int


NOWHERE = Span(1, 1, 1, 1)

BLANKS: Final = " \t\r\n\f\v"
"""White space of the language. More than these must not be stripped: in latin-1 text, str.strip() would take
bytes 0x85 and 0xA0 too, which end many a UTF-8 character."""


def as_bytes(text: str) -> str:
    """Text as a controller sees it, one character a byte."""
    try:
        text.encode("latin-1")
    except UnicodeEncodeError:
        return text.encode("utf-8", "surrogateescape").decode("latin-1")
    return text


def as_utf8(text: str) -> str:
    """Text of a program for people: bytes that are UTF-8 become the characters they mean."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


@dataclass(frozen=True, slots=True)
class Source:
    """One program text and the name that people know it by (a file name, or `<program>`)."""

    text: str
    name: str = "<program>"
    _lines: list[str] = field(default_factory=list, init=False, repr=False, compare=False)

    def line(self, number: int) -> str:
        """Line `number` (from 1) without its line end; empty past either end of the text."""
        if not self._lines:
            self._lines.extend(self.text.split("\n"))
        if not 1 <= number <= len(self._lines):
            return ""
        return self._lines[number - 1].rstrip("\r")

    def caret(self, line: int, column: int, width: int = 1) -> str:
        """The source line and, below it, carets under `width` characters from `column` on.

        Tabs before the caret are kept, and characters of several bytes count as one, so that it stands below
        the same character in any terminal.
        """
        shown = self.line(line)
        before, under = as_utf8(shown[: column - 1]), as_utf8(shown[column - 1 : column - 1 + width])
        lead = "".join("\t" if char == "\t" else " " for char in before)
        lead += " " * max(0, column - 1 - len(shown))
        width = max(1, len(under))
        return f"    {shown}\n    {lead}{'^' * width}"
