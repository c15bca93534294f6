"""The command `ur-emulator`: serve a control box until Ctrl-C."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from secrets import token_urlsafe
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from protocol.errors import ProtocolError
from ur_emulator import check_platform
from ur_emulator.errors import EmulatorError
from ur_emulator.host.box_log import LogEntry, printable
from ur_emulator.host.box_options import (
    PAGE_TOKEN_VARIABLE,
    TOKEN_VARIABLE,
    BoxOptions,
    ServedAt,
    counted_up,
    is_loopback,
)
from ur_hil import PENDANT_PORT
from ur_hil.command_line import ExitCode, examples, new_app, run_app

if TYPE_CHECKING:
    from ur_emulator.host.runtime.line_writer import LineWriter

_END_SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Enough for hundreds of boxes with hundreds of clients, and a number that every system grants.
WANTED_DESCRIPTORS = 65_536

app = new_app("An emulated Universal Robots control box.")


def _option(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, **more)


_window_port = partial(_option, "Port of the window; 0 takes a free one.", min=0, max=65535)


@app.command(
    epilog=examples(
        "ur-emulator serve",
        "ur-emulator serve --robot ur5 --software 3.4.0 --pace lockstep --seed 7",
        "ur-emulator serve --robot my_arm.toml",
        "ur-emulator serve --boxes 20 --host 127.0.0.2",
        "ur-emulator serve --programs my_programs --control-port 29900 --log",
    )
)
def serve(
    robot: Annotated[str, _option("Type of the arm, or FILE.toml: an arm of your own.")] = "ur3",
    software: Annotated[
        str | None,
        _option(
            "Software the box runs; decides packet layouts and builtins.",
            "--software",
            "--version",
            show_default="the usual one of the arm's generation",
        ),
    ] = None,
    host: Annotated[str, _option("Address to listen on; 127.0.0.1 keeps other machines out.")] = "127.0.0.1",
    pace: Annotated[
        str, _option("realtime, or lockstep: as fast as the processor, and repeatable.")
    ] = "realtime",
    speed: Annotated[float, _option("Times as fast as real time (realtime pace only).")] = 1.0,
    seed: Annotated[int, _option("Which arm: calibration, gear phases, delays, noise.")] = 0,
    fidelity: Annotated[
        str, _option("How imperfect the arm is: exact (no physics), ideal, typical, poor, or FILE.toml.")
    ] = "typical",
    port_base: Annotated[int, _option("Offset added to all standard ports.")] = 0,
    boxes: Annotated[
        int, _option("How many boxes; --host and --seed are those of the first, then counted up.")
    ] = 1,
    tool: Annotated[str, _option("On the flange: none, robotiq-2f85 and others, or FILE.toml.")] = "none",
    scene: Annotated[
        Path | None, _option("Around the arm, with things to grip: a cell file (.toml), or MJCF (.xml).")
    ] = None,
    programs: Annotated[
        Path | None,
        _option("Folder of programs (.urp, .script) and installations, for the dashboard's load and play."),
    ] = None,
    skip_unknown_nodes: Annotated[
        bool,
        _option(
            "Run .urp programs without the nodes that are not known, as of URCaps.", "--skip-unknown-nodes"
        ),
    ] = False,
    remote_control: Annotated[
        bool,
        _option(
            "Whether clients may command an e-Series box: the dashboard, and scripts on 30001 to 30003.",
            "--remote-control/--local-control",
        ),
    ] = True,
    control_port: Annotated[
        int | None,
        _option("Open the control API over HTTP on this port, for `ur-emulator ctl` (its default: 29900)."),
    ] = None,
    token: Annotated[
        str | None,
        _option(
            "What requests to the control API must show; better in the environment, "
            "where other users of the machine do not see it.",
            envvar=TOKEN_VARIABLE,
            show_envvar=True,
        ),
    ] = None,
    services: Annotated[
        str, _option("Services of a PolyScope X box to enable: primary,rtde.", show_default="none")
    ] = "",
    pendant: Annotated[
        bool, _option("Open a window on the box in the browser, on port 29980.", "--pendant")
    ] = False,
    pendant_view: Annotated[bool, _option("The same, to look only.", "--pendant-view")] = False,
    window_port: Annotated[int | None, _window_port(show_default="29980 + port base")] = None,
    window_host: Annotated[str, _option("Address of this machine that the window is on.")] = "127.0.0.1",
    ready_file: Annotated[Path | None, _option("Write address and ports here (JSON) when ready.")] = None,
    journal: Annotated[
        Path | None,
        _option("Write the inputs of each cycle here, for `ur-emulator replay`.", metavar="FILE"),
    ] = None,
    log: Annotated[
        bool, _option("Show the log of the box on stderr: programs, errors, clients.", "--log", "-v")
    ] = False,
) -> None:
    """Serve a control box, or several, powered on with the brakes released, until Ctrl-C."""
    try:
        check_platform()
    except ImportError as error:
        _complain(str(error))
        raise typer.Exit(ExitCode.FAILED) from None
    from ur_emulator.host.runtime.processes import prepare_workers

    has_pendant = pendant or pendant_view
    if has_pendant:
        _check_window()
    # Who may not use the control API may not use it through the window.
    tokens = {} if token is None else {PAGE_TOKEN_VARIABLE: token}
    if has_pendant and control_port is None:
        control_port = 0  # for what the window does beside what a pendant can
        token = token if is_loopback(host) else token or token_urlsafe()
    raise_descriptor_limit()
    prepare_workers()  # the compiler is loaded while the box is loaded
    os.environ.setdefault("MUJOCO_GL", "disabled")  # the box draws nothing
    from ur_emulator.host.rack import LoopRack
    from ur_emulator.host.runtime.line_writer import LineWriter

    try:
        first = BoxOptions(
            robot=robot,
            tool=tool,
            scene=scene,
            version=software,
            host=host,
            pace=pace,
            speed=speed,
            seed=seed,
            fidelity=fidelity,
            port_base=port_base,
            programs=programs,
            control_port=control_port,
            control_token=token,
            skip_unknown_nodes=skip_unknown_nodes,
            remote_control=remote_control,
            services=services.replace(",", " ").split(),
            journal=journal,
        )
        options = counted_up(boxes, first)
        tokens |= {} if token is None else {TOKEN_VARIABLE: token}
        if window_port is None:
            window_port = PENDANT_PORT + port_base
        window = _WindowProcess(tokens, window_host, window_port, view=pendant_view) if has_pendant else None
        rack = LoopRack(options)
    except EmulatorError as error:
        sys.stderr.write(f"ur-emulator: {error}\n")
        raise typer.Exit(ExitCode.WRONG_USAGE) from None
    try:
        for name in _END_SIGNALS:
            signal.signal(name, lambda number, frame: rack.stop())
        rack.listen()
        served = rack.served
        if ready_file is not None:
            _write_ready_file(ready_file, served)
    except (EmulatorError, ProtocolError, OSError) as error:
        sys.stderr.write(f"ur-emulator: {error}\n")
        raise typer.Exit(ExitCode.FAILED) from None
    out, err = LineWriter(sys.stdout, "this output"), LineWriter(sys.stderr, "the log")
    for notice in _notices(served):
        err.write(f"ur-emulator: {notice}")
    for k, at in enumerate(served):
        out.write(
            f"{at.title} ready at {at.host}, {pace}, {fidelity}, "
            f"seed {seed + k}, serial {at.serial_number}: {_ports_line(at)}"
        )
        if log:
            rack.follow_log(k, partial(_show_entry, err, f"{at.host} " if boxes > 1 else ""))
    if window is not None:
        window.open(served)
    try:
        rack.serve_forever()
    except EmulatorError as error:
        err.write(f"ur-emulator: {error}")
        raise typer.Exit(ExitCode.FAILED) from None
    finally:
        if window is not None:
            window.close()
        if ready_file is not None:
            with suppress(OSError):
                ready_file.unlink(missing_ok=True)
        for name in _END_SIGNALS:
            signal.signal(name, signal.SIG_DFL)
        out.close()
        err.close()


@app.command(
    epilog=examples("ur-emulator replay session.journal", "ur-emulator replay session.journal --until 75")
)
def replay(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A journal, as `serve --journal` writes it.")],
    until: Annotated[
        float | None, typer.Option(metavar="T", help="Time of the robot at which to end [s].")
    ] = None,
) -> None:
    """Feed a bare machine with the inputs of a journal; each cycle must give the same, bit for bit."""
    os.environ.setdefault("MUJOCO_GL", "disabled")
    from ur_emulator.host.replay import replay as run

    try:
        found = run(file, until)
    except EmulatorError as error:
        _complain(str(error))
        raise typer.Exit(ExitCode.WRONG_USAGE) from None
    for note in found.notes:
        _complain(note)
    typer.echo(str(found))
    if found.difference is not None or found.end:
        raise typer.Exit(ExitCode.FAILED)


class _CtlCommand(TyperCommand):
    """Its options are words of its argument, for the parser of `ctl`: also when the shell completes them."""

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Return what may follow."""
        return self.params[0].shell_complete(ctx, incomplete)


