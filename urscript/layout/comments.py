"""Text -> logical lines of tokens, and the comments between them: what a formatter needs beside the tree.

A logical line is one line of the canonical layout: a short statement, the head of a block up to its colon,
`else:`, `end`. Comments are between two tokens.
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
    """A `#` and the rest of its line, without trailing spaces.

    Attributes:
        text: From the `#` on.
        position: Characters of the text before it.
        column: From 1.
        follows_code: A token precedes it on its line.
    """

    text: str
    position: int
    column: int
    follows_code: bool

    @property
    def end(self) -> int:
        """The position after it."""
        return self.position + len(self.text)


class RuleToken(NamedTuple):
    """One token and the rule of the grammar that it belongs to."""

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
        """The position after it."""
        return self.token.end_pos or 0


class LogicalLine(NamedTuple):
    """The tokens of one line of the canonical layout, and the number of blocks around it."""

    level: int
    tokens: tuple[RuleToken, ...]


def read_logical_lines(source: Source) -> list[LogicalLine]:
    """The logical lines of a program that `parser.parse` accepts."""
    return list(_logical_lines(_concrete_parser().parse(source.text)))


def read_comments(text: str, start: int, end: int) -> list[Comment]:
    """The comments in `text[start:end]`, a range between two tokens."""
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


def _logical_lines(program: Tree[Any]) -> Iterator[LogicalLine]:
    """The lines from top to bottom; no recursion, because programs nest deeper than Python calls."""
    stack: list[tuple[int, str, Any]] = [(-1, "start", program.children[0])]
    head: list[RuleToken] = []
    while stack:
        level, parent, item = stack.pop()
        rule = str(getattr(item, "data", ""))
        if rule == "block":
            if head:
                yield LogicalLine(level, tuple(head))
                head = []
            stack.extend((level + 1, rule, part) for part in reversed(item.children))
        elif rule in _COMPOUND:
            stack.extend((level, rule, part) for part in reversed(item.children))
        elif parent == "block":
            yield LogicalLine(level, tuple(_tokens(item, parent)))
        else:
            head.extend(_tokens(item, parent))
            if head and head[-1].kind == "END":
                yield LogicalLine(level, tuple(head))
                head = []


def _tokens(item: Any, parent: str) -> Iterator[RuleToken]:
    """The tokens of a short statement, or of a part of a longer one, in the order of the text."""
    stack: list[tuple[str, Any]] = [(parent, item)]
    while stack:
        rule, part = stack.pop()
        if hasattr(part, "data"):
            stack.extend((str(part.data), inner) for inner in reversed(part.children))
        elif part is not None:
            yield RuleToken(part, rule)
