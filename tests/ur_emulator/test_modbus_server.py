"""Port 502: the port with connections that the test holds, then pymodbus's client and raw bytes on a whole box."""

import socket
import struct

import pytest
from box_support import TIMEOUT, BareBox, Bench, FakeConnection, connect, printed_by
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

from protocol.modbus import decode_values, encode_frame, encode_read
from ur_emulator import ControlBox, cli
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import PortError, PortPermissionError
from ur_emulator.host import rack
from ur_emulator.host.ports.modbus import ModbusSession
from ur_emulator.host.ports.session import SessionPort
from ur_emulator.host.runtime import listener
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.runtime.listener import ClientLimits, Listener, SpareDescriptor
from ur_emulator.machine.controller.modbus_map import COILS, REGISTERS, read_coil, read_register

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
READ_VERSION, VERSION = bytes.fromhex("0301000002"), bytes.fromhex("03040003000f")


def frame(pdu, transaction=1):
    return encode_frame(transaction, 255, pdu)


# --- the port itself


class PortBench(Bench):
    """A controller with its Modbus port."""

    def __init__(self):
        super().__init__()
        self.commands = []
        self.box = BareBox(None, self.controller, self.commands)
        self.port = SessionPort(self.box, ModbusSession)

    def cycle(self):
        """Advance by a cycle, in which all acts that was written."""
        written, self.commands[:] = tuple(self.commands), ()
        self.box.steps.publish(self.tick(1, *written))

    def ask(self, pdu):
        """Return the answer to a request."""
        client = FakeConnection(self.port)
        client.say(frame(pdu))
        self.cycle()
        client.close()
        (answer,) = client.sent
        return answer[7:]


@pytest.fixture(scope="module")
def bench():
    return PortBench()


@pytest.mark.parametrize(
    ("rows", "functions", "read_one"),
    [(COILS, (1, 2), read_coil), (REGISTERS, (3, 4), read_register)],
    ids=["coils", "registers"],
)
def test_every_address_of_the_map_can_be_read_and_gives_what_scripts_read(bench, rows, functions, read_one):
    for row in rows:
        for offset in range(0, row.count, 125):
            first, count = row.first + offset, min(125, row.count - offset)
            expected = tuple(read_one(bench.controller.state, first + i) for i in range(count))
            for function in functions:
                request = encode_read(function, first, count)
                client = FakeConnection(bench.port)
                client.say(frame(request))
                assert decode_values(request, client.sent[0][7:]) == expected


@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        ("0300030001", None),
        ("0301030001", ILLEGAL_ADDRESS),  # 259: a hole
        ("0301020002", ILLEGAL_ADDRESS),  # 258 and the hole
        ("03ffff0002", ILLEGAL_ADDRESS),  # beyond the end of all addresses
        ("0300000000", ILLEGAL_VALUE),
        ("030000007e", ILLEGAL_VALUE),  # 126 registers
        ("0100a00001", ILLEGAL_ADDRESS),
        ("01000007d1", ILLEGAL_VALUE),  # 2001 coils
        ("0600000001", ILLEGAL_ADDRESS),  # digital inputs
        ("050000ff00", ILLEGAL_ADDRESS),
        ("0501f4ff00", ILLEGAL_ADDRESS),  # general purpose outputs belong to scripts
        ("0500101234", ILLEGAL_VALUE),  # neither on nor off
        ("10008000010400010002", ILLEGAL_VALUE),  # sizes that do not match
        ("1000800002020001", ILLEGAL_VALUE),
        ("1000ff00020400010002", ILLEGAL_ADDRESS),  # 255 and, read only, 256
        ("0f0010000a01ff", ILLEGAL_VALUE),
        ("0f00100009020000", None),
        ("03", ILLEGAL_VALUE),
        ("030000000100", ILLEGAL_VALUE),
        ("07", ILLEGAL_FUNCTION),
        ("170080000100800001020001", ILLEGAL_FUNCTION),
        ("ff", ILLEGAL_FUNCTION),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_right_exception(bench, pdu, code):
    pdu = bytes.fromhex(pdu)
    answer = bench.ask(pdu)
    if code is None:
        assert answer[0] == pdu[0]
    else:
        assert answer == bytes([pdu[0] | 0x80, code])


def test_a_refused_write_writes_nothing(bench):
    before = read_register(bench.controller.state, 255)
    bench.ask(bytes.fromhex("1000ff00020400080009"))
    assert read_register(bench.controller.state, 255) == before


@given(st.lists(st.binary(min_size=1, max_size=30), min_size=1, max_size=5))
def test_any_request_gets_an_answer(bench, pdus):
    for pdu in pdus:
        assert bench.ask(pdu)[0] & 0x7F == pdu[0] & 0x7F


def test_a_write_is_answered_after_a_cycle_and_not_when_the_last_one_is_shown_again():
    bench = PortBench()
    client = FakeConnection(bench.port)
    client.say(frame(b"\6\0\x80\0\7") + frame(b"\3\0\x80\0\1"))
    for _ in range(3):
        bench.box.steps.publish(bench.now)
    assert client.sent == []
    bench.cycle()
    client.next_turns()
    assert [answer[7:] for answer in client.sent] == [b"\6\0\x80\0\7", b"\3\2\0\7"]


def test_a_client_whose_answers_find_no_room_is_cut_off():
    client = FakeConnection(PortBench().port, full=True)
    client.say(frame(READ_VERSION))
    assert not client.is_open


def test_writes_of_several_clients_act_in_the_order_in_which_they_came():
    bench = PortBench()
    clients = [FakeConnection(bench.port) for _ in range(20)]
    for i, client in enumerate(clients):
        client.say(frame(b"\6\0\x80" + struct.pack(">H", i)) * 2)
    for _ in range(2):
        assert [submitted.command.values for submitted in bench.commands] == [(i,) for i in range(20)]
        bench.cycle()
        for client in clients:
            client.next_turns()
    assert all(len(client.sent) == 2 for client in clients)


