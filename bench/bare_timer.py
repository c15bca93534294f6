"""How punctual this machine is without us: a process that does nothing but wake up every cycle.

Runs beside the realtime measurement, so that a late frame is separated from a late machine.
Prints the 99.9th percentile and the maximum of its lateness in microseconds when its time is over.
"""

from __future__ import annotations

import select
import socket
import sys
import time


def main(seconds: float, period: float) -> None:
    """Wake up at absolute deadlines, a period [s] apart, for so many seconds."""
    idle, _other_end = socket.socketpair()
    began = time.monotonic()
    lateness = []
    for k in range(1, round(seconds / period)):
        deadline = began + k * period
        while (now := time.monotonic()) < deadline:
            select.select([idle], [], [], deadline - now)
        lateness.append(now - deadline)
    lateness.sort()
    print(1e6 * lateness[int(0.999 * len(lateness))], 1e6 * lateness[-1])


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]))
