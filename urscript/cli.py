"""The `urscript` command: `check` programs, `run` them without a robot, lay them out (`fmt`).

Exit codes: 0 all is well, 1 a program is wrong, failed or is not in canonical layout, 2 the command was used
wrongly. docs/urscript-tool.md shows all of it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext
from difflib import unified_diff
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from urscript.catalogue import Catalogue, catalogue_for
from urscript.diagnostics import Diagnostic, diagnostic_of
from urscript.errors import ScriptCompileError, ScriptError, ScriptSyntaxError
from urscript.formatter import format_program
from urscript.lint_rules import RULES, ScriptWarning
from urscript.program import CompiledProgram, ProgramStatus, check_program, compile_program
from urscript.recording_host import RecordedCall, RecordingHost
from urscript.source import Source, as_utf8
from urscript.tracing import LineTracer, TracedLine
from urscript.values import str_form

app = typer.Typer(
    help="URScript without a robot.", no_args_is_help=True, add_completion=False, rich_markup_mode=None
)

_STANDARD_INPUT: Final = Path("-")

_Software = Annotated[
    str, typer.Option("--software", help="Software version of the robot, e.g. 3.15 or 5.11.")
]
_AsJson = Annotated[bool, typer.Option("--json", help="One JSON document instead of text, for editors.")]


# --- check -----------------------------------------------------------------------------------------------


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(help="Programs to check; - reads one.", show_default=False)],
    software: _Software = "3.15",
    ignore: Annotated[
        list[str] | None, typer.Option(help="Warnings to leave out: W101, or W101,W103.", show_default=False)
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings make it exit with 1 too.")] = False,
    as_json: _AsJson = False,
) -> None:
    """Show all errors and warnings of the given programs; exit 1 if there is an error."""
    catalogue = _catalogue(software)
    ignored = _codes(ignore or ())
    found: list[tuple[str, ScriptError]] = []
    for file in files:
        errors, warnings = check_program(_read(file), catalogue=catalogue, name=_shown_name(file))
        found += [(str(file), error) for error in errors]
        found += [(str(file), warning) for warning in warnings if warning.rule.code not in ignored]
    if as_json:
        _echo_json(diagnostics=[diagnostic_of(error, file)._asdict() for file, error in found])
    else:
        for _, error in found:
            typer.echo(as_utf8(error.render()))
    if any(strict or not isinstance(error, ScriptWarning) for _, error in found):
        raise typer.Exit(1)


def _codes(words: Iterable[str]) -> frozenset[str]:
    """The codes in the values of `--ignore`."""
    codes = frozenset(code.strip().upper() for word in words for code in word.split(","))
    unknown = codes - {rule.code for rule in RULES}
    if unknown:
        known = f"{RULES[0].code} to {RULES[-1].code}"
        raise typer.BadParameter(f"no warning has the code {', '.join(sorted(unknown))}; there are {known}")
    return codes


# --- fmt -------------------------------------------------------------------------------------------------


@app.command()
def fmt(
    files: Annotated[
        list[Path],
        typer.Argument(help="Programs to rewrite in place; - reads one and prints it.", show_default=False),
    ],
    only_check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit 1 if a layout is not canonical.")
    ] = False,
    diff: Annotated[bool, typer.Option("--diff", help="Write nothing; show what would change.")] = False,
    as_json: _AsJson = False,
) -> None:
    """Put programs into the canonical layout; comments and labels stay, and what the program does."""
    reports: list[dict[str, Any]] = []
    diagnostics: list[Diagnostic] = []
    for file in files:
        source = Source(_read(file), _shown_name(file))
        try:
            formatted = format_program(source)
        except ScriptSyntaxError as error:
            diagnostics.append(diagnostic_of(error, str(file)))
            if not as_json:
                typer.echo(as_utf8(error.render()), err=True)
            continue
        changes = formatted != source.text
        reports.append({"file": str(file), "changes": changes})
        if diff:
            _echo_diff(source, formatted, silent=as_json)
        elif only_check:
            if changes and not as_json:
                typer.echo(f"{source.name}: not in canonical layout")
        elif file == _STANDARD_INPUT:
            _write_bytes(formatted)
        elif changes:
            _write(file, formatted)
    if as_json:
        _echo_json(files=reports, diagnostics=[item._asdict() for item in diagnostics])
    if diagnostics or (only_check and any(report["changes"] for report in reports)):
        raise typer.Exit(1)


def _echo_diff(source: Source, formatted: str, silent: bool) -> None:
    before, after = (as_utf8(text).splitlines(keepends=True) for text in (source.text, formatted))
    for line in () if silent else unified_diff(before, after, source.name, f"{source.name} (canonical)"):
        typer.echo(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n", nl=False)


def _write(file: Path, text: str) -> None:
    try:
        file.write_bytes(text.encode("latin-1"))
    except OSError as error:
        typer.echo(f"cannot write {file}: {error.strerror}", err=True)
        raise typer.Exit(2) from None


def _write_bytes(text: str) -> None:
    """Program text on standard output, byte for byte."""
    sys.stdout.buffer.write(text.encode("latin-1"))
    sys.stdout.flush()


# --- run -------------------------------------------------------------------------------------------------


@app.command()
def run(
    file: Annotated[Path, typer.Argument(help="Program to run; - reads it.", show_default=False)],
    software: _Software = "3.15",
    limit: Annotated[
        float, typer.Option(help="Robot seconds after which to stop a program.", min=0.0)
    ] = 60.0,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show the texts of textmsg only.")] = False,
    trace: Annotated[
        bool, typer.Option("--trace", help="Show each line before it is executed: cycle, thread, line.")
    ] = False,
    trace_lines: Annotated[int, typer.Option(help="Lines after which --trace falls silent.", min=1)] = 1000,
) -> None:
    """Run a program at full speed on a robot that only writes down what it is told."""
    catalogue = _catalogue(software)
    try:
        program = compile_program(_read(file), catalogue=catalogue, name=_shown_name(file))
    except ScriptCompileError as error:
        typer.echo(as_utf8(error.render()), err=True)
        raise typer.Exit(1) from None
    host = RecordingHost(
        catalogue=catalogue,
        on_message=_show,
        on_call=None if quiet else lambda call: _show(_call_line(call)),
    )
    tracer: AbstractContextManager[Any] = _tracer(program, host, trace_lines) if trace else nullcontext()
    with tracer:
        running = host.run(program, max_cycles=int(limit / host.step_time))
    seconds = host.cycle * host.step_time
    if running.status is ProgramStatus.FAILED and running.error is not None:
        typer.echo(as_utf8(running.error.render()), err=True)
        raise typer.Exit(1)
    if running.status is ProgramStatus.RUNNING:
        running.kill()
        typer.echo(f"stopped: still running after {seconds:g} s of robot time (--limit)", err=True)
    elif not quiet:
        typer.echo(f"finished after {seconds:g} s of robot time", err=True)


def _tracer(program: CompiledProgram, host: RecordingHost, limit: int) -> LineTracer:
    def show(traced: TracedLine) -> None:
        _show(f"{host.cycle:6d}  {traced.thread}:{traced.line}: {traced.text}")

    def stop() -> None:
        typer.echo(f"trace stops after {limit} lines (--trace-lines)", err=True)

    return LineTracer(program, show, stop, limit)


def _show(text: str) -> None:
    """A line of a running program; whoever has read enough of them (`| head`) ends the run."""
    try:
        typer.echo(as_utf8(text))
    except BrokenPipeError:
        # Python would complain again when it closes the stream at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


def _call_line(call: RecordedCall) -> str:
    seconds = call.cycle * RecordingHost.step_time
    return f"{seconds:9.3f} s  {call.thread}: {call.name}({', '.join(map(_argument, call.arguments))})"


def _argument(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str_form(value)


# --- all commands ----------------------------------------------------------------------------------------


def main() -> None:
    """Entry point of the console script."""
    app()


def _catalogue(software: str) -> Catalogue:
    try:
        return catalogue_for(software)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _shown_name(file: Path) -> str:
    return "<stdin>" if file == _STANDARD_INPUT else str(file)


def _read(file: Path) -> str:
    """A program as bytes are on the wire; a byte order mark is dropped."""
    try:
        text = sys.stdin.buffer.read() if file == _STANDARD_INPUT else file.read_bytes()
    except OSError as error:
        typer.echo(f"cannot read {file}: {error.strerror}", err=True)
        raise typer.Exit(2) from None
    return text.removeprefix(b"\xef\xbb\xbf").decode("latin-1")


def _echo_json(**document: Any) -> None:
    typer.echo(json.dumps(document, indent=2, ensure_ascii=False))
