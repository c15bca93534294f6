"""Options that several commands share, and the terminal they write to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console

from pc_client.errors import printable
from pc_client.kinematics.cell import NO_CELL, Cell
from protocol.errors import ProtocolError
from protocol.ur_types import Ports

if TYPE_CHECKING:
    from pc_client.analysis.report import Report

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
ControllerOption = Annotated[
    str,
    typer.Option(
        "--controller",
        metavar="NAME|FILE.toml",
        help="paper (as published), preview (ahead by the loop delay) or best (makes up for the drives' lag "
        "and the gears' waves, and uses ILC between runs of a movement), or a file with numbers.",
        show_default=True,
    ),
]
GainPOption = Annotated[
    float | None, typer.Option("--gain-p", metavar="X", help="Proportional gain, 1/s, instead of its own.")
]
GainIOption = Annotated[
    float | None, typer.Option("--gain-i", metavar="X", help="Integral gain, 1/s2, instead of its own.")
]
AccelerationOption = Annotated[
    float | None,
    typer.Option(
        "--acceleration", metavar="X", help="The a of the robot's speedj, rad/s2, instead of its own."
    ),
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
ReversePortOption = Annotated[
    int | None,
    typer.Option(
        "--reverse-port",
        metavar="N",
        min=0,
        max=65535,
        help="TCP port of this computer that the robot's program calls; 0: any free one.  [default: 31000]",
    ),
]
OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Replace simulated recordings of the same names.")
]
DryRunOption = Annotated[
    bool,
    typer.Option("--dry-run", help="Connect, check, plan and show what would happen; nothing moves."),
]
YesOption = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before a real arm moves.")]


def say(text: str) -> None:
    """Print text as it is: no markup, no line breaks of our own, nothing that the terminal obeys."""
    console.print(printable(text), markup=False, soft_wrap=True)


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
    """Refuse both `--workers` and `--dask`.

    Raises:
        typer.BadParameter: both are given.
    """
    if workers is not None and dask is not None:
        raise typer.BadParameter("--workers is for this machine, --dask for a cluster: give only one")


def cell_of(path: Path | None) -> Cell:
    """What stands around the arm and what it carries; nothing is known without a file.

    Raises:
        CellError: the file makes no sense.
    """
    from pc_client.kinematics.cell_file import load_cell

    return NO_CELL if path is None else load_cell(path)


def ports_of(port_base: int) -> Ports:
    """The robot's ports.

    Raises:
        typer.BadParameter: the offset leaves the TCP ports.
    """
    try:
        return Ports.standard(offset=port_base)
    except ProtocolError as error:
        raise typer.BadParameter(str(error)) from error
