"""What the commands of `urscript` share: their options, reading programs, showing lines."""

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from ur_hil.command_line import ExitCode
from urscript import errors
from urscript.catalogue import Catalogue, catalogue_for
from urscript.check.warnings import ScriptWarning
from urscript.source import as_utf8, program_text

STANDARD_INPUT: Final = Path("-")

Software = Annotated[
    str, typer.Option("--software", help="Software version of the robot, e.g. 3.15 or 5.11.")
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document instead of text, for editors.")]


def catalogue_of(software: str) -> Catalogue:
    """The builtins of a software version named on the command line."""
    try:
        return catalogue_for(software)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def shown_name(file: Path) -> str:
    """The name of a program in messages."""
    return "<stdin>" if file == STANDARD_INPUT else str(file)


def read_program(file: Path) -> str:
    """A program as bytes are on the wire; a byte order mark is dropped."""
    try:
        content = sys.stdin.buffer.read() if file == STANDARD_INPUT else file.read_bytes()
        return program_text(content, shown_name(file))
    except OSError as error:
        typer.echo(f"cannot read {file}: {error.strerror}", err=True)
    except ValueError as error:
        typer.echo(str(error), err=True)
    raise typer.Exit(ExitCode.WRONG_USAGE)


def echo_json(**document: Any) -> None:
    """One document on standard output."""
    typer.echo(json.dumps(document, indent=2, ensure_ascii=False))


def show(text: str, *, error: bool = False) -> None:
    """Print a line of a running program; a closed pipe (`| head`) ends the run."""
    try:
        typer.echo(as_utf8(text), err=error)
    except BrokenPipeError:
        # Python would complain again when it closes the stream at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


# --- errors and warnings as plain records: `urscript check --json` --------------------------------------

ERROR_CODES: Final[dict[type[errors.ScriptError], str]] = {
    errors.ScriptSyntaxError: "E101",
    errors.ScriptLexerError: "E102",
    errors.ScriptNameError: "E103",
    errors.ScriptTypeError: "E104",
    errors.ScriptContextError: "E105",
    errors.ScriptRuntimeError: "E201",
}
"""The stable codes of errors; those of warnings are in `check.warnings`."""


def diagnostic_of(error: errors.ScriptError, file: str) -> dict[str, Any]:
    """An error or warning about a program in `file`, with its place.

    Lines and columns count from 1 and columns count bytes, as in a controller's messages; `end_column` is the
    one after the last character.
    """
    if isinstance(error, ScriptWarning):
        severity, code = "warning", error.rule.code
        end_line, end_column = error.span.end_line, error.span.end_column
    else:
        severity, code = "error", ERROR_CODES.get(type(error), "E100")
        end_line, end_column = error.line, error.column + error.width
    return {
        "file": file,
        "line": error.line,
        "column": error.column,
        "end_line": end_line,
        "end_column": end_column,
        "severity": severity,
        "code": code,
        "message": as_utf8(error.message),
        "hint": as_utf8(error.hint) if error.hint else None,
    }
