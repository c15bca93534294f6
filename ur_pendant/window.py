"""The process of a window; `ur-emulator pendant` and `ur-client view` start it with their options as JSON."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import threading
import time
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from pc_client.errors import ClientError
from pc_client.kinematics.tool import surroundings
from protocol.errors import ProtocolError
from protocol.ur_types import Ports
from ur_emulator.host.box_log import printable
from ur_emulator.host.box_options import PAGE_TOKEN_VARIABLE, TOKEN_VARIABLE
from ur_hil.command_line import ExitCode
from ur_pendant.drawing import RobotDrawing
from ur_pendant.hands import Hands
from ur_pendant.panel import Panel
from ur_pendant.robot import RATE, Address, Robot
from ur_pendant.server import PageServer, WindowError

_BESIDE = 1.3
"""From one arm to the next in a window of several [m]."""

Update = Callable[[], object]


def show_robots(
    hosts: Sequence[str],
    control_ports: Sequence[int],
    port_base: int,
    view: bool,
    tool: str | None,
    cell: str | None,
    port: int,
    listen: str,
) -> None:
    """Show robots until the process is interrupted; options as of `ur-emulator pendant`."""
    ports, around = Ports.standard(port_base), surroundings(cell, tool)
    server = PageServer(listen, port, os.environ.get(PAGE_TOKEN_VARIABLE), "UR")
    controls = [*control_ports, *[0] * len(hosts)]
    robots: list[Robot] = []
    updates: list[Update] = []
    for k, (host, control) in enumerate(zip(hosts, controls, strict=False)):
        address = Address(host, ports, control, os.environ.get(TOKEN_VARIABLE))
        robots.append(robot := Robot(address, view_only=view))
        drawing = RobotDrawing(server, f"/robot{k}", robot, (0.0, -_BESIDE * k, 0.0), around)
        container = server.gui.add_folder(host) if len(hosts) > 1 else None
        panel = Panel(server, robot, Hands(robot), drawing, container)
        updates += [drawing.update, panel.update]
    try:
        _serve(server, updates)
    finally:
        for robot in robots:
            robot.close()


def show_recordings(files: Sequence[str], save: str | None, port: int) -> None:
    """Show recordings until the process is interrupted, or save a page; options as of `ur-client view`."""
    from ur_pendant.recordings import RecordingsWindow, load_track  # with scipy, which the robots do not need

    tracks = [load_track(Path(file)) for file in files]
    server = PageServer("127.0.0.1", 0 if save is not None else port, None, "UR recordings")
    window = RecordingsWindow(server, tracks)
    if save is None:
        _serve(server, [window.update])
    else:
        window.save_page(server, Path(save))
        server.stop()
        print(f"page: {save}")


def _serve(server: PageServer, updates: list[Update]) -> None:
    """Say where the window is; update it thirty times a second and take its events until an interrupt."""
    logging.getLogger("websockets.server").disabled = True  # what pages send may be no message
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: `serve` ends its window with it
    with suppress(KeyboardInterrupt):
        _announce(server)
        while updates:
            end = time.monotonic() + 1.0 / RATE
            with server.atomic():
                for update in list(updates):
                    if not _try(update, "a part of the window is shown no more"):
                        updates.remove(update)
            for handle in server.events.until(end):
                _try(handle, "an event of a page has no effect")
    # Ctrl-C reaches this process and `serve`, which then ends it, too: once is enough.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    server.stop()


def _try(update: Update, consequence: str) -> bool:
    """Whether it could be done; what one robot sends, or a page, must not end the window on the others."""
    try:
        update()
    except Exception as error:
        _complain(f"{consequence}: {type(error).__name__}: {error}")
        return False
    return True


def _announce(server: PageServer) -> None:
    """Say where the window is; on a terminal, a line opens it."""
    host, port = server.address
    has_token = PAGE_TOKEN_VARIABLE in os.environ
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}"
    on_terminal = not has_token and sys.stdin is not None and sys.stdin.isatty()
    more = "/?token=..." if has_token else "; press Enter to open it in the browser" if on_terminal else ""
    print(f"window at {url}{more}", flush=True)
    if on_terminal:
        opening = partial(_open_when_asked, url)
        threading.Thread(target=opening, daemon=True).start()


def _open_when_asked(url: str) -> None:
    if sys.stdin.readline():
        webbrowser.open(url)


def _complain(text: str) -> None:
    sys.stderr.write(f"window: {printable(' '.join(text.split()))}\n")


def main() -> None:
    """Show what the options say, and end the process."""
    sys.exit(_show())


def _show() -> ExitCode:
    try:
        words = sys.argv[1]
        if words.startswith("fd:"):  # options come when the boxes are there
            with open(int(words[3:])) as pipe:
                words = pipe.read() or sys.exit(ExitCode.DONE)
        options = json.loads(words)
        (show_recordings if "files" in options else show_robots)(**options)
    except (IndexError, ValueError, TypeError):
        _complain("start it by `ur-emulator pendant HOST` or `ur-client view FILE`")
        return ExitCode.WRONG_USAGE
    except (ClientError, ProtocolError, WindowError) as error:
        _complain(str(error))
        return ExitCode.FAILED
    return ExitCode.DONE
