"""Rules for statements: words and symbols of other languages, misplaced assignments, missing values."""

from __future__ import annotations

import re
from typing import Final

from urscript.advice.problem import Advice, Edit, Problem, advice_at, replacement
from urscript.advice.words import OPERATORS, RESERVED, STATEMENTS, WORD_OPERATORS

_COMPARES: Final = frozenset({"==", "!=", "<", ">", "<=", ">="})
_CONDITIONS: Final = frozenset({"if", "elif", "while"})


def foreign_statement(problem: Problem) -> Advice | None:
    """`for i in range(3):`, `elseif x:`, `function f():` and the like."""
    lines = {problem.token.line, problem.previous.line if problem.starts_line else problem.token.line}
    for line in sorted(lines):
        index, head = problem.line_head(line)
        word = STATEMENTS.get(head.text)
        if word is None or index > problem.index or problem.tokenized.tokens[index + 1].text == "=":
            continue
        if word.new and not word.new.endswith(":"):
            edit = replacement(head, word.new)
        else:
            end = problem.tokenized.line_start(line) + len(problem.tokenized.line(line))
            edit = Edit(head.start, end, word.new.ljust(end - head.start))
        message = f"there is no '{head.text}' in URScript"
        return advice_at(head, message, word.hint, edit, exact=word.exact)
    return None


def reserved_word(problem: Problem) -> Advice | None:
    """`end = 3`, `textmsg(run)`: a reserved word as a name."""
    token, before = problem.token, problem.previous
    if token.text == "=" and before.text in RESERVED and before.line == token.line:
        word = before
    elif token.text in RESERVED and not problem.starts_line and problem.accepts("NAME"):
        word = token
    elif before.text == "run" and before.line == token.line and token.kind == "symbol":
        word = before
    else:
        return None
    message = f"'{word.text}' is a reserved word and cannot be a name"
    hint = f"choose another name, for example my_{word.text}"
    return advice_at(word, message, hint, replacement(word, "_" * len(word.text)), exact=False)


def augmented_assignment(problem: Problem) -> Advice | None:
    """`i += 1`."""
    token, operator = problem.token, problem.previous
    if token.text != "=" or operator.text not in ("+", "-", "*", "/", "%") or operator.end != token.start:
        return None
    variable = problem.neighbor(-2)
    name = variable.text if variable.kind == "word" else "x"
    message, hint = (
        f"there is no '{operator.text}=' in URScript",
        f"write {name} = {name} {operator.text} ...",
    )
    edit = Edit(operator.start, token.end, f"= {name} {operator.text}")
    return advice_at(operator, message, hint, edit, last=token)


def assignment_in_expression(problem: Problem) -> Advice | None:
    """`if x = 1:`, `a = b = 1`, `a := 1`, `a === b`."""
    token, before = problem.token, problem.previous
    if token.text != "=":
        return None
    if before.text == ":" or before.text in _COMPARES:
        sign, new = (":=", "=") if before.text == ":" else (f"{before.text}=", before.text)
        edit = replacement(before, new, token)
        return advice_at(before, f"there is no '{sign}' in URScript", f"write {new}", edit, last=token)
    if problem.line_head(token.line)[1].text in _CONDITIONS:
        return advice_at(token, "'=' assigns; it does not compare", "write ==", replacement(token, "=="))
    if problem.accepts("WHILE"):
        message = "an assignment has no value"
        return advice_at(token, message, "write two assignments", replacement(token, "=="))
    return None


def colon_assignment(problem: Problem) -> Advice | None:
    """`a := 1`."""
    token, following = problem.token, problem.following
    if token.text != ":" or following.text != "=" or following.start != token.end:
        return None
    edit = replacement(token, "=", following)
    return advice_at(token, "there is no ':=' in URScript", "write =", edit, last=following)


def comparison_chain(problem: Problem) -> Advice | None:
    """`0 < x < 2`."""
    token, middle = problem.token, problem.previous
    if token.text not in _COMPARES or middle.text in _COMPARES or not problem.accepts("AND"):
        return None
    name = middle.text if middle.kind in ("word", "number") else "x"
    edit = Edit(token.start, token.start, f"and {name} ")
    hint = f"write ... and {name} {token.text} ..."
    return advice_at(token, "comparisons cannot be chained", hint, edit, exact=name == middle.text)


