"""Text -> text in the canonical layout: `urscript fmt`.

Two spaces a level, one statement a line, one space around operators and after commas. Kept as written:
comments, `$` labels, redundant brackets, the spelling of numbers, one blank line where there were some, and a
line break inside a statement after a comma or an opening bracket or beside an operator.
Only white space changes, so the program keeps its meaning.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from urscript.errors import ScriptSyntaxError
from urscript.source import BLANKS, Source
from urscript.syntax.nodes import same_tree
from urscript.syntax.parser import make_parser, parse

if TYPE_CHECKING:
    from lark import Lark, Tree


_OPERATORS: Final = frozenset({"OR", "XOR", "AND", "PLUS", "MINUS", "TIMES", "COMPARE"})
_OPENERS: Final = frozenset({"LPAR", "LSQB"})
_CLOSERS: Final = frozenset({"RPAR", "RSQB"})
_NUMBERS: Final = frozenset({"INT", "FLOAT"})
_CALL_LIKE: Final = frozenset({"function", "thread", "call", "run"})
"""Rules whose bracket belongs to the name before it."""

INDENT: Final = "  "

_CONTINUED: Final = 2 * INDENT
"""Additional indentation of continuation lines; more than that of a block."""

ALIGNED_WIDTH: Final = 60
"""Comments after consecutive lines are aligned; those after longer lines are not."""


def format_program(source: Source) -> str:
    """The text of `source` in the canonical layout, line feeds only.

    Raises:
        ScriptSyntaxError: `source` has a syntax error.
    """
    tree = parse(source)
    try:
        logical_lines = _logical_lines(_concrete_parser().parse(source.text))
        formatted = _render(_Layout(source.text).lines(logical_lines))
        unchanged = same_tree(parse(Source(formatted, source.name)), tree)
    except RecursionError:
        message = "the program is nested too deeply"
        raise ScriptSyntaxError(message, line=1, column=1, source=source) from None
    if not unchanged:
        raise AssertionError(f"{source.name}: the layout would change the program; please report this")
    return formatted


@dataclass(slots=True)
class _PhysicalLine:
    """A line of the output: code, a comment, both, or neither (a blank line)."""

    indent: str = ""
    code: str = ""
    comment: str = ""


class _Layout:
    """Makes physical lines of logical ones, with the comments and blank lines between them in `text`."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._lines: list[_PhysicalLine] = []
        self._end = 0

    def lines(self, logical_lines: Iterator[LogicalLine]) -> list[_PhysicalLine]:
        for logical in logical_lines:
            start = logical.tokens[0].start
            column = start - self._text.rfind("\n", 0, start)
            for comment in self._comments_until(start):
                self._add_comment(comment, INDENT * _comment_level(comment, logical, column))
            self._keep_blank_line(start)
            self._add(logical)
        for comment in self._comments_until(len(self._text)):
            self._add_comment(comment, "")
        return self._lines

    def _comments_until(self, position: int) -> list[Comment]:
        return read_comments(self._text, self._end, position)

    def _add_comment(self, comment: Comment, indent: str) -> None:
        if comment.follows_code:
            self._lines[-1].comment = comment.text
        else:
            self._keep_blank_line(comment.position)
            self._lines.append(_PhysicalLine(indent, comment=comment.text))
        self._end = comment.position + len(comment.text)

    def _keep_blank_line(self, position: int) -> None:
        if self._lines and self._text.count("\n", self._end, position) > 1:
            self._lines.append(_PhysicalLine())

    def _add(self, logical: LogicalLine) -> None:
        """Add a logical line; it breaks only at allowed places where the author broke it, and at comments."""
        indent = INDENT * logical.level
        line = _PhysicalLine(indent)
        self._lines.append(line)
        before: RuleToken | None = None
        opened: list[int] = []  # the line of each open bracket
        for token in logical.tokens:
            if token.kind in _CLOSERS:
                opened.pop()
            if before is not None:
                comments = self._comments_until(token.start)
                deeper = _CONTINUED * (len(set(opened)) if opened or token.kind in _CLOSERS else 1)
                # On the wire only the first line and the last `end` of a program may start in column 1.
                deeper = deeper or ("" if indent else INDENT)
                for comment in comments:
                    if not comment.follows_code:
                        self._lines.append(
                            _PhysicalLine(indent + (deeper or _CONTINUED), comment=comment.text)
                        )
                    else:
                        self._lines[-1].comment = comment.text
                if comments or (_may_break(before, token) and self._is_broken(before, token)):
                    line = _PhysicalLine(indent + deeper)
                    self._lines.append(line)
                elif _needs_space(before, token):
                    line.code += " "
            if token.kind in _OPENERS:
                opened.append(len(self._lines))
            line.code += _spelling(token)
            self._end = token.end
            before = token

    def _is_broken(self, before: RuleToken, token: RuleToken) -> bool:
        return "\n" in self._text[before.end : token.start]


