"""`ur-client report` and `ur-client export`: what is done with recordings, without a robot."""

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from pc_client.commands.options import console, say, show_report
from pc_client.errors import RecordingError, one_line
from ur_hil import PENDANT_PORT
from ur_hil.command_line import ExitCode


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folders with the recordings of one experiment each."),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Page of several experiments; report.html by default."),
    ] = None,
    include_aborted: Annotated[
        bool, typer.Option("--include-aborted", help="Show runs that were given up, too, marked as such.")
    ] = False,
) -> None:
    """Build tables and report again from the recordings of an experiment; of several, one page more.

    A recording that cannot be used is named and left out; the exit code is 1 then.
    """
    if len(folders) == 1:
        if out is not None:
            raise typer.BadParameter(
                f"--out is for several folders: the page of one is {folders[0]}/report.html"
            )
        if show_report(folders[0], include_aborted=include_aborted).left_out:
            raise typer.Exit(ExitCode.FAILED)
        return
    from pc_client.analysis.report import build_report, build_side_by_side

    page = out or Path("report.html")
    reports, left_out = [], []
    for folder in folders:
        try:
            report = build_report(folder, console, include_aborted=include_aborted)
        except RecordingError as error:
            left_out.append(one_line(error))
        else:
            reports.append(report)
            left_out += [f"{folder}: {line}" for line in report.left_out]
    for line in left_out:
        say(line)
    shown = build_side_by_side(reports, page)
    console.print(shown.to_rich())
    say(f"report: {page}")
    if left_out:
        raise typer.Exit(ExitCode.FAILED)


def export(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording, .mcap.")],
    to: Annotated[
        Literal["csv", "parquet", "mat"],
        typer.Option("--to", metavar="csv|parquet|mat", help="Format of the table."),
    ] = "csv",
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Beside the recording by default.")
    ] = None,
) -> None:
    """Write the rows of a recording as a table."""
    from pc_client.recording.export import export as write_table
    from pc_client.recording.recording import load_recording

    recording = load_recording(file)
    if recording.damage:
        say(f"{file}: {recording.damage}; exporting {recording.n_rows} rows")
    path = write_table(recording, out or file.with_suffix(f".{to}"), to)
    say(f"data: {recording.provenance.origin.says}")
    say(str(path))


def view(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Recordings, shown side by side.")],
    save: Annotated[
        Path | None,
        typer.Option("--save", metavar="PAGE.html", help="Write a page that needs no server, and end."),
    ] = None,
    port: Annotated[int, typer.Option(help="Port of the window; 0 takes a free one.")] = PENDANT_PORT,
) -> None:
    """Show recordings in the browser: arm, reference, speeds and errors, with a bar of time."""
    from pc_client.results.window import view_command

    command = view_command(files, port, save)
    os.execv(command[0], command)
