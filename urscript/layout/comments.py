"""Text -> rows of tokens with the comments between them: what the tree leaves out and a formatter needs.

A row is what stands on one line of the canonical layout: a short statement, the head of a block up to its
colon, `else:`, `end`. Comments are nothing but what is left between two tokens besides blanks.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from urscript.source import BLANKS, Source

if TYPE_CHECKING:
    from lark import Lark, Token, Tree

_COMMENT: Final = re.compile(r"#[^\n]*")


class Comment(NamedTuple):
    """A `#` and the rest of its line, without blanks at the end.

    Attributes:
        text: From the `#` on.
        position: Characters of the text before it.
        column: From 1.
        follows_code: A token stands before it on its line.
    """

    text: str
    position: int
    column: int
    follows_code: bool

    @property
    def end(self) -> int:
        """The position just after it."""
        return self.position + len(self.text)


class Piece(NamedTuple):
    """One token and the rule of the grammar it stands in."""

    token: Token
    rule: str

    @property
    def kind(self) -> str:
        """The name of the token in the grammar."""
        return self.token.type

    @property
    def start(self) -> int:
        """Characters of the text before it."""
        return self.token.start_pos or 0

    @property
    def end(self) -> int:
        """The position just after it."""
        return self.token.end_pos or 0


class Row(NamedTuple):
    """The tokens of one line of the canonical layout, and how many blocks it stands in."""

    level: int
    pieces: tuple[Piece, ...]


def read_rows(source: Source) -> list[Row]:
    """The rows of a program that `parser.parse` accepts."""
    return list(_rows(_concrete_parser().parse(source.text)))


def read_comments(text: str, start: int, end: int) -> list[Comment]:
    """The comments in `text[start:end]`, a stretch between two tokens."""
    found = []
    for match in _COMMENT.finditer(text, start, end):
        line_start = text.rfind("\n", 0, match.start()) + 1
        follows_code = start > 0 and line_start <= start
        column = match.start() - line_start + 1
        found.append(Comment(match[0].rstrip(BLANKS), match.start(), column, follows_code))
    return found


@cache
def _concrete_parser() -> Lark:
    """The parser of the language without its tree builder: it keeps every bracket and comma."""
    from importlib.resources import files

    from lark import Lark

    grammar = files("urscript.syntax").joinpath("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", lexer="basic", keep_all_tokens=True)


_COMPOUND: Final = frozenset({"function", "thread", "if_", "elif_", "while_"})


def _rows(program: Tree[Any]) -> Iterator[Row]:
    """The rows from top to bottom; with a stack of its own: programs nest deeper than Python calls."""
    stack: list[tuple[int, str, Any]] = [(-1, "start", program.children[0])]
    head: list[Piece] = []
    while stack:
        level, parent, item = stack.pop()
        rule = str(getattr(item, "data", ""))
        if rule == "block":
            if head:
                yield Row(level, tuple(head))
                head = []
            stack.extend((level + 1, rule, part) for part in reversed(item.children))
        elif rule in _COMPOUND:
            stack.extend((level, rule, part) for part in reversed(item.children))
        elif parent == "block":
            yield Row(level, tuple(_pieces(item, parent)))
        else:
            head.extend(_pieces(item, parent))
            if head and head[-1].kind == "END":
                yield Row(level, tuple(head))
                head = []


def _pieces(item: Any, parent: str) -> Iterator[Piece]:
    """The tokens of a short statement, or of a part of a longer one, in the order of the text."""
    stack: list[tuple[str, Any]] = [(parent, item)]
    while stack:
        rule, part = stack.pop()
        if hasattr(part, "data"):
            stack.extend((str(part.data), inner) for inner in reversed(part.children))
        elif part is not None:
            yield Piece(part, rule)
