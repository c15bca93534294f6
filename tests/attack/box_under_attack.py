"""A box under attack: `ur-emulator serve` in its own process, bystanders beside it, and questions to it afterwards.

with serving("ur5e") as box, watching(box) as seen:
    attack(box)
seen.rate, seen.gap_ms, box.problems()
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import bystander
import psutil

from protocol.realtime.layout import RealtimeLayout, layout_for_version
from protocol.ur_types import Ports, RobotType
from ur_emulator.models.robots import robot_by_name

PATIENCE = 20.0  # s; a box that has not answered by then does not answer
MOST_MEMORY = 300e6  # bytes; of the box and its worker processes together
# Away from the standard ports, and below those that the kernel gives to clients.
PORT_BASE, CONTROL_PORT = 1000, 30_900
_START = "import sys\nsys.argv[0] = 'ur-emulator'\n{prelude}\nfrom ur_emulator.cli import main\nmain()\n"
_MOVE = "def alive():\n  speedj([{speed}, 0, 0, 0, 0, 0], 2.0, 0.1)\n  stopj(5.0)\nend\n"
_REPORT_AGAIN = 250  # frames
_numbers = count(1)


@dataclass(slots=True)
class BoxUnderAttack:
    """A served box.

    Attributes:
        process: in which it runs.
        host: its address.
        ports: its ports.
        layout: of its frames.
        period: its control cycle [s].
        model: as its dashboard says.
        programs: its folder of programs.
        errors: the file that stderr goes to, unless an attack took it.
        at_rest: descriptors and threads before the attack.
        is_stopped: it was told to end.
    """

    process: subprocess.Popen
    host: str
    ports: Ports
    layout: RealtimeLayout
    period: float
    model: str
    programs: Path
    errors: Path
    at_rest: tuple[int, int] = (0, 0)
    is_stopped: bool = False
    _turns: Iterator[int] = field(default_factory=count)

    @property
    def open_ports(self) -> tuple[str, ...]:
        """Names of the ports that take something."""
        names = ("dashboard", "primary", "secondary", "realtime", "rtde", "modbus", "interpreter")
        return (*(name for name in names if getattr(self.ports, name)), "control")

    def connect(self, port: str, timeout: float = PATIENCE) -> socket.socket:
        """Connect to a port by its name in `Ports`, or "control"."""
        number = CONTROL_PORT if port == "control" else getattr(self.ports, port)
        sock = socket.create_connection((self.host, number), timeout=timeout)
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

    def forget_peaks(self) -> None:
        """Let the peaks of memory begin anew, for the next attack on the same box."""
        for process in self._processes():
            with suppress(OSError):
                Path(f"/proc/{process.pid}/clear_refs").write_text("5")

    def _processes(self) -> list[psutil.Process]:
        box = psutil.Process(self.process.pid)
        return [box, *box.children()]

    # --- afterwards

    def problems(self) -> list[str]:
        """Return what is wrong with the box, a line each: none if it lives, answers, moves and has let go of all."""
        if self.is_stopped:
            return []
        if self.process.poll() is not None:
            told = self.errors.read_text().strip().splitlines()
            return [f"the box has ended with code {self.process.returncode}: {(told or ['no word'])[-1]}"]
        found = []
        for check in (
            self._answers,
            self._keeps_nothing,
            self._moves,
            self._memory_is_bounded,
            self._is_calm,
        ):
            try:
                problem = check()
            except OSError as error:
                problem = f"{check.__name__.strip('_').replace('_', ' ')}: {error or type(error).__name__}"
            found += [problem] if problem else []
        return found

    def _answers(self) -> str:
        model = self.ask("programState", "get robot model")[1]
        return "" if model == self.model else f"asked for its model the box says {model!r}"

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

    def _memory_is_bounded(self) -> str:
        workers = psutil.Process(self.process.pid).children()
        peaks = [
            bystander.peak_memory(pid) for pid in (self.process.pid, *(worker.pid for worker in workers))
        ]
        return "" if sum(peaks) < MOST_MEMORY else f"memory: {sum(peaks) / 1e6:.0f} MB"

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
def serving(
    robot: str, *options: str, prelude: str = "", unread_log: bool = False
) -> Iterator[BoxUnderAttack]:
    """Serve a box in real time with an empty folder of programs and the control API.

    Args:
        robot: type of its arm.
        options: more options of `ur-emulator serve`.
        prelude: Python code that its process runs first.
        unread_log: stderr is a pipe that nobody reads, instead of a file.
    """
    with tempfile.TemporaryDirectory(prefix="attack-") as temporary:
        folder = Path(temporary)
        programs, ready, errors = folder / "programs", folder / "ready.json", folder / "errors.txt"
        programs.mkdir()
        number = next(_numbers)
        host = f"127.{64 + number % 64}.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"
        code = _START.format(prelude=prelude)
        command = [
            sys.executable,
            "-c",
            code,
            "serve",
            "--robot",
            robot,
            "--host",
            host,
            "--port-base",
            str(PORT_BASE),
        ]
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
                [*command, *options],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE if unread_log else file,
                env={
                    **os.environ,
                    "PYTHONDONTWRITEBYTECODE": "",
                },  # as installed: what is loaded late is compiled
            )
        try:
            while not ready.exists():
                assert process.poll() is None, errors.read_text()
                time.sleep(0.01)
            facts = json.loads(ready.read_text())
            arm = robot_by_name(robot)
            box = BoxUnderAttack(
                process,
                facts["host"],
                Ports(**facts["ports"]),
                layout_for_version(arm.software_version(None)),
                arm.generation.period_s,
                RobotType(arm.robot_type).name,
                programs,
                errors,
            )
            if problem := box._moves():  # so that all that is loaded late is there
                raise AssertionError(problem)
            time.sleep(0.3)  # the last clients are gone
            box.at_rest = box.usage()
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
        timer_gap_ms: longest time between two wakes of a timer of 8 ms that has nothing to do with the box.
        box_mb: most memory of the box.
        worker_mb: most memory of its worker processes together.
    """

    rate: float = 0.0
    gap_ms: float = 0.0
    lost: int = 0
    closed: bool = False
    timer_gap_ms: float = 0.0
    box_mb: float = 0.0
    worker_mb: float = 0.0


@contextmanager
def watching(box: BoxUnderAttack) -> Iterator[Seen]:
    """Let bystanders watch a box as long as the block lasts."""
    seen = Seen()
    timer = _bystander("timer", box.process.pid)
    stream = _bystander("stream", box.host, box.ports.realtime, box.period)
    try:
        yield seen
    finally:
        told = json.loads(stream.communicate()[0])
        host = json.loads(timer.communicate()[0])
        seen.timer_gap_ms = host.pop("gap_ms")
        for name, value in {**told, **host}.items():
            setattr(seen, name, value)


def _bystander(*arguments: object) -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, bystander.__file__, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "ready\n"
    return process
