"""Modbus signals over real sockets: a box, pymodbus's server, and units that misbehave."""

import asyncio
import socket
import struct
import threading
from contextlib import contextmanager, suppress

import pytest
from box_support import TIMEOUT, MessageReader, connect, printed_by, program
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from protocol.modbus import encode_frame
from protocol.primary.messages import RuntimeExceptionMessage
from ur_emulator.emulator import ControlBox
from ur_emulator.host.script_network import modbus_units

# Function codes by which pymodbus reaches its four memories.
COILS, INPUTS, HOLDING, INPUT_REGISTERS = 1, 2, 3, 4
N_ADDRESSES = 64


class GoodUnit:
    """pymodbus's server in a thread; addresses 0 to 63 exist, all 0 at first."""

    def __init__(self):
        self.connections = 0
        self._loop = asyncio.new_event_loop()
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self._started.wait(TIMEOUT)

    def _run(self):
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self):
        bits = SimData(0, count=N_ADDRESSES, values=False, datatype=DataType.BITS)
        words = SimData(0, count=N_ADDRESSES, values=0, datatype=DataType.REGISTERS)
        device = SimDevice(0, simdata=([bits], [bits], [words], [words]))
        self._server = ModbusTcpServer(device, address=("127.0.0.1", 0), trace_connect=self._count_connection)
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

    def until_seen(self, memory, address, value):
        """Wait for a value, asking as fast as it answers."""
        for _ in range(100_000):
            if self.get(memory, address) == value:
                return
        raise AssertionError("the value did not come")

    def close(self):
        self._do(self._server.shutdown())
        self._thread.join(TIMEOUT)


@pytest.fixture
def good_unit():
    unit = GoodUnit()
    yield unit
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


def answers_42(sock):
    """Behave: every register is 42."""
    while True:
        transaction, unit, pdu = read_request(sock)
        sock.sendall(encode_frame(transaction, unit, pdu[:1] + b"\2\0\x2a"))


@pytest.fixture(scope="module")
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None) as running:
        yield running


def add(port, kind, name, address=5):
    return f'modbus_add_signal("127.0.0.1:{port}", 255, {address}, {kind}, "{name}")'


def until(condition):
    return f"while not ({condition}): sync() end"


def status(name):
    return f'modbus_get_signal_status("{name}", False)'


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_signals_of_every_type_go_there_and_back_on_one_connection(good_unit, pace):
    good_unit.set(INPUTS, 2, True)
    good_unit.set(INPUT_REGISTERS, 4, 1234)
    with ControlBox(in_process=True, pace=pace, port_base=None) as box:
        texts = printed_by(
            box,
            *(
                add(good_unit.port, *signal)
                for signal in ((1, "coil", 1), (0, "input", 2), (3, "out", 3), (2, "in", 4))
            ),
            until(f"{status('input')} and {status('in')} > 0"),
            f"textmsg({status('in')})",
            'modbus_set_runstate_dependent_choice("coil", 1)',
            'modbus_set_output_signal("coil", True, False)',
            'modbus_set_output_register("out", 4711, False)',
            "while True: sync() end",
        )
        assert texts == ["1234"]
        good_unit.until_seen(COILS, 1, True)
        good_unit.until_seen(HOLDING, 3, 4711)
        with connect(box, "primary") as sock:
            sock.sendall(b"stop program\n")
            good_unit.until_seen(COILS, 1, False)
        assert good_unit.get(HOLDING, 3) == 4711
    assert good_unit.connections == 1


def test_a_unit_that_is_not_there_ends_the_program_that_uses_it(box, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        sock.sendall(program(add(port, 2, "in"), f"while True: {status('in')} sync() end").encode())
        message = reader.message(RuntimeExceptionMessage)
    assert message.line == 3
    assert message.text.endswith(f'signal "in" is lost: 127.0.0.1:{port} refuses the connection')


def test_an_address_may_be_a_name(box):
    with peer(answers_42) as port:
        signal = f'modbus_add_signal("localhost:{port}", 255, 4, 2, "in")'
        assert printed_by(box, signal, until(f"{status('in')} == 42"), 'textmsg("found")') == ["found"]


def test_an_own_request_reaches_the_unit_and_its_connection_ends(box):
    asked = []
    ended = threading.Event()

    def behave(sock):
        asked.append(read_request(sock))
        sock.sendall(encode_frame(asked[0][0], 103, b"\x86\1"))
        ended.connected = sock.recv(1)
        ended.set()

    with peer(behave) as port:
        printed_by(
            box, f'modbus_send_custom_command("127.0.0.1:{port}", 103, 6, [17, 32, 2, 88])', 'textmsg("sent")'
        )
        assert ended.wait(TIMEOUT)
    assert asked[0][1:] == (103, bytes([6, 17, 32, 2, 88]))
    assert ended.connected == b""


def test_a_box_that_ends_closes_its_connections():
    ended = threading.Event()

    def behave(sock):
        with suppress(EOFError, ConnectionError):  # a reset, where an answer had not been read
            answers_42(sock)
        ended.set()

    with peer(behave) as port:
        with ControlBox(in_process=True, pace="lockstep", port_base=None) as box:
            assert printed_by(box, add(port, 2, "in"), until(f"{status('in')} == 42"), 'textmsg("up")') == [
                "up"
            ]
        assert ended.wait(TIMEOUT)


# --- units that misbehave on their first connection and are good on the next


def closes_at_once(sock):
    pass


def resets(sock):
    read_request(sock)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def is_silent(sock):
    read_exactly(sock, 1 << 20)


def floods(sock):
    while True:
        sock.sendall(encode_frame(0, 255, b"\4\2\0\7") * 5000)


@pytest.mark.parametrize("bad", [closes_at_once, resets, is_silent, floods], ids=lambda bad: bad.__name__)
def test_a_unit_that_misbehaves_harms_nobody(box, bad, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", TIMEOUT)
    monkeypatch.setattr(modbus_units, "ANSWER_TIMEOUT", 0.2)
    with peer(answers_42) as good, peer(bad, answers_42) as port:
        texts = printed_by(
            box,
            add(port, 2, "bad"),
            add(good, 2, "good", 4),
            *(
                line
                for name in ("good", "bad")
                for line in (until(f"{status(name)} == 42"), f'textmsg("{name}")')
            ),
            'modbus_delete_signal("bad")',
            n=2,
        )
    assert texts == ["good", "bad"]
