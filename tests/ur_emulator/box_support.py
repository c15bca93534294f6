"""What the tests of the box share: a controller without ports, a network without sockets, a client without a library."""

import socket
import struct
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from protocol.frame_buffer import FrameBuffer
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE
from protocol.primary.messages import TextMessage
from protocol.primary.packages import RobotState, decode_package
from protocol.realtime.layout import layout_for_size
from protocol.ur_types import SoftwareVersion
from ur_emulator.errors import RefusedError
from ur_emulator.host.pacing import RealtimePacer
from ur_emulator.host.served_box import BoxIdentity, ServedBox
from ur_emulator.machine.commands.programs import StartProgram
from ur_emulator.machine.controller.controller import SETTLE_TIME, Controller
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.scripting.network import Network
from ur_emulator.machine.scripting.robot_host import robot_hosts
from urscript import compile_program

VERSION = SoftwareVersion(3, 15, 8)
TIMEOUT = 20.0  # s; a limit for hangs, no test waits for it


def inside(box):
    """The box behind one that runs in this process."""
    return box._rack.boxes[box._index]


class FakeSocket:
    """A script socket whose other end is the test."""

    def __init__(self):
        self.problem = ""
        self.inbox = bytearray()
        self.sent = bytearray()
        self.is_connecting = self.is_own = False
        self.is_open = True

    def send(self, data):
        if self.is_open:
            self.sent += data
        return self.is_open

    def close(self):
        self.is_open = False


class FakeModbusUnit:
    """A Modbus unit that does at once what it is asked for.

    Attributes:
        memory: (signal type, address) to a value, 0 where there is none; inputs and outputs are separate.
        log: what it was asked, in order.
        trouble: what it reports of every signal instead of answering.
    """

    def __init__(self):
        self.memory = {}
        self.log = []
        self.trouble = ""
        self.is_released = False

    def want(self, signal):
        kind = int(signal.type.single)
        first = signal.write_address if signal.reads_back else signal.address
        signal.trouble = self.trouble
        signal.connection_error = -2 if self.trouble else 0
        self.log.append((signal.name, "read" if signal.output is None else signal.output))
        if self.trouble:
            return
        if signal.output is not None:
            self.memory.update({(kind, first + i): value for i, value in enumerate(signal.output)})
        if signal.output is None or signal.reads_back:
            read = range(signal.address, signal.address + signal.count)
            signal.values = tuple(self.memory.get((kind, address), 0) for address in read)

    def describe(self, signal):
        pass

    def forget(self, signal):
        self.log.append((signal.name, "forgotten"))

    def send(self, slave, function_code, data):
        self.log.append((slave, function_code, data))

    def reset(self):
        self.log.append("reset")

    def release(self):
        self.is_released = True


class FakeNetwork:
    """Connects every script at once, or never if `refuse` is set; Modbus units by "host:port"."""

    def __init__(self, *, refuse=False):
        self.refuse = refuse
        self.sockets = []
        self.modbus_units = {}

    def open(self, host, port):
        sock = FakeSocket()
        sock.is_open = not self.refuse
        self.sockets.append(sock)
        return sock

    def modbus_unit(self, address):
        unit = self.modbus_units.setdefault(str(address), FakeModbusUnit())
        unit.is_released = False
        return unit


def printed(events):
    return [event.text for event in events if type(event).__name__ == "TextPrinted"]


class Bench:
    """A controller on the bench: ticks when the test says so, remembers what was said."""

    def __init__(self, *, robot="ur3", seed=7, fidelity="typical", generation=CB3, network=None, **kwargs):
        self.network = network or FakeNetwork()
        self.controller = Controller(
            replace(robot_by_name(robot), generation=generation),
            generation.fidelity(fidelity),
            seed,
            partial(robot_hosts, network=self.network),
            **kwargs,
        )
        self.events = []
        self.snapshots = []

    @property
    def now(self):
        return self.controller.snapshot

    def tick(self, n=1, *commands):
        for _ in range(n):
            self.snapshots.append(self.controller.tick(commands))
            for _, error in self.controller.outcomes:
                if error is not None and not isinstance(error, RefusedError):
                    raise error
            commands = ()
            self.events += self.controller.state.events.take()
        return self.now

    def start(self, text, *, loaded=False):
        return self.tick(1, StartProgram(compile_program(text), loaded=loaded))

    def run(self, text, limit=5000):
        """Run a program to its end and the arm to rest; return the texts it printed.

        What is locked after a protective stop is not waited for.
        """
        first, box, rested = len(self.events), self.controller, 0
        self.start(text)
        for _ in range(limit):
            moves = box.programs.has_work or box.state.motion.is_moving or box.state.mode.is_changing
            rested = 0 if moves or box.safety.is_braking else rested + 1
            if not box.is_active or rested > box.generation.cycles(2 * SETTLE_TIME):
                break
            self.tick()
        else:
            raise AssertionError("the program did not end")
        return printed(self.events[first:])

    @property
    def texts(self):
        """What programs have printed so far."""
        return printed(self.events)


