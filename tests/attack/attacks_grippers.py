"""Attacks on the ports of a gripper: its variables at 63352, and the serial line at 54321."""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial

from attack_record import Section
from attackers import arm_at_rest, asked_while, crowd, flood, in_background, until
from box_under_attack import WITH_GRIPPER, BoxUnderAttack

from protocol.modbus_rtu import encode_rtu

GRIPPERS = Section("Ports of a gripper")

_UNIT = 9
_STATUS = encode_rtu(_UNIT, struct.pack(">BHH", 4, 0x07D0, 3))
_CLOSE = encode_rtu(_UNIT, struct.pack(">BHHB3H", 16, 0x03E8, 3, 6, 0x0900, 0x00FF, 0xFFFF))
_ODD_LINES = (
    *(
        f"SET {name} {value}"
        for name in ("POS", "SPE", "FOR")
        for value in ("256", "-1", "1.5", "x", "", 5000 * "9")
    ),
    *(f"SET {name} 2" for name in ("ACT", "GTO", "ATR", "ARD", "MOD", "LBP", "SCN_BLOCK")),
    *(
        f"SET {name} 1"
        for name in ("STA", "OBJ", "FLT", "PRE", "COU", "NCY", "SNU", "NOTHING", "pos", "POS\0")
    ),
    "SET",
    "SET POS 1 POS",
    "SET SID 0",
    "SET SID 248",
    "SET SID 9 POS 100",
    "SET POS 100 NOTHING 1",
)
_ODD_QUESTIONS = ("GET", "GET NOTHING", "GET POS PRE", "GET SCN_BLOCK", "get POS", "POS", "\xff\xfe", "")


