"""The command `ur-emulator`: serve a control box until Ctrl-C."""

from __future__ import annotations

import dataclasses
import json
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocol.errors import ProtocolError

if TYPE_CHECKING:
    from ur_emulator.box_log import LogEntry
    from ur_emulator.emulator import ControlBox

app = typer.Typer(
    add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None
)


@app.callback()
def _program() -> None:
    """An emulated Universal Robots control box."""


@app.command()
def serve(
    robot: Annotated[str, typer.Option(help="Type of the arm.")] = "ur3",
    version: Annotated[
        str, typer.Option(help="Software the box runs; decides packet layouts and builtins.")
    ] = "3.15.8",
    host: Annotated[
        str, typer.Option(help="Address to listen on; 127.0.0.1 keeps other machines out.")
    ] = "127.0.0.1",
    pace: Annotated[
        str, typer.Option(help="realtime, or lockstep: as fast as the processor, and repeatable.")
    ] = "realtime",
    speed: Annotated[float, typer.Option(help="Times as fast as real time (realtime pace only).")] = 1.0,
    seed: Annotated[int, typer.Option(help="Which arm: calibration, gear phases, delays, noise.")] = 0,
    fidelity: Annotated[
        str, typer.Option(help="How imperfect the arm is: ideal, typical or poor.")
    ] = "typical",
    port_base: Annotated[int, typer.Option(help="Offset added to all standard ports.")] = 0,
    ready_file: Annotated[
        Path | None, typer.Option(help="Write address and ports here (JSON) when ready.")
    ] = None,
    log: Annotated[
        bool,
        typer.Option("--log", "-v", help="Show the log of the box on stderr: programs, errors, clients."),
    ] = False,
) -> None:
    """Serve a control box, powered on with its brakes released, until Ctrl-C."""
    from ur_emulator.emulator import ControlBox
    from ur_emulator.errors import EmulatorError

    try:
        box = ControlBox(robot, version, host, pace, speed, seed, fidelity, port_base)
        for name in (signal.SIGINT, signal.SIGTERM):
            signal.signal(name, lambda number, frame: box.stop())
        if log:
            box.follow_log(_print_entry)
        box.listen()
        if ready_file is not None:
            _write_ready_file(ready_file, box)
    except (EmulatorError, ProtocolError, OSError) as error:
        sys.stderr.write(f"ur-emulator: {error}\n")
        raise typer.Exit(1) from None
    for notice in box.notices:
        sys.stderr.write(f"ur-emulator: {notice}\n")
    print(
        f"{robot.upper()} CB3 {version} ready at {host}, {pace}, {fidelity}, "
        f"seed {seed}, serial {box.serial_number}: "
        f"dashboard {box.ports.dashboard}, primary {box.ports.primary}, secondary {box.ports.secondary}, "
        f"realtime {box.ports.realtime}, rtde {box.ports.rtde}"
        + (f", modbus {box.ports.modbus}" if box.ports.modbus else ""),
        flush=True,
    )
    try:
        box.serve_forever()
    except EmulatorError as error:
        sys.stderr.write(f"ur-emulator: {error}\n")
        raise typer.Exit(1) from None


def _print_entry(entry: LogEntry) -> None:
    with suppress(OSError):  # nobody reads it any more
        sys.stderr.write(f"{entry}\n")
        sys.stderr.flush()


def _write_ready_file(path: Path, box: ControlBox) -> None:
    """Write the file in one step, so that whoever waits for it never reads half of it."""
    facts = {"host": box.host, "ports": dataclasses.asdict(box.ports), "serial_number": box.serial_number}
    partial = path.with_name(path.name + ".part")
    partial.write_text(json.dumps(facts) + "\n")
    partial.replace(path)


def main() -> None:
    """Entry point of the console script."""
    app(prog_name="ur-emulator")


if __name__ == "__main__":
    main()
