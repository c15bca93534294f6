"""`ur-client`: the command line. Exit codes: `ur_hil.command_line`.

Every error that a user can cause is one line on stderr. Heavy libraries are loaded by the commands that
need them.
"""

import signal
import sys
from collections.abc import Sequence

from pc_client.commands import doctor, draw, experiment, extract, movements, recordings, sweep
from pc_client.errors import ClientError, InterruptedByUserError, UnknownMovementError, full_message, one_line
from protocol.errors import ProtocolError
from ur_hil.command_line import ExitCode, examples, new_app, run_app

app = new_app("Moves a Universal Robots arm, real or emulated, by streaming joint velocities.")
for _command, _examples in (
    (
        experiment.experiment,
        (
            "ur-client experiment --robot 127.0.0.1 --out out/experiment",
            "ur-client experiment --robot 127.0.0.1 --out out/mine --movements lognorm_4_1 --repeat 1",
        ),
    ),
    (
        experiment.run,
        (
            "ur-client run lognorm_4_1 --robot 127.0.0.1 --out out/run",
            "ur-client run my_movement.toml --robot 192.168.0.10 --out out/run --controller best --repeat 3",
        ),
    ),
    (sweep.sweep, ("ur-client sweep examples/sweeps/gains.toml --workers 4",)),
    (
        extract.extract,
        (
            "ur-client extract drawing.txt --out out/strokes",
            "ur-client extract reaches/ --out out/strokes --time-unit ms",
        ),
    ),
    (draw.draw, ("ur-client draw drawing.txt --robot 127.0.0.1 --out out/draw",)),
    (
        experiment.compare,
        (
            "ur-client compare --out out/compare",
            "ur-client compare --robot 127.0.0.1 --out out/compare --targets 5",
        ),
    ),
    (recordings.report, ("ur-client report out/run", "ur-client report out/a out/b --out both.html")),
    (recordings.export, ("ur-client export out/run/lognorm_4_1_r1.mcap --to csv",)),
    (recordings.view, ("ur-client view out/run/lognorm_4_1_r1.mcap", "ur-client view a.mcap b.mcap")),
    (
        doctor.doctor,
        ("ur-client doctor --robot 127.0.0.1", "ur-client doctor --robot 192.168.0.10 --seconds 10"),
    ),
):
    app.command(epilog=examples(*_examples))(_command)
app.add_typer(movements.app, name="movements")

_EXTRAS = {
    "pinocchio": "client",
    "scipy": "client",
    "mcap": "client",
    "polars": "client",
    "matplotlib": "report",
    "jinja2": "report",
    "distributed": "cluster",
    "optuna": "search",
    "viser": "pendant",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line, with the arguments of the process, and leave it with the exit code."""
    # A request to end is answered like Ctrl-C: the arm is stopped first.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(run(list(arguments) if arguments is not None else None))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    try:
        return run_app(app, "ur-client", arguments, _complain)
    except InterruptedByUserError as error:
        _complain(full_message(error))
        return ExitCode.INTERRUPTED
    except UnknownMovementError as error:
        _complain(full_message(error))
        return ExitCode.WRONG_USAGE
    except (ClientError, ProtocolError) as error:
        _complain(full_message(error))
        return ExitCode.FAILED
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        _complain(f"this needs {error.name}: run `pip install 'ur-hil[{extra}]'`")
        return ExitCode.FAILED


def _complain(text: str) -> None:
    print(f"ur-client: {one_line(text)}", file=sys.stderr)
