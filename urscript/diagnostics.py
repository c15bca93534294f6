"""Errors and warnings as plain records, for editors and other programs: `urscript check --json`."""

from __future__ import annotations

from typing import Final, NamedTuple

from urscript.errors import (
    ScriptContextError,
    ScriptError,
    ScriptLexerError,
    ScriptNameError,
    ScriptRuntimeError,
    ScriptSyntaxError,
    ScriptTypeError,
)
from urscript.lint.rules import ScriptWarning
from urscript.source import as_utf8

ERROR_CODES: Final[dict[type[ScriptError], str]] = {
    ScriptSyntaxError: "E101",
    ScriptLexerError: "E102",
    ScriptNameError: "E103",
    ScriptTypeError: "E104",
    ScriptContextError: "E105",
    ScriptRuntimeError: "E201",
}
"""The stable codes of errors; those of warnings are in `lint.rules`."""


class Diagnostic(NamedTuple):
    """An error or warning about a program, with its place.

    Lines and columns count from 1 and columns count bytes, as in a controller's messages; `end_column` is the
    one after the last character.
    """

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    severity: str
    code: str
    message: str
    hint: str | None


def diagnostic_of(error: ScriptError, file: str) -> Diagnostic:
    """The record of an error or warning in `file`."""
    if isinstance(error, ScriptWarning):
        severity, code = "warning", error.rule.code
        end_line, end_column = error.span.end_line, error.span.end_column
    else:
        severity, code = "error", ERROR_CODES.get(type(error), "E100")
        end_line, end_column = error.line, error.column + error.width
    hint = as_utf8(error.hint) if error.hint else None
    return Diagnostic(
        file, error.line, error.column, end_line, end_column, severity, code, as_utf8(error.message), hint
    )
