"""Program text with positions: `Source` (the text, its name, its lines) and `Span` (a range of it).

Lines and columns count from 1, as a controller reports them; line 1 is the first line of the text that
was passed, on the wire the `def` line. Source: primary interface captures of runtime exceptions.
This module renders carets; it knows nothing of errors.
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple


class Span(NamedTuple):
    """A range of program text; `end_column` is the column after the last character."""

    line: int
    column: int
    end_line: int
    end_column: int


NOWHERE = Span(1, 1, 1, 1)

BLANKS: Final = " \t\r\n\f\v"
"""White space of the language. str.strip() removes more: in latin-1 text also the bytes 0x85 and 0xA0, which
occur inside UTF-8 characters."""


def as_bytes(text: str) -> str:
    """Text as a controller receives it, one character a byte."""
    try:
        text.encode("latin-1")
    except UnicodeEncodeError:
        return text.encode("utf-8", "surrogateescape").decode("latin-1")
    return text


def program_text(content: bytes, name: str) -> str:
    """Text of a program file as a controller receives it, without a byte order mark.

    Raises:
        ValueError: The file is UTF-16, as some editors of Windows save it; a controller cannot read that.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff")) or content[:2].count(0) == 1:
        raise ValueError(f"{name} is UTF-16 text: a controller reads UTF-8, save it as that")
    return content.removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def as_utf8(text: str) -> str:
    """Text of a program for display: UTF-8 bytes are decoded."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


@dataclass(frozen=True, slots=True)
class Source:
    """One program text and its name in messages (a file name, or `<program>`)."""

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

        Tabs before the caret are kept, and characters of several bytes count as one, so that the caret is
        below its character in any terminal.
        """
        shown = self.line(line)
        before, under = as_utf8(shown[: column - 1]), as_utf8(shown[column - 1 : column - 1 + width])
        lead = "".join("\t" if char == "\t" else " " for char in before)
        lead += " " * max(0, column - 1 - len(shown))
        return f"    {shown}\n    {lead}{'^' * max(1, len(under))}"
