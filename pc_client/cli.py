"""`ur-client`: the command line. Exit codes: 0 done, 1 it did not work, 2 wrong usage.

Every error that a user can cause is one line on stderr. Heavy libraries are loaded by the commands that
need them.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

import typer

from pc_client.commands import compare, doctor, draw, experiment, extract, movements, recordings, sweep
from pc_client.errors import ClientError, full_message, one_line
from protocol.errors import ProtocolError

app = typer.Typer(
    name="ur-client",
    help="Moves a Universal Robots arm, real or emulated, by streaming joint velocities.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command()(experiment.experiment)
app.command()(experiment.run)
app.add_typer(movements.app, name="movements")
app.command()(sweep.sweep)
app.command()(extract.extract)
app.command()(draw.draw)
app.command()(compare.compare)
app.command()(recordings.report)
app.command()(recordings.export)
app.command()(doctor.doctor)

# typer >= 0.16 carries its own copy of click, older ones import it: the class is found where it is used.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]

_INTERRUPTED = 130

_EXTRAS = {
    "pinocchio": "client",
    "scipy": "client",
    "mcap": "client",
    "polars": "client",
    "matplotlib": "report",
    "jinja2": "report",
    "distributed": "cluster",
    "optuna": "search",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code.

    Args:
        arguments: instead of those of the process.
    """
    # A request to end is answered like Ctrl-C: the arm is stopped first.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(run(list(arguments) if arguments is not None else None))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    try:
        words = sys.argv[1:] if arguments is None else arguments
        code = app(words or ["--help"], prog_name="ur-client", standalone_mode=False)
    except _UsageError as error:
        text = error.format_message() if hasattr(error, "format_message") else str(error)
        return _complain(f"{text} (see ur-client --help)", 2)
    except typer.Abort:
        return _complain("aborted", 1)
    except KeyboardInterrupt:
        return _complain("interrupted", 1)
    except (ClientError, ProtocolError) as error:
        return _complain(full_message(error), 1)
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        return _complain(f"this needs {error.name}: run `pip install 'ur-hil[{extra}]'`", 1)
    except BrokenPipeError:  # the reader of our output went away
        return 1
    if code == _INTERRUPTED:  # newer typer turns Ctrl-C into the shell's exit code
        return _complain("interrupted", 1)
    return code if isinstance(code, int) else 0


def _complain(text: str, code: int) -> int:
    print(f"ur-client: {one_line(text)}", file=sys.stderr)
    return code