# --- over real sockets


@pytest.fixture(scope="module", params=["lockstep", "realtime"])
def box(request):
    with ControlBox(in_process=True, pace=request.param, port_base=None, seed=7) as running:
        yield running


@pytest.fixture
def client(box):
    with ModbusTcpClient(box.host, port=box.ports.modbus, timeout=TIMEOUT, retries=0) as client:
        yield client


def test_the_state_of_the_robot(client):
    for unit in (1, 17, 255):  # it does not matter, and is sent back
        answer = client.read_holding_registers(256, count=2, device_id=unit)
        assert (answer.registers, answer.dev_id) == ([3, 15], unit)
    assert client.read_holding_registers(258).registers == [7]  # robot mode RUNNING
    assert client.read_coils(260, count=6).bits[:6] == [True, False, False, False, False, False]
    q = client.read_input_registers(270, count=6).registers
    assert all(0 <= value < 6284 for value in q)
    assert any(q)


def test_what_was_written_is_read_back_at_once(client):
    for value in (0, 1, 65535):
        assert client.write_register(128, value).registers == [value]
        assert client.read_holding_registers(128).registers == [value]
    assert client.write_registers(130, [1, 2, 65535]).count == 3
    assert client.read_holding_registers(129, count=5).registers == [0, 1, 2, 65535, 0]


def test_scripts_and_clients_share_words_and_booleans(box, client):
    client.write_register(140, 4711)
    client.write_coils(364, [True, False, True])
    lines = ("x = read_port_register(140)", "write_port_register(141, x + 1)", "sync()")
    assert printed_by(box, *lines, "textmsg(x, read_input_boolean_register(66))") == ["4711True"]
    assert client.read_holding_registers(141).registers == [4712]


def read_answer(stream):
    transaction, _, length, _ = struct.unpack(">HHHB", stream.read(7))
    return transaction, stream.read(length - 1)


def test_requests_that_come_together_are_answered_in_order(box):
    n = 5 * BUDGETS.client_work
    with connect(box, "modbus") as sock, sock.makefile("rb") as stream:
        requests = [
            frame(b"\x06\x00\xa0" + struct.pack(">H", i), i) if i % 10 == 0 else frame(b"\3\0\xa0\0\1", i)
            for i in range(n)
        ]
        sock.sendall(b"".join(requests))
        for i in range(n):
            transaction, pdu = read_answer(stream)
            assert transaction == i
            assert int.from_bytes(pdu[-2:], "big") == i - i % 10  # reads see the write before them


def test_a_client_that_never_reads_is_cut_off_alone(box, client):
    requests = frame(b"\3\0\x80\0\x7d") * 1_000_000  # the buffers of the system take a part of it only
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.settimeout(TIMEOUT)
        sock.connect((box.host, box.ports.modbus))
        with pytest.raises(ConnectionError):
            sock.sendall(requests)
    assert client.read_holding_registers(256).registers == [3]


# --- a port that this user may not open


def forbid_low_ports(monkeypatch):
    class Socket(socket.socket):
        def bind(self, address):
            if 0 < address[1] < 1024:
                raise PermissionError(13, "Permission denied")
            super().bind(("127.0.0.1", 0))

    monkeypatch.setattr(listener.socket, "socket", Socket)


def test_a_forbidden_port_is_distinguished_from_a_taken_one(monkeypatch):
    loop = EventLoop()

    def listen(port):
        limits, spare = ClientLimits(), SpareDescriptor()
        Listener(loop, "127.0.0.1", port, None, set(), print, pytest.fail, "modbus", limits, spare)

    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(PortError) as error:
        listen(taken.getsockname()[1])
    assert not isinstance(error.value, PortPermissionError)
    forbid_low_ports(monkeypatch)
    with pytest.raises(PortPermissionError, match=r"port 502 on 127\.0\.0\.1 needs privileges"):
        listen(502)
    loop.close()


def test_a_box_without_its_modbus_port_serves_all_others_and_says_so(monkeypatch):
    forbid_low_ports(monkeypatch)
    with ControlBox(in_process=True, pace="lockstep") as box:
        assert box.ports.modbus == 0
        assert box.ports.dashboard > 0
        assert printed_by(box, 'textmsg("up")') == ["up"]
        assert len(box.notices) == 1
        assert "502" in box.notices[0]
        assert "--port-base" in box.notices[0]


POLYSCOPE_X = ["--robot", "ur5e", "--software", "10.11"]


@pytest.mark.parametrize(
    ("options", "missing", "n"),
    [
        ([], ["no Modbus server: port 502"], 1),
        (POLYSCOPE_X, ["no Robot API: port 80", "no Modbus server: port 502"], 3),
    ],
)
def test_the_command_names_each_port_that_is_missing_in_one_line(monkeypatch, capfd, options, missing, n):
    forbid_low_ports(monkeypatch)
    monkeypatch.setattr(rack.LoopRack, "serve_forever", rack.LoopRack.close)
    boxes = ["--boxes", str(n), "--pace", "lockstep"]
    assert not cli.app(["serve", *options, *boxes], standalone_mode=False)
    out, err = capfd.readouterr()
    lines = [line for line in err.splitlines() if "--services" not in line]
    assert [line.partition(" on 127.0.0.1 needs privileges")[0] for line in lines] == [
        f"ur-emulator: {one}" for one in missing
    ]
    assert all(line.endswith(" (the same for 2 more boxes)") is (n == 3) for line in err.splitlines())
    assert "modbus" not in out
    assert out.count("ready at") == n
