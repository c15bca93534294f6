"""What a rule gets, a `Problem`, and what it returns, an `Advice`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from urscript.advice.tokens import CLOSERS, PAIRS, Token, TokenizedText
from urscript.errors import ScriptSyntaxError


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


@dataclass(frozen=True, slots=True)
class Problem:
    """The first syntax error of a text.

    Attributes:
        tokenized: The text.
        error: The parser's error.
        index: Index of the token at the error.
    """

    tokenized: TokenizedText
    error: ScriptSyntaxError
    index: int

    @property
    def token(self) -> Token:
        """The unexpected token."""
        return self.tokenized.tokens[self.index]

    @property
    def previous(self) -> Token:
        """The token before it; itself at the start of the text."""
        return self.neighbor(-1)

    @property
    def following(self) -> Token:
        """The token after it; itself at the end of the text."""
        return self.neighbor(1)

    def neighbor(self, distance: int) -> Token:
        """The token at a distance, negative before it; limited to the first and last token."""
        tokens = self.tokenized.tokens
        return tokens[max(0, min(self.index + distance, len(tokens) - 1))]

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