def _is(mode: str, box: BoxUnderAttack) -> bool:
    return box.ask("robotmode")[0] == f"Robotmode: {mode}"


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
    f"Port 63352: {len(_ODD_LINES)} SETs of what may not be set, {len(_ODD_QUESTIONS)} odd questions",
    "`nak`, `?`: nothing of them is done",
    kinds=WITH_GRIPPER,
)
def odd_requests_to_a_gripper(box: BoxUnderAttack, seconds: float) -> None:
    names = ("POS", "PRE", "SPE", "FOR", "ACT", "GTO", "STA")
    every = "".join(f"GET {name}\n" for name in names)
    with _arm_at_rest(box), box.connect("gripper") as client:
        before = _told(client, every)
        end = time.monotonic() + seconds
        while True:
            for line in _ODD_LINES:
                answer = _told(client, line + "\n")
                while len(line) > 1024 and len(answer) < 3 + 2 * (len(line) // 1024):
                    answer += client.recv(1 << 16).decode()
                assert set(answer.replace("nak", "").split()) <= {"?"}, f"{line[:40]!r}: {answer[:40]!r}"
            for line in _ODD_QUESTIONS:
                answer = _told(client, line + "\n")
                assert answer == "?\n", f"{line!r}: {answer!r}"
            if time.monotonic() > end:
                break
        after = _told(client, every)
        assert after == before, f"{after!r} instead of {before!r}"


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


@GRIPPERS.attack(
    "Port 54321: false checksums, counts and sizes that lie, units and functions that do not exist, noise, a request "
    "byte by byte",
    "dropped, or an exception of Modbus",
    kinds=WITH_GRIPPER,
)
def odd_frames_on_a_line(box: BoxUnderAttack, seconds: float) -> None:
    rng = random.Random(7)
    write, both = struct.Struct(">BHHB"), struct.Struct(">BHHHHB")
    dropped = [
        _CLOSE[:-1] + b"\0",
        _CLOSE[:5] + b"\xff" + _CLOSE[6:],
        b"\t\x63" + 300 * b"\0",
        b"\xff" + _CLOSE[1:],
    ]
    dropped += [encode_rtu(unit, _CLOSE[1:-2]) for unit in (0, 1, 8, 10, 248, 255)]
    dropped += [b"\t\x10" + rng.randbytes(2000), rng.randbytes(5000)]
    refused = [
        write.pack(16, 0x03E8, 0xFFFF, 254) + 254 * b"\xff",
        write.pack(16, 0x03E8, 123, 246) + 246 * b"\xff",
        write.pack(16, 0x03E8, 3, 4) + 4 * b"\xff",
        write.pack(16, 0x03E8, 0, 0),
        write.pack(15, 0, 8, 1) + b"\xff",
        both.pack(23, 0x07D0, 126, 0x03E8, 1, 2) + b"\xff\xff",
        both.pack(23, 0x07D0, 3, 0x03E8, 122, 244) + 244 * b"\xff",
        both.pack(23, 0xFFFF, 3, 0xFFFF, 1, 2) + b"\xff\xff",
        struct.pack(">BHH", 4, 0x07D0, 0xFFFF),
        struct.pack(">BHH", 6, 0xFFFF, 0xFFFF),
        struct.pack(">BHH", 5, 0, 0xFF00),
    ]
    with _arm_at_rest(box):
        _until_line_answers(box)
        end = time.monotonic() + seconds
        while True:
            for frame in dropped:
                with box.connect("tool_line") as client:
                    client.sendall(frame)
            _until_line_answers(box)
            with box.connect("tool_line") as client:
                for pdu in refused:
                    client.sendall(encode_rtu(_UNIT, pdu))
                    answer = client.recv(300)
                    assert answer[1] == pdu[0] | 0x80, f"{pdu[:12].hex(' ')}: {answer.hex(' ')}"
                for byte in _STATUS:
                    client.sendall(bytes((byte,)))
                    time.sleep(0.0005)
                answer = client.recv(100)
                assert answer[:3] == b"\t\4\6", f"byte by byte: {answer.hex(' ')}"
            if time.monotonic() > end:
                return


def _activate(client: socket.socket) -> None:
    _told(client, "SET ACT 0 ATR 0 GTO 0\n")
    until(lambda: _told(client, "GET STA\n") == "STA 0\n", "the gripper is reset")
    _told(client, "SET ACT 1\n")
    until(lambda: _told(client, "GET STA\n") == "STA 3\n", "the gripper is activated")


@GRIPPERS.attack(
    "Ten clients of port 63352 activate, reset, release and move at once, one by the serial line",
    kinds=WITH_GRIPPER,
    is_short=False,
)
def activations_while_it_moves(box: BoxUnderAttack, seconds: float) -> None:
    block = b"SET ACT 1\nSET POS 255 SPE 255 FOR 255 GTO 1\nSET ATR 1\nSET ARD 1\nSET POS 0\nSET ACT 0 ATR 0\nSET GTO 0\n"
    with _arm_at_rest(box):
        with in_background(flood, box, "gripper", block, seconds, clients=10):
            flood(box, "tool_line", 20 * (_CLOSE + _STATUS), seconds, clients=1)
        with box.connect("gripper") as client:
            _activate(client)
            _told(client, "SET POS 100 SPE 255 GTO 1\n")
            until(
                lambda: _told(client, "GET POS\nGET OBJ\n") == "POS 100\nOBJ 3\n",
                "the fingers are where they shall be",
            )


@GRIPPERS.attack(
    "The dashboard powers the arm off while the fingers move and clients ask",
    "`?`; it must be activated anew",
    kinds=WITH_GRIPPER,
    is_short=False,
)
def power_cuts_while_it_moves(box: BoxUnderAttack, seconds: float) -> None:
    with _arm_at_rest(box), box.connect("gripper") as client:
        for _ in range(max(1, round(seconds / 2))):
            _activate(client)
            _told(client, "SET POS 255 SPE 0 GTO 1\n")
            until(lambda: _told(client, "GET OBJ\n") == "OBJ 0\n", "the fingers move")
            box.ask("power off")
            until(lambda: _told(client, "GET POS\n") == "POS ?\n", "the gripper has no power")
            assert _told(client, "SET POS 0 GTO 1\n") == "ack"
            for command, mode in (("power on", "IDLE"), ("brake release", "RUNNING")):
                box.ask(command)
                until(partial(_is, mode, box), f"the arm is {mode}")
            assert _told(client, "GET STA\nGET ACT\nGET FLT\n") == "STA 0\nACT 0\nFLT 0\n"
