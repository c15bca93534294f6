"""The `urscript` command: `check` programs, `run` them without a robot.

Exit codes: 0 all is well, 1 the program is wrong or failed, 2 the command was used wrongly.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from urscript.catalogue import Catalogue, catalogue_for
from urscript.errors import ScriptCompileError
from urscript.program import ProgramStatus, check_program, compile_program
from urscript.recording_host import RecordedCall, RecordingHost
from urscript.values import str_form

app = typer.Typer(
    help="URScript without a robot.", no_args_is_help=True, add_completion=False, rich_markup_mode=None
)

_Software = Annotated[
    str, typer.Option("--software", help="Software version of the robot, e.g. 3.15 or 5.11.")
]


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(help="Programs to check.", show_default=False)],
    software: _Software = "3.15",
) -> None:
    """Show all errors of the given programs; exit 1 if there is one."""
    catalogue = _catalogue(software)
    n_errors = 0
    for file in files:
        errors, warnings = check_program(_read(file), catalogue=catalogue, name=str(file))
        n_errors += len(errors)
        for error in errors:
            typer.echo(_as_utf8(error.render()))
        for warning in warnings:
            typer.echo(_as_utf8(warning.render().replace(warning.kind, "Warning", 1)))
    if n_errors:
        raise typer.Exit(1)


@app.command()
def run(
    file: Annotated[Path, typer.Argument(help="Program to run.", show_default=False)],
    software: _Software = "3.15",
    limit: Annotated[
        float, typer.Option(help="Robot seconds after which to stop a program.", min=0.0)
    ] = 60.0,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show the texts of textmsg only.")] = False,
) -> None:
    """Run a program at full speed on a robot that only writes down what it is told."""
    catalogue = _catalogue(software)
    try:
        program = compile_program(_read(file), catalogue=catalogue, name=str(file))
    except ScriptCompileError as error:
        typer.echo(_as_utf8(error.render()), err=True)
        raise typer.Exit(1) from None
    host = RecordingHost(
        catalogue=catalogue,
        on_message=lambda text: typer.echo(_as_utf8(text)),
        on_call=None if quiet else lambda call: typer.echo(_as_utf8(_shown(call))),
    )
    running = host.run(program, max_cycles=int(limit / host.step_time))
    seconds = host.cycle * host.step_time
    if running.status is ProgramStatus.FAILED and running.error is not None:
        typer.echo(_as_utf8(running.error.render()), err=True)
        raise typer.Exit(1)
    if running.status is ProgramStatus.RUNNING:
        running.kill()
        typer.echo(f"stopped: still running after {seconds:g} s of robot time (--limit)", err=True)
    elif not quiet:
        typer.echo(f"finished after {seconds:g} s of robot time", err=True)


def main() -> None:
    """Entry point of the console script."""
    app()


def _catalogue(software: str) -> Catalogue:
    try:
        return catalogue_for(software)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _read(file: Path) -> str:
    """A program file as bytes are on the wire; a byte order mark is dropped."""
    try:
        text = file.read_bytes()
    except OSError as error:
        typer.echo(f"cannot read {file}: {error.strerror}", err=True)
        raise typer.Exit(2) from None
    return text.removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def _as_utf8(text: str) -> str:
    """Text of the program for a terminal: bytes that are UTF-8 become the characters they mean."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


def _shown(call: RecordedCall) -> str:
    seconds = call.cycle * RecordingHost.step_time
    return f"{seconds:9.3f} s  {call.thread}: {call.name}({', '.join(map(_argument, call.arguments))})"


def _argument(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str_form(value)
