"""Rules for characters and numbers that mean nothing: what stands there, and what to write."""

from __future__ import annotations

import re

from urscript.advice.problem import Advice, Edit, Problem, about, replaced
from urscript.advice.words import INVISIBLE, SIGNS
from urscript.source import as_utf8
from urscript.values import to_script_text

_DIVISION_BEHIND = re.compile(r"//(\d|\(|\w| \d)")
_VALUE_BEFORE = re.compile(r"=.*[\w)\]]\s*$")


def comment(problem: Problem) -> Advice | None:
    """`// text`, `/* text */`: comments of other languages, and the division of whole numbers."""
    text, start = problem.rough.text, problem.rough.line_start(problem.at.line)
    found = re.compile(r"//|/\*").search(text, start, problem.at.start + 2)
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
    elif _VALUE_BEFORE.search(lead) and _DIVISION_BEHIND.match(text, found.start()):
        edit = Edit(found.start(), found.end(), "/ ")
        hint = "write floor(a / b)"
    else:
        edit = Edit(found.start(), found.end(), "# ")
        hint = "a comment begins with '#'"
    message = f"there is no '{found[0]}' in URScript"
    return Advice(message, hint, found.start(), found.end(), (edit,))


def quotes(problem: Problem) -> Advice | None:
    """Strings between other quotation marks than `"`."""
    piece = problem.at
    mark = as_utf8(piece.text)
    if SIGNS.get(mark, ("", ""))[0] != '"':
        return None
    marks = "|".join(re.escape(to_script_text(sign)) for sign, (new, _) in SIGNS.items() if new == '"')
    start, line = problem.rough.line_start(piece.line), problem.rough.line(piece.line)
    edits = [
        Edit(start + match.start(), start + match.end(), '"'.ljust(len(match[0])))
        for match in re.finditer(marks, line)
    ]
    return about(piece, f"{mark} does not delimit a string", SIGNS[mark][1], *edits)


def sign(problem: Problem) -> Advice | None:
    """Signs of other languages, and those that editors put in."""
    piece, last = problem.at, problem.at
    if problem.error.unexpected or piece.kind != "sign":
        return None
    spelt = as_utf8(piece.text)
    if piece.text + problem.after.text in SIGNS and problem.after.start == piece.end:
        last = problem.after
        spelt = piece.text + last.text
    if spelt not in SIGNS:
        message = f"unexpected character '{spelt}'"
        return about(piece, message, None, replaced(piece, " "), sure=False)
    new, hint = SIGNS[spelt]
    if spelt == "{" and problem.before.text == ":":
        new = " "
    edit = replaced(piece, f" {new} " if new.isalpha() else new, last)
    what = f"unexpected {INVISIBLE[spelt]}" if spelt in INVISIBLE else f"there is no '{spelt}' in URScript"
    return about(piece, what, hint, edit, last=last)


def number(problem: Problem) -> Advice | None:
    """Numbers that are none: hexadecimal ones, units, two points."""
    piece, following = problem.at, problem.after
    if problem.error.unexpected or piece.kind != "number":
        return None
    text = piece.text
    if following.start == piece.end and as_utf8(following.text) == "\u00b0":
        edit = replaced(following, " ")
        return about(following, "there is no '\u00b0' in URScript", f"write d2r({text})", edit)
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,8}", text):
        value = int(text, 16)
        message, hint = (
            f"URScript has no hexadecimal numbers, got {text}",
            f'write {value} or to_num("{text}")',
        )
        return about(piece, message, hint, replaced(piece, str(value)))
    unit = re.fullmatch(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)([A-Za-z]\w*)", text)
    if unit:
        hint = f"write {unit[1]} alone: lengths are in m, times in s, angles in rad"
        return about(piece, f"a number has no unit, got {text}", hint, replaced(piece, unit[1]))
    return about(piece, f"malformed number {text}", None, replaced(piece, "0"), sure=False)


def open_string(problem: Problem) -> Advice | None:
    """A string without its closing quote."""
    piece = problem.at
    if problem.error.unexpected or piece.kind != "string" or piece.text.count('"') != 1:
        return None
    text = piece.text.rstrip()
    n_open = len(problem.open_brackets())
    while n_open and text.endswith(")"):
        text, n_open = text[:-1], n_open - 1
    end = piece.start + len(text)
    return about(
        piece, "unterminated string: no closing '\"'", "close it on the same line", Edit(end, end, '"')
    )


def pose_parts(problem: Problem) -> Advice | None:
    """`p[x, y, z, rx, ry]`: a pose of another number of parts than six."""
    letter, bracket = problem.at, problem.after
    if problem.error.unexpected or letter.text != "p" or bracket.text != "[":
        return None
    depth, n_parts = 0, 1
    for piece in problem.rough.pieces[problem.index + 1 :]:
        depth += (piece.text in ("(", "[")) - (piece.text in (")", "]"))
        n_parts += piece.text == "," and depth == 1
        if depth == 0:
            message = f"a pose has 6 elements, not {n_parts}"
            filling = ", 0" * (6 - n_parts)
            edits = (Edit(piece.start, piece.start, filling),) if n_parts < 6 else ()
            return about(letter, message, "write p[x, y, z, rx, ry, rz]", *edits, last=piece)
    return None
