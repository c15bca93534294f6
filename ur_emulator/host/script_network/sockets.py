"""Connections that a box makes: they never block, and their buffers are bounded, each and together."""

import errno
import selectors
import socket
import time
from collections.abc import Callable
from functools import partial
from weakref import WeakSet

from ur_emulator.budgets import BUDGETS, CYCLE
from ur_emulator.host.runtime.barrier import Report
from ur_emulator.host.runtime.connection import BufferedSocket
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.addresses import LOOK_UPS, LookUp, is_closed
from ur_emulator.machine.controller.io.network import (
    SHARE,
    Arrival,
    BytesArrived,
    BytesUnsent,
    Network,
    SocketClosed,
    SocketOpened,
)


class Buffers:
    """Counts the connections of a box that somebody still has, also closed ones, and their unsent bytes.

    Attributes:
        loop, report, own_address: as in `LoopNetwork`.
        full: connections of scripts that do not read before scripts have read what has come.
    """

    def __init__(self, loop: EventLoop, report: Report, own_address: str) -> None:
        self.loop = loop
        self.report = report
        self.own_address = own_address
        self._window_end = 0.0
        self._in_window = 0
        self._has_read_enough = False
        self.connections: WeakSet[OutgoingConnection] = WeakSet()
        self.full: set[OutgoingConnection] = set()
        self.unsent = 0

    def received(self, n_bytes: int) -> None:
        """Count bytes that have come; if they are too many all connections stop reading for a cycle."""
        now = time.monotonic()
        if now >= self._window_end:
            self._window_end, self._in_window = now + CYCLE, 0
        self._in_window += n_bytes
        if self._in_window >= BUDGETS.received_bytes and not self._has_read_enough:
            self._has_read_enough = True
            self.loop.add(self)
            self._tell()

    def advance(self, now: float) -> float:
        """Read on when it is time; the loop calls this while connections do not read."""
        if now < self._window_end:
            return self._window_end
        self.close()
        self._tell()
        return now + CYCLE

    def failed(self, error: Exception) -> None:
        """Close all connections after an error of ours."""
        self.report("the connections of scripts are closed", error)
        self.close()
        for connection in tuple(self.connections):
            connection.close()

    def close(self) -> None:
        """Do not look any more."""
        self._has_read_enough = False
        self.loop.remove(self)

    def may_receive(self, waiting: int) -> bool:
        """Whether a connection with so many bytes in its inbox may read on."""
        return not self._has_read_enough and waiting < BUDGETS.inbox_bytes

    def may_send(self, waiting: int, n_bytes: int) -> bool:
        """Whether a connection with so many unsent bytes may send as many more as given."""
        return waiting + n_bytes <= SHARE or self.unsent + n_bytes <= BUDGETS.all_unsent_bytes

    def _tell(self) -> None:
        for connection in tuple(self.connections):
            connection.read_on()


_READ_SIZE = 16 * 1024
_IN_PROGRESS = {0, errno.EINPROGRESS, errno.EWOULDBLOCK, getattr(errno, "WSAEWOULDBLOCK", errno.EINPROGRESS)}


