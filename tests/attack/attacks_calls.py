"""Attacks on port 41414: calls of XML-RPC to a gripper of OnRobot."""

from __future__ import annotations

import http.client
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from itertools import count
from typing import Any
from xmlrpc.client import Fault, ServerProxy, loads

from attack_record import Section
from attackers import arm_at_rest, asked_while, crowd, flood, in_background, until
from box_under_attack import ADDRESSES, PATIENCE, WITH_GRIPPER, BoxUnderAttack

CALLS = Section("Calls to a gripper")
Methods = Any  # those of a server, each with a result of its own type

_WIDTH, _OFFSET = 60.0, 4.45  # mm
_LIMIT = 8 * 1024  # bytes of a call
_REFUSED = (-501, -503, -506)
_SAMPLES = {
    "int": "<int>0</int>",
    "double": "<double>1.5</double>",
    "boolean": "<boolean>1</boolean>",
    "string": "<string>rg_stop</string>",
}
_names = count(1)


def _call(name: str, *values: str) -> bytes:
    """Return a call; values are XML."""
    params = "".join(f"<param><value>{value}</value></param>" for value in values)
    return f"<methodCall><methodName>{name}</methodName><params>{params}</params></methodCall>".encode()


def _head(box: BoxUnderAttack, *lines: str) -> bytes:
    return "\r\n".join(("POST / HTTP/1.1", f"Host: {box.host}", *lines, "", "")).encode()


def _post(box: BoxUnderAttack, body: bytes) -> bytes:
    return _head(box, f"Content-Length: {len(body)}") + body


def _server(box: BoxUnderAttack) -> Methods:
    return ServerProxy(f"http://{box.host}:{box.ports.onrobot}/")


@contextmanager
def _gripper_obeys(box: BoxUnderAttack) -> Iterator[Methods]:
    """The arm stands where it stood, and the fingers go where a client tells them, when the block ends."""
    with arm_at_rest(box), _server(box) as server:
        _go(server, _WIDTH)
        yield server
        until(lambda: server.rg_get_status(0) >= 0, "the gripper has power")
        server.rg_set_fingertip_offset(0, _OFFSET)
        _go(server, _WIDTH + 10.0)
        _go(server, _WIDTH)


def _go(server: Methods, width: float) -> None:
    assert server.rg_grip(0, width, 20.0) == 0
    # They are at the width before they rest there.
    until(lambda: not server.rg_get_busy(0) and abs(server.rg_get_speed(0)) < 0.1, "the fingers stand")
    now = server.rg_get_width(0)
    assert abs(now - width) < 1.0, f"the width is {now:.1f} mm instead of {width:g} mm"


def _answers_while(server: Methods, thread: threading.Thread) -> str:
    """Ask as long as others attack; return a remark."""

    def ask() -> None:
        assert server.cb_is_device_connected(0, 0x20) is True

    return asked_while(thread, ask)


@contextmanager
def _asking(box: BoxUnderAttack) -> Iterator[http.client.HTTPConnection]:
    asking = http.client.HTTPConnection(
        box.host, box.ports.onrobot, timeout=PATIENCE, source_address=(ADDRESSES[0], 0)
    )
    with closing(asking):
        yield asking


def _fault(asking: http.client.HTTPConnection, body: bytes) -> int | None:
    """Send the body of a call; return the code of the fault, None if it was answered."""
    asking.request("POST", "/", body)
    answer = asking.getresponse()
    text = answer.read()
    assert answer.status == 200, f"{body[:80]!r}: {answer.status} {text[:80]!r}"
    try:
        loads(text)
    except Fault as fault:
        said = fault.faultString
        assert len(said) < 300, f"{len(said)} characters: {said[:80]}"
        return fault.faultCode
    return None


