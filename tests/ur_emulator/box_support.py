"""What the tests of the box share: a controller without ports, a network without sockets, a client without a library."""

import socket
import struct
import xmlrpc.client
from contextlib import contextmanager
from dataclasses import dataclass, replace
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
from ur_emulator.machine.controller.io.network import (
    BytesArrived,
    CallEnded,
    CallProcedure,
    CloseServer,
    CloseSocket,
    ForgetSignal,
    OpenSocket,
    ReleaseUnit,
    ResetUnit,
    SendBytes,
    SendToUnit,
    ServeSignal,
    SignalServed,
    SignalType,
    SocketClosed,
    SocketOpened,
)
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.scripting.robot_host import robot_hosts
from urscript import compile_program

VERSION = SoftwareVersion(3, 15, 8)
TIMEOUT = 20.0  # s; a limit for hangs, no test waits for it


def inside(box):
    """The box behind one that runs in this process."""
    return box._rack.boxes[box._index]


class FakeSocket:
    """A socket whose other end is the test: what the test says is in `inbox` until the socket has it."""

    def __init__(self, number=0):
        self.number = number
        self.problem = ""
        self.inbox = bytearray()
        self.sent = bytearray()
        self.is_connecting = False
        self.is_open = True
        self._was_connecting = self._was_open = True

    def send(self, data):
        if self.is_open:
            self.sent += data
        return self.is_open

    def close(self):
        self.is_open = self.is_connecting = False

    def arrivals(self):
        """What has changed since the last call, for the machine."""
        if self._was_connecting and not self.is_connecting:
            self._was_connecting = False
            if self.is_open:
                yield SocketOpened(self.number, self.is_own)
        if self.inbox:
            yield BytesArrived(self.number, bytes(self.inbox))
            self.inbox.clear()
        if self._was_open and not (self.is_open or self.is_connecting):
            self._was_open = False
            yield SocketClosed(self.number, self.problem)

    is_own = False


class FakeModbusUnit:
    """A Modbus unit that does at once what it is asked for.

    Attributes:
        memory: (signal type, address) to a value, 0 where there is none; inputs and outputs are separate.
        log: what it was asked, in order; signals by their address.
        trouble: what it reports of every signal instead of answering.
        device_error: what it reports of every signal.
    """

    def __init__(self):
        self.memory = {}
        self.log = []
        self.trouble = ""
        self.device_error = 0
        self.is_released = False

    def serve(self, wanted):
        """Do what is wanted of a signal; return what the machine gets."""
        self.log.append((wanted.address, "read" if wanted.output is None else wanted.output))
        if self.trouble:
            return SignalServed(wanted.signal, (), self.trouble, self.device_error, -2)
        kind, reads_back = int(wanted.type.single), wanted.type is SignalType.READ_WRITE_REGISTERS
        first = wanted.write_address if reads_back else wanted.address
        if wanted.output is not None:
            self.memory.update({(kind, first + i): value for i, value in enumerate(wanted.output)})
        read = range(wanted.address, wanted.address + wanted.count)
        values = tuple(self.memory.get((kind, address), 0) for address in read)
        return SignalServed(wanted.signal, values, "", self.device_error, 0)


class FakeNetwork:
    """The host of a bench: connects every script, or none if `refuse` is set; Modbus units by "host:port".

    What it does is known to the machine in the next cycle.
    """

    def __init__(self, *, refuse=False):
        self.refuse = refuse
        self.sockets = []
        self.modbus_units = {}
        self._addresses = {}
        self._arrivals = []

    def make_socket(self, number, host, port):
        sock = FakeSocket(number)
        sock.is_open = not self.refuse
        return sock

    def open(self, host, port):
        """Connect as a host does for itself."""
        self.sockets.append(self.make_socket(0, host, port))
        return self.sockets[-1]

    def call(self, request, method, arguments):
        """Do a call of a remote procedure."""
        self._arrivals.append(CallEnded(request.call, None, f"no method {method}"))

    def close_server(self, server):
        pass

    def modbus_unit(self, address):
        return self.modbus_units.setdefault(str(address), FakeModbusUnit())

    def serve(self, unit, request):
        self._arrivals.append(unit.serve(request))

    def carry_out(self, requests):
        for request in requests:
            match request:
                case OpenSocket(number, host, port):
                    self.sockets.append(self.make_socket(number, host, port))
                case SendBytes(number, data):
                    self._socket(number).send(data)
                case CloseSocket(number):
                    self._socket(number).close()
                case CallProcedure(body=body):
                    arguments, method = xmlrpc.client.loads(body)
                    self.call(request, method, list(arguments))
                case CloseServer(server):
                    self.close_server(server)
                case _:
                    self._serve_unit(request, self.modbus_unit(request.unit))

    def arrivals(self):
        """What the machine gets in the next cycle."""
        arrivals, self._arrivals = self._arrivals, []
        for sock in self.sockets:
            arrivals += sock.arrivals()
        return arrivals

    def _socket(self, number):
        return next(sock for sock in self.sockets if sock.number == number)

    def _serve_unit(self, request, unit):
        unit.is_released = isinstance(request, ReleaseUnit)
        match request:
            case ServeSignal(signal=number):
                self._addresses[number] = request.address
                if request.wanted:
                    self.serve(unit, request)
            case ForgetSignal(_, number):
                unit.log.append((self._addresses[number], "forgotten"))
            case SendToUnit(_, slave, function_code, data):
                unit.log.append((slave, function_code, data))
            case ResetUnit():
                unit.log.append("reset")


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
            robot_hosts,
            **kwargs,
        )
        self.events = []
        self.snapshots = []

    @property
    def now(self):
        return self.controller.snapshot

    def tick(self, n=1, *commands):
        outside = self.controller.state.network
        for _ in range(n):
            for arrival in self.network.arrivals():
                outside.take(arrival)
            self.snapshots.append(self.controller.tick(commands))
            self.network.carry_out(outside.take_requests())
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
    """A machine that has this controller."""
    machine = Machine.__new__(Machine)
    machine.controller, machine.network = controller, controller.state.network
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
        self.is_open = self.can_send = True
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
