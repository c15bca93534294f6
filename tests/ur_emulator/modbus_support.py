"""Modbus units for the tests: pymodbus's own server, and servers that misbehave."""

import asyncio
import socket
import threading
from contextlib import contextmanager, suppress

from box_support import TIMEOUT
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

# Function codes by which pymodbus reaches its four memories.
COILS, INPUTS, HOLDING, INPUT_REGISTERS = 1, 2, 3, 4
N_ADDRESSES = 64


class GoodUnit:
    """pymodbus's server in a thread; addresses 0 to 63 exist, all 0 at first."""

    def __init__(self, port=0):
        self._loop = asyncio.new_event_loop()
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(port,), daemon=True)
        self._thread.start()
        assert self._started.wait(TIMEOUT)

    def _run(self, port):
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve(port))
        self._loop.close()

    async def _serve(self, port):
        bits = SimData(0, count=N_ADDRESSES, values=False, datatype=DataType.BITS)
        words = SimData(0, count=N_ADDRESSES, values=0, datatype=DataType.REGISTERS)
        device = SimDevice(0, simdata=([bits], [bits], [words], [words]))
        self.connections = 0
        self._server = ModbusTcpServer(
            device, address=("127.0.0.1", port), trace_connect=self._count_connection
        )
        await self._server.serve_forever(background=True)
        self.port = self._server.transport.sockets[0].getsockname()[1]
        self._started.set()
        await self._server.serving

    def _count_connection(self, connected):
        self.connections += connected

    def _do(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(TIMEOUT)

    def set(self, memory, address, value):
        self._do(self._server.async_setValues(0, memory, address, [value]))

    def get(self, memory, address):
        return self._do(self._server.async_getValues(0, memory, address, 1))[0]

    def close(self):
        if self._thread.is_alive():
            self._do(self._server.shutdown())
            self._thread.join(TIMEOUT)


@contextmanager
def good_unit(port=0):
    unit = GoodUnit(port)
    try:
        yield unit
    finally:
        unit.close()


@contextmanager
def peer(*behaviours):
    """A server whose n-th connection is handled by the n-th of `behaviours` (the last for all that follow).

    A behaviour gets the connected socket; when it returns, the socket is closed.
    """
    with socket.create_server(("127.0.0.1", 0)) as server:
        is_over = threading.Event()

        def serve():
            for i in range(10_000):
                try:
                    sock, _ = server.accept()
                except OSError:
                    return
                if is_over.is_set():
                    sock.close()
                    return
                handle = behaviours[min(i, len(behaviours) - 1)]
                threading.Thread(target=run, args=(handle, sock), daemon=True).start()

        def run(handle, sock):
            with sock, suppress(OSError, EOFError):
                sock.settimeout(TIMEOUT)
                handle(sock)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield server.getsockname()[1]
        finally:
            is_over.set()
            with suppress(OSError), socket.create_connection(server.getsockname(), timeout=TIMEOUT):
                pass
            thread.join(TIMEOUT)


def read_request(sock):
    """Return transaction number, unit and function code with data of the next request."""
    head = read_exactly(sock, 6)
    body = read_exactly(sock, int.from_bytes(head[4:], "big"))
    return int.from_bytes(head[:2], "big"), body[0], body[1:]


def read_exactly(sock, size):
    data = b""
    while len(data) < size:
        piece = sock.recv(size - len(data))
        if not piece:
            raise EOFError
        data += piece
    return data


def frame(transaction, unit, pdu):
    return transaction.to_bytes(2, "big") + b"\0\0" + (len(pdu) + 1).to_bytes(2, "big") + bytes([unit]) + pdu


def answers_42(sock):
    """Behave: every register is 42."""
    while True:
        transaction, unit, pdu = read_request(sock)
        sock.sendall(frame(transaction, unit, pdu[:1] + b"\2\0\x2a"))
