"""What a rule gets, a `Problem` with the tokens of the text, and what it returns, an `Advice`.

The tokenizer is tolerant: words, numbers, strings and symbols of any text, also where the parser's lexer
fails. Comments and labels are left out. Offsets count from 0, lines and columns from 1.
"""

import re
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from urscript.errors import ScriptLexerError, ScriptSyntaxError

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
    """A text and its tokens in order, the last one of kind "end"."""

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
        return self.text[self.line_start(number) : self.line_end(number)]

    def line_start(self, number: int) -> int:
        """Offset of the first character of a line."""
        return self._starts[number - 1]

    def line_end(self, number: int) -> int:
        """Offset of the line feed that ends a line, or of the end of the text."""
        return self._starts[number] - 1 if number < len(self._starts) else len(self.text)

    def indent(self, number: int) -> int:
        """Blanks before the first token of a line; a tab reaches to the next multiple of eight."""
        lead = re.match(r"[ \t]*", self.line(number))
        return len(lead[0].expandtabs(8)) if lead else 0

    def token_at(self, offset: int) -> int:
        """Index of the token at an offset, or of the next one after it."""
        return bisect_right(self.tokens, offset, hi=len(self.tokens) - 1, key=lambda token: token.end)

    def is_first(self, index: int) -> bool:
        """Whether a token is the first of its line."""
        return index == 0 or self.tokens[index - 1].line != self.tokens[index].line


# --- rules ----------------------------------------------------------------------------------------------


class Edit(NamedTuple):
    """Replace the text from offset `start` to `end`; lines stay where they are."""

    start: int
    end: int
    new: str


class Advice(NamedTuple):
    """An explanation of a syntax error, and its repair.

    Attributes:
        message: What is wrong.
        hint: What to write; None if the message says it.
        start: Offset of the first character that is underlined.
        end: Offset after the last one.
        edits: The repair, so that the parser can find the next error.
        exact: The repair keeps the meaning; if not, names of that line may be undefined elsewhere.
    """

    message: str
    hint: str | None
    start: int
    end: int
    edits: tuple[Edit, ...] = ()
    exact: bool = True


def advice_at(
    first: Token, message: str, hint: str | None, *edits: Edit, last: Token | None = None, exact: bool = True
) -> Advice:
    """Advice that underlines a token, or the text from `first` to `last`."""
    return Advice(message, hint, first.start, (last or first).end, edits, exact)


def replacement(token: Token, new: str, last: Token | None = None) -> Edit:
    """Replace a token, or the text from it to `last`; padded, so that what follows keeps its column."""
    end = (last or token).end
    return Edit(token.start, end, new.ljust(end - token.start))


def absent(
    word: str, hint: str, first: Token, new: str, last: Token | None = None, *, exact: bool = True
) -> Advice:
    """Advice that URScript has no `word`, which stands from `first` to `last`, and to replace it."""
    message = f"there is no '{word}' in URScript"
    return advice_at(first, message, hint, replacement(first, new, last), last=last, exact=exact)


@dataclass(frozen=True, slots=True)
class Problem:
    """The first syntax error of a text; `index` is that of the token at the error."""

    tokenized: TokenizedText
    error: ScriptSyntaxError
    index: int

    @property
    def token(self) -> Token:
        """The unexpected token."""
        return self.tokenized.tokens[self.index]

    @property
    def previous(self) -> Token:
        """The token before it."""
        return self.neighbor(-1)

    @property
    def following(self) -> Token:
        """The token after it."""
        return self.neighbor(1)

    def neighbor(self, distance: int) -> Token:
        """The token at a distance, negative before it; limited to the first and last token."""
        tokens = self.tokenized.tokens
        return tokens[max(0, min(self.index + distance, len(tokens) - 1))]

    @property
    def is_lexical(self) -> bool:
        """Whether the text there is no token of the language."""
        return isinstance(self.error, ScriptLexerError)

    @property
    def starts_line(self) -> bool:
        """It is the first token of its line: what is missing belongs to a line above."""
        return self.tokenized.is_first(self.index) or self.token.kind == "end"

    def line_head(self, line: int) -> tuple[int, Token]:
        """Index and first token of a line."""
        index = self.tokenized.token_at(self.tokenized.line_start(line))
        return index, self.tokenized.tokens[index]

    def accepts(self, *terminals: str) -> bool:
        """Whether the parser expects one of these."""
        return not self.error.accepted.isdisjoint(terminals)

    def open_brackets(self) -> list[Token]:
        """The open brackets of the statement before it, the innermost last."""
        found: list[Token] = []
        for token in self.tokenized.tokens[: self.index]:
            if token.kind == "symbol" and token.text in PAIRS:
                found.append(token)
            elif token.kind == "symbol" and token.text in CLOSERS:
                if found and found[-1].text == CLOSERS[token.text]:
                    found.pop()
            elif token.text in _STATEMENT_WORDS and token.kind == "word":
                found.clear()
        return found


_STATEMENT_WORDS = frozenset(
    {"def", "sec", "thread", "end", "if", "elif", "else", "while", "return", "global", "local", "halt"}
)

Rule = Callable[[Problem], Advice | None]