def foreign_operator(problem: Problem) -> Advice | None:
    """`2 ** 3`, `a <> b`, `a => b`."""
    token, before = problem.token, problem.previous
    both = before.text + token.text
    if before.end != token.start or both not in OPERATORS:
        return None
    new, hint = OPERATORS[both]
    return advice_at(
        before, f"there is no '{both}' in URScript", hint, replacement(before, new, token), last=token
    )


def word_operator(problem: Problem) -> Advice | None:
    """`x is None`, `1 in x`."""
    token = problem.token
    if problem.starts_line or token.text not in WORD_OPERATORS:
        return None
    new, hint = WORD_OPERATORS[token.text]
    message = f"there is no '{token.text}' in URScript"
    return advice_at(token, message, hint, replacement(token, new), exact=token.text != "in")


def conditional_expression(problem: Problem) -> Advice | None:
    """`x = 1 if y else 2`."""
    token = problem.token
    if token.text != "else" or problem.starts_line:
        return None
    line, start = problem.tokenized.line(token.line), problem.tokenized.line_start(token.line)
    found = re.search(r"\bif\b", line)
    if found is None or problem.line_head(token.line)[1].text in _CONDITIONS:
        return None
    edit = Edit(start + found.start(), start + len(line), " " * (len(line) - found.start()))
    message, hint = "URScript has no conditional expressions", "write if ...: x = a else: x = b end"
    return Advice(message, hint, start + found.start(), start + found.end(), (edit,))


def lambda_expression(problem: Problem) -> Advice | None:
    """`f = lambda x: x`."""
    start = problem.line_head(problem.token.line)[0]
    for token in problem.tokenized.tokens[start : problem.index]:
        if token.text == "lambda":
            end = problem.tokenized.line_start(token.line) + len(problem.tokenized.line(token.line))
            edit = Edit(token.start, end, "0".ljust(end - token.start))
            return advice_at(token, "there is no 'lambda' in URScript", "write a def", edit, exact=False)
    return None


def function_head(problem: Problem) -> Advice | None:
    """`def f:`, `def f() -> int:`, `thread t(x):`, `run t(1)`."""
    token, before, tokenized = problem.token, problem.previous, problem.tokenized
    line_end = tokenized.line_start(token.line) + len(tokenized.line(token.line).rstrip())
    if token.text == "-" and problem.following.text == ">":
        edit = Edit(token.start, line_end, ":".ljust(line_end - token.start))
        return advice_at(token, "a function has no return type", "remove it", edit, last=problem.following)
    word = problem.neighbor(-2).text
    if token.text in (":", "{") and word in ("def", "thread", "sec"):
        message, hint = (
            "a definition needs parentheses, also without parameters",
            f"write {word} {before.text}():",
        )
        return advice_at(before, message, hint, Edit(before.end, before.end, "()"))
    head = problem.line_head(token.line)[1].text
    if token.text == ":" and head == "def" and problem.accepts("COMMA", "RPAR"):
        edit = replacement(token, " ", problem.following)
        return advice_at(token, "a parameter has no type", "remove it", edit, last=problem.following)
    if before.text == "(" and problem.neighbor(-3).text in ("thread", "run") and token.text != ")":
        close = tokenized.text.find(")", token.start, line_end)
        edit = Edit(token.start, max(close, token.end), " ")
        hint = "pass values in global variables"
        return advice_at(token, "a thread takes no parameters", hint, edit, exact=False)
    return None


def missing_value(problem: Problem) -> Advice | None:
    """`x = ` at the end of a line, `y = 1 +`."""
    token, before = problem.token, problem.previous
    if not problem.accepts("RUN", "NAME") or problem.accepts("WHILE"):
        return None
    if not problem.starts_line and token.text not in RESERVED:
        return None
    what = "a value" if problem.accepts("RUN") else "a name"
    message = f"{what} is missing after '{before.text}'"
    return Advice(
        message, None, before.end - 1, before.end, (Edit(before.end, before.end, " 0"),), exact=False
    )
