"""What runs beside the box while it is measured, each in its own process: the clients, and a bare timer."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass

from bench import bare_timer, streams


@dataclass(frozen=True, slots=True)
class Watched:
    """What the clients saw.

    Attributes:
        lost: cycles that each client lost, in their order.
        late_us: lateness over all of them: 50th, 99th and 99.9th percentile, maximum.
        timer_us: lateness of the bare timer in the same time: 99.9th percentile, maximum.
        clients_cpu_percent: of the process of the clients.
    """

    lost: list[int]
    late_us: tuple[float, float, float, float]
    timer_us: tuple[float, float]
    clients_cpu_percent: float


class SideProcesses:
    """Clients and timer, from now on for so many seconds."""

    def __init__(self, seconds: float, period: float, clients: list[tuple[str, int, str]]) -> None:
        """Start both; return when all clients are connected.

        Args:
            seconds: how long they read.
            period: control cycle of the boxes [s].
            clients: host, port and kind ("realtime" or "rtde") of each.
        """
        self._streams = _start(streams.__file__, str(seconds), str(period), json.dumps(clients))
        assert self._streams.stdout is not None
        if self._streams.stdout.readline() != "ready\n":
            sys.exit("bench: the clients could not connect")
        self._timer = _start(bare_timer.__file__, str(seconds), str(period))

    def wait(self) -> Watched:
        """Wait for their end."""
        seen = json.loads(self._streams.communicate()[0])
        p999, largest = map(float, self._timer.communicate()[0].split())
        return Watched(seen["lost"], tuple(seen["late_us"]), (p999, largest), seen["cpu_percent"])


def _start(*command: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True)
