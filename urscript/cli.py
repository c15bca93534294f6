"""The `urscript` command: `check` programs, `run` them, lay them out (`fmt`).

Exit codes: `ur_hil.command_line`; 1 also for a program with errors, or that is not in canonical layout.
docs/urscript-tool.md shows all of it.
"""

import gc
import sys
from collections.abc import Iterable
from difflib import unified_diff
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from ur_hil.command_line import ExitCode, examples, new_app, run_app
from urscript.check.checking import check_with_advice, with_advice
from urscript.check.warnings import RULES, ScriptWarning
from urscript.commands import support
from urscript.commands.run_command import run
from urscript.errors import ScriptError, ScriptSyntaxError
from urscript.formatter import format_program
from urscript.source import Source, as_utf8

_GC_THRESHOLD: Final = (100_000, 20, 100)

app = new_app("URScript without a robot.")

app.command(
    epilog=examples(
        "urscript run my_program.script",
        "urscript run --robot ur5 --fidelity ideal --seed 3 my_program.script",
        "urscript run --robot none --trace my_program.script",
    )
)(run)


@app.command(
    epilog=examples(
        "urscript check my_program.script",
        "urscript check --software 5.11 --strict --ignore W101,W103 my_program.script",
    )
)
def check(
    files: Annotated[list[Path], typer.Argument(help="Programs to check; - reads one.", show_default=False)],
    software: support.Software = "3.15",
    ignore: Annotated[
        list[str] | None, typer.Option(help="Warnings to leave out: W101, or W101,W103.", show_default=False)
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings make it exit with 1 too.")] = False,
    as_json: support.AsJson = False,
) -> None:
    """Show all errors and warnings of the given programs; exit 1 if there is an error."""
    catalogue = support.catalogue_of(software)
    ignored = _codes(ignore or ())
    found: list[tuple[str, ScriptError]] = []
    for file in files:
        errors, warnings = check_with_advice(
            support.read_program(file), catalogue=catalogue, name=support.shown_name(file)
        )
        kept = [warning for warning in warnings if warning.rule.code not in ignored]
        in_order = sorted([*errors, *kept], key=lambda problem: (problem.line, problem.column))
        found += [(str(file), problem) for problem in in_order]
    if as_json:
        support.echo_json(diagnostics=[support.diagnostic_of(error, file) for file, error in found])
    else:
        for _, error in found:
            typer.echo(as_utf8(error.render()))
    if any(strict or not isinstance(error, ScriptWarning) for _, error in found):
        raise typer.Exit(ExitCode.FAILED)


def _codes(words: Iterable[str]) -> frozenset[str]:
    codes = frozenset(code.strip().upper() for word in words for code in word.split(","))
    unknown = codes - {rule.code for rule in RULES}
    if unknown:
        known = f"{RULES[0].code} to {RULES[-1].code}"
        raise typer.BadParameter(f"no warning has the code {', '.join(sorted(unknown))}; there are {known}")
    return codes


@app.command(
    epilog=examples("urscript fmt my_program.script", "urscript fmt --check --diff my_program.script")
)
def fmt(
    files: Annotated[
        list[Path],
        typer.Argument(help="Programs to rewrite in place; - reads one and prints it.", show_default=False),
    ],
    only_check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit 1 if a layout is not canonical.")
    ] = False,
    diff: Annotated[bool, typer.Option("--diff", help="Write nothing; show what would change.")] = False,
    as_json: support.AsJson = False,
) -> None:
    """Put programs into the canonical layout; comments and labels stay, and what the program does."""
    reports: list[dict[str, Any]] = []
    diagnostics: list[dict[str, Any]] = []
    for file in files:
        source = Source(support.read_program(file), support.shown_name(file))
        try:
            formatted = format_program(source)
        except ScriptSyntaxError as wrong:
            error = with_advice(wrong)
            diagnostics.append(support.diagnostic_of(error, str(file)))
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
        elif file == support.STANDARD_INPUT:
            sys.stdout.buffer.write(formatted.encode("latin-1"))
            sys.stdout.flush()
        elif changes:
            _write(file, formatted)
    if as_json:
        support.echo_json(files=reports, diagnostics=diagnostics)
    if diagnostics or (only_check and any(report["changes"] for report in reports)):
        raise typer.Exit(ExitCode.FAILED)


def _echo_diff(source: Source, formatted: str, silent: bool) -> None:
    before, after = (as_utf8(text).splitlines(keepends=True) for text in (source.text, formatted))
    for line in () if silent else unified_diff(before, after, source.name, f"{source.name} (canonical)"):
        typer.echo(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n", nl=False)


def _write(file: Path, text: str) -> None:
    try:
        file.write_bytes(text.encode("latin-1"))
    except OSError as error:
        typer.echo(f"cannot write {file}: {error.strerror}", err=True)
        raise typer.Exit(ExitCode.WRONG_USAGE) from None


def main() -> None:
    """Entry point of the console script."""
    # Trees of long programs are no garbage; the collector would take a third of the time.
    gc.set_threshold(*_GC_THRESHOLD)
    sys.exit(run_app(app, "urscript", None, _complain))


def _complain(text: str) -> None:
    typer.echo(f"urscript: {as_utf8(' '.join(text.split()))}", err=True)
