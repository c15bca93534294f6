"""Modbus signals over real sockets: a box and its own server, and units that misbehave."""

import socket
import struct
import threading
from contextlib import contextmanager, suppress

import pytest
from box_support import TIMEOUT, MessageReader, connect, printed_by, program

from protocol.modbus import encode_frame
from protocol.primary.messages import RuntimeExceptionMessage
from ur_emulator.emulator import ControlBox
from ur_emulator.host.script_network import modbus_units


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


def test_signals_of_every_type_go_there_and_back_on_one_connection(box):
    """The unit is the server of the box itself, which `test_modbus_server.py` holds against pymodbus."""
    port = box.ports.modbus
    signals = ((1, "coil", 17), (0, "input", 260), (3, "out", 150), (2, "in", 256))
    texts = printed_by(
        box,
        *(add(port, *signal) for signal in signals),
        until(f"{status('input')} and {status('in')} > 0"),
        f"textmsg({status('in')})",
        'modbus_set_runstate_dependent_choice("coil", 1)',
        'modbus_set_output_signal("coil", True, False)',
        'modbus_set_output_register("out", 4711, False)',
        f'modbus_send_custom_command("127.0.0.1:{port}", 255, 6, [0, 160, 18, 52])',
        until(
            "read_port_register(150) == 4711 and read_port_register(160) == 4660 and get_standard_digital_out(1)"
        ),
        'textmsg("set")',
        n=2,
    )
    assert texts == ["3", "set"]
    assert [client for client in box.state.clients if "at modbus" in client] == [box.state.clients[0]]
    while box.state.digital_outputs["standard"][1]:
        box.wait_until(time=box.state.time + 0.1)
    printed_by(box, *(f'modbus_delete_signal("{name}")' for _, name, _ in signals), 'textmsg("gone")')


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


def resets(sock):
    read_request(sock)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def floods(sock):
    while True:
        sock.sendall(encode_frame(0, 255, b"\4\2\0\7") * 5000)


@pytest.mark.parametrize("bad", [resets, floods], ids=lambda bad: bad.__name__)
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
