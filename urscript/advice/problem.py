"""What a rule gets, a `Problem`, and what it gives, an `Advice`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from urscript.advice.rough_tokens import CLOSERS, PAIRS, Piece, RoughText
from urscript.errors import ScriptSyntaxError


class Edit(NamedTuple):
    """Replace the text from offset `start` to `end`; lines stay where they are."""

    start: int
    end: int
    new: str


class Advice(NamedTuple):
    """A syntax error in the words of somebody who knows what was meant.

    Attributes:
        message: What is wrong.
        hint: What to write; None if the message says it.
        start: Offset where a person would look.
        end: Offset behind what is underlined.
        edits: What makes the text right as far as this goes, so that the next error can be looked for.
        sure: The repaired text means what was meant; if not, names of that line may be missing elsewhere.
    """

    message: str
    hint: str | None
    start: int
    end: int
    edits: tuple[Edit, ...] = ()
    sure: bool = True


def about(
    first: Piece, message: str, hint: str | None, *edits: Edit, last: Piece | None = None, sure: bool = True
) -> Advice:
    """Advice that underlines a piece, or all from `first` to `last`."""
    return Advice(message, hint, first.start, (last or first).end, edits, sure)


def replaced(piece: Piece, new: str, last: Piece | None = None) -> Edit:
    """Other text in place of a piece, or of all from it to `last`; what stands behind it stays in place."""
    end = (last or piece).end
    return Edit(piece.start, end, new.ljust(end - piece.start))


@dataclass(frozen=True, slots=True)
class Problem:
    """The first syntax error of a text.

    Attributes:
        rough: The text.
        error: As the parser words it.
        index: The piece at its place.
    """

    rough: RoughText
    error: ScriptSyntaxError
    index: int

    @property
    def at(self) -> Piece:
        """The piece that cannot stand where it is."""
        return self.rough.pieces[self.index]

    @property
    def before(self) -> Piece:
        """The piece before it; itself at the start of the text."""
        return self.piece(-1)

    @property
    def after(self) -> Piece:
        """The piece behind it."""
        return self.piece(1)

    def piece(self, distance: int) -> Piece:
        """The piece so many places on or back, or the last or first one."""
        pieces = self.rough.pieces
        return pieces[max(0, min(self.index + distance, len(pieces) - 1))]

    @property
    def starts_line(self) -> bool:
        """Nothing stands before it on its line: what is missing is missing on a line above."""
        return self.rough.is_first(self.index) or self.at.kind == "end"

    def line_head(self, line: int) -> tuple[int, Piece]:
        """Index and piece of the first one of a line."""
        index = self.rough.piece_at(self.rough.line_start(line))
        return index, self.rough.pieces[index]

    def accepts(self, *terminals: str) -> bool:
        """Whether one of these could stand there."""
        return not self.error.accepted.isdisjoint(terminals)

    def open_brackets(self) -> list[Piece]:
        """The brackets of the statement that are open before it, the innermost last."""
        found: list[Piece] = []
        for piece in self.rough.pieces[: self.index]:
            if piece.kind == "sign" and piece.text in PAIRS:
                found.append(piece)
            elif piece.kind == "sign" and piece.text in CLOSERS:
                if found and found[-1].text == CLOSERS[piece.text]:
                    found.pop()
            elif piece.text in _STATEMENT_WORDS and piece.kind == "word":
                found.clear()
        return found


_STATEMENT_WORDS = frozenset(
    {"def", "sec", "thread", "end", "if", "elif", "else", "while", "return", "global", "local", "halt"}
)

Rule = Callable[[Problem], Advice | None]
