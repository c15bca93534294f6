"""Rules for blocks; the indentation shows where an `end` is missing or superfluous."""

from __future__ import annotations

import re
from typing import NamedTuple

from urscript.advice.problem import Advice, Edit, Problem, advice_at, replacement
from urscript.advice.tokens import Token, TokenizedText
from urscript.advice.words import BLOCK_ENDS, WORDS_AFTER_END

_OPENERS = frozenset({"def", "sec", "thread", "if", "while"})
_BRANCHES = frozenset({"else", "elif"})


class _Opener(NamedTuple):
    token: Token
    indent: int


def foreign_end(problem: Problem) -> Advice | None:
    """`endif`, `end if`: ends of other languages, anywhere above the error."""
    tokenized = problem.tokenized
    if not problem.starts_line:
        return None
    for index, token in enumerate(tokenized.tokens[: problem.index]):
        if not tokenized.is_first(index) or token.kind != "word":
            continue
        second, third = (
            tokenized.tokens[index + 1],
            tokenized.tokens[min(index + 2, len(tokenized.tokens) - 1)],
        )
        if token.text in BLOCK_ENDS and _is_elsewhere(second, token):
            return advice_at(
                token, f"there is no '{token.text}' in URScript", "write end", replacement(token, "end")
            )
        alone = not _is_elsewhere(second, token) and _is_elsewhere(third, token)
        if token.text == "end" and second.text in WORDS_AFTER_END and alone:
            message = f"a block ends with 'end', not 'end {second.text}'"
            return advice_at(token, message, "write end", replacement(second, " "), last=second)
    return None


def _is_elsewhere(token: Token, other: Token) -> bool:
    return token.line != other.line or token.kind == "end"


def missing_end(problem: Problem) -> Advice | None:
    """The text ends inside a block."""
    if problem.error.unexpected != "$END" or problem.open_brackets():
        return None
    found = _unclosed(problem.tokenized)
    if found is None:
        return None
    opener, index = found
    message = f"this '{opener.token.text}' has no 'end'"
    following = problem.tokenized.tokens[index]
    if following.kind == "end":
        edit = Edit(following.end, following.end, f"\n{' ' * opener.indent}end")
        return advice_at(opener.token, message, "add 'end' at the end of the program", edit)
    # After the last token before it: there it moves no other token and is not in a comment.
    last = problem.tokenized.tokens[index - 1]
    hint = f"it seems to belong before line {following.line}"
    return advice_at(opener.token, message, hint, Edit(last.end, last.end, " end"))


def _unclosed(tokenized: TokenizedText) -> tuple[_Opener, int] | None:
    """The block that has no end, and the index of the token before which it is missing.

    A statement that is indented no deeper than an open block shows that the block should have ended.
    """
    stack: list[_Opener] = []
    for index, token in enumerate(tokenized.tokens):
        if tokenized.is_first(index) and stack and token.kind == "word":
            indent, top = tokenized.indent(token.line), stack[-1]
            may_follow = token.text == "end" or token.text in _BRANCHES
            if indent < top.indent or (indent == top.indent and not may_follow):
                return top, index
        if token.kind == "word" and token.text in _OPENERS:
            stack.append(_Opener(token, tokenized.indent(token.line)))
        elif token.text == "end" and stack:
            stack.pop()
    return (stack[-1], len(tokenized.tokens) - 1) if stack else None


def extra_end(problem: Problem) -> Advice | None:
    """There are more `end`s than blocks."""
    wrong, tokenized = problem.token, problem.tokenized
    if wrong.text != "end" or problem.accepts("END") or not problem.accepts("WHILE", "$END"):
        return None
    stack: list[_Opener] = []
    for index, token in enumerate(tokenized.tokens[: problem.index]):
        if token.kind == "word" and token.text in _OPENERS:
            stack.append(_Opener(token, tokenized.indent(token.line)))
        elif token.text == "end" and stack:
            opener = stack.pop()
            if tokenized.is_first(index) and tokenized.indent(token.line) != opener.indent:
                wrong = token
                break
    return advice_at(wrong, "this 'end' has no block", "remove it", replacement(wrong, " "))


def else_if(problem: Problem) -> Advice | None:
    """`else if x:`."""
    token, before = problem.token, problem.previous
    if token.text != "if" or before.text != "else" or problem.starts_line:
        return None
    edit = replacement(before, "elif", token)
    return advice_at(before, "there is no 'else if' in URScript", "write elif", edit, last=token)


def missing_colon(problem: Problem) -> Advice | None:
    """`if x == 1` and no colon before the next statement."""
    token, before = problem.token, problem.previous
    if not problem.accepts("COLON"):
        return None
    if token.text in ("then", "do"):
        return advice_at(
            token, f"there is no '{token.text}' in URScript", "write ':'", replacement(token, ":")
        )
    if not problem.starts_line and token.kind != "word":
        return None
    _, head = problem.line_head(before.line)
    shown = re.sub(r"\s+", " ", problem.tokenized.text[head.start : before.end])
    hint = f"write {shown}:" if len(shown) <= 40 else None
    message = f"a ':' is missing after '{before.text}'"
    return Advice(message, hint, before.end - 1, before.end, (Edit(before.end, before.end, ":"),))
