"""Modbus signals over real sockets: a box, pymodbus's server, and servers that misbehave."""

import socket
import struct
import threading
from contextlib import suppress

import pytest
from box_support import TIMEOUT, MessageReader, connect
from modbus_support import (
    COILS,
    HOLDING,
    INPUT_REGISTERS,
    INPUTS,
    answers_42,
    frame,
    good_unit,
    peer,
    read_exactly,
    read_request,
)

from protocol.primary.messages import RuntimeExceptionMessage, TextMessage
from ur_emulator.emulator import ControlBox
from ur_emulator.outgoing import modbus_units


@pytest.fixture(scope="module", params=["lockstep", "realtime"])
def box(request):
    with ControlBox(in_process=True, pace=request.param, port_base=None) as running:
        yield running


def send(sock, *lines):
    body = "".join(f"  {line}\n" for line in lines)
    sock.sendall(f"def p():\n{body}end\n".encode())


def run(box, *lines, n=1):
    """Run a program and return the first `n` texts that it prints."""
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(sock, *lines)
        return [reader.message(TextMessage).text for _ in range(n)]


def add(port, kind, name, address=5, sequential=False):
    return f'modbus_add_signal("127.0.0.1:{port}", 255, {address}, {kind}, "{name}", {sequential})'


def until(condition):
    return f"while not ({condition}): sync() end"


def status(name):
    return f'modbus_get_signal_status("{name}", False)'


def until_seen(unit, memory, address, value):
    """Wait for a value in a unit, asking it as fast as it answers."""
    for _ in range(100_000):
        if unit.get(memory, address) == value:
            return
    raise AssertionError("the value did not come")


def test_every_type_of_signal_is_read(box):
    with good_unit() as unit:
        unit.set(COILS, 1, True)
        unit.set(INPUTS, 2, True)
        unit.set(HOLDING, 3, 65535)
        unit.set(INPUT_REGISTERS, 4, 1234)
        texts = run(
            box,
            add(unit.port, 1, "coil", 1),
            add(unit.port, 0, "input", 2),
            add(unit.port, 3, "out", 3),
            add(unit.port, 2, "in", 4),
            until(f"{status('coil')} and {status('input')}"),
            until(f"{status('out')} > 0 and {status('in')} > 0"),
            f"textmsg({status('out')})",
            f"textmsg({status('in')})",
            n=2,
        )
        assert unit.connections == 1
    assert texts == ["65535", "1234"]


def test_outputs_are_written_and_follow_the_program(box):
    with good_unit() as unit:
        run(
            box,
            add(unit.port, 1, "coil", 1),
            add(unit.port, 3, "out", 3),
            'modbus_set_runstate_dependent_choice("coil", 1)',
            'modbus_set_output_signal("coil", True, False)',
            'modbus_set_output_register("out", 4711, False)',
            'textmsg("set")',
            "while True: sync() end",
        )
        until_seen(unit, COILS, 1, True)
        until_seen(unit, HOLDING, 3, 4711)
        with connect(box, "primary") as sock:
            sock.sendall(b"stop program\n")
            until_seen(unit, COILS, 1, False)
        assert unit.get(HOLDING, 3) == 4711


def test_a_value_that_changes_is_seen(box):
    with good_unit() as unit, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(
            sock,
            add(unit.port, 2, "in", 4),
            'modbus_set_signal_update_frequency("in", 125)',
            "last = 0",
            "while True:",
            f"now = {status('in')}",
            "if now != last: textmsg(now) last = now end",
            "sync()",
            "end",
        )
        for value in (1, 2, 65535):
            unit.set(INPUT_REGISTERS, 4, value)
            assert reader.message(TextMessage).text == str(value)


