"""Clients that come and go, 200 a second over all ports, polite and rude ones: what remains of them?"""

from __future__ import annotations

import random
import socket
import struct
import time
from contextlib import suppress
from itertools import count

from rich.progress import track

from bench.box_process import BoxProcess, box_process
from bench.length import FULL, Length
from bench.side_process import SideProcesses
from protocol.ur_types import Ports
from ur_emulator.machine.models.generations import CB3

RATE = 200.0  # connections a second
# Before memory is compared the box must have seen everything once, and its bounded log must be full.
_WARM_UP = 4000  # connections
_SETTLE = 1.0  # s
_RESET = struct.pack("ii", 1, 0)

_NAMES = b"timestamp,actual_q,actual_qd,target_q"
_RTDE_SETUP = (
    struct.pack(">HBH", 5, ord("V"), 2)
    + struct.pack(">HBd", 11 + len(_NAMES), ord("O"), 125.0)
    + _NAMES
    + struct.pack(">HB", 3, ord("S"))
)
_SCRIPT = b"def f():\n  textmsg(1)\nend\n"
# What a client of each port says that gets an answer; ports that only speak have nothing.
_REQUESTS = {
    "dashboard": b"robotmode\n",
    "primary": _SCRIPT,
    "secondary": _SCRIPT,
    "realtime": b"set_digital_out(0, True)\n",
    "rtde": _RTDE_SETUP,
    "modbus": bytes.fromhex("000100000006010300800002"),
}
MANNERS = ("silent", "garbage", "half a request", "reset", "answered")


def visit(host: str, number: int, request: bytes, manner: str, rng: random.Random) -> None:
    """Connect once and behave like that."""
    with socket.create_connection((host, number), timeout=10.0) as sock, suppress(OSError):
        if manner == "garbage":
            sock.sendall(rng.randbytes(200))
        elif manner == "half a request":
            sock.sendall(request[: len(request) // 2])
        elif manner == "reset":
            sock.sendall(request)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
        elif manner == "answered":
            sock.sendall(request)
            sock.recv(4096)


def measure_connect_storm(length: Length = FULL) -> dict[str, float]:
    """Storm, after a storm that warms up."""
    seconds = length.seconds
    with box_process("--seed", "7") as box:
        rng = random.Random(7)
        visits = count()
        descriptors = box.process.num_fds()
        for _ in track(range(length.part_of(_WARM_UP)), description="storm, warming up"):
            _visit_next(box, next(visits), rng)
        time.sleep(_SETTLE)
        memory = box.process.memory_info().rss
        beside = SideProcesses(seconds, CB3.period_s, [(box.host, box.ports.realtime, "realtime")])
        box.process.cpu_percent()
        began = time.monotonic()
        n = round(RATE * seconds)
        for k in track(range(n), description=f"{RATE:g} connections a second"):
            time.sleep(max(0.0, began + k / RATE - time.monotonic()))
            _visit_next(box, next(visits), rng)
        lasted = time.monotonic() - began
        cpu = box.process.cpu_percent()
        time.sleep(_SETTLE)
        grown = box.process.memory_info().rss - memory
        kept = box.process.num_fds() - descriptors
        seen = beside.wait()
    return {
        "connect_storm_per_s": n / lasted,
        "connect_storm_leak_kb": grown / 1024,
        "connect_storm_leak_descriptors": float(kept),
        "connect_storm_lost_cycles": float(sum(seen.lost)),
        "connect_storm_late_p999_us": seen.late_us[2],
        "connect_storm_bare_timer_late_p999_us": seen.timer_us[0],
        "connect_storm_cpu_percent": cpu,
    }


def _visit_next(box: BoxProcess, k: int, rng: random.Random) -> None:
    """Every port, in turn, in every manner."""
    names = tuple(Ports.__dataclass_fields__)
    name, manner = names[k % len(names)], MANNERS[k // len(names) % len(MANNERS)]
    if getattr(box.ports, name):
        visit(box.host, getattr(box.ports, name), _REQUESTS.get(name, b""), manner, rng)
