"""What the three commands share: exit codes, `--version`, `-h`, completion, examples, errors of usage.

docs/commands.md shows the table of exit codes.
"""

import sys
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Annotated, Final

import typer

from ur_hil import tool_version


class ExitCode(IntEnum):
    """How a command ends."""

    DONE = 0
    FAILED = 1
    WRONG_USAGE = 2
    INTERRUPTED = 130


EXIT_CODES: Final = {
    ExitCode.DONE: "done",
    ExitCode.FAILED: "it did not work: a line on stderr says why and what to do",
    ExitCode.WRONG_USAGE: "given wrongly: an unknown command or option, or a value that it does not take",
    ExitCode.INTERRUPTED: "interrupted by Ctrl-C or SIGTERM before it was done",
}
"""Their meanings, for people."""


def _show_version(context: typer.Context, wanted: bool) -> None:
    if wanted:
        typer.echo(f"{context.info_name} {tool_version()}")
        raise typer.Exit


def new_app(help_text: str) -> typer.Typer:
    """The app of one command, without sub-commands; `help_text` says what it is for."""
    app = typer.Typer(
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback(help=help_text)
    def _program(
        version: Annotated[
            bool,
            typer.Option(
                "--version", callback=_show_version, is_eager=True, help="Show the version of the tool."
            ),
        ] = False,
    ) -> None: ...

    return app


def examples(*lines: str) -> str:
    """The end of the help text of a command: commands to copy."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


# typer >= 0.16 carries its own copy of click, older ones import it: the class is found where it is used.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]


def run_app(
    app: typer.Typer, program: str, words: Sequence[str] | None, complain: Callable[[str], None]
) -> int:
    """Run a command line of an app made by `new_app`; return the exit code.

    Without `words` they are those of the process; `complain` shows one line on stderr.
    """
    given = list(sys.argv[1:] if words is None else words)
    try:
        code = app(given or ["--help"], prog_name=program, standalone_mode=False)
    except _UsageError as error:
        text = error.format_message() if hasattr(error, "format_message") else str(error)
        complain(f"{text} (see {program} --help)")
        return ExitCode.WRONG_USAGE
    except typer.Abort:
        complain("aborted")
        return ExitCode.FAILED
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except BrokenPipeError:  # the reader of our output went away
        return ExitCode.FAILED
    if code == ExitCode.INTERRUPTED:  # newer typer turns Ctrl-C into this code
        complain("interrupted")
    return code if isinstance(code, int) else ExitCode.DONE
