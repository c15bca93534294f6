"""What the integration tests share: a client without a library, the PC's side of the velocity receiver, processes.

Everything goes over real sockets. Time-outs are limits for hangs: no test waits for one to pass.
"""

import json
import os
import random
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import SimpleNamespace

from box_support import TIMEOUT, VERSION, MessageReader, connect

from pc_client.driver.receiver import fill_template, receiver_template
from protocol.primary.messages import KeyMessage
from protocol.realtime.layout import layout_for_version
from protocol.ur_types import Ports, ProgramState

LAYOUT = layout_for_version(VERSION)
PERIOD = 0.008  # s
SPIN = "def spin():\n  while True:\n    speedj([0.3,0,0,0,0,0], 2.0, get_steptime())\n  end\nend\n"
STARTED = "PROGRAM_XXX_STARTED"
HELLO_PROGRAM = 'def hello():\n  textmsg("hello")\nend\n'


class Frames:
    """Reads realtime frames; remembers every stamp, so that a hole shows."""

    def __init__(self, box, port="realtime"):
        self.sock = connect(box, port)
        self.stamps = []
        self._rest = bytearray()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.sock.close()

    def raw(self):
        """Return the bytes of the next frame."""
        while len(self._rest) < LAYOUT.size:
            data = self.sock.recv(1 << 16)
            if not data:
                raise EOFError("the box closed the stream")
            self._rest += data
        frame = bytes(self._rest[: LAYOUT.size])
        del self._rest[: LAYOUT.size]
        size, stamp = struct.unpack_from(">id", frame)
        assert size == LAYOUT.size, "a package was cut in half"
        self.stamps.append(stamp)
        return frame

    def next(self):
        """Return the next frame."""
        return LAYOUT.decode(self.raw())

    def until(self, condition, read=None):
        """Return the first frame that meets the condition; while time stands still, frames repeat themselves."""
        read = read or self.next
        while not condition(frame := read()):
            pass
        return frame

    def until_stamp(self, stamp):
        """Read on, cheaply, until a stamp."""
        self.until(lambda frame: self.stamps[-1] >= stamp - PERIOD / 2, self.raw)

    def new(self):
        """Return the next frame with a stamp of its own."""
        last = self.stamps[-1] if self.stamps else -1.0
        return self.until(lambda frame: frame.timestamp > last)

    def lost(self):
        """Return how many cycles between the first and the last frame never came."""
        cycles = [round(stamp / PERIOD) for stamp in self.stamps]
        assert cycles == sorted(cycles), "time went backwards"
        return cycles[-1] - cycles[0] + 1 - len(set(cycles))

    def rest(self):
        """Wait until no program runs and the arm rests; return that frame."""
        return self.until(
            lambda f: (
                f.runtime_state == ProgramState.STOPPED
                and not any(f.target_qd)
                and abs(f.actual_qd).max() < 2e-3
            )
        )


class Messages(MessageReader):
    """Reads packages of a primary or secondary port; remembers all."""

    def __init__(self, box, port="primary"):
        super().__init__(connect(box, port))
        self.all = []

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.sock.close()

    def next(self):
        self.all.append(super().next())
        return self.all[-1]

    def message(self, kind, limit=5000, **wanted):
        """Return the next message of a class, with these values, skipping everything else."""
        for _ in range(limit):
            package = self.next()
            if isinstance(package, kind) and all(getattr(package, k) == v for k, v in wanted.items()):
                return package
        raise AssertionError(f"no {kind.__name__} came")


def send(box, port, data):
    """Send bytes on a connection of their own and close it."""
    with connect(box, port) as sock:
        sock.sendall(data.encode("latin-1") if isinstance(data, str) else data)


def programs_since(primary, box):
    """Names of the programs that the box has started since `primary` connected; a program of our own marks the end."""
    send(box, "secondary", "def marker():\n  sync()\nend\n")
    primary.message(KeyMessage, title=STARTED, text="marker")
    return [m.text for m in primary.all if isinstance(m, KeyMessage) and m.title == STARTED][:-1]


@contextmanager
def in_background(read):
    """Call `read` again and again in a thread, as a client of its own, until the block ends."""
    ending = threading.Event()

    def work():
        while not ending.is_set():
            read()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()


def is_closed(sock):
    """Wait for the other end to close; with bytes that it has not read it closes by a reset."""
    try:
        return sock.recv(1) == b""
    except ConnectionResetError:
        return True


def velocity_receiver(host, port, **values):
    """The client's program for the robot, with other values than the client's where given."""
    standard = {"acceleration": 20.0, "stop_deceleration": 20.0, "read_timeout": 1.0, "missed_allowed": 1}
    return fill_template(
        receiver_template(), {"pc_address": f'"{host}"', "pc_port": port, **standard, **values}
    )


