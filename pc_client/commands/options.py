"""What several commands share: options, the terminal, how a command moves an arm, what it does before."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console

from pc_client.control.controller import DEFAULT, Controller, load_controller
from pc_client.errors import ControllerError, printable
from pc_client.kinematics.tool import surroundings
from protocol.errors import ProtocolError
from protocol.ur_types import Ports
from ur_hil.cell import Cell

if TYPE_CHECKING:
    from rich.progress import Progress

    from pc_client.analysis.report import Report
    from pc_client.arm import Arm

console = Console(highlight=False)

RobotOption = Annotated[
    str, typer.Option("--robot", metavar="HOST", help="Name or address of the control box.")
]
PortBaseOption = Annotated[
    int, typer.Option("--port-base", metavar="N", help="Offset of all ports, as given to the box.")
]
OutOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for recordings, tables and report.")
]
RepeatOption = Annotated[int, typer.Option("--repeat", min=1, max=99, help="Runs of each movement.")]
SetOption = Annotated[
    str | None, typer.Option("--set", metavar="NAME", help="Ten movements of the library: paper or arcs.")
]
TimeUnitOption = Annotated[
    Literal["auto", "s", "ms", "us", "ns"],
    typer.Option(
        "--time-unit",
        metavar="auto|s|ms|us|ns",
        help="Of the time column; auto: by its name, or by the typical step between samples.",
    ),
]
WorkersOption = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", min=1, help="Processes; as many as there are cores by default."),
]
DaskOption = Annotated[
    str | None,
    typer.Option("--dask", metavar="ADDRESS", help="A Dask scheduler to work on, tcp://HOST:8786."),
]
CellOption = Annotated[
    Path | None,
    typer.Option(
        "--cell",
        metavar="FILE",
        help="What stands around the arm and what it carries, .toml; without: the bare arm on a plane z = 0.",
    ),
]
ToolOption = Annotated[
    str | None,
    typer.Option(
        "--tool",
        metavar="NAME|FILE.toml",
        help="Gripper on the flange, such as robotiq-2f85: its TCP, payload and shape; without: the flange.",
    ),
]
YesOption = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before a real arm moves.")]


def say(text: str) -> None:
    """Print text as it is: no markup, no line breaks of our own, nothing that the terminal obeys."""
    console.print(printable(text), markup=False, soft_wrap=True)


def progress_bar(*, remaining: bool = False, live: bool = True) -> Progress:
    """A bar with the task, a count and the time so far, or remaining, which is gone when all is done.

    One that is not live is drawn when it is refreshed: no thread takes the interpreter from a control loop.
    """
    from rich import progress

    time = progress.TimeRemainingColumn() if remaining else progress.TimeElapsedColumn()
    text = progress.TextColumn("{task.description}")
    columns = (text, progress.BarColumn(), progress.MofNCompleteColumn(), time)
    return progress.Progress(*columns, console=console, transient=True, auto_refresh=live)


def show_report(folder: Path, *, include_aborted: bool = False) -> Report:
    """Build tables and report from a folder of recordings, and print Table I beside the paper's."""
    from pc_client.analysis.report import build_report

    report = build_report(folder, console, include_aborted=include_aborted)
    console.print(report.table.to_rich())
    for line in report.left_out:
        say(line)
    say(f"report: {report.paths[-1]}")
    return report


def check_workers(workers: int | None, dask: str | None) -> None:
    """Raise typer.BadParameter for both `--workers` and `--dask`."""
    if workers is not None and dask is not None:
        raise typer.BadParameter("--workers is for this machine, --dask for a cluster: give only one")


def ports_of(port_base: int) -> Ports:
    """The robot's ports; typer.BadParameter if the offset leaves the TCP ports."""
    try:
        return Ports.standard(offset=port_base)
    except ProtocolError as error:
        raise typer.BadParameter(str(error)) from error


_OPTIONS = {"gain_p": "--gain-p", "gain_i": "--gain-i", "speedj_acceleration": "--acceleration"}


@dataclass(frozen=True, slots=True)
class RunSettings:
    """How to move an arm, whatever the movements and whichever the robot.

    Attributes:
        controller: the same for all runs.
        dry_run: end where the arm would begin to move.
    """

    controller: Controller
    cell: Cell
    ports: Ports
    reverse_port: int | None
    overwrite: bool
    yes: bool
    dry_run: bool


def _read_settings(
    controller: Annotated[
        str,
        typer.Option(
            "--controller",
            metavar="NAME|FILE.toml",
            help="paper (as published), preview (ahead by the loop delay) or best (makes up for the drives' "
            "lag and the gears' waves, and uses ILC between runs of a movement), or a file with numbers.",
            show_default=True,
        ),
    ] = DEFAULT,
    gain_p: Annotated[
        float | None,
        typer.Option("--gain-p", metavar="X", help="Proportional gain, 1/s, instead of its own."),
    ] = None,
    gain_i: Annotated[
        float | None, typer.Option("--gain-i", metavar="X", help="Integral gain, 1/s2, instead of its own.")
    ] = None,
    acceleration: Annotated[
        float | None,
        typer.Option(
            "--acceleration", metavar="X", help="The a of the robot's speedj, rad/s2, instead of its own."
        ),
    ] = None,
    cell: CellOption = None,
    tool: ToolOption = None,
    port_base: PortBaseOption = 0,
    reverse_port: Annotated[
        int | None,
        typer.Option(
            "--reverse-port",
            metavar="N",
            min=0,
            max=65535,
            help="TCP port of this computer that the robot's program calls; 0: any free one.  "
            "[default: 31000]",
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace simulated recordings of the same names.")
    ] = False,
    yes: YesOption = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Connect, check, plan and show what would happen; nothing moves."),
    ] = False,
) -> RunSettings:
    """Make the record from what was given on the command line."""
    given = {"gain_p": gain_p, "gain_i": gain_i, "speedj_acceleration": acceleration}
    numbers = {name: value for name, value in given.items() if value is not None}
    base = load_controller(controller)
    try:
        config = base.changed(numbers, _OPTIONS.__getitem__)
    except ControllerError as error:
        raise typer.BadParameter(str(error)) from error
    around, ports = surroundings(cell, tool), ports_of(port_base)
    return RunSettings(config, around, ports, reverse_port, overwrite, yes, dry_run)


def takes_run_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `_read_settings` in place of its keyword parameter `settings`.

    Typer reads a command's options from its signature: the two signatures are put together here.
    """
    shared = inspect.signature(_read_settings, eval_str=True).parameters
    own = dict(inspect.signature(command, eval_str=True).parameters)
    del own["settings"]
    together = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in (*own.values(), *shared.values())]

    @wraps(command)
    def with_options(**given: Any) -> None:
        settings = _read_settings(**{name: given.pop(name) for name in shared})
        command(**given, settings=settings)

    vars(with_options)["__signature__"] = inspect.Signature(together)
    with_options.__annotations__ = {p.name: p.annotation for p in together}
    return with_options


def reach(robot: str, ports: Ports, cell: Cell, reverse_port: int | None = None, *, yes: bool = False) -> Arm:
    """Ask a robot what it is, and refuse it before anything is planned; it stays as it is.

    With `yes` nobody is asked before a real arm moves.

    Raises:
        ClientError: it does not answer, does not report which arm it is, or is not as it must be.
    """
    from pc_client.arm import ask_at_terminal, connect

    confirm = (lambda text: True) if yes else ask_at_terminal
    return connect(robot, ports, cell=cell, reverse_port=reverse_port, confirm=confirm)
