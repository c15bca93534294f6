"""Text -> text in the canonical layout: `urscript fmt`.

Two blanks a level, one statement a line, one blank around operators and after commas. Kept as written:
comments, `$` labels, spare brackets, the spelling of numbers, one blank line where there were some, and a
line break inside a statement where it stands after a comma or an opening bracket or beside an operator.
Only blanks and line ends ever change, so the program means what it meant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urscript.errors import ScriptSyntaxError
from urscript.layout.comments import Comment, Piece, Row, read_comments, read_rows
from urscript.source import BLANKS, Source
from urscript.syntax.parser import parse
from urscript.syntax.walk import same_tree

_OPERATORS: Final = frozenset({"OR", "XOR", "AND", "PLUS", "MINUS", "TIMES", "COMPARE"})
_OPENERS: Final = frozenset({"LPAR", "LSQB"})
_CLOSERS: Final = frozenset({"RPAR", "RSQB"})
_NUMBERS: Final = frozenset({"INT", "FLOAT"})
_CALL_LIKE: Final = frozenset({"function", "thread", "call", "run"})
"""Rules whose bracket belongs to the name before it."""

INDENT: Final = "  "

_CONTINUED: Final = 2 * INDENT
"""How much deeper the rest of a broken statement stands; more than a block, to look different."""

ALIGNED_WIDTH: Final = 60
"""Comments behind neighbouring lines stand below each other; behind longer lines each stands for itself."""


def format_program(source: Source) -> str:
    """The text of `source` in the canonical layout, line feeds only.

    Raises:
        ScriptSyntaxError: `source` is not a program; nothing can be said about its layout.
    """
    tree = parse(source)
    try:
        formatted = _render(_Layout(source.text).lines(read_rows(source)))
        unchanged = same_tree(parse(Source(formatted, source.name)), tree)
    except RecursionError:
        message = "the program is nested too deeply"
        raise ScriptSyntaxError(message, line=1, column=1, source=source) from None
    if not unchanged:
        raise AssertionError(f"{source.name}: the layout would change the program; please report this")
    return formatted


@dataclass(slots=True)
class _Line:
    """A line to be: code, a comment, both, or neither (a blank line)."""

    indent: str = ""
    code: str = ""
    comment: str = ""


class _Layout:
    """Sets rows into lines, with the comments and blank lines that stand between them in `text`."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._made: list[_Line] = []
        self._end = 0

    def lines(self, rows: list[Row]) -> list[_Line]:
        """The lines of a whole program."""
        for row in rows:
            first = row.pieces[0]
            for comment in self._comments_until(first.start):
                self._place(comment, INDENT * _comment_level(comment, row, self._column(first.start)))
            self._keep_blank_line(first.start)
            self._set(row)
        for comment in self._comments_until(len(self._text)):
            self._place(comment, "")
        return self._made

    def _comments_until(self, position: int) -> list[Comment]:
        return read_comments(self._text, self._end, position)

    def _column(self, position: int) -> int:
        return position - self._text.rfind("\n", 0, position)

    def _place(self, comment: Comment, indent: str) -> None:
        """A comment behind the line before it, or on a line of its own."""
        if comment.follows_code:
            self._made[-1].comment = comment.text
        else:
            self._keep_blank_line(comment.position)
            self._made.append(_Line(indent, comment=comment.text))
        self._end = comment.end

    def _keep_blank_line(self, position: int) -> None:
        if self._made and self._text.count("\n", self._end, position) > 1:
            self._made.append(_Line())

    def _set(self, row: Row) -> None:
        """One row, on one line unless it was broken at a good place or has comments inside."""
        indent = INDENT * row.level
        line = _Line(indent)
        self._made.append(line)
        before: Piece | None = None
        opened: list[int] = []  # for each open bracket the line it stands in
        for piece in row.pieces:
            if piece.kind in _CLOSERS:
                opened.pop()
            if before is not None:
                comments = self._comments_until(piece.start)
                deeper = _CONTINUED * (len(set(opened)) if opened or piece.kind in _CLOSERS else 1)
                # On the wire only the first line and the last `end` of a program may start in column 1.
                deeper = deeper or ("" if indent else INDENT)
                for comment in comments:
                    if not comment.follows_code:
                        self._made.append(_Line(indent + (deeper or _CONTINUED), comment=comment.text))
                    else:
                        self._made[-1].comment = comment.text
                if comments or (_may_break(before, piece) and self._is_broken(before, piece)):
                    line = _Line(indent + deeper)
                    self._made.append(line)
                elif _stand_apart(before, piece):
                    line.code += " "
            if piece.kind in _OPENERS:
                opened.append(len(self._made))
            line.code += _spelling(piece)
            self._end = piece.end
            before = piece

    def _is_broken(self, before: Piece, piece: Piece) -> bool:
        return "\n" in self._text[before.end : piece.start]


def _comment_level(comment: Comment, row: Row, column: int) -> int:
    """How deep a comment before `row` stands: before `end` it belongs to the block that ends.

    Before `elif` and `else` it belongs to the block that ends if it is indented more than the word.
    """
    first = row.pieces[0].kind
    ends_block = first == "END" or (first in ("ELIF", "ELSE") and comment.column > column)
    return row.level + ends_block


def _spelling(piece: Piece) -> str:
    if piece.kind == "LABEL":
        text = piece.token[1:].strip(BLANKS)
        return f"$ {text}" if text else "$"
    return str(piece.token)


def _is_sign(piece: Piece) -> bool:
    return piece.rule == "prefix" and piece.kind != "NOT"


def _is_operator(piece: Piece) -> bool:
    return piece.kind in _OPERATORS and piece.rule != "prefix"


def _may_break(before: Piece, piece: Piece) -> bool:
    """Whether a line break of the author between two tokens is kept."""
    if before.kind in _OPENERS and piece.kind in _CLOSERS:
        return False
    return (
        before.kind == "COMMA"
        or before.kind in _OPENERS
        or piece.kind in _CLOSERS
        or _is_operator(before)
        or _is_operator(piece)
    )


def _stand_apart(before: Piece, piece: Piece) -> bool:
    """Whether a blank stands between two tokens of a line."""
    kind = piece.kind
    if kind == "DOT":
        return before.kind in _NUMBERS  # or the dot would become part of the number
    if kind in ("COMMA", "COLON") or kind in _CLOSERS or before.kind == "DOT" or before.kind in _OPENERS:
        return False
    if _is_sign(before):
        return False
    if kind == "LPAR" and piece.rule in _CALL_LIKE:
        return False
    if kind == "LSQB" and piece.rule == "index":
        return False
    return "EQUAL" not in (kind, before.kind) or not (_binds_name(piece) or _binds_name(before))


def _binds_name(piece: Piece) -> bool:
    """Whether it is the `=` of a named argument or of a default."""
    return piece.kind == "EQUAL" and piece.rule in ("named_argument", "param")


def _render(lines: list[_Line]) -> str:
    """The text of `lines`, comments behind neighbouring lines aligned."""
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


def _is_aligned(line: _Line) -> bool:
    return bool(line.code and line.comment) and len(line.indent) + _width(line.code) <= ALIGNED_WIDTH


def _width(code: str) -> int:
    """Columns on a screen; the text has one character a byte."""
    return len(code.encode("latin-1").decode("utf-8", "replace"))
