"""Rules for brackets and commas: unclosed, unmatched, missing."""

from __future__ import annotations

from urscript.advice.problem import Advice, Edit, Problem, advice_at, replacement
from urscript.advice.tokens import CLOSERS, PAIRS, Token
from urscript.advice.words import RESERVED

_VALUE_WORDS = frozenset({"True", "False", "true", "false", "None", "not", "run"})


def unmatched_closer(problem: Problem) -> Advice | None:
    """`textmsg(1))`, `[1, 2)`."""
    token = problem.token
    if token.text not in CLOSERS:
        return None
    brackets = problem.open_brackets()
    if not brackets:
        message = f"this '{token.text}' has no '{CLOSERS[token.text]}'"
        return advice_at(token, message, "remove it", replacement(token, " "))
    opener = brackets[-1]
    right = PAIRS[opener.text]
    if right == token.text:
        return None
    if len(brackets) > 1 and PAIRS[brackets[-2].text] == token.text:
        message = f"this '{opener.text}' is never closed"
        return advice_at(
            opener, message, f"write {right} before {token.text}", Edit(token.start, token.start, right)
        )
    line, column = problem.tokenized.place(opener.start)
    message = f"'{token.text}' does not close the '{opener.text}' of {line}:{column}"
    return advice_at(token, message, f"write {right}", replacement(token, right))


def unclosed_bracket(problem: Problem) -> Advice | None:
    """A bracket that is still open where the next statement begins."""
    brackets = problem.open_brackets()
    if not brackets:
        return None
    opener, last = brackets[-1], problem.previous
    message = f"this '{opener.text}' is never closed"
    comma = problem.neighbor(-2)
    if problem.token.text == "=" and opener.text == "[" and last.kind == "word" and comma.text == ",":
        return advice_at(
            opener, message, f"write ] before ', {last.text}='", Edit(comma.start, comma.start, "]")
        )
    if not problem.starts_line or not problem.accepts("COMMA", "RPAR", "RSQB", "RUN"):
        return None
    missing = "".join(PAIRS[bracket.text] for bracket in reversed(brackets))
    hint = f"write {missing} at the end of line {last.line}"
    if last.text == ",":
        return advice_at(opener, message, f"{hint}, in place of ','", replacement(last, missing))
    if last.kind == "symbol" and last.text not in CLOSERS and last != opener:
        return None  # a value is missing as well: that comes first
    return advice_at(opener, message, hint, Edit(last.end, last.end, missing))


def decimal_comma(problem: Problem) -> Advice | None:
    """`x = 0,5`."""
    before, comma, after = problem.previous, problem.token, problem.following
    if comma.text != "," or before.kind != "number" or after.kind != "number":
        return None
    if before.end != comma.start or comma.end != after.start or "." in before.text + after.text:
        return None
    hint = f"write {before.text}.{after.text}"
    return advice_at(comma, "the decimal separator is '.', not ','", hint, replacement(comma, "."))


def tuples(problem: Problem) -> Advice | None:
    """`x = (1, 2)`, `a, b = 1, 2`."""
    comma = problem.token
    if comma.text != ",":
        return None
    brackets = problem.open_brackets()
    if brackets and brackets[-1].text == "(":
        opener = brackets[-1]
        edits = [replacement(opener, "[")]
        close = _partner(problem, opener)
        if close is not None:
            edits.append(replacement(close, "]"))
        return advice_at(opener, "a list is written in [ ]", "write [a, b]", *edits)
    index, head = problem.line_head(comma.line)
    if not brackets and head.kind == "word" and index + 1 == problem.index:
        end = problem.tokenized.line_start(comma.line) + len(problem.tokenized.line(comma.line))
        edit = Edit(head.start, end, " " * (end - head.start))
        hint = "write one assignment for each"
        return advice_at(head, "an assignment sets one variable", hint, edit, last=comma, exact=False)
    return None


def _partner(problem: Problem, opener: Token) -> Token | None:
    """The bracket that closes `opener`, counting its own kind only."""
    depth = 0
    for token in problem.tokenized.tokens[problem.tokenized.token_at(opener.start) :]:
        depth += (token.text == opener.text) - (token.text == PAIRS[opener.text])
        if not depth:
            return token
    return None


def missing_comma(problem: Problem) -> Advice | None:
    """`[1, 2 3]`, `movej(q a=1)`; and strings that end too early."""
    token, before = problem.token, problem.previous
    if problem.starts_line or not problem.accepts("COMMA"):
        return None
    if token.kind not in ("word", "number", "string") and token.text not in PAIRS:
        return None
    if token.text in RESERVED - _VALUE_WORDS:
        return None
    if before.kind == "string" and before.text.endswith('\\"'):
        start = problem.tokenized.line_start(token.line)
        end = max(before.end, start + problem.tokenized.line(token.line).rfind('"') + 1)
        edit = Edit(before.start, end, '""'.ljust(end - before.start))
        message, hint = 'a string cannot contain \\": it ends here', "remove the quotation marks"
        return Advice(message, hint, before.end - 2, before.end, (edit,))
    if token.kind == "string" and before.text in ("f", "r", "b") and before.end == token.start:
        hint = "write textmsg(text, x) or str_cat(text, x)" if before.text == "f" else "remove the letter"
        return advice_at(before, f"a string has no prefix '{before.text}'", hint, replacement(before, " "))
    return advice_at(
        token, f"a ',' is missing before '{token.text}'", None, Edit(before.end, before.end, ",")
    )


def trailing_comma(problem: Problem) -> Advice | None:
    """`[1, 2,]`."""
    comma = problem.previous
    if comma.text != "," or problem.token.text not in CLOSERS:
        return None
    return advice_at(comma, "nothing follows this ','", "remove it", replacement(comma, " "))


def inside_brackets(problem: Problem) -> Advice | None:
    """`x[1:2]`, `[i for i in x]`: what is not allowed in brackets."""
    token = problem.token
    if problem.starts_line or not problem.open_brackets() or not problem.accepts("COMMA", "RPAR", "RSQB"):
        return None
    if token.text == ":":
        return advice_at(token, "URScript has no slices x[a:b] and no pairs a: b", "write a while loop")
    if token.text == "for":
        return advice_at(token, "URScript has no list comprehensions", "write a while loop")
    if token.text in ("if", "else"):
        return advice_at(
            token, "URScript has no conditional expressions", "write if ...: x = a else: x = b end"
        )
    return None