def test_a_unit_that_comes_back_is_found_again(box, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", TIMEOUT)
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        with good_unit() as unit:
            port = unit.port
            unit.set(INPUT_REGISTERS, 4, 1)
            send(
                sock,
                add(port, 2, "in", 4),
                until(f"{status('in')} == 1"),
                'textmsg("there")',
                until(f"{status('in')} == 2"),
                'textmsg("again")',
            )
            assert reader.message(TextMessage).text == "there"
        with good_unit(port) as unit:
            unit.set(INPUT_REGISTERS, 4, 2)
            assert reader.message(TextMessage).text == "again"


def test_an_exception_of_the_unit_is_named(box, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", TIMEOUT)
    with good_unit() as unit, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(
            sock,
            add(unit.port, 2, "good", 4),
            add(unit.port, 2, "bad", 999),
            *(line for i in (1, 2) for line in (until(f"{status('good')} == {i}"), f"textmsg({i})")),
            f"while True: {status('bad')} sync() end",
        )
        for i in (1, 2):
            unit.set(INPUT_REGISTERS, 4, i)
            assert reader.message(TextMessage).text == str(i)
        # Between the two texts both signals had their turn.
        monkeypatch.setattr(modbus_units, "TOLERANCE", 0.0)
        text = reader.message(RuntimeExceptionMessage).text
    assert text.endswith(
        f'signal "bad" is lost: 127.0.0.1:{unit.port} answers with exception E2 (illegal data address)'
    )


def test_a_unit_that_is_not_there_ends_the_program_that_uses_it(box, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(sock, add(port, 2, "in"), f"while True: {status('in')} sync() end")
        message = reader.message(RuntimeExceptionMessage)
    assert message.line == 3
    assert message.text.endswith(f'signal "in" is lost: 127.0.0.1:{port} refuses the connection')


def test_an_address_may_be_a_name(box):
    with good_unit() as unit:
        unit.set(INPUT_REGISTERS, 4, 5)
        texts = run(
            box,
            f'modbus_add_signal("localhost:{unit.port}", 255, 4, 2, "in")',
            until(f"{status('in')} == 5"),
            'textmsg("found")',
        )
    assert texts == ["found"]


def test_an_own_request_reaches_the_unit_and_its_connection_ends():
    asked = []
    ended = threading.Event()

    def behave(sock):
        asked.append(read_request(sock))
        sock.sendall(frame(asked[0][0], 103, b"\x86\1"))
        ended.connected = sock.recv(1)
        ended.set()

    with ControlBox(in_process=True, pace="lockstep", port_base=None) as box, peer(behave) as port:
        run(
            box, f'modbus_send_custom_command("127.0.0.1:{port}", 103, 6, [17, 32, 2, 88])', 'textmsg("sent")'
        )
        assert ended.wait(TIMEOUT)
    assert asked[0][1:] == (103, bytes([6, 17, 32, 2, 88]))
    assert ended.connected == b""


def test_a_box_that_ends_closes_its_connections():
    ended = threading.Event()

    def behave(sock):
        answers_until_closed(sock)
        ended.set()

    def answers_until_closed(sock):
        with suppress(EOFError):
            answers_42(sock)

    with peer(behave) as port:
        with ControlBox(in_process=True, pace="lockstep", port_base=None) as box:
            assert run(box, add(port, 2, "in"), until(f"{status('in')} == 42"), 'textmsg("up")') == ["up"]
        assert ended.wait(TIMEOUT)


# --- units that misbehave on their first connection and are good on the next


def says_nonsense(sock):
    sock.sendall(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n")
    read_exactly(sock, 1 << 20)


def closes_at_once(sock):
    pass


def resets(sock):
    read_request(sock)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def is_silent(sock):
    read_exactly(sock, 1 << 20)


def closes_within_a_frame(sock):
    transaction, unit, pdu = read_request(sock)
    sock.sendall(frame(transaction, unit, pdu[:1] + b"\2\0\x07")[:9])


def answers_others(sock):
    while True:
        transaction, unit, pdu = read_request(sock)
        sock.sendall(frame(transaction + 1 & 0xFFFF, unit, pdu[:1] + b"\2\0\x07") * 40)


def floods(sock):
    while True:
        sock.sendall(b"\xa5" * 65536)


def floods_with_frames(sock):
    while True:
        sock.sendall(frame(0, 255, b"\4\2\0\7") * 5000)


def trickles(sock):
    read_request(sock)
    for byte in b"\0\1\0\0\0\xf0" + bytes(300):
        sock.sendall(bytes([byte]))
        sock.settimeout(0.05)
        try:
            if not sock.recv(4096):
                return
        except TimeoutError:
            pass


def announces_too_much(sock):
    transaction, _, _ = read_request(sock)
    sock.sendall(struct.pack(">HHHB", transaction, 0, 65535, 255) + bytes(3000))
    read_exactly(sock, 1 << 20)


BAD = [
    says_nonsense,
    closes_at_once,
    resets,
    is_silent,
    closes_within_a_frame,
    answers_others,
    floods,
    floods_with_frames,
    trickles,
    announces_too_much,
]


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: bad.__name__)
def test_a_unit_that_misbehaves_harms_nobody(box, bad, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", TIMEOUT)
    monkeypatch.setattr(modbus_units, "ANSWER_TIMEOUT", 0.2)
    with good_unit() as good, peer(bad, answers_42) as port:
        good.set(INPUT_REGISTERS, 4, 5)
        texts = run(
            box,
            add(port, 2, "bad"),
            add(good.port, 2, "good", 4),
            until(f"{status('good')} == 5"),
            'textmsg("good")',
            until(f"{status('bad')} != 0"),
            f"textmsg({status('bad')})",
            'modbus_delete_signal("bad")',
            n=2,
        )
        assert texts == ["good", "42"]
        assert run(box, 'textmsg("alive")') == ["alive"]