def _comment_level(comment: Comment, logical: LogicalLine, column: int) -> int:
    """The level of a comment before `logical`: before `end` it belongs to the block that ends.

    Before `elif` and `else` it belongs to the block that ends if it is indented more than the word.
    """
    first = logical.tokens[0].kind
    ends_block = first == "END" or (first in ("ELIF", "ELSE") and comment.column > column)
    return logical.level + ends_block


def _spelling(token: RuleToken) -> str:
    if token.kind == "LABEL":
        text = token.text[1:].strip(BLANKS)
        return f"$ {text}" if text else "$"
    return token.text


def _is_sign(token: RuleToken) -> bool:
    return token.rule == "prefix" and token.kind != "NOT"


def _is_operator(token: RuleToken) -> bool:
    return token.kind in _OPERATORS and token.rule != "prefix"


def _may_break(before: RuleToken, token: RuleToken) -> bool:
    """Whether a line break of the author between two tokens is kept."""
    if before.kind in _OPENERS and token.kind in _CLOSERS:
        return False
    return (
        before.kind == "COMMA"
        or before.kind in _OPENERS
        or token.kind in _CLOSERS
        or _is_operator(before)
        or _is_operator(token)
    )


def _needs_space(before: RuleToken, token: RuleToken) -> bool:
    kind = token.kind
    if kind == "DOT":
        return before.kind in _NUMBERS  # or the dot would become part of the number
    if (
        kind in ("COMMA", "COLON", "SEMICOLON")
        or kind in _CLOSERS
        or before.kind == "DOT"
        or before.kind in _OPENERS
    ):
        return False
    if _is_sign(before):
        return False
    if kind == "LPAR" and token.rule in _CALL_LIKE:
        return False
    if kind == "LSQB" and token.rule == "index":
        return False
    return "EQUAL" not in (kind, before.kind) or not (_binds_name(token) or _binds_name(before))


def _binds_name(token: RuleToken) -> bool:
    """Whether it is the `=` of a named argument or of a default."""
    return token.kind == "EQUAL" and token.rule in ("named_argument", "param")


def _render(lines: list[_PhysicalLine]) -> str:
    """The text of `lines`, comments after consecutive lines aligned."""
    result: list[str] = []
    start = 0
    while start < len(lines):
        end = start + 1
        while end < len(lines) and _is_aligned(lines[start]) and _is_aligned(lines[end]):
            if lines[end].indent != lines[start].indent:
                break
            end += 1
        width = max(_width(line.code) for line in lines[start:end])
        for line in lines[start:end]:
            text = line.indent + line.code
            if line.code and line.comment:
                text += " " * (width - _width(line.code) + 2)
            result.append(f"{text}{line.comment}\n")
        start = end
    return "".join(result)


def _is_aligned(line: _PhysicalLine) -> bool:
    return bool(line.code and line.comment) and len(line.indent) + _width(line.code) <= ALIGNED_WIDTH


def _width(code: str) -> int:
    """Columns on a screen; the text has one character a byte."""
    return len(code.encode("latin-1").decode("utf-8", "replace"))


# --- text to logical lines of tokens, and the comments between them -------------------------------------
#
# A logical line is one line of the canonical layout: a short statement, the head of a block up to its colon,
# `else:`, `end`. Comments are between two tokens.

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


class RuleToken(NamedTuple):
    """One token.

    Attributes:
        kind: Its name in the grammar.
        start: Characters of the source before it.
        end: The position after it.
        rule: The rule of the grammar that it belongs to.
    """

    kind: str
    text: str
    start: int
    end: int
    rule: str


class LogicalLine(NamedTuple):
    """The tokens of one line of the canonical layout, and the number of blocks around it."""

    level: int
    tokens: tuple[RuleToken, ...]


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
    return make_parser(None)


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
        else:
            head.extend(_tokens(item, parent))
            if head and (parent == "block" or head[-1].kind == "END"):
                if stack and getattr(stack[-1][2], "type", "") == "SEMICOLON":
                    head.extend(_tokens(stack.pop()[2], parent))
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
            yield RuleToken(part.type, str(part), part.start_pos, part.end_pos, rule)
