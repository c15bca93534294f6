"""What no closed loop can be faster than: the steps of the arm's physics and one round trip of its bytes.

Measured beside the loop itself, so that both have the same machine at the same time.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

import mujoco

from bench.length import FULL, Length
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.plant import Plant

FRAME, COMMAND = 1140, 28  # bytes of a realtime frame, and of a velocity command with its mode
BATCHES, BATCH = 200, 20
# The other end of the round trip: plain blocking sockets, nothing but the interpreter between the calls.
_ECHO = """
import socket, sys
with socket.create_connection(("127.0.0.1", int(sys.argv[1]))) as sock:
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    left, command = int(sys.argv[2]), bytes(int(sys.argv[3]))
    while data := sock.recv(65536):
        left -= len(data)
        if not left:
            left = int(sys.argv[2])
            sock.send(command)
"""


class Limit(NamedTuple):
    """In microseconds: the best of many batches, for whatever disturbs one is not part of it."""

    steps_us: float
    round_trip_us: float

    @property
    def cycle_us(self) -> float:
        """Both, one after the other."""
        return self.steps_us + self.round_trip_us


def measure_limit(robot: str, length: Length = FULL) -> Limit:
    """Measure both parts, in a second."""
    return Limit(_measure_steps(robot, length), _measure_round_trip(length))


def _measure_steps(robot: str, length: Length) -> float:
    """The steps of a cycle of the arm's own model, at rest under its servos [us]."""
    arm = robot_by_name(robot)
    generation = arm.generation
    plant = Plant(arm, generation.fidelity("typical"), 7)
    for _ in range(100):
        plant.step(JointTarget(arm.home_q))
    model, data = plant._physics.model, plant._physics.data
    return best_of(lambda: mujoco.mj_step(model, data, generation.n_substeps), length)


def _measure_round_trip(length: Length) -> float:
    with socket.create_server(("127.0.0.1", 0)) as server:
        arguments = (str(server.getsockname()[1]), str(FRAME), str(COMMAND))
        echo = subprocess.Popen([sys.executable, "-c", _ECHO, *arguments])
        sock = server.accept()[0]
    frame = bytes(FRAME)
    with sock:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def there_and_back() -> None:
            sock.send(frame)
            left = COMMAND
            while left:
                left -= len(sock.recv(left))

        best = best_of(there_and_back, length)
    echo.wait()
    return best


def best_of(action: Callable[[], object], length: Length) -> float:
    """Microseconds that an action takes, over the best of many batches."""
    best = float("inf")
    for _ in range(length.part_of(BATCHES)):
        began = time.perf_counter()
        for _ in range(BATCH):
            action()
        best = min(best, time.perf_counter() - began)
    return 1e6 * best / BATCH