def machine_of(controller):
    """A machine that has this controller; what its scripts open is the bench's."""
    machine = Machine.__new__(Machine)
    machine.controller, machine.network = controller, Network()
    return machine


@dataclass(frozen=True)
class Submitted:
    """A command whose sender gets the result, or the error, which ends only the command."""

    command: Any
    done: Any

    def apply(self, box):
        try:
            result = self.command.apply(box)
        except Exception as error:
            self.done(None, error)
            return None
        self.done(result, None)
        return result


class BareBox(ServedBox):
    """A box without a loop, for its ports; what they submit is appended to `submitted`."""

    def __init__(self, software, controller, submitted):
        self.submitted = submitted
        identity = BoxIdentity(software, "UR3", "UR3", "20993000007")
        super().__init__(machine_of(controller), identity, RealtimePacer(controller.period_s), None, None)

    def submit(self, command, done=None, *, in_place_of="", urgent=True):
        self.submitted.append(command if done is None else Submitted(command, done))

    submit_quietly = submit

    def report(self, what, error):
        raise error


class FakeConnection:
    """A client as a port sees it: `sent` is what the port has sent, unless it is `full`."""

    def __init__(self, port, *, full=False):
        self.port = port
        self.full = full
        self.is_open = self.takes_answers = True
        self.has_ended = False
        self.sent = []
        self._calls = []
        port.opened(self)

    def send(self, package):
        if self.full or not self.is_open:
            return False
        self.sent.append(package)
        return True

    def close(self):
        if self.is_open:
            self.is_open = False
            self.port.closed(self)

    close_when_sent = close

    def failed(self, error):
        raise error

    def set_reading(self, wanted):
        pass

    def call_soon(self, call):
        self._calls.append(call)

    def say(self, data):
        """Send bytes to the port and give it all the turns that it asks for."""
        self.port.received(self, data)
        self.next_turns()

    def next_turns(self):
        while self._calls:
            self._calls.pop(0)()


def connect(box, port):
    sock = socket.create_connection((box.host, getattr(box.ports, port)), timeout=TIMEOUT)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return sock


class FrameReader:
    """Reads realtime frames from a socket."""

    def __init__(self, sock):
        self.sock = sock
        self._rest = b""

    def next(self):
        while len(self._rest) < 4 or len(self._rest) < struct.unpack_from(">i", self._rest)[0]:
            data = self.sock.recv(65536)
            if not data:
                raise EOFError
            self._rest += data
        size = struct.unpack_from(">i", self._rest)[0]
        frame, self._rest = self._rest[:size], self._rest[size:]
        return layout_for_size(size).decode(frame)

    def until(self, condition, limit=20_000):
        for _ in range(limit):
            frame = self.next()
            if condition(frame):
                return frame
        raise AssertionError("the frame that was waited for did not come")


class MessageReader:
    """Reads packages of the primary port."""

    def __init__(self, sock):
        self.sock = sock
        self._buffer = FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)

    def next(self):
        while (frame := self._buffer.next_frame()) is None:
            data = self.sock.recv(65536)
            if not data:
                raise EOFError
            self._buffer.feed(data)
        return decode_package(frame, VERSION)

    def message(self, kind, limit=2000):
        """Return the next message of a class, skipping everything else."""
        for _ in range(limit):
            package = self.next()
            if isinstance(package, kind):
                return package
        raise AssertionError(f"no {kind.__name__} came")

    def state(self):
        return self.message(RobotState)


def program(*lines):
    """A program of these lines."""
    return "def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


def printed_by(box, *lines, n=1):
    """Run a program on a box and return the first `n` texts that it prints."""
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        sock.sendall(program(*lines).encode())
        return [reader.message(TextMessage).text for _ in range(n)]


@contextmanager
def listening_socket():
    """A server socket of the test, for scripts to connect to."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(TIMEOUT)
        yield server
