"""A tolerant tokenizer: words, numbers, strings and symbols of any text, also where the parser's lexer fails.

Comments and labels are left out. Offsets count from 0, lines and columns from 1.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import Final, NamedTuple

_TOKENS: Final = re.compile(
    r"""(?P<space>[ \t\r\n\f\v]+|\#[^\n]*|\$[^\n]*)
    |(?P<string>"[^"\n]*"?)
    |(?P<number>(?:[0-9]|\.[0-9])(?:[eE][+-](?=[0-9])|[\w.])*)
    |(?P<word>[A-Za-z_]\w*)
    |(?P<symbol>==|!=|<=|>=|[\xc2-\xf4][\x80-\xbf]+|.)""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)

PAIRS: Final = {"(": ")", "[": "]"}
CLOSERS: Final = {")": "(", "]": "["}


class Token(NamedTuple):
    """One token.

    Attributes:
        kind: "word", "number", "string", "symbol", or "end" after the last one.
        text: As written; a character of several bytes is one symbol.
        start: Offset of its first character.
        end: Offset after its last one.
        line: Line it begins in.
    """

    kind: str
    text: str
    start: int
    end: int
    line: int


class TokenizedText:
    """A text and its tokens.

    Attributes:
        text: The text.
        tokens: Its tokens in order, the last one of kind "end".
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._starts = [0]
        self._starts += [match.end() for match in re.finditer("\n", text)]
        self.tokens: list[Token] = []
        for match in _TOKENS.finditer(text):
            kind = match.lastgroup or "symbol"
            if kind != "space":
                line = bisect_right(self._starts, match.start())
                self.tokens.append(Token(kind, match[0], match.start(), match.end(), line))
        self.tokens.append(Token("end", "", len(text), len(text), len(self._starts)))

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
        """Blanks before the first token of a line; a tab reaches to the next multiple of eight."""
        lead = re.match(r"[ \t]*", self.line(number))
        return len(lead[0].expandtabs(8)) if lead else 0

    def token_at(self, offset: int) -> int:
        """Index of the token at an offset, or of the next one after it."""
        low, high = 0, len(self.tokens) - 1
        while low < high:
            middle = (low + high) // 2
            if self.tokens[middle].end <= offset:
                low = middle + 1
            else:
                high = middle
        return low

    def is_first(self, index: int) -> bool:
        """Whether a token is the first of its line."""
        return index == 0 or self.tokens[index - 1].line != self.tokens[index].line
