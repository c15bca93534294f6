"""Sockets that scripts open: the network that `scripting` asks for, made of non-blocking sockets."""

from __future__ import annotations

import errno
import selectors
import socket
import threading
from weakref import WeakSet

from ur_emulator.controller.io.modbus_signals import UnitAddress
from ur_emulator.realtime.barrier import Report
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.servers.modbus.client import ModbusClient
from ur_emulator.servers.modbus.link import ModbusLink
from ur_emulator.servers.scripts.xmlrpc_client import XmlRpcServer
from ur_emulator.servers.tcp.buffered_socket import BufferedSocket

_READ_SIZE = 64 * 1024
# Bytes of a script that may wait for a peer that does not read; further sends fail.
_SEND_LIMIT = 256 * 1024
# Bytes that may wait for a script that does not read; then the box stops reading from the peer. Above the
# longest text that a read waits for (socket_functions.MAX_INBOX).
_INBOX_LIMIT = 2 << 20
_IN_PROGRESS = {0, errno.EINPROGRESS, errno.EWOULDBLOCK, getattr(errno, "WSAEWOULDBLOCK", errno.EINPROGRESS)}


class ScriptConnection(BufferedSocket):
    """One client connection of a script."""

    def __init__(self, loop: EventLoop, host: str, port: int, report: Report, own_address: str = "") -> None:
        """Begin to connect; a name is looked up in a thread of its own, the loop never waits for it.

        Args:
            loop: watches the socket.
            host: name or address of the peer.
            port: of the peer.
            report: called with an error of ours in what the peer has caused; it ends the connection.
            own_address: where to call from, if the peer can be reached from there; "" leaves it open.
        """
        super().__init__(loop, _SEND_LIMIT, _READ_SIZE)
        self._peer = f"{host}:{port}"
        self._report = report
        self._own_address = own_address
        self._inbox = bytearray()
        self.is_connecting = True
        if _is_numeric(host):
            self._connect(host, port)
        else:
            threading.Thread(
                target=self._look_up, args=(host, port), name="script-lookup", daemon=True
            ).start()

    @property
    def inbox(self) -> bytearray:
        """Bytes that have come and were not read yet; reading from the peer goes on with this call."""
        if not self._wants_data and self._sock is not None:
            self._wants_data = True
            self._watch()
        return self._inbox

    def close(self) -> None:
        """Close; what has come can still be read."""
        super().close()
        self.is_connecting = False

    def failed(self, error: Exception) -> None:
        """Close after an error of ours, and report it; the script sees a peer that has closed."""
        self._report(f"the connection of a script to {self._peer} is closed", error)
        self.close()

    # --- connecting

    def _look_up(self, host: str, port: int) -> None:
        """Find the address of a name; in its own thread, touching nothing but the loop's call queue."""
        try:
            address = str(socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_STREAM)[0][4][0])
        except (OSError, ValueError, OverflowError):
            self._loop.call_soon_threadsafe(self.close, self.failed)
        else:
            self._loop.call_soon_threadsafe(lambda: self._connect(address, port), self.failed)

    def _connect(self, address: str, port: int) -> None:
        if not self.is_connecting:
            return  # closed while the name was looked up
        try:
            self._sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._sock.setblocking(False)
            if _can_call_from(self._own_address, address):
                self._sock.bind((self._own_address, 0))
            code = self._sock.connect_ex((address, port))
        except (OSError, OverflowError):  # descriptors are out, or that is not an address
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
        self._open(self._sock)

    # --- bytes

    def _received(self, data: bytes) -> None:
        self._inbox += data
        if len(self._inbox) > _INBOX_LIMIT:
            self._wants_data = False
            self._watch()

    def _ended(self) -> None:
        self.close()

    def _send_failed(self) -> None:
        self.close()

    def _sent(self) -> None:
        pass


def _is_numeric(host: str) -> bool:
    try:
        socket.inet_aton(host)
    except (OSError, ValueError):  # no address, or no text that could be one
        return False
    return True


def _can_call_from(own: str, address: str) -> bool:
    """Whether a call from our own address can reach an address: none leads out of the loopback network."""
    if not _is_numeric(own) or own == "0.0.0.0":
        return False
    return own.startswith("127.") == address.startswith("127.")


class LoopNetwork:
    """Opens script sockets in a loop."""

    def __init__(self, loop: EventLoop, period_s: float, report: Report, own_address: str = "") -> None:
        """Prepare; nothing is opened.

        Args:
            loop: watches the sockets.
            period_s: control cycle [s].
            report: called with an error of ours and what it has ended.
            own_address: of the box. A robot calls from the address at which it is called, and clients that
                listen for it check that.
        """
        self._loop = loop
        self._report = report
        self._own_address = own_address
        self._sockets: WeakSet[ScriptConnection] = WeakSet()
        self._modbus = ModbusClient(loop, self.open, period_s, report)

    def open(self, host: str, port: int) -> ScriptConnection:
        """Begin to connect to `host`:`port`."""
        opened = ScriptConnection(self._loop, host, port, self._report, self._own_address)
        self._sockets.add(opened)
        return opened

    def remote_server(self, url: str) -> XmlRpcServer:
        """Return an XML-RPC server; nothing is connected before its first call."""
        return XmlRpcServer(self._loop, url)

    def modbus_unit(self, address: UnitAddress) -> ModbusLink:
        """Return the connection to a Modbus unit."""
        return self._modbus.unit(address)

    def close(self) -> None:
        """Close everything, whatever the programs are doing."""
        self._modbus.close()
        for opened in tuple(self._sockets):
            opened.close()
