"""A client that dies at an exact command of an exact program, and what a bystander sees of it in robot time.

`DyingNetwork` stands between the real client and its sockets. Killed: all sockets close, as the kernel closes
those of a process. Frozen: the client stands still, its sockets stay open. Cut off: the client goes on, but
nothing reaches the robot any more and nothing comes from it.
"""

import struct
import threading

from integration_support import LAYOUT, PERIOD

from pc_client.driver.transport import TcpNetwork
from pc_client.driver.watchdog import REST_SPEED
from pc_client.errors import DriverError
from protocol.ur_types import ProgramState
from protocol.velocity_stream import VelocityMode

KILLED, FROZEN, CUT_OFF = "killed", "frozen", "cut off"


class Killed(BaseException):
    """Where a killed process would not go on."""


class DyingNetwork:
    """A network whose client dies.

    Args:
        death: how.
        program: in which of the programs that it sends, counted from 1.
        speed: after the first command of that program with a joint faster than this [rad/s]; None: before the
            program is sent.

    Attributes:
        dead: set when it has happened.
        last_command: time stamp of the frame that the last command answered [s].
    """

    def __init__(self, death, program, speed):
        self.death, self.program, self.speed = death, program, speed
        self.dead, self.awake = threading.Event(), threading.Event()
        self.last_command = self.stamp = 0.0
        self.programs = 0
        self.sockets = []
        self._tcp = TcpNetwork()
        self._skew = 0.0

    # ---- Network
    def now(self):
        return self._tcp.now() + self._skew

    def connect(self, host, port, timeout):
        if self.is_gone():
            self.pass_time(timeout)
            raise DriverError(f"{host}:{port} does not answer")
        return self._watched(self._tcp.connect(host, port, timeout))

    def listen(self, address, port):
        self.is_gone()
        return _Listener(self, self._tcp.listen(address, port))

    # ---- death
    def die(self):
        self.dead.set()
        if self.death == KILLED:
            self.close()
        elif self.death == FROZEN:
            self.awake.wait()

    def is_gone(self):
        """True when nothing gets through any more; a killed client does not even come back."""
        if not self.dead.is_set() or self.death == FROZEN:
            return False
        if self.death == KILLED:
            raise Killed
        return True

    def pass_time(self, seconds):
        """A client that waits for a lost robot need not really wait."""
        self._skew += seconds

    def close(self):
        for each in self.sockets:
            each.close()

    def before(self, data):
        """The client is going to send this; dies before the program that was chosen."""
        if data.startswith(b"def velocity_receiver"):
            self.programs += 1
            if self.speed is None and self.programs == self.program:
                self.die()

    def took(self, data):
        """The robot has a message; dies after the one that was chosen."""
        if self.dead.is_set() or len(data) != 28:
            return
        mode, *steps = struct.unpack(">7i", data)
        if mode == VelocityMode.VELOCITY:
            self.last_command = self.stamp
            is_fast = self.speed is not None and max(map(abs, steps)) > 1e6 * self.speed
            if is_fast and self.programs == self.program:
                self.die()

    def _watched(self, transport):
        self.sockets.append(transport)
        return _Transport(self, transport)


class _Transport:
    def __init__(self, network, inner):
        self._network, self._inner = network, inner
        self.local_address, self.peer_address = inner.local_address, inner.peer_address

    def send(self, data):
        self._network.before(data)
        if not self._network.is_gone():
            self._inner.send(data)
            self._network.took(data)

    def receive(self, timeout):
        if self._network.is_gone():
            self._network.pass_time(timeout)
            return None
        data = self._inner.receive(timeout)
        if data and len(data) % LAYOUT.size == 0:  # no package of another port has this size
            (self._network.stamp,) = struct.unpack_from(">d", data, len(data) - LAYOUT.size + 4)
        return data

    def close(self):
        if not self._network.is_gone():
            self._inner.close()


class _Listener:
    def __init__(self, network, inner):
        self._network, self._inner, self.port = network, inner, inner.port
        network.sockets.append(inner)

    def accept(self, timeout):
        if self._network.is_gone():
            self._network.pass_time(timeout)
            return None
        caller = self._inner.accept(timeout)
        return None if caller is None else self._network._watched(caller)

    def close(self):
        if not self._network.is_gone():
            self._inner.close()


class Bystander:
    """Reads the frames of a robot on a connection of its own, while a client works and dies.

    Attributes:
        latest: the newest frame.
    """

    def __init__(self, frames):
        self._frames = frames
        self.latest = frames.next()
        self._last_motion = 0.0

    def read(self):
        frame = self.latest = self._frames.next()
        if any(frame.target_qd) or abs(frame.actual_qd).max() > REST_SPEED:
            self._last_motion = frame.timestamp

    def read_what_has_come(self):
        while self._frames.has_come():
            self.read()

    def until(self, condition):
        while not condition():
            self.read()

    def until_rest(self):
        """Read until no program runs and nothing has moved for as long as time goes on without one."""
        still = 0
        while still < 40:
            self.read()
            at_rest = self.latest.timestamp > self._last_motion
            still = still + 1 if at_rest and self.latest.runtime_state == ProgramState.STOPPED else 0

    def time_to_rest(self, since):
        """From a time stamp to the first of the frames in which the arm rests for good [s]; 0 if it rested."""
        return max(self._last_motion + PERIOD - since, 0.0)
