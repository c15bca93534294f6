"""Text in rough pieces: words, numbers, strings, signs. Unlike the parser's tokens they exist for any text.

Comments and labels are left out. Offsets count from 0, lines and columns from 1.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import Final, NamedTuple

_PIECES: Final = re.compile(
    r"""(?P<blank>[ \t\r\n\f\v]+|\#[^\n]*|\$[^\n]*)
    |(?P<string>"[^"\n]*"?)
    |(?P<number>(?:[0-9]|\.[0-9])(?:[eE][+-](?=[0-9])|[\w.])*)
    |(?P<word>[A-Za-z_]\w*)
    |(?P<sign>==|!=|<=|>=|[\xc2-\xf4][\x80-\xbf]+|.)""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)

PAIRS: Final = {"(": ")", "[": "]"}
CLOSERS: Final = {")": "(", "]": "["}


class Piece(NamedTuple):
    """One piece of text.

    Attributes:
        kind: "word", "number", "string", "sign", or "end" behind the last one.
        text: As written; a character of several bytes is one sign.
        start: Offset of its first character.
        end: Offset behind its last one.
        line: Line it begins in.
    """

    kind: str
    text: str
    start: int
    end: int
    line: int


class RoughText:
    """A text and its pieces.

    Attributes:
        text: The text.
        pieces: Its pieces in order, the last one of kind "end".
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._starts = [0]
        self._starts += [match.end() for match in re.finditer("\n", text)]
        self.pieces: list[Piece] = []
        for match in _PIECES.finditer(text):
            kind = match.lastgroup or "sign"
            if kind != "blank":
                line = bisect_right(self._starts, match.start())
                self.pieces.append(Piece(kind, match[0], match.start(), match.end(), line))
        self.pieces.append(Piece("end", "", len(text), len(text), len(self._starts)))

    def offset(self, line: int, column: int) -> int:
        """The offset of a place."""
        return min(self._starts[line - 1] + column - 1, len(self.text)) if line <= len(self._starts) else 0

    def place(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset."""
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def line(self, number: int) -> str:
        """A line without its end."""
        end = self._starts[number] - 1 if number < len(self._starts) else len(self.text)
        return self.text[self._starts[number - 1] : end]

    def line_start(self, number: int) -> int:
        """Offset of the first character of a line."""
        return self._starts[number - 1]

    def indent(self, number: int) -> int:
        """Blanks before the first piece of a line; a tab reaches to the next multiple of eight."""
        lead = re.match(r"[ \t]*", self.line(number))
        return len(lead[0].expandtabs(8)) if lead else 0

    def piece_at(self, offset: int) -> int:
        """Index of the piece at an offset, or of the next one behind it."""
        low, high = 0, len(self.pieces) - 1
        while low < high:
            middle = (low + high) // 2
            if self.pieces[middle].end <= offset:
                low = middle + 1
            else:
                high = middle
        return low

    def is_first(self, index: int) -> bool:
        """Whether a piece is the first of its line."""
        return index == 0 or self.pieces[index - 1].line != self.pieces[index].line