class VelocitySession:
    """The PC's side of the velocity receiver, without the client's checks: may send anything."""

    def __init__(self, box, **values):
        self.frames = Frames(box)
        with socket.create_server(("127.0.0.1", 0)) as server:
            server.settimeout(TIMEOUT)
            send(box, "secondary", velocity_receiver("127.0.0.1", server.getsockname()[1], **values))
            self.reverse, _ = server.accept()
        self.reverse.settimeout(TIMEOUT)
        self.reverse.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        hello = self.reverse.recv(4)
        assert hello == b"\0\0\0\1"

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.reverse.close()
        self.frames.sock.close()

    def send(self, mode, values=(0,) * 6):
        """Send a message of integers as they are on the wire; the program may have ended in the meantime."""
        with suppress(BrokenPipeError, ConnectionResetError):
            self.reverse.sendall(struct.pack(">7i", mode, *values))

    def velocity(self, *qd):
        """Send a velocity [rad/s] (missing joints rest) and return the next new frame."""
        self.send(1, [round(v * 1e6) for v in (*qd, 0, 0, 0, 0, 0, 0)[:6]])
        return self.frames.new()

    def spin_up(self, speed=0.4):
        """Bring the base joint to a speed; in real time a command may come late, so that the arm starts anew."""
        for sent in range(400):
            frame = self.velocity(speed)
            if sent >= 60 and frame.target_qd[0] == speed:
                return frame
        raise AssertionError(f"the base joint turns with {frame.target_qd[0]} rad/s, asked was {speed}")


# --- processes


@dataclass(frozen=True)
class Finished:
    """A command that has ended."""

    code: int
    out: str
    err: str

    def complaint(self):
        """Return the one line on stderr; anything more is a failure."""
        assert "Traceback" not in self.err, self.err
        assert self.err.count("\n") == 1, self.err
        return self.err


def start(package, *arguments, **options):
    """Start `python -m package arguments...`; output is captured as text."""
    command = [sys.executable, "-m", package, *map(str, arguments)]
    settings = {
        "stdin": subprocess.DEVNULL,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
    }
    return subprocess.Popen(command, **{**settings, **options})


def finish(process):
    """Wait for the end of a process."""
    try:
        out, err = process.communicate(timeout=60)
    except BaseException:
        process.kill()
        process.communicate()
        raise
    return Finished(process.returncode, out or "", err or "")


def at(box):
    """The options that lead the client to a box."""
    return ("--robot", box.host, "--port-base", box.ports.realtime - Ports.standard().realtime)


def free_port_base():
    """An offset at which all ports of a box are free.

    They lie above the ports that the kernel gives to clients, that for Modbus below them. Processes of a run have
    different ones: between this answer and the box another one could take them.
    """
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    bases = list(range(31_000, 32_260, 20))[worker :: int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))]
    random.Random(os.getpid() + time.monotonic_ns()).shuffle(bases)
    for base in bases:
        ports = Ports.standard(base)
        if all(_is_free(getattr(ports, name)) for name in ports.__dataclass_fields__):
            return base
    raise AssertionError("no free ports")


def _is_free(port):
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


@contextmanager
def serving(folder, *options, **process_options):
    """Run `ur-emulator serve` as long as the block lasts; gives process, host and ports."""
    base, ready = free_port_base(), folder / f"ready-{time.monotonic_ns()}.json"
    process = start(
        "ur_emulator", "serve", "--port-base", base, "--ready-file", ready, *options, **process_options
    )
    try:
        line = process.stdout.readline()
        assert " ready at " in line, process.stderr.read()
        facts = json.loads(ready.read_text())
        yield SimpleNamespace(
            process=process, host=facts["host"], ports=Ports(**facts["ports"]), base=base, facts=facts
        )
    finally:
        if process.poll() is None:
            process.terminate()
        finish(process)


def reach():
    """A movement long enough for what shall happen in the midst of it."""
    from pc_client.movements.movement import Movement

    return Movement.through([(0.35, -0.1, 0.25), (0.35, 0.1, 0.3)], durations=[4.0], name="reach")


def prepare_experiment(movements, *, repeat, out):
    """Plan movements for a UR3."""
    from pc_client.experiment.experiment import Experiment
    from pc_client.kinematics.model import robot_model
    from pc_client.planning.plan import make_plan

    model = robot_model("ur3")
    return Experiment(model, tuple(make_plan(movement, model) for movement in movements), repeat, out)