class OutgoingConnection(BufferedSocket):
    """One connection that a box has opened.

    Attributes:
        problem: why there is none, if it could not be made; "" if the peer refused.
        is_connecting: it is being made.
        is_own: it leads to a port of the box itself.
    """

    def __init__(self, buffers: Buffers) -> None:
        super().__init__(buffers.loop, BUDGETS.unsent_bytes, _READ_SIZE)
        self._buffers = buffers
        self._peer = ""
        self._look_up: LookUp | None = None
        self._inbox = bytearray()
        self._counted_unsent = 0
        self.is_connecting = self.is_own = False
        self.problem = ""

    def begin(self, host: str, port: int) -> None:
        """Begin to connect; the loop never waits for the look-up of a name."""
        self._buffers.connections.add(self)
        self._peer = f"{host}:{port}"
        self.is_connecting = True
        try:
            address = socket.inet_ntoa(socket.inet_aton(host))
        except (OSError, ValueError):  # no address, or no text that could be one
            self._begin_look_up(host, port)
        else:
            self._connect(address, port)

    def refuse(self, problem: str) -> None:
        """End the attempt to connect."""
        self.problem = problem
        self.close()

    @property
    def inbox(self) -> bytearray:
        """Bytes that have come and were not read yet; reading from the peer goes on with this call."""
        if not self._wants_data:
            self.read_on()
        return self._inbox

    @property
    def _unread(self) -> int:
        """How many bytes nobody has read."""
        return len(self._inbox)

    def read_on(self) -> None:
        """Read from the peer, or stop reading, as the budgets say now."""
        wants_data = self._buffers.may_receive(self._unread)
        if wants_data != self._wants_data and self.is_open:
            self._wants_data = wants_data
            self._watch()

    def send(self, data: bytes) -> bool:
        """Send what the kernel takes at once, keep the rest for later; False if there is no room for it."""
        if not self._buffers.may_send(len(self._outbox), len(data)):
            return False
        is_sent = super().send(data)
        self._count_unsent()
        return is_sent

    def close(self) -> None:
        """Close; what has come can still be read."""
        if self._look_up is not None:
            LOOK_UPS.forget(self._look_up)
            self._look_up = None
        super().close()
        self._count_unsent()
        self.is_connecting = False

    def failed(self, error: Exception) -> None:
        """Close after an error of ours, and report it; the script sees a peer that has closed."""
        self._buffers.report(f"the connection of a script to {self._peer} is closed", error)
        self.close()

    # --- connecting

    def _begin_look_up(self, host: str, port: int) -> None:
        loop = self._loop
        self._look_up = LookUp(
            self._buffers,
            host,
            lambda address: loop.call_soon_threadsafe(partial(self._found, address, port), self.failed),
        )
        if not LOOK_UPS.start(self._look_up):
            self.refuse(f"{BUDGETS.look_ups_waiting} names are being looked up already")

    def _found(self, address: str, port: int) -> None:
        if not self.is_connecting:
            return  # closed while the name was looked up
        self._look_up = None
        if address:
            self._connect(address, port)
        else:
            self.refuse("the name is not known")

    def _connect(self, address: str, port: int) -> None:
        if is_closed(address, port):
            self.refuse("this is the port of the control API of a box, which scripts may not use")
            return
        try:
            self._sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._sock.setblocking(False)
            own = self._buffers.own_address
            if _can_call_from(own, address):
                self._sock.bind((own, 0))
            code = self._sock.connect_ex((address, port))
        except (OSError, OverflowError):  # descriptors are out, or that is no port
            code = errno.EINVAL
        if self._sock is not None and code in _IN_PROGRESS:
            self._loop.watch(self._sock, selectors.EVENT_WRITE, self._on_connected, self.failed)
        else:
            self.close()

    def _on_connected(self, events: int) -> None:
        assert self._sock is not None
        if self._sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self.close()
            return
        self.is_connecting = False
        self._wants_data = True
        self._open(self._sock)

    # --- bytes

    def _received(self, data: bytes) -> None:
        self._inbox += data
        self._buffers.received(len(data))
        self.read_on()

    def _flush(self) -> None:
        super()._flush()
        self._count_unsent()

    def _count_unsent(self) -> None:
        self._buffers.unsent += len(self._outbox) - self._counted_unsent
        self._counted_unsent = len(self._outbox)


class ScriptConnection(OutgoingConnection):
    """A connection of a script: what comes of it arrives at the machine, which has the inbox."""

    def __init__(
        self, buffers: Buffers, number: int, network: Network, arrive: Callable[[Arrival], None]
    ) -> None:
        """Prepare; nothing is connected. `number` is that of the machine; `arrive` takes what comes."""
        super().__init__(buffers)
        self._number = number
        self._network = network
        self._arrive = arrive
        self._is_over = False

    @property
    def _unread(self) -> int:
        return self._network.unread(self._number)

    def read_on(self) -> None:
        """Read from the peer, or stop reading, as the budgets say now."""
        super().read_on()
        if self.is_open and not self._wants_data:
            self._buffers.full.add(self)
        else:
            self._buffers.full.discard(self)

    def drop(self) -> None:
        """Close, since the script has closed."""
        self._is_over = True
        self.close()

    def close(self) -> None:
        """Close; what has come can still be read."""
        super().close()
        self._buffers.full.discard(self)
        if not self._is_over:
            self._is_over = True
            self._arrive(SocketClosed(self._number, self.problem))

    def _on_connected(self, events: int) -> None:
        super()._on_connected(events)
        if self.is_open:
            self._arrive(SocketOpened(self._number, self.is_own))

    def _received(self, data: bytes) -> None:
        self._arrive(BytesArrived(self._number, data))
        self._buffers.received(len(data))
        if not self._buffers.may_receive(self._unread):
            self.read_on()

    def _count_unsent(self) -> None:
        before = self._counted_unsent
        super()._count_unsent()
        if self._counted_unsent != before and self.is_open:
            self._arrive(BytesUnsent(self._number, self._counted_unsent))


def _can_call_from(own: str, address: str) -> bool:
    """Whether a call from our own address can reach an address: none leads out of the loopback network."""
    try:
        socket.inet_aton(own)
    except OSError:
        return False
    return own != "0.0.0.0" and own.startswith("127.") == address.startswith("127.")
