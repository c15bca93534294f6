"""A served box that stands still unless it is told to go on: its loop runs in this thread, cycle by cycle.

All its ports are open. Clients of this process are served between the cycles, and the box waits for its worker,
so the same actions in the same cycles give the same walk, but for the turns of the sockets.
"""

import math
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ur_emulator.errors import ArgumentError, EmulatorError
from ur_emulator.host.box import Box
from ur_emulator.host.box_options import BoxOptions
from ur_emulator.host.control_api.operations import make
from ur_emulator.host.pacing import Situation
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.runtime.worker import TaskQueue
from ur_emulator.host.steps import Steps
from ur_emulator.machine.controller.controller import Controller
from ur_emulator.machine.controller.events import Event
from ur_emulator.machine.controller.snapshot import Snapshot

JOURNAL = "walk.journal"
_HANG = 30.0  # s of real time; no walk waits for it


@dataclass(frozen=True)
class Kind:
    """A robot and its software."""

    name: str
    robot: str
    version: str
    tool: str = "none"
    services: tuple[str, ...] = ()


KINDS = {
    kind.name: kind
    for kind in (
        Kind("CB3 3.15", "ur3", "3.15"),
        Kind("CB3 3.4", "ur5", "3.4"),
        Kind("5.12", "ur3e", "5.12", "robotiq-2f85"),
        Kind("5.25", "ur5e", "5.25.1"),
        Kind("X", "ur5e", "10.12", services=("primary", "rtde")),
    )
}


class WalkBox:
    """A box on a loop of its own.

    Attributes:
        served: the box behind its ports.
        clients: open connections by name; those that broke are gone.
    """

    publish_at = -math.inf

    def __init__(self, kind: Kind, seed: int, programs: Path, fidelity: str = "typical") -> None:
        options = BoxOptions(
            kind.robot, kind.version, port_base=None, seed=seed, programs=programs, fidelity=fidelity,
            tool=kind.tool, services=kind.services, journal=programs / JOURNAL,
        )  # fmt: skip
        self._loop = EventLoop(precise=False)
        self._tasks = TaskQueue(self._loop)
        self._box = Box(options, tasks=self._tasks)
        assert self._box._journal is not None
        self._box._journal._waits = True
        self._box.on_end = self._loop.stop
        self.served = self._box._box
        self.served._pacer, self.served._repeats = self, False
        self.player = self._box._player
        self.clients: dict[str, socket.socket] = {}
        self._left = 0
        self._until: Callable[[], bool] = lambda: True
        self._began = 0.0
        self._error: Exception | None = None
        self._box.listen()
        self._loop.add(self)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.setblocking(False)
        self.peers: list[socket.socket] = []

    @property
    def controller(self) -> Controller:
        return self.served.controller

    @property
    def now(self) -> Snapshot:
        return self.served.snapshot

    @property
    def port(self) -> int:
        """Where programs may connect to."""
        return int(self.listener.getsockname()[1])

    def watch(self, look: Callable[[Snapshot], None], note: Callable[[Event], None]) -> None:
        """Call `look(snapshot)` after every cycle, and `note(event)`; an error in `look` is raised by `tick`."""
        box = self

        class Watcher:
            def publish(self, snapshot: Snapshot) -> None:
                try:
                    if box._error is None:
                        look(snapshot)
                except AssertionError as error:
                    box._error = error

        self.served._publishers = (*self.served._publishers, Watcher())
        self.served._listeners = (*self.served._listeners, note)

    # --- the pacer

    def may_tick(self, now: float, situation: Situation) -> bool:
        if self._left <= 0 or not self._tasks.is_idle:
            return False
        self._left -= 1
        return True

    def next_call(self, now: float) -> float:
        return now if self._left > 0 else now + 1e-3

    # --- a service of the loop, after the box

    def advance(self, now: float) -> float:
        if now - self._began > _HANG:
            raise AssertionError("the box hangs: it does not tick")
        if self._until() or self._error is not None:
            self._loop.stop()
        return now + 1e-3

    def failed(self, error: Exception) -> None:
        raise error

    def _run(self, until: Callable[[], bool]) -> None:
        self._until, self._began = until, time.monotonic()
        self._loop._stopping = False
        self._loop.run()
        if self._error is not None:
            raise self._error
        if self._box.failure is not None:
            raise AssertionError("the box has ended") from self._box.failure

    # --- what a walk does

    def tick(self, cycles: int) -> None:
        self._left += cycles
        self._run(lambda: self._left <= 0)

    def settle(self, turns: int = 5) -> None:
        """Give clients and worker their turns; no time passes."""
        left = [turns]

        def is_settled() -> bool:
            left[0] -= 1
            return left[0] <= 0 and self._tasks.is_idle

        self._run(is_settled)

    def perform(self, name: str, /, **arguments: object) -> None:
        """Have an operation of the control API done, in a cycle or some; what is refused is refused."""
        try:
            operation = make(name, arguments)
        except ArgumentError:
            self.tick(1)  # as for one that the state refuses
        else:
            self._do(lambda done: self._box.begin(operation, done))

    def steps(self, steps: Steps[Any]) -> None:
        """Have done what the player does in steps."""
        self._do(lambda done: self.served.steps.start(steps, done))

    def _do(self, begin: Callable[[Callable[[Any, Exception | None], None]], object]) -> None:
        outcome: list[Exception | None] = []
        begin(lambda result, error: outcome.append(error))
        for _ in range(50):
            self.tick(1)
            if outcome:
                break
        if outcome and outcome[0] is not None and not isinstance(outcome[0], EmulatorError):
            raise AssertionError("an operation failed") from outcome[0]

    def connect(self, name: str) -> None:
        """A client of a port; the one before it leaves."""
        self.leave(name)
        number = getattr(self._box.served_at.ports, name)
        if number:
            client = socket.create_connection(("127.0.0.1", number))
            client.setblocking(False)
            self.clients[name] = client
            self.settle()

    def leave(self, name: str) -> None:
        if client := self.clients.pop(name, None):
            client.close()
            self.settle()

    def send(self, name: str, data: bytes) -> None:
        """Send what a client says, connecting first if need be, and read what came."""
        if name not in self.clients:
            self.connect(name)
        if client := self.clients.get(name):
            try:
                client.send(data)
            except OSError:
                self.leave(name)
        self.settle()
        self.read()

    def read(self) -> None:
        """Let all clients read what they have, and peers of programs be silent."""
        for name, client in tuple(self.clients.items()):
            try:
                while client.recv(1 << 16):
                    pass
                self.leave(name)
            except BlockingIOError:
                pass
            except OSError:
                self.leave(name)
        try:
            while True:
                self.peers.append(self.listener.accept()[0])
        except BlockingIOError:
            pass

    def close(self) -> None:
        for sock in (*self.clients.values(), *self.peers, self.listener):
            sock.close()
        self._box.close()
        self._tasks.close()
        self._loop.close()


def rtde(kind: str, payload: bytes = b"") -> bytes:
    """A package of RTDE."""
    return struct.pack(">HB", 3 + len(payload), ord(kind)) + payload
