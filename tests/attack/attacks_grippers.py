"""Attacks on the ports of a gripper: its variables at 63352, and the serial line at 54321."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from attack_record import Section
from attackers import arm_at_rest, asked_while, crowd, flood, in_background, until
from box_under_attack import WITH_GRIPPER, BoxUnderAttack

from protocol.modbus_rtu import encode_rtu

GRIPPERS = Section("Ports of a gripper")

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


@GRIPPERS.attack(
    "300 connections to port 63352, then 300 to port 54321",
    "64 of an address are the most",
    kinds=WITH_GRIPPER,
)
def crowds_at_a_gripper(box: BoxUnderAttack, seconds: float) -> str:
    with _arm_at_rest(box):
        with crowd(box, "gripper", 300, b"GET SID") as clients:
            served = 0
            for client in clients:
                with suppress(OSError):
                    served += client.recv(10) == b"[9]"
            time.sleep(seconds / 2)
        with crowd(box, "tool_line", 300, _STATUS) as clients:
            time.sleep(seconds / 2)
    return f"{served} of 300 were served"


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
