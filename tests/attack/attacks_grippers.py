"""Attacks on the ports of grippers: variables at 63352, the serial line at 54321, calls of XML-RPC at 41414."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any
from xmlrpc.client import ServerProxy

from attack_record import Section
from attackers import arm_at_rest, asked_while, crowd, flood, in_background, until
from box_under_attack import WITH_GRIPPER, BoxUnderAttack

from protocol.modbus_rtu import encode_rtu

GRIPPERS = Section("Ports of grippers")

_UNIT = 9
_STATUS = encode_rtu(_UNIT, struct.pack(">BHH", 4, 0x07D0, 3))
_CLOSE = encode_rtu(_UNIT, struct.pack(">BHHB3H", 16, 0x03E8, 3, 6, 0x0900, 0x00FF, 0xFFFF))


def _told(client: socket.socket, text: str) -> str:
    """Send a request; return what comes, up to the end of its line."""
    client.sendall(text.encode("latin-1"))
    return client.recv(1 << 16).decode()


def _asked(box: BoxUnderAttack, text: str) -> str:
    """Ask on a connection of its own; "" if it is refused."""
    with suppress(ConnectionError), box.connect("gripper") as client:
        return _told(client, text)
    return ""


@contextmanager
def _arm_at_rest(box: BoxUnderAttack) -> Iterator[None]:
    """The arm stands where it stood, and the gripper answers, when the block ends."""
    with arm_at_rest(box):
        yield
        until(lambda: _asked(box, "GET SID") == "[9]", "the gripper answers")


def _answers_while(client: socket.socket, thread: threading.Thread) -> str:
    """Ask as long as others attack; return a remark."""

    def ask() -> None:
        answer = _told(client, "GET OBJ\n")
        assert answer.startswith("OBJ "), answer

    return asked_while(thread, ask)


@GRIPPERS.attack(
    "40 clients of port 63352 send GETs and SETs without pause and read no answers",
    "they are closed",
    kinds=WITH_GRIPPER,
)
def unread_answers_of_a_gripper(box: BoxUnderAttack, seconds: float) -> str:
    block = 50 * b"GET POS\nGET SID\nSET LBP 1 LRD 0\nGET SNU\nGET NOTHING\n"
    with (
        _arm_at_rest(box),
        box.connect("gripper") as client,
        in_background(flood, box, "gripper", block, seconds, clients=40, reads=False) as attack,
    ):
        return _answers_while(client, attack)


@GRIPPERS.attack(
    "20 clients of port 63352 send a line without end; 40 keep the half of a SET",
    "1,024 bytes are a line",
    kinds=WITH_GRIPPER,
)
def endless_lines_of_a_gripper(box: BoxUnderAttack, seconds: float) -> str:
    with _arm_at_rest(box), crowd(box, "gripper", 40, b"SET POS 255 SPE 255 GTO") as halves:
        assert len(halves) == 40, f"{len(halves)} of 40 were served"
        with (
            box.connect("gripper") as client,
            in_background(
                flood, box, "gripper", b"SET POS " + (1 << 20) * b"9", seconds, clients=20
            ) as attack,
        ):
            before = _told(client, "GET PRE\nGET GTO\n")
            remark = _answers_while(client, attack)
            after = _told(client, "GET PRE\nGET GTO\n")
            assert after == before, f"{after!r} instead of {before!r}"
        return remark


def _until_line_answers(box: BoxUnderAttack) -> None:
    """Wait until the line is free again, and a request on it is answered."""

    def answers() -> bool:
        with suppress(OSError), box.connect("tool_line", 0.2) as client:
            client.sendall(_STATUS)
            return client.recv(100)[:3] == b"\t\4\6"
        return False

    until(answers, "the serial line answers")


@GRIPPERS.attack(
    "30 masters of port 54321 read and write at once without pause; half of them do not read",
    "the first has the line",
    kinds=WITH_GRIPPER,
)
def many_masters_of_a_line(box: BoxUnderAttack, seconds: float) -> None:
    block = 30 * (_STATUS + _CLOSE + encode_rtu(_UNIT, struct.pack(">BHH", 6, 0x03EA, 0xFFFF)))
    with _arm_at_rest(box):
        with in_background(flood, box, "tool_line", block, seconds, clients=15, reads=False):
            flood(box, "tool_line", block, seconds, clients=15)
        _until_line_answers(box)


_CALL = b"<methodCall><methodName>%s</methodName><params>%s</params></methodCall>"


def _call(name: str, *values: float) -> bytes:
    """Return a request that calls a method of the first gripper."""
    shown = ["<int>0</int>", *(f"<double>{value}</double>" for value in values)]
    params = "".join(f"<param><value>{value}</value></param>" for value in shown)
    body = _CALL % (name.encode(), params.encode())
    return b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n" % len(body) + body


@contextmanager
def _server(box: BoxUnderAttack) -> Iterator[Any]:
    with ServerProxy(f"http://{box.host}:{box.ports.onrobot}/") as server:
        yield server


@GRIPPERS.attack(
    "60 clients of port 41414 and 60 others after them send half a call, then a byte every 10 ms",
    "the one that was silent longest is closed for a new one",
    kinds=WITH_GRIPPER,
)
def calls_that_never_end(box: BoxUnderAttack, seconds: float) -> str:
    half = _call("rg_grip", 1.0)[:-30]

    def attack() -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with crowd(box, "onrobot", 60, half) as clients:
                for _ in range(20):
                    for client in clients:
                        with suppress(OSError):
                            client.send(b"<")
                    time.sleep(0.01)

    def ask() -> None:
        with _server(box) as server:
            assert server.rg_get_status(0) == 0

    with arm_at_rest(box), in_background(attack) as attacking:
        return asked_while(attacking, ask)


@GRIPPERS.attack(
    "20 clients of port 41414 grip, stop, set the fingertips and turn the supply off, 10 masters of port 502 and a "
    "program by tool outputs move the same fingers at once",
    kinds=WITH_GRIPPER,
)
def three_ways_to_the_same_fingers(box: BoxUnderAttack, seconds: float) -> None:
    numbers = (0.0, 100.0, 1e308, -1e308, 55.5)
    grips = [_call("rg_grip", a, b) for a in numbers for b in numbers]
    tips = [_call("rg_set_fingertip_offset", a) for a in numbers]
    calls = [*grips, *tips, _call("rg_stop"), *grips, _call("cb_reset_tool_power")]
    write = struct.Struct(">HHHBBHHB3H")
    registers = [
        write.pack(7, 0, 13, 65, 16, 0, 3, 6, *values) for values in ((400, 0, 16), (0xFFFF, 0xFFFF, 1))
    ]
    registers += [struct.pack(">HHHBBHH", 7, 0, 6, 63, 6, 0, 2)]
    outputs = (f"  set_tool_digital_out(0, {word})\n    sync()" for word in ("True", "False"))
    with arm_at_rest(box), _server(box) as server:
        box.run("while True:", *outputs, "end")
        with in_background(flood, box, "modbus", 100 * b"".join(registers), seconds, clients=10):
            flood(box, "onrobot", b"".join(calls), seconds, clients=20)
        box.send("secondary", "stop program\n")
        until(lambda: server.rg_get_status(0) >= 0, "the gripper has power")
        server.rg_set_fingertip_offset(0, 4.45)
        until(lambda: server.rg_grip(0, 60.0, 20.0) == 0, "the gripper obeys")
        until(lambda: abs(server.rg_get_width(0) - 60.0) < 1.0, "the fingers are there")
        until(lambda: not server.rg_get_busy(0), "the fingers stand")