def _next_words(context: typer.Context, incomplete: str) -> list[str]:
    from ur_emulator.host.control_api.command_line import next_words

    words = next_words(context.params.get("words") or [])
    return [word for word in words if word.startswith(incomplete)]


@app.command(
    cls=_CtlCommand,
    context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False},
    add_help_option=False,
)
def ctl(
    words: Annotated[
        list[str] | None, typer.Argument(metavar="OPERATION ...", autocompletion=_next_words)
    ] = None,
) -> None:
    """Do something to a box that runs with --control-port: set inputs, push, stop, answer, read the log."""
    from ur_emulator.host.control_api.command_line import main as control

    raise typer.Exit(control(words or ()))


@app.command(
    epilog=examples(
        "ur-emulator pendant 127.0.0.1",
        "ur-emulator pendant 127.0.0.1 --control-port 29900",
        "ur-emulator pendant 192.168.0.10 --tool robotiq-2f85",
    )
)
def pendant(
    hosts: Annotated[list[str], typer.Argument(metavar="HOST...", help="Boxes or real arms.")],
    port: Annotated[int, _window_port()] = PENDANT_PORT,
    port_base: Annotated[int, _option("Offset of the robots' ports, as given to the box.")] = 0,
    control_port: Annotated[
        list[int] | None,
        _option("Control API of an emulated box, once for each host: opens what no pendant has."),
    ] = None,
    view: Annotated[bool, _option("Show only, hold nothing.", "--view")] = False,
    tool: Annotated[
        str | None, _option("Tool of a robot without a control API: a name, or FILE.toml.")
    ] = None,
    cell: Annotated[Path | None, _option("What stands around such a robot: a cell file.")] = None,
    listen: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address of this machine that the window is on.")
    ] = "127.0.0.1",
    token: Annotated[
        str | None,
        _option(
            "What a page must show, as /?token=...; needed beyond loopback.",
            envvar=PAGE_TOKEN_VARIABLE,
            show_envvar=True,
        ),
    ] = None,
) -> None:
    """Open a window on boxes in the browser, or on real arms, which are only shown."""
    _check_window()
    if token is not None:
        os.environ[PAGE_TOKEN_VARIABLE] = token
    where = {"hosts": hosts, "control_ports": control_port or (), "port_base": port_base}
    options = _window_options(**where, port=port, view=view, tool=tool, cell=cell, listen=listen)
    # A shell has a command in the background ignore it, also after `execv`, but not what was caught.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.execv(sys.executable, [*_WINDOW, options])


