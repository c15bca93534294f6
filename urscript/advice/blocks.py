"""Rules for blocks: an `end` that is missing or too many is looked for where the indentation shows it."""

from __future__ import annotations

import re
from typing import NamedTuple

from urscript.advice.problem import Advice, Edit, Problem, about, replaced
from urscript.advice.rough_tokens import Piece, RoughText
from urscript.advice.words import BLOCK_ENDS, WORDS_AFTER_END

_OPENERS = frozenset({"def", "sec", "thread", "if", "while"})
_BRANCHES = frozenset({"else", "elif"})


class _Opener(NamedTuple):
    piece: Piece
    indent: int


def foreign_end(problem: Problem) -> Advice | None:
    """`endif`, `end if`: ends of other languages, anywhere above a place where the blocks do not fit."""
    rough = problem.rough
    if not problem.starts_line:
        return None
    for index, piece in enumerate(rough.pieces[: problem.index]):
        if not rough.is_first(index) or piece.kind != "word":
            continue
        second, third = rough.pieces[index + 1], rough.pieces[min(index + 2, len(rough.pieces) - 1)]
        if piece.text in BLOCK_ENDS and _is_elsewhere(second, piece):
            return about(
                piece, f"there is no '{piece.text}' in URScript", "write end", replaced(piece, "end")
            )
        alone = not _is_elsewhere(second, piece) and _is_elsewhere(third, piece)
        if piece.text == "end" and second.text in WORDS_AFTER_END and alone:
            message = f"a block ends with 'end', not 'end {second.text}'"
            return about(piece, message, "write end", replaced(second, " "), last=second)
    return None


def _is_elsewhere(piece: Piece, other: Piece) -> bool:
    return piece.line != other.line or piece.kind == "end"


def missing_end(problem: Problem) -> Advice | None:
    """The text ends inside a block."""
    if problem.error.unexpected != "$END" or problem.open_brackets():
        return None
    found = _unclosed(problem.rough)
    if found is None:
        return None
    opener, index = found
    message = f"this '{opener.piece.text}' has no 'end'"
    following = problem.rough.pieces[index]
    if following.kind == "end":
        edit = Edit(following.end, following.end, f"\n{' ' * opener.indent}end")
        return about(opener.piece, message, "add 'end' at the end of the program", edit)
    # Behind the last piece before it: there it shifts nothing, and no comment hides it.
    last = problem.rough.pieces[index - 1]
    hint = f"it seems to belong before line {following.line}"
    return about(opener.piece, message, hint, Edit(last.end, last.end, " end"))


def _unclosed(rough: RoughText) -> tuple[_Opener, int] | None:
    """The block that has no end, and the index of the piece before which it is missing.

    A statement that begins no deeper than an open block shows that the block should have been closed.
    """
    stack: list[_Opener] = []
    for index, piece in enumerate(rough.pieces):
        if rough.is_first(index) and stack and piece.kind == "word":
            indent, top = rough.indent(piece.line), stack[-1]
            may_follow = piece.text == "end" or piece.text in _BRANCHES
            if indent < top.indent or (indent == top.indent and not may_follow):
                return top, index
        if piece.kind == "word" and piece.text in _OPENERS:
            stack.append(_Opener(piece, rough.indent(piece.line)))
        elif piece.text == "end" and stack:
            stack.pop()
    return (stack[-1], len(rough.pieces) - 1) if stack else None


def extra_end(problem: Problem) -> Advice | None:
    """There are more `end`s than blocks."""
    wrong, rough = problem.at, problem.rough
    if wrong.text != "end" or problem.accepts("END") or not problem.accepts("WHILE", "$END"):
        return None
    stack: list[_Opener] = []
    for index, piece in enumerate(rough.pieces[: problem.index]):
        if piece.kind == "word" and piece.text in _OPENERS:
            stack.append(_Opener(piece, rough.indent(piece.line)))
        elif piece.text == "end" and stack:
            opener = stack.pop()
            if rough.is_first(index) and rough.indent(piece.line) != opener.indent:
                wrong = piece
                break
    return about(wrong, "this 'end' has no block", "remove it", replaced(wrong, " "))


def else_if(problem: Problem) -> Advice | None:
    """`else if x:`."""
    piece, before = problem.at, problem.before
    if piece.text != "if" or before.text != "else" or problem.starts_line:
        return None
    edit = replaced(before, "elif", piece)
    return about(before, "there is no 'else if' in URScript", "write elif", edit, last=piece)


def missing_colon(problem: Problem) -> Advice | None:
    """`if x == 1` and no colon before the next statement."""
    piece, before = problem.at, problem.before
    if not problem.accepts("COLON"):
        return None
    if piece.text in ("then", "do"):
        return about(piece, f"there is no '{piece.text}' in URScript", "write ':'", replaced(piece, ":"))
    if not problem.starts_line and piece.kind != "word":
        return None
    _, head = problem.line_head(before.line)
    shown = re.sub(r"\s+", " ", problem.rough.text[head.start : before.end])
    hint = f"write {shown}:" if len(shown) <= 40 else None
    message = f"a ':' is missing after '{before.text}'"
    return Advice(message, hint, before.end - 1, before.end, (Edit(before.end, before.end, ":"),))
