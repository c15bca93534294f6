"""Rules for characters and numbers without meaning in URScript."""

from __future__ import annotations

import re

from urscript.advice.problem import Advice, Edit, Problem, advice_at, replacement
from urscript.advice.words import INVISIBLE, SYMBOLS
from urscript.source import as_utf8
from urscript.values import to_script_text

_DIVISION_AFTER = re.compile(r"//(\d|\(|\w| \d)")
_VALUE_BEFORE = re.compile(r"=.*[\w)\]]\s*$")


def comment(problem: Problem) -> Advice | None:
    """`// text`, `/* text */`: comments of other languages, and the division of whole numbers."""
    text, start = problem.tokenized.text, problem.tokenized.line_start(problem.token.line)
    found = re.compile(r"//|/\*").search(text, start, problem.token.start + 2)
    if found is None:
        return None
    lead = text[start : found.start()]
    if lead.count('"') % 2 or "#" in lead:
        return None
    if found[0] == "/*":
        end = text.find("*/", found.end()) + 2
        end = len(text) if end < found.end() else end
        edit = Edit(found.start(), end, re.sub(r"[^\n]", " ", text[found.start() : end]))
        hint = "begin each line of a comment with '#'"
    elif _VALUE_BEFORE.search(lead) and _DIVISION_AFTER.match(text, found.start()):
        edit = Edit(found.start(), found.end(), "/ ")
        hint = "write floor(a / b)"
    else:
        edit = Edit(found.start(), found.end(), "# ")
        hint = "a comment begins with '#'"
    message = f"there is no '{found[0]}' in URScript"
    return Advice(message, hint, found.start(), found.end(), (edit,))


def quotes(problem: Problem) -> Advice | None:
    """Strings between other quotation marks than `"`."""
    token = problem.token
    mark = as_utf8(token.text)
    if SYMBOLS.get(mark, ("", ""))[0] != '"':
        return None
    marks = "|".join(re.escape(to_script_text(sign)) for sign, (new, _) in SYMBOLS.items() if new == '"')
    start, line = problem.tokenized.line_start(token.line), problem.tokenized.line(token.line)
    edits = [
        Edit(start + match.start(), start + match.end(), '"'.ljust(len(match[0])))
        for match in re.finditer(marks, line)
    ]
    return advice_at(token, f"{mark} does not delimit a string", SYMBOLS[mark][1], *edits)


def symbol(problem: Problem) -> Advice | None:
    """Symbols of other languages, and those that editors insert."""
    token, last = problem.token, problem.token
    if problem.error.unexpected or token.kind != "symbol":
        return None
    written = as_utf8(token.text)
    if token.text + problem.following.text in SYMBOLS and problem.following.start == token.end:
        last = problem.following
        written = token.text + last.text
    if written not in SYMBOLS:
        message = f"unexpected character '{written}'"
        return advice_at(token, message, None, replacement(token, " "), exact=False)
    new, hint = SYMBOLS[written]
    if written == "{" and problem.previous.text == ":":
        new = " "
    edit = replacement(token, f" {new} " if new.isalpha() else new, last)
    what = (
        f"unexpected {INVISIBLE[written]}" if written in INVISIBLE else f"there is no '{written}' in URScript"
    )
    return advice_at(token, what, hint, edit, last=last)


def number(problem: Problem) -> Advice | None:
    """Malformed numbers: hexadecimal, with units, with two points."""
    token, following = problem.token, problem.following
    if problem.error.unexpected or token.kind != "number":
        return None
    text = token.text
    if following.start == token.end and as_utf8(following.text) == "\u00b0":
        edit = replacement(following, " ")
        return advice_at(following, "there is no '\u00b0' in URScript", f"write d2r({text})", edit)
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,8}", text):
        value = int(text, 16)
        message, hint = (
            f"URScript has no hexadecimal numbers, got {text}",
            f'write {value} or to_num("{text}")',
        )
        return advice_at(token, message, hint, replacement(token, str(value)))
    unit = re.fullmatch(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)([A-Za-z]\w*)", text)
    if unit:
        hint = f"write {unit[1]} alone: lengths are in m, times in s, angles in rad"
        return advice_at(token, f"a number has no unit, got {text}", hint, replacement(token, unit[1]))
    return advice_at(token, f"malformed number {text}", None, replacement(token, "0"), exact=False)


def unterminated_string(problem: Problem) -> Advice | None:
    """A string without its closing quote."""
    token = problem.token
    if problem.error.unexpected or token.kind != "string" or token.text.count('"') != 1:
        return None
    text = token.text.rstrip()
    n_open = len(problem.open_brackets())
    while n_open and text.endswith(")"):
        text, n_open = text[:-1], n_open - 1
    end = token.start + len(text)
    return advice_at(
        token, "unterminated string: no closing '\"'", "close it on the same line", Edit(end, end, '"')
    )


def pose_elements(problem: Problem) -> Advice | None:
    """`p[x, y, z, rx, ry]`: a pose without exactly six elements."""
    letter, bracket = problem.token, problem.following
    if problem.error.unexpected or letter.text != "p" or bracket.text != "[":
        return None
    depth, n_parts = 0, 1
    for token in problem.tokenized.tokens[problem.index + 1 :]:
        depth += (token.text in ("(", "[")) - (token.text in (")", "]"))
        n_parts += token.text == "," and depth == 1
        if depth == 0:
            message = f"a pose has 6 elements, not {n_parts}"
            filling = ", 0" * (6 - n_parts)
            edits = (Edit(token.start, token.start, filling),) if n_parts < 6 else ()
            return advice_at(letter, message, "write p[x, y, z, rx, ry, rz]", *edits, last=token)
    return None
