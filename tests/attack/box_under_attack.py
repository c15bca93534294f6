"""A box under attack: `ur-emulator serve` in its own process, bystanders beside it, and questions to it afterwards.

with serving(KINDS["e-Series"]) as box, watching(box) as seen:
    attack(box)
seen.rate, seen.gap_ms, box.problems()
"""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count, cycle
from pathlib import Path
from typing import Any

import bystander
import psutil

from protocol.realtime.layout import RealtimeLayout, layout_for_version
from protocol.ur_types import Ports
from ur_emulator.machine.models.robots import robot_by_name

PATIENCE = 60.0  # s; a box that has not answered by then does not answer
MOST_MEMORY = 300.0  # MB; of the box and its worker processes together
# Clients of attacks have these in turn; the innocent one has 127.0.0.1.
ADDRESSES = ("127.0.0.2", "127.0.0.3", "127.0.0.4", "127.0.0.5")
# Away from the standard ports, and below those that the kernel gives to clients.
PORT_BASE, CONTROL_PORT = 1000, 30_900
_START = "import sys\nsys.argv[0] = 'ur-emulator'\n{prelude}\nfrom ur_emulator.cli import main\nmain()\n"
_MOVE = "def alive():\n  speedj([{speed}, 0, 0, 0, 0, 0], 2.0, 0.1)\n  stopj(5.0)\nend\n"
_REPORT_AGAIN = 250  # frames
_LOOK_PERIOD = 0.02  # s; between two looks at what is resident, which cost nothing
_MORE = 2e6  # bytes; so much more is a new peak: shares in common pages take 10 ms to be counted
_PAGE = os.sysconf("SC_PAGE_SIZE")
_MODES = ("robot_mode", "safety_mode", "operational_mode", "remote_control")
_numbers = count(1)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of box.

    Attributes:
        name: in results and on the page.
        robot: type of the arm.
        software: "" for that of the generation.
        options: more options of `ur-emulator serve`.
    """

    name: str
    robot: str
    software: str = ""
    options: tuple[str, ...] = ()


KINDS = {
    kind.name: kind
    for kind in (
        Kind("CB3", "ur3"),
        Kind("e-Series", "ur5e", "5.25.1", ("--tool", "robotiq-2f85,onrobot-rg2")),
        Kind("PolyScope X", "ur5e", "10.14.0", ("--services", "primary,rtde")),
        Kind("oldest", "ur3", "3.0.0"),
        Kind("rack", "ur3", "", ("--boxes", "3")),
    )
}
# Those with a dashboard; that with grippers; the first, for what is the same in all of them.
WITH_DASHBOARD = ("CB3", "e-Series", "oldest", "rack")
WITH_GRIPPER = ("e-Series",)
ONE = ("CB3",)


@dataclass(slots=True)
class BoxUnderAttack:
    """A served box.

    Attributes:
        process: in which it runs.
        host: its address.
        ports: its ports.
        layout: of its frames.
        period: its control cycle [s].
        neighbour: address of the last box of its rack; its own without one.
        programs: its folder of programs.
        errors: the file that stderr goes to, unless an attack took it.
        at_rest: descriptors and threads before the attack.
        modes: of all boxes before the attack.
        is_stopped: it was told to end.
    """

    process: subprocess.Popen[bytes]
    host: str
    ports: Ports
    layout: RealtimeLayout
    period: float
    neighbour: str
    programs: Path
    errors: Path
    at_rest: tuple[int, int] = (0, 0)
    modes: tuple[dict[str, Any], ...] = ()
    is_stopped: bool = False
    _turns: Iterator[int] = field(default_factory=count)
    _addresses: Iterator[str] = field(default_factory=lambda: cycle(ADDRESSES))

    @property
    def open_ports(self) -> tuple[str, ...]:
        """Names of the ports that take something."""
        names = (
            "dashboard primary secondary realtime rtde modbus interpreter robot_api tool_line gripper onrobot"
        )
        return (*(name for name in names.split() if getattr(self.ports, name)), "control")

    def has(self, port: str) -> bool:
        """Return whether this port is open."""
        return port in self.open_ports

    def connect(self, port: str, timeout: float = PATIENCE, source: str = "") -> socket.socket:
        """Connect to a port by its name in `Ports`, or "control", from an address or from the next of `ADDRESSES`."""
        number = CONTROL_PORT if port == "control" else getattr(self.ports, port)
        source = source or next(self._addresses)
        sock = socket.create_connection((self.host, number), timeout=timeout, source_address=(source, 0))
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return sock

    def send(self, port: str, text: str | bytes) -> None:
        """Send to a port of scripts on a connection of its own; return when the box has read all and closed it."""
        with self.connect(port) as sock:
            sock.sendall(text.encode("latin-1") if isinstance(text, str) else text)
            sock.shutdown(socket.SHUT_WR)
            while sock.recv(1 << 16):
                pass

    def run(self, *lines: str) -> None:
        """Send a program of these lines to port 30002."""
        self.send("secondary", "def attack():\n" + "".join(f"  {line}\n" for line in lines) + "end\n")

    def ask(self, *lines: str) -> list[str]:
        """Send lines to the dashboard, one after the other; return the answers."""
        with self.connect("dashboard") as sock, sock.makefile("rw", newline="\n") as stream:
            stream.readline()
            answers = []
            for line in lines:
                stream.write(line + "\n")
                stream.flush()
                answers.append(stream.readline().rstrip("\n"))
            return answers

    def usage(self) -> tuple[int, int]:
        """Return how many descriptors and threads the process has."""
        process = psutil.Process(self.process.pid)
        return process.num_fds(), process.num_threads()

    def workers(self) -> list[psutil.Process]:
        """Return the worker processes; they come from a server process, which is the only child of the box."""
        return [
            worker for server in psutil.Process(self.process.pid).children() for worker in server.children()
        ]

    def state(self, host: str = "") -> dict[str, Any]:
        """Return the modes and the program state of a box of the rack, by the control API."""
        asking = http.client.HTTPConnection(host or self.host, CONTROL_PORT, timeout=PATIENCE)
        with closing(asking):
            asking.request("GET", "/v1/state")
            found = json.loads(asking.getresponse().read())
        return {name: found[name] for name in (*_MODES, "program_state")}

    def _modes(self) -> tuple[dict[str, Any], ...]:
        states = [self.state(host) for host in dict.fromkeys((self.host, self.neighbour))]
        return tuple({name: state[name] for name in _MODES} for state in states)

    # --- afterwards

    def problems(self) -> list[str]:
        """Return what is wrong with the box, a line each: none if it lives, answers, moves and has let go of all."""
        if self.is_stopped:
            return []
        if self.process.poll() is not None:
            told = self.errors.read_text().strip().splitlines()
            return [f"the box has ended with code {self.process.returncode}: {(told or ['no word'])[-1]}"]
        found = []
        for check in (self._answers, self._keeps_nothing, self._moves, self._is_calm):
            try:
                problem = check()
            except OSError as error:
                problem = f"{check.__name__.strip('_').replace('_', ' ')}: {error or type(error).__name__}"
            found += [problem] if problem else []
        return found

    def _answers(self) -> str:
        modes = self._modes()
        if modes != self.modes:
            return f"the modes are {modes} instead of {self.modes}"
        if not self.ports.dashboard:
            return ""
        answer = self.ask("robotmode")[0]
        return "" if answer == "Robotmode: RUNNING" else f"the dashboard says {answer!r}"

    def _moves(self) -> str:
        speed = 0.1 * (-1) ** next(self._turns)
        with self.connect("realtime") as sock, sock.makefile("rb") as frames:
            for k in range(round(PATIENCE / self.period)):
                if k % _REPORT_AGAIN == 0:  # what others have sent before may take the place of the program
                    self.send("secondary", _MOVE.format(speed=speed))
                frame = frames.read(self.layout.size)
                if len(frame) < self.layout.size:
                    return "the stream of port 30003 was closed"
                if self.layout.decode(frame).target_qd[0] / speed > 0.2:  # the slider may stand anywhere
                    return ""
        return "a joint did not move when a script told it to"

    def _keeps_nothing(self) -> str:
        end = time.monotonic() + PATIENCE
        while any(now > before for now, before in zip(self.usage(), self.at_rest, strict=True)):
            if time.monotonic() > end:
                return f"descriptors and threads: {self.usage()} instead of {self.at_rest}"
            time.sleep(0.05)
        return ""

    def _is_calm(self) -> str:
        _, is_there, told = self.errors.read_text().partition("Traceback")
        return f"a traceback on stderr: {' / '.join(told.split(chr(10))[-8:])}" if is_there else ""

    def stop(self) -> float:
        """Request the end of the box; return how long that takes [s], infinity if it must be killed."""
        began = time.monotonic()
        self.is_stopped = True
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return float("inf")
        return time.monotonic() - began


@contextmanager
def serving(kind: Kind, *, prelude: str = "", unread_log: bool = False) -> Iterator[BoxUnderAttack]:
    """Serve a box in real time with an empty folder of programs and the control API.

    Args:
        kind: of box.
        prelude: Python code that its process runs first.
        unread_log: its log goes to stderr, and that is a pipe that nobody reads, instead of a file.
    """
    with tempfile.TemporaryDirectory(prefix="attack-") as temporary:
        folder = Path(temporary)
        programs, ready, errors = folder / "programs", folder / "ready.json", folder / "errors.txt"
        programs.mkdir()
        number = next(_numbers)
        host = f"127.{64 + number % 64}.{os.getpid() >> 6 & 255}.{4 * (os.getpid() & 63) + 1}"
        command = [sys.executable, "-c", _START.format(prelude=prelude), "serve", "--robot", kind.robot]
        command += ["--software", kind.software] if kind.software else []
        command += [*kind.options, "--host", host, "--port-base", str(PORT_BASE)]
        command += [
            "--control-port",
            str(CONTROL_PORT),
            "--programs",
            str(programs),
            "--ready-file",
            str(ready),
        ]
        with errors.open("w") as file:
            process = subprocess.Popen(
                [*command, "--log"] if unread_log else command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE if unread_log else file,
                # As installed: what is loaded late is compiled.
                env={**os.environ, "PYTHONDONTWRITEBYTECODE": ""},
            )
        try:
            while not ready.exists():
                assert process.poll() is None, errors.read_text()
                time.sleep(0.01)
            facts = json.loads(ready.read_text())
            arm = robot_by_name(kind.robot, kind.software)
            box = BoxUnderAttack(
                process,
                facts["host"],
                Ports(**facts["ports"]),
                layout_for_version(arm.software_version(kind.software or None)),
                arm.generation.period_s,
                facts["boxes"][-1]["host"],
                programs,
                errors,
            )
            if problem := box._moves():  # so that all that is loaded late is there
                raise AssertionError(problem)
            time.sleep(0.3)  # the last clients are gone
            box.at_rest, box.modes = box.usage(), box._modes()
            yield box
        finally:
            process.kill()
            process.wait()
            if process.stderr is not None:
                process.stderr.close()


@dataclass(slots=True)
class Seen:
    """What the bystanders saw; filled when the block of `watching` ends.

    Attributes:
        rate: robot time per real time.
        gap_ms: longest time between two frames of port 30003.
        lost: cycles of which no frame came.
        closed: the box has ended the stream.
        timer_gap_ms: longest time between two wakes of a timer of the same period that has nothing to do with the box.
        box_mb: most memory of the box.
        worker_mb: most memory of its worker processes and their server together.
        memory_mb: most memory of all of them.
    """

    rate: float = 0.0
    gap_ms: float = 0.0
    lost: int = 0
    closed: bool = False
    timer_gap_ms: float = 0.0
    box_mb: float = 0.0
    worker_mb: float = 0.0
    memory_mb: float = 0.0

    def look(self, box: int) -> None:
        """Take the memory of a box and of its children into account: proportional shares of common pages."""
        own, *others = map(_share, _family(box))
        self.box_mb = max(self.box_mb, own / 1e6)
        self.worker_mb = max(self.worker_mb, sum(others) / 1e6)
        self.memory_mb = max(self.memory_mb, (own + sum(others)) / 1e6)


def _family(box: int) -> list[int]:
    with suppress(psutil.Error):
        return [box, *(child.pid for child in psutil.Process(box).children(recursive=True))]
    return [box]


def _share(pid: int) -> int:
    """Return the bytes that a process has to itself, and its shares in those that it has in common; 0 without it."""
    with suppress(OSError), open(f"/proc/{pid}/smaps_rollup") as file:
        return next(1024 * int(line.split()[1]) for line in file if line.startswith("Pss:"))
    return 0


def _resident(pid: int) -> int:
    with suppress(OSError), open(f"/proc/{pid}/statm") as file:
        return int(file.read().split()[1]) * _PAGE
    return 0


def _watch_memory(seen: Seen, box: int, has_ended: threading.Event) -> None:
    """Look at the memory of a box whenever more is resident than ever before."""
    most, k, family = 0, 0, _family(box)
    while not has_ended.wait(_LOOK_PERIOD):
        if k % 5 == 0:  # they cost most
            family = _family(box)
        k += 1
        now = sum(map(_resident, family))
        if now > most + _MORE:
            most = now
            seen.look(box)


@contextmanager
def watching(box: BoxUnderAttack) -> Iterator[Seen]:
    """Let bystanders watch a box as long as the block lasts; the client is that of the neighbour in a rack."""
    seen, has_ended = Seen(), threading.Event()
    memory = threading.Thread(target=_watch_memory, args=(seen, box.process.pid, has_ended), daemon=True)
    timer = _bystander("timer", box.period)
    stream = _bystander("stream", box.neighbour, box.ports.realtime, box.period)
    memory.start()
    try:
        yield seen
    finally:
        told = json.loads(stream.communicate()[0]) | json.loads(timer.communicate()[0])
        has_ended.set()
        memory.join()
        for name, value in told.items():
            setattr(seen, name, value)


def _bystander(*arguments: object) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-S", bystander.__file__, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process
