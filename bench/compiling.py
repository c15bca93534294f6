"""What a long program that is compiled costs those who read the box: frames lost or late meanwhile."""

from __future__ import annotations

import socket
import sys
import time

from bench.box_process import box_process
from bench.length import FULL, Length
from bench.script import driver_like_script
from bench.side_process import SideProcesses
from ur_emulator.machine.models.generations import CB3

_EVERY = 1.0  # s, from one program to the next
_LIMIT = 30.0  # s


def measure_compiling(length: Length = FULL) -> dict[str, float]:
    """Send a control script again and again, one client reading; then only read."""
    seconds = length.seconds
    with box_process("--seed", "7") as box:
        reader = [(box.host, box.ports.realtime, "realtime")]
        beside = SideProcesses(seconds, CB3.period_s, reader)
        took = _send_programs(box.host, box.ports.secondary, seconds - _EVERY)
        busy = beside.wait()
        idle = SideProcesses(seconds, CB3.period_s, reader).wait()
    return {
        "compile_in_box_s": min(took),
        "frames_lost_while_compiling": float(sum(busy.lost)),
        "frames_late_p99_us_while_compiling": busy.late_us[1],
        "frames_late_p99_us_without": idle.late_us[1],
        "frames_late_max_us_while_compiling": busy.late_us[3],
        "frames_late_max_us_without": idle.late_us[3],
    }


def _send_programs(host: str, port: int, seconds: float) -> list[float]:
    """Send programs, at least one, that call back when they run; return how long each took until then [s]."""
    took: list[float] = []
    with (
        socket.create_connection((host, port), timeout=_LIMIT) as box,
        socket.create_server((host, 0)) as home,
    ):
        home.settimeout(_LIMIT)
        script = _calling_back(host, home.getsockname()[1]).encode()
        end = time.monotonic() + seconds
        while not took or time.monotonic() < end:
            began = time.monotonic()
            box.sendall(script)
            try:
                home.accept()[0].close()
            except TimeoutError:
                sys.exit("bench: the program did not run")
            took.append(time.monotonic() - began)
            _drain(box, began + _EVERY)
    return took


def _calling_back(host: str, port: int) -> str:
    """The control script, its first deed being to connect to us."""
    head, _, rest = driver_like_script().partition("\n")
    return f'{head}\n  socket_open("{host}", {port})\n{rest}'


def _drain(sock: socket.socket, until: float) -> None:
    """Read what the box sends until a point in time, so that it need not wait for us."""
    while (left := until - time.monotonic()) > 0.0:
        sock.settimeout(left)
        try:
            sock.recv(1 << 16)
        except TimeoutError:
            return
