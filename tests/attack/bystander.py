"""Bystanders of an attack, each in a process of its own: a reader of port 30003, and a timer that also looks at memory.

    python bystander.py stream HOST PORT PERIOD
    python bystander.py timer PID

Both print "ready", go on until their standard input is closed, then print one JSON object: `Stream`, `Timer`.
"""

import json
import os
import select
import socket
import struct
import sys
import time
from contextlib import suppress
from itertools import pairwise

import psutil

PERIOD = 0.008  # s; of the timer
_LOOK_EVERY = 5  # periods between two looks at the memory
_CHILDREN_EVERY = 25  # periods between two searches for worker processes; they cost most
_HEAD = struct.Struct(">id")
_MB = 1e6


def stream(host, port, period):
    """Read frames.

    Returns:
        rate: robot time per real time; gap_ms: longest time without a frame; lost: cycles without a frame; closed:
        the box has ended the stream.
    """
    sock = socket.create_connection((host, port), timeout=10.0)
    stamps, arrivals, buffer = [], [], bytearray()

    def read():
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


def timer(pid):
    """Wake up every 8 ms, and look at the memory of a process and of its children.

    Returns:
        gap_ms: longest time between two wakes; box_mb, worker_mb: most memory that the process held, and most that
        its children held together.
    """
    box, children, box_peak, worker_peak, k = psutil.Process(pid), [], 0, 0, 0
    began = last = time.monotonic()
    gap = 0.0
    _begin()
    while not select.select([sys.stdin], [], [], max(0.0, began + k * PERIOD - time.monotonic()))[0]:
        now = time.monotonic()
        gap, last = max(gap, now - last), now
        with suppress(psutil.Error):
            if k % _CHILDREN_EVERY == 0:
                children = box.children()
            if k % _LOOK_EVERY == 0:
                box_peak = max(box_peak, peak_memory(pid))
                worker_peak = max(worker_peak, sum(peak_memory(child.pid) for child in children))
        # What the looks cost is no gap of the host.
        last += time.monotonic() - now
        k = max(k + 1, round((last - began) / PERIOD))
    return {
        "gap_ms": 1e3 * gap,
        "box_mb": max(box_peak, peak_memory(pid)) / _MB,
        "worker_mb": worker_peak / _MB,
    }


def peak_memory(pid):
    """Return the most memory that a process has held at once [bytes], 0 for one that has ended."""
    with suppress(OSError), open(f"/proc/{pid}/status") as status:
        for line in status:
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    return 0


def _received(sock):
    try:
        return sock.recv(1 << 16)
    except OSError:
        return b""


def _begin():
    os.write(1, b"ready\n")


if __name__ == "__main__":
    role, *rest = sys.argv[1:]
    print(
        json.dumps(stream(rest[0], int(rest[1]), float(rest[2])) if role == "stream" else timer(int(rest[0])))
    )
