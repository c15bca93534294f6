"""Rules for statements: words and signs of other languages, assignments that are none, missing values."""

from __future__ import annotations

import re
from typing import Final

from urscript.advice.problem import Advice, Edit, Problem, about, replaced
from urscript.advice.words import OPERATORS, RESERVED, STATEMENTS, WORD_OPERATORS

_COMPARES: Final = frozenset({"==", "!=", "<", ">", "<=", ">="})
_CONDITIONS: Final = frozenset({"if", "elif", "while"})


def foreign_statement(problem: Problem) -> Advice | None:
    """`for i in range(3):`, `elseif x:`, `function f():` and the like."""
    lines = {problem.at.line, problem.before.line if problem.starts_line else problem.at.line}
    for line in sorted(lines):
        index, head = problem.line_head(line)
        word = STATEMENTS.get(head.text)
        if word is None or index > problem.index or problem.rough.pieces[index + 1].text == "=":
            continue
        if word.new and not word.new.endswith(":"):
            edit = replaced(head, word.new)
        else:
            end = problem.rough.line_start(line) + len(problem.rough.line(line))
            edit = Edit(head.start, end, word.new.ljust(end - head.start))
        message = f"there is no '{head.text}' in URScript"
        return about(head, message, word.hint, edit, sure=word.sure)
    return None


def reserved_word(problem: Problem) -> Advice | None:
    """`end = 3`, `textmsg(run)`: a word of the language as a name."""
    piece, before = problem.at, problem.before
    if piece.text == "=" and before.text in RESERVED and before.line == piece.line:
        word = before
    elif piece.text in RESERVED and not problem.starts_line and problem.accepts("NAME"):
        word = piece
    elif before.text == "run" and before.line == piece.line and piece.kind == "sign":
        word = before
    else:
        return None
    message = f"'{word.text}' is a reserved word and cannot be a name"
    hint = f"choose another name, for example my_{word.text}"
    return about(word, message, hint, replaced(word, "_" * len(word.text)), sure=False)


def in_place(problem: Problem) -> Advice | None:
    """`i += 1`."""
    piece, operator = problem.at, problem.before
    if piece.text != "=" or operator.text not in ("+", "-", "*", "/", "%") or operator.end != piece.start:
        return None
    variable = problem.piece(-2)
    name = variable.text if variable.kind == "word" else "x"
    message, hint = (
        f"there is no '{operator.text}=' in URScript",
        f"write {name} = {name} {operator.text} ...",
    )
    edit = Edit(operator.start, piece.end, f"= {name} {operator.text}")
    return about(operator, message, hint, edit, last=piece)


def assignment_as_value(problem: Problem) -> Advice | None:
    """`if x = 1:`, `a = b = 1`, `a := 1`, `a === b`."""
    piece, before = problem.at, problem.before
    if piece.text != "=":
        return None
    if before.text == ":" or before.text in _COMPARES:
        sign, new = (":=", "=") if before.text == ":" else (f"{before.text}=", before.text)
        edit = replaced(before, new, piece)
        return about(before, f"there is no '{sign}' in URScript", f"write {new}", edit, last=piece)
    if problem.line_head(piece.line)[1].text in _CONDITIONS:
        return about(piece, "'=' assigns; it does not compare", "write ==", replaced(piece, "=="))
    if problem.accepts("WHILE"):
        message = "an assignment has no value"
        return about(piece, message, "write two assignments", replaced(piece, "=="))
    return None


def walrus(problem: Problem) -> Advice | None:
    """`a := 1`."""
    piece, following = problem.at, problem.after
    if piece.text != ":" or following.text != "=" or following.start != piece.end:
        return None
    edit = replaced(piece, "=", following)
    return about(piece, "there is no ':=' in URScript", "write =", edit, last=following)


def comparison_chain(problem: Problem) -> Advice | None:
    """`0 < x < 2`."""
    piece, middle = problem.at, problem.before
    if piece.text not in _COMPARES or middle.text in _COMPARES or not problem.accepts("AND"):
        return None
    name = middle.text if middle.kind in ("word", "number") else "x"
    edit = Edit(piece.start, piece.start, f"and {name} ")
    hint = f"write ... and {name} {piece.text} ..."
    return about(piece, "comparisons cannot be chained", hint, edit, sure=name == middle.text)


