"""`python -m ur_pendant`: the process of a window, which `ur-emulator pendant` and `ur-client view` start."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from itertools import zip_longest
from pathlib import Path
from typing import Annotated

import typer

from pc_client.errors import ClientError
from pc_client.kinematics.tool import surroundings
from protocol.errors import ProtocolError
from protocol.ur_types import Ports
from ur_emulator.box_log import printable
from ur_emulator.box_options import TOKEN_VARIABLE
from ur_hil.command_line import ExitCode, examples, new_app, run_app
from ur_pendant.drawing import RobotDrawing
from ur_pendant.hands import Hands
from ur_pendant.panel import Panel
from ur_pendant.recordings import RecordingsWindow, load_track
from ur_pendant.robot import RATE, Address, Robot
from ur_pendant.server import DEFAULT_PORT, PageServer, WindowError, open_server

app = new_app("A window on a control box, a real arm or recordings, in the browser.")

_BESIDE = 1.3
"""From one arm to the next in a window of several [m]."""

PortOption = Annotated[int, typer.Option("--port", help="Port of the window; 0 takes a free one.")]
ListenOption = Annotated[
    str, typer.Option("--listen", metavar="ADDRESS", help="Address of this machine that the window is on.")
]
TokenOption = Annotated[
    str | None,
    typer.Option("--token", help="What a page must show, as /?token=...; needed beyond loopback."),
]


@app.command(
    epilog=examples(
        "ur-emulator pendant 127.0.0.1",
        "ur-emulator pendant 127.0.0.1 --control-port 29900",
        "ur-emulator pendant 192.168.0.10 --tool robotiq-2f85",
    )
)
def pendant(
    hosts: Annotated[list[str], typer.Argument(metavar="HOST...", help="Boxes or real arms.")],
    port: PortOption = DEFAULT_PORT,
    port_base: Annotated[int, typer.Option(help="Offset of the robots' ports, as given to the box.")] = 0,
    control_port: Annotated[
        list[int] | None,
        typer.Option(help="Control API of an emulated box, one for each host: opens what no pendant has."),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show only, hold nothing.")] = False,
    tool: Annotated[
        str | None, typer.Option(help="Tool of a robot without a control API: a name, or FILE.toml.")
    ] = None,
    cell: Annotated[Path | None, typer.Option(help="What stands around such a robot: a cell file.")] = None,
    listen: ListenOption = "127.0.0.1",
    token: TokenOption = None,
) -> None:
    """Show robots, and hold those that say that they are simulated. A real arm is only shown."""
    ports, around = Ports.standard(port_base), surroundings(cell, tool)
    server = open_server(listen, port, token, "UR")
    control_token = os.environ.get(TOKEN_VARIABLE)
    robots: list[Robot] = []
    updates: list[Callable[[], None]] = []
    for k, (host, control) in enumerate(zip_longest(hosts, (control_port or ())[: len(hosts)], fillvalue=0)):
        robot = Robot(Address(str(host), ports, int(control), control_token), view_only=view)
        drawing = RobotDrawing(server, f"/robot{k}", robot, (0.0, -_BESIDE * k, 0.0), around)
        container = server.gui.add_folder(str(host)) if len(hosts) > 1 else None
        panel = Panel(server, robot, Hands(robot), drawing, container)
        robots.append(robot)
        updates += [drawing.update, panel.update]
    _announce(server.get_host(), server.get_port(), token)
    try:
        _run(server, updates)
    finally:
        for robot in robots:
            robot.close()
        server.stop()


@app.command(
    epilog=examples(
        "ur-client view out/run/lognorm_4_1_r1.mcap", "ur-client view a.mcap b.mcap --save page.html"
    )
)
def view(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Recordings (.mcap).")],
    save: Annotated[
        Path | None, typer.Option(metavar="PAGE.html", help="Write a page that needs no server, and end.")
    ] = None,
    port: PortOption = DEFAULT_PORT,
    listen: ListenOption = "127.0.0.1",
    token: TokenOption = None,
) -> None:
    """Show recordings: arm, reference, speeds and errors, with a bar of time."""
    tracks = [load_track(path) for path in files]
    server = open_server(listen, 0 if save is not None else port, token, "UR recordings")
    window = RecordingsWindow(server, tracks)
    if save is not None:
        window.save_page(server, save)
        typer.echo(f"page: {save}")
        return
    _announce(server.get_host(), server.get_port(), token)
    try:
        _run(server, [window.update])
    finally:
        server.stop()


def _run(server: PageServer, updates: list[Callable[[], None]]) -> None:
    """Update the page thirty times a second, until the process is interrupted."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: `serve` ends its window with it
    with suppress(KeyboardInterrupt):
        while updates:
            begun = time.monotonic()
            with server.atomic():
                _update(updates)
            time.sleep(max(0.0, 1.0 / RATE - (time.monotonic() - begun)))


def _update(updates: list[Callable[[], None]]) -> None:
    for update in list(updates):
        try:
            update()
        except Exception as error:  # what one robot sends must not end the window on the others
            updates.remove(update)
            _complain(f"a part of the window is shown no more: {type(error).__name__}: {error}")


def _announce(host: str, port: int, token: str | None) -> None:
    """Say where the window is; on a terminal, a line opens it."""
    where = f"[{host}]" if ":" in host else host
    url = f"http://{where}:{port}" + ("" if token is None else "/?token=...")
    on_terminal = token is None and sys.stdin is not None and sys.stdin.isatty()
    typer.echo(f"window at {url}" + ("; press Enter to open it in the browser" if on_terminal else ""))
    sys.stdout.flush()
    if on_terminal:
        threading.Thread(target=lambda: sys.stdin.readline() and webbrowser.open(url), daemon=True).start()


def _complain(text: str) -> None:
    sys.stderr.write(f"ur-pendant: {printable(' '.join(text.split()))}\n")


def main() -> None:
    """Run the command line."""
    try:
        code = run_app(app, "ur-pendant", None, _complain)
    except (ClientError, ProtocolError, WindowError) as error:
        _complain(str(error))
        code = ExitCode.FAILED
    sys.exit(code)


if __name__ == "__main__":
    main()
