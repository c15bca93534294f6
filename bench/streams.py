"""Many cheap clients in one process: they count frames by their time stamps and note when each one came.

    python bench/streams.py SECONDS PERIOD '[["127.0.0.1", 30003, "realtime"], ["127.0.0.1", 30004, "rtde"]]'

says "ready" when all are connected, reads, then prints one JSON object, see `main`. A process of its own:
nothing else shall want its interpreter.
"""

from __future__ import annotations

import json
import selectors
import socket
import struct
import sys
import time
from array import array

import numpy as np
from numpy.typing import NDArray

from protocol.rtde.client_connection import RtdeClientConnection
from protocol.rtde.codec import Request, RequestProtocolVersion, SetupOutputs, Start

# What a monitor asks for: the time stamp first, then some 500 bytes.
RECIPE = (
    "timestamp",
    *("target_q", "target_qd", "actual_q", "actual_qd", "actual_current", "actual_TCP_pose"),
    *("actual_TCP_speed", "actual_TCP_force", "robot_mode", "safety_mode", "runtime_state", "speed_scaling"),
)
_STAMP = struct.Struct(">d").unpack_from
_STAMP_AT = 4  # in a realtime frame behind its size; in an RTDE package behind size, type and recipe
_SIZE = {"realtime": struct.Struct(">i"), "rtde": struct.Struct(">H")}
_BUFFER = 1 << 16
_Times = NDArray[np.float64]  # s
# What came while others were still connecting is read but does not count.
_CATCH_UP = 0.5  # s


class Stream:
    """One client.

    Attributes:
        period: control cycle of the box [s].
        stamps: time stamps of what has come [s].
        arrivals: monotonic time at which each came [s].
    """

    def __init__(self, host: str, port: int, kind: str, period: float) -> None:
        """Connect to a box with this control cycle [s]; an RTDE client sets itself up."""
        self.sock = socket.create_connection((host, port), timeout=10.0)
        if kind == "rtde":
            connection = RtdeClientConnection()
            for request in (RequestProtocolVersion(2), SetupOutputs(RECIPE, round(1.0 / period)), Start()):
                self._ask(connection, request)
        self.sock.setblocking(False)
        self.period = period
        self.stamps, self.arrivals = array("d"), array("d")
        self._size = _SIZE[kind]
        self._buffer = bytearray(_BUFFER)
        self._view = memoryview(self._buffer)
        self._filled = 0

    def read(self) -> None:
        """Take what has come."""
        self._filled += self.sock.recv_into(self._view[self._filled :])
        now = time.monotonic()
        at, filled, buffer = 0, self._filled, self._buffer
        while filled - at >= self._size.size:
            size = self._size.unpack_from(buffer, at)[0]
            if filled - at < size:
                break
            self.stamps.append(_STAMP(buffer, at + _STAMP_AT)[0])
            self.arrivals.append(now)
            at += size
        if at < filled:
            buffer[: filled - at] = buffer[at:filled]
        self._filled = filled - at

    def _ask(self, connection: RtdeClientConnection, request: Request) -> None:
        self.sock.sendall(connection.send(request))
        while connection.next_event() is None:
            connection.receive_data(self.sock.recv(4096))


def lost_cycles(stream: Stream) -> int:
    """How many cycles never came: holes in the stream, and cycles by which the box fell behind the clock."""
    cycles = np.round(np.array(stream.stamps) / stream.period).astype(int)
    holes = cycles[-1] - cycles[0] + 1 - len(np.unique(cycles))
    late, fifth = _phases(stream), max(1, len(cycles) // 5)
    behind = np.median(late[-fifth:]) - np.median(late[:fifth])
    return int(holes) + max(0, round(float(behind) / stream.period))


def lateness(streams: list[Stream]) -> _Times:
    """How late the frames of one box came [s], measured from the grid on which the earliest of all lie."""
    late = np.concatenate([_phases(stream) for stream in streams])
    behind_the_earliest: _Times = late - late.min()
    return behind_the_earliest


def _phases(stream: Stream) -> _Times:
    period = stream.period
    return np.array(stream.arrivals) - period * np.round(np.array(stream.stamps) / period)


def main(seconds: float, period: float, clients: list[tuple[str, int, str]]) -> dict[str, object]:
    """Read for so many seconds from boxes with this control cycle [s].

    Returns:
        lost: cycles that each client lost, in their order; late_us: its 50th, 99th and 99.9th percentile and
        maximum over all clients; cpu_percent: of this process.
    """
    streams = [Stream(*client, period) for client in clients]
    selector = selectors.DefaultSelector()
    for stream in streams:
        selector.register(stream.sock, selectors.EVENT_READ, stream.read)
    print("ready", flush=True)
    _read_until(time.monotonic() + _CATCH_UP, selector)
    for stream in streams:
        del stream.stamps[:], stream.arrivals[:]
    used = time.process_time()
    _read_until(time.monotonic() + seconds, selector)
    used = time.process_time() - used
    by_host: dict[str, list[Stream]] = {}
    for (host, _, _), stream in zip(clients, streams, strict=True):
        by_host.setdefault(host, []).append(stream)
    late = 1e6 * np.concatenate([lateness(group) for group in by_host.values()])
    return {
        "lost": [lost_cycles(stream) for stream in streams],
        "late_us": np.percentile(late, [50.0, 99.0, 99.9, 100.0]).tolist(),
        "cpu_percent": 100.0 * used / seconds,
    }


def _read_until(end: float, selector: selectors.BaseSelector) -> None:
    while time.monotonic() < end:
        for key, _ in selector.select(1.0):
            key.data()


if __name__ == "__main__":
    print(json.dumps(main(float(sys.argv[1]), float(sys.argv[2]), json.loads(sys.argv[3]))))
