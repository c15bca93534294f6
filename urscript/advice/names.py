"""Hints for names and arguments that other languages know and URScript does not."""

from __future__ import annotations

import re

from urscript.advice.words import KEYWORDS, NAMES, STATEMENTS, TYPES
from urscript.errors import ScriptCompileError, ScriptNameError, ScriptTypeError


def with_hint(error: ScriptCompileError) -> ScriptCompileError:
    """Improve the hint and the place of an error where possible; returns the same error."""
    text = error.source.line(error.line) if error.source else ""
    if isinstance(error, ScriptNameError):
        error.hint = _hint_for_name(error.name, text, error.column) or error.hint
    elif isinstance(error, ScriptTypeError):
        _point_at_keyword(error, text)
    return error


def concerns_whole_line(error: ScriptCompileError) -> bool:
    """Whether the error concerns all of its line, so that other errors in it are consequences."""
    text = error.source.line(error.line).lstrip() if error.source else ""
    head = re.match(r"\w*", text)
    return text.startswith("--") or (head is not None and head[0] in STATEMENTS.keys() | TYPES)


def _hint_for_name(name: str, text: str, column: int) -> str | None:
    rest = text[column - 1 + len(name) :]
    if text.lstrip().startswith("--"):
        return "a comment begins with '#'"
    if name in TYPES and (variable := re.match(r"\s+([A-Za-z_]\w*)\s*=", rest)):
        return f"URScript has no type declarations: write {variable[1]} = ..."
    if name in ("math", "np") and (function := re.match(r"\.(\w+)\s*\(", rest)):
        return f"mathematical functions have no prefix: write {function[1]}(...)"
    if name in STATEMENTS and not text[: column - 1].strip():
        return STATEMENTS[name].hint
    return NAMES.get(name)


def _point_at_keyword(error: ScriptTypeError, text: str) -> None:
    """Underline the argument that does not exist instead of the call."""
    unknown = re.search(r"unexpected keyword argument '(\w+)'", error.message)
    if unknown is None:
        return
    place = re.compile(rf"\b{unknown[1]}\s*=(?!=)").search(text, error.column - 1)
    if place is not None:
        error.column, error.width = place.start() + 1, len(unknown[1])
    signature = error.hint or ""
    parameter = KEYWORDS.get(unknown[1].lower(), unknown[1].lower())
    if re.search(rf"[(,]\s*{parameter}\b", signature):
        error.hint = f"write {parameter}=, {signature}"