@CALLS.attack(
    "Port 41414: XML with entities that double, in content and attributes, of files; deep, of 900 values, of 900 "
    "attributes; each time in another encoding that does not exist",
    "a fault",
    kinds=WITH_GRIPPER,
)
def xml_bombs(box: BoxUnderAttack, seconds: float) -> str:
    doubling = '<!ENTITY a "xxxxxxxxxx">' + "".join(
        f'<!ENTITY {name} "{10 * f"&{before};"}">'
        for before, name in zip("abcdefgh", "bcdefghi", strict=True)
    )
    long = f'<!ENTITY a "{3000 * "x"}">'
    bombs = [
        f"<!DOCTYPE a [{doubling}]><methodCall><methodName>&i;</methodName></methodCall>",
        f"<!DOCTYPE a [{long}]><methodCall><methodName>{1500 * '&a;'}</methodName></methodCall>",
        f'<!DOCTYPE a [{long}]><methodCall a="{1500 * "&a;"}"/>',
        f'<!DOCTYPE a [{long}<!ATTLIST methodCall b CDATA "{1500 * "&a;"}">]><methodCall/>',
        '<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]><methodCall><methodName>&a;</methodName></methodCall>',
        f'<!DOCTYPE a SYSTEM "http://{box.host}:{box.ports.onrobot}/"><methodCall/>',
        f"<methodCall><methodName>a</methodName><params><param>{300 * '<value><array><data>'}",
        "<methodCall " + " ".join(f"a{k}=''" for k in range(900)) + "/>",
        _call("rg_stop", f"<array><data>{900 * '<value/>'}</data></array>").decode(),
    ]
    bodies = [text.encode() for text in bombs] + [bombs[0].encode("utf-16")]
    with _gripper_obeys(box) as server, _asking(box) as asking:
        for body in bodies:
            assert _fault(asking, body) in _REFUSED, f"{body[:200]!r} was answered"

        def attack() -> None:
            flood(box, "onrobot", b"".join(_post(box, body) for body in bodies), seconds / 2, clients=16)
            stock = max(50, round(500 * seconds))
            strange = b"".join(_post(box, _strange(next(_names))) for _ in range(stock))
            flood(box, "onrobot", strange, seconds / 2, clients=1)

        with in_background(attack) as attacking:
            return _answers_while(server, attacking)


def _strange(number: int) -> bytes:
    return f'<?xml version="1.0" encoding="x{number}{7000 * "x"}"?><methodCall/>'.encode()


@CALLS.attack(
    "60 clients of port 41414 and 60 others after them send half a call, then a byte every 10 ms",
    "the one that was silent longest is closed for a new one",
    kinds=WITH_GRIPPER,
)
def calls_that_never_end(box: BoxUnderAttack, seconds: float) -> str:
    half = _head(box, f"Content-Length: {_LIMIT}") + _call("rg_grip", _SAMPLES["int"])[:-30]

    def attack() -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with crowd(box, "onrobot", 60, half) as clients:
                for _ in range(20):
                    for client in clients:
                        with suppress(OSError):
                            client.send(b"<")
                    time.sleep(0.01)

    with _gripper_obeys(box), in_background(attack) as attacking:

        def ask() -> None:
            with _server(box) as server:
                assert server.rg_get_status(0) == 0

        return asked_while(attacking, ask)


@CALLS.attack(
    "20 clients of port 41414 grip, stop, set the fingertips and turn the supply off, 10 masters of port 502 and a "
    "program by tool outputs move the same fingers at once",
    kinds=WITH_GRIPPER,
)
def three_ways_to_the_same_fingers(box: BoxUnderAttack, seconds: float) -> None:
    place, numbers = _SAMPLES["int"], (0.0, 100.0, 1e308, -1e308, 55.5)
    grips = [
        _call("rg_grip", place, f"<double>{a}</double>", f"<double>{b}</double>")
        for a in numbers
        for b in numbers
    ]
    tips = [_call("rg_set_fingertip_offset", place, f"<double>{a}</double>") for a in numbers]
    calls = [*grips, *tips, _call("rg_stop", place), *grips, _call("cb_reset_tool_power")]
    write = struct.Struct(">HHHBBHHB3H")
    registers = [
        write.pack(7, 0, 13, 65, 16, 0, 3, 6, *values) for values in ((400, 0, 16), (0xFFFF, 0xFFFF, 1))
    ]
    registers += [struct.pack(">HHHBBHH", 7, 0, 6, 63, 6, 0, 2)]
    with _gripper_obeys(box):
        box.run(
            "while True:",
            *(f"  set_tool_digital_out(0, {word})\n    sync()" for word in ("True", "False")),
            "end",
        )
        with in_background(flood, box, "modbus", 100 * b"".join(registers), seconds, clients=10):
            flood(box, "onrobot", b"".join(_post(box, call) for call in calls), seconds, clients=20)
        box.send("secondary", "stop program\n")
        time.sleep(0.2)
