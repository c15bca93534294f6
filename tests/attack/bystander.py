"""Bystanders of an attack, each in a process of its own: a reader of port 30003, and a bare timer.

    python bystander.py stream HOST PORT PERIOD
    python bystander.py timer PERIOD

Both print "ready", go on until their standard input is closed, then print one JSON object.
"""

import json
import os
import select
import socket
import struct
import sys
import time
from itertools import pairwise

_HEAD = struct.Struct(">id")


def stream(host: str, port: int, period: float) -> dict[str, float]:
    """Read frames.

    Returns:
        rate: robot time per real time; gap_ms: longest time without a frame; lost: cycles without a frame; closed:
        the box has ended the stream.
    """
    sock = socket.create_connection((host, port), timeout=10.0)
    stamps: list[float] = []
    arrivals: list[float] = []
    buffer = bytearray()

    def read() -> bool:
        data = _received(sock)
        now = time.monotonic()
        buffer.extend(data)
        while len(buffer) >= _HEAD.size and len(buffer) >= (size := _HEAD.unpack_from(buffer)[0]):
            stamps.append(_HEAD.unpack_from(buffer)[1])
            arrivals.append(now)
            del buffer[:size]
        return bool(data)

    while not stamps and read():
        pass
    _begin()
    is_open = True
    while sys.stdin not in select.select([sys.stdin] + [sock] * is_open, [], [])[0]:
        is_open = is_open and read()
    if is_open:  # a stream that stood still at the end has a gap there
        stamps.append(stamps[-1])
        arrivals.append(max(arrivals[-1], time.monotonic() - period))
    cycles = {round(stamp / period) for stamp in stamps}
    return {
        "rate": (stamps[-1] - stamps[0]) / max(period, arrivals[-1] - arrivals[0]),
        "gap_ms": 1e3 * max(after - before for before, after in pairwise(arrivals)),
        "lost": max(cycles) - min(cycles) + 1 - len(cycles),
        "closed": not is_open,
    }


def timer(period: float) -> dict[str, float]:
    """Wake up once a period.

    Returns:
        timer_gap_ms: longest time between two wakes.
    """
    began = last = time.monotonic()
    gap, k = 0.0, 0
    _begin()
    while not select.select([sys.stdin], [], [], max(0.0, began + k * period - time.monotonic()))[0]:
        now = time.monotonic()
        gap, last = max(gap, now - last), now
        k = max(k + 1, round((now - began) / period))
    return {"timer_gap_ms": 1e3 * gap}


def _received(sock: socket.socket) -> bytes:
    try:
        return sock.recv(1 << 16)
    except OSError:
        return b""


def _begin() -> None:
    os.write(1, b"ready\n")


if __name__ == "__main__":
    role, *rest = sys.argv[1:]
    print(
        json.dumps(
            stream(rest[0], int(rest[1]), float(rest[2])) if role == "stream" else timer(float(rest[0]))
        )
    )