def doubled_operator(problem: Problem) -> Advice | None:
    """`2 ** 3`, `a <> b`, `a => b`."""
    piece, before = problem.at, problem.before
    both = before.text + piece.text
    if before.end != piece.start or both not in OPERATORS:
        return None
    new, hint = OPERATORS[both]
    return about(before, f"there is no '{both}' in URScript", hint, replaced(before, new, piece), last=piece)


def word_operator(problem: Problem) -> Advice | None:
    """`x is None`, `1 in x`."""
    piece = problem.at
    if problem.starts_line or piece.text not in WORD_OPERATORS:
        return None
    new, hint = WORD_OPERATORS[piece.text]
    message = f"there is no '{piece.text}' in URScript"
    return about(piece, message, hint, replaced(piece, new), sure=piece.text != "in")


def value_with_if(problem: Problem) -> Advice | None:
    """`x = 1 if y else 2`."""
    piece = problem.at
    if piece.text != "else" or problem.starts_line:
        return None
    line, start = problem.rough.line(piece.line), problem.rough.line_start(piece.line)
    found = re.search(r"\bif\b", line)
    if found is None or problem.line_head(piece.line)[1].text in _CONDITIONS:
        return None
    edit = Edit(start + found.start(), start + len(line), " " * (len(line) - found.start()))
    message, hint = "URScript has no conditional expressions", "write if ...: x = a else: x = b end"
    return Advice(message, hint, start + found.start(), start + found.end(), (edit,))


def anonymous_function(problem: Problem) -> Advice | None:
    """`f = lambda x: x`."""
    start = problem.line_head(problem.at.line)[0]
    for piece in problem.rough.pieces[start : problem.index]:
        if piece.text == "lambda":
            end = problem.rough.line_start(piece.line) + len(problem.rough.line(piece.line))
            edit = Edit(piece.start, end, "0".ljust(end - piece.start))
            return about(piece, "there is no 'lambda' in URScript", "write a def", edit, sure=False)
    return None


def function_head(problem: Problem) -> Advice | None:
    """`def f:`, `def f() -> int:`, `thread t(x):`, `run t(1)`."""
    piece, before, rough = problem.at, problem.before, problem.rough
    line_end = rough.line_start(piece.line) + len(rough.line(piece.line).rstrip())
    if piece.text == "-" and problem.after.text == ">":
        edit = Edit(piece.start, line_end, ":".ljust(line_end - piece.start))
        return about(piece, "a function has no return type", "remove it", edit, last=problem.after)
    word = problem.piece(-2).text
    if piece.text in (":", "{") and word in ("def", "thread", "sec"):
        message, hint = (
            "a definition needs parentheses, also without parameters",
            f"write {word} {before.text}():",
        )
        return about(before, message, hint, Edit(before.end, before.end, "()"))
    head = problem.line_head(piece.line)[1].text
    if piece.text == ":" and head == "def" and problem.accepts("COMMA", "RPAR"):
        edit = replaced(piece, " ", problem.after)
        return about(piece, "a parameter has no type", "remove it", edit, last=problem.after)
    if before.text == "(" and problem.piece(-3).text in ("thread", "run") and piece.text != ")":
        close = rough.text.find(")", piece.start, line_end)
        edit = Edit(piece.start, max(close, piece.end), " ")
        hint = "pass values in global variables"
        return about(piece, "a thread takes no parameters", hint, edit, sure=False)
    return None


def missing_value(problem: Problem) -> Advice | None:
    """`x = ` at the end of a line, `y = 1 +`."""
    piece, before = problem.at, problem.before
    if not problem.accepts("RUN", "NAME") or problem.accepts("WHILE"):
        return None
    if not problem.starts_line and piece.text not in RESERVED:
        return None
    what = "a value" if problem.accepts("RUN") else "a name"
    message = f"{what} is missing after '{before.text}'"
    return Advice(
        message, None, before.end - 1, before.end, (Edit(before.end, before.end, " 0"),), sure=False
    )
