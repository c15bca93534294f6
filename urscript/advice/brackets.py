"""Rules for brackets and commas: what is open, what closes nothing, what is missing in between."""

from __future__ import annotations

from urscript.advice.problem import Advice, Edit, Problem, about, replaced
from urscript.advice.rough_tokens import CLOSERS, PAIRS, Piece
from urscript.advice.words import RESERVED

_VALUE_WORDS = frozenset({"True", "False", "true", "false", "None", "not", "run"})


def closes_nothing(problem: Problem) -> Advice | None:
    """`textmsg(1))`, `[1, 2)`."""
    piece = problem.at
    if piece.text not in CLOSERS:
        return None
    brackets = problem.open_brackets()
    if not brackets:
        message = f"this '{piece.text}' has no '{CLOSERS[piece.text]}'"
        return about(piece, message, "remove it", replaced(piece, " "))
    opener = brackets[-1]
    right = PAIRS[opener.text]
    if right == piece.text:
        return None
    if len(brackets) > 1 and PAIRS[brackets[-2].text] == piece.text:
        message = f"this '{opener.text}' is never closed"
        return about(
            opener, message, f"write {right} before {piece.text}", Edit(piece.start, piece.start, right)
        )
    line, column = problem.rough.place(opener.start)
    message = f"'{piece.text}' does not close the '{opener.text}' of {line}:{column}"
    return about(piece, message, f"write {right}", replaced(piece, right))


def never_closed(problem: Problem) -> Advice | None:
    """A bracket that is still open where the next statement begins."""
    brackets = problem.open_brackets()
    if not brackets:
        return None
    opener, last = brackets[-1], problem.before
    message = f"this '{opener.text}' is never closed"
    comma = problem.piece(-2)
    if problem.at.text == "=" and opener.text == "[" and last.kind == "word" and comma.text == ",":
        return about(opener, message, f"write ] before ', {last.text}='", Edit(comma.start, comma.start, "]"))
    if not problem.starts_line or not problem.accepts("COMMA", "RPAR", "RSQB", "RUN"):
        return None
    missing = "".join(PAIRS[bracket.text] for bracket in reversed(brackets))
    hint = f"write {missing} at the end of line {last.line}"
    if last.text == ",":
        return about(opener, message, f"{hint}, in place of ','", replaced(last, missing))
    if last.kind == "sign" and last.text not in CLOSERS and last != opener:
        return None  # a value is missing as well: that comes first
    return about(opener, message, hint, Edit(last.end, last.end, missing))


def decimal_comma(problem: Problem) -> Advice | None:
    """`x = 0,5`."""
    before, comma, after = problem.before, problem.at, problem.after
    if comma.text != "," or before.kind != "number" or after.kind != "number":
        return None
    if before.end != comma.start or comma.end != after.start or "." in before.text + after.text:
        return None
    hint = f"write {before.text}.{after.text}"
    return about(comma, "the decimal separator is '.', not ','", hint, replaced(comma, "."))


def tuples(problem: Problem) -> Advice | None:
    """`x = (1, 2)`, `a, b = 1, 2`."""
    comma = problem.at
    if comma.text != ",":
        return None
    brackets = problem.open_brackets()
    if brackets and brackets[-1].text == "(":
        opener = brackets[-1]
        edits = [replaced(opener, "[")]
        close = _partner(problem, opener)
        if close is not None:
            edits.append(replaced(close, "]"))
        return about(opener, "a list is written in [ ]", "write [a, b]", *edits)
    index, head = problem.line_head(comma.line)
    if not brackets and head.kind == "word" and index + 1 == problem.index:
        end = problem.rough.line_start(comma.line) + len(problem.rough.line(comma.line))
        edit = Edit(head.start, end, " " * (end - head.start))
        hint = "write one assignment for each"
        return about(head, "an assignment sets one variable", hint, edit, last=comma, sure=False)
    return None


def _partner(problem: Problem, opener: Piece) -> Piece | None:
    """The bracket that closes `opener`, counting its own kind only."""
    depth = 0
    for piece in problem.rough.pieces[problem.rough.piece_at(opener.start) :]:
        depth += (piece.text == opener.text) - (piece.text == PAIRS[opener.text])
        if not depth:
            return piece
    return None


def missing_comma(problem: Problem) -> Advice | None:
    """`[1, 2 3]`, `movej(q a=1)`; and strings that end earlier than was meant."""
    piece, before = problem.at, problem.before
    if problem.starts_line or not problem.accepts("COMMA"):
        return None
    if piece.kind not in ("word", "number", "string") and piece.text not in PAIRS:
        return None
    if piece.text in RESERVED - _VALUE_WORDS:
        return None
    if before.kind == "string" and before.text.endswith('\\"'):
        start = problem.rough.line_start(piece.line)
        end = max(before.end, start + problem.rough.line(piece.line).rfind('"') + 1)
        edit = Edit(before.start, end, '""'.ljust(end - before.start))
        message, hint = 'a string cannot contain \\": it ends here', "remove the quotation marks"
        return Advice(message, hint, before.end - 2, before.end, (edit,))
    if piece.kind == "string" and before.text in ("f", "r", "b") and before.end == piece.start:
        hint = "write textmsg(text, x) or str_cat(text, x)" if before.text == "f" else "remove the letter"
        return about(before, f"a string has no prefix '{before.text}'", hint, replaced(before, " "))
    return about(piece, f"a ',' is missing before '{piece.text}'", None, Edit(before.end, before.end, ","))


def trailing_comma(problem: Problem) -> Advice | None:
    """`[1, 2,]`."""
    comma = problem.before
    if comma.text != "," or problem.at.text not in CLOSERS:
        return None
    return about(comma, "nothing follows this ','", "remove it", replaced(comma, " "))


def inside_brackets(problem: Problem) -> Advice | None:
    """`x[1:2]`, `[i for i in x]`: what cannot stand in brackets."""
    piece = problem.at
    if problem.starts_line or not problem.open_brackets() or not problem.accepts("COMMA", "RPAR", "RSQB"):
        return None
    if piece.text == ":":
        return about(piece, "URScript has no slices x[a:b] and no pairs a: b", "write a while loop")
    if piece.text == "for":
        return about(piece, "URScript has no list comprehensions", "write a while loop")
    if piece.text in ("if", "else"):
        return about(piece, "URScript has no conditional expressions", "write if ...: x = a else: x = b end")
    return None