def _check_window() -> None:
    if find_spec("viser") is None:
        _complain("a window needs the package viser: pip install 'ur-hil[pendant]'")
        raise typer.Exit(ExitCode.FAILED)


# The window is a process of its own, which is a client like others; its options are JSON.
_WINDOW = (sys.executable, "-m", "ur_pendant")


def _window_options(**options: Any) -> str:
    """Return the options of `ur_pendant.window.show_robots`, all of them, as its process takes them."""
    return json.dumps(options, default=str)


class _WindowProcess:
    """The window on boxes, which loads while they do. It says where it is, or why it is not there."""

    def __init__(self, tokens: Mapping[str, str], listen: str, port: int, *, view: bool) -> None:
        options, self._options = os.pipe()
        command = [*_WINDOW, f"fd:{options}"]
        self._process = subprocess.Popen(command, env={**os.environ, **tokens}, pass_fds=[options])
        os.close(options)
        self._fixed = {"port": port, "listen": listen, "view": view, "tool": None, "cell": None}

    def open(self, served: Sequence[ServedAt]) -> None:
        """Tell it where the boxes are."""
        hosts, controls = [at.host for at in served], [at.control_port for at in served]
        base = served[0].port_base
        options = _window_options(hosts=hosts, control_ports=controls, port_base=base, **self._fixed)
        with suppress(OSError):  # it has ended already
            os.write(self._options, options.encode())
        os.close(self._options)

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        self._process.wait()


def raise_descriptor_limit() -> None:
    """Raise this process's limit of descriptors as far as the system allows.

    Each client takes a descriptor, and some systems start with 256.
    """
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def _ports_line(at: ServedAt) -> str:
    """Name the ports that a user may want to connect to."""
    numbers = {**dataclasses.asdict(at.ports), "control": at.control_port}
    shown = {name: number for name, number in numbers.items() if number and not name.endswith("_ro")}
    return ", ".join(f"{name.replace('_', ' ')} {number}" for name, number in shown.items())


def _notices(served: Sequence[ServedAt]) -> Iterator[str]:
    """Yield what the user should know before the boxes run."""
    first, *others = served
    for notice in first.notices:  # all boxes have the same options
        yield f"{notice} (the same for {len(others)} more boxes)" if others else notice
    if not is_loopback(first.host):
        yield (
            f"other machines can reach {first.host}: whoever reaches port {first.ports.secondary} "
            "(30002) runs programs here, which may connect to anything; let a firewall decide who"
        )


def _show_entry(err: LineWriter, prefix: str, entry: LogEntry) -> None:
    err.write(f"{prefix}{entry}")


def _write_ready_file(path: Path, served: Sequence[ServedAt]) -> None:
    """Write the file in one step: a reader never sees half of it.

    Its top level describes the first box, `boxes` all of them.
    """
    boxes = [
        {
            "host": at.host,
            "ports": dataclasses.asdict(at.ports),
            "serial_number": at.serial_number,
            "control_port": at.control_port,
        }
        for at in served
    ]
    facts = {**boxes[0], "boxes": boxes}
    part = Path(f"{path}.part")
    try:
        part.write_text(json.dumps(facts) + "\n")
        part.replace(path)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        why = error.strerror
        raise EmulatorError(f"--ready-file {path} cannot be written ({why}): give another path") from None


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run_app(app, "ur-emulator", None, _complain))


def _complain(text: str) -> None:
    sys.stderr.write(f"ur-emulator: {printable(' '.join(text.split()))}\n")


if __name__ == "__main__":
    main()
