"""Attacks by many clients, or by clients that ask for much: the others must not notice them."""

from __future__ import annotations

import json
import socket
import struct
import time
from contextlib import suppress

from attack_record import Section
from attackers import crowd, flood, get, post, reset
from box_under_attack import ONE, WITH_DASHBOARD, BoxUnderAttack

CLIENTS = Section("Fairness: many clients, many requests")

_QUESTIONS = (
    b"robotmode\nprogramState\nget loaded program\nversion\nget serial number\nsafetystatus\nisProgramSaved\n"
)
_RTDE_START = (
    struct.pack(">HBHHBd", 5, ord("V"), 2, 11 + 27, ord("O"), 125.0) + b"timestamp,actual_q,target_q\0\3S"
)


def _read(function: int, first: int, count: int) -> bytes:
    return struct.pack(">HHHBBHH", 7, 0, 6, 1, function, first, count)


@CLIENTS.attack("Ten dashboards ask seven questions without pause", kinds=WITH_DASHBOARD)
def ten_dashboards(box: BoxUnderAttack, seconds: float) -> None:
    flood(box, "dashboard", 100 * _QUESTIONS, seconds, clients=10)


@CLIENTS.attack("Ten dashboards load programs, some of which do not exist", kinds=WITH_DASHBOARD)
def ten_dashboards_that_load(box: BoxUnderAttack, seconds: float) -> None:
    (box.programs / "spin.script").write_text("while True:\n  sync()\nend\n")
    flood(box, "dashboard", 20 * b"load spin.script\nload nothing.urp\nplay\nstop\n", seconds, clients=10)


@CLIENTS.attack("Twenty Modbus masters read and write all registers without pause")
def twenty_modbus_masters(box: BoxUnderAttack, seconds: float) -> None:
    block = _read(3, 128, 125) + _read(1, 0, 1000) + struct.pack(">HHHBBHH", 7, 0, 6, 1, 6, 128, 77)
    flood(box, "modbus", 200 * block, seconds, clients=20)


@CLIENTS.attack("16 clients of the control API send requests ahead without pause, and read the answers")
def pipelined_http(box: BoxUnderAttack, seconds: float) -> None:
    flood(box, "control", 200 * get(box, "state"), seconds, clients=16)


@CLIENTS.attack("16 clients of the control API post bodies of 1 MB: numbers, names, blanks", kinds=ONE)
def long_bodies(box: BoxUnderAttack, seconds: float) -> None:
    bodies = (
        json.dumps({"force": 150_000 * [1.5]}).encode(),
        json.dumps({f"name{n}": n for n in range(50_000)}).encode(),
        b"{" + 1_000_000 * b" " + b"}",
        json.dumps({"script": 1_000_000 * "x"}).encode(),
    )
    for body in bodies:
        flood(box, "control", post(box, "push", body[: 1 << 20]), seconds / len(bodies), clients=16)


@CLIENTS.attack("Clients connect to all ports, as many in a second as come about, and are reset", "they wait")
def connect_storm(box: BoxUnderAttack, seconds: float) -> str:
    n, end = 0, time.monotonic() + seconds
    while time.monotonic() < end and n < 60_000:
        for port in box.open_ports:
            with suppress(OSError):
                reset(box.connect(port, 1.0))
            n += 1
    return f"{n / seconds:,.0f} connections a second"


@CLIENTS.attack("1,500 readers of port 30003", "refused, or each of them gets its frames", is_short=False)
def crowd_of_readers(box: BoxUnderAttack, seconds: float) -> str:
    n = max(150, min(1500, round(190 * seconds)))
    with crowd(box, "realtime", n) as clients:
        time.sleep(seconds)
        fed = sum(_has_frames(client) for client in clients)
    return f"{fed} of {n} were served"


@CLIENTS.attack("200 RTDE clients with streams of their own at 125 Hz, half of which do not read")
def crowd_of_rtde_clients(box: BoxUnderAttack, seconds: float) -> str:
    with crowd(box, "rtde", 200, _RTDE_START) as clients:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            fed = sum(_has_frames(client) for client in clients[::2])
            time.sleep(0.05)
    return f"{fed} of 100 were served"


@CLIENTS.attack("Clients of all ports that read nothing", "packages to them are dropped, or they are closed")
def unread_streams(box: BoxUnderAttack, seconds: float) -> None:
    said = {
        "primary": b"",
        "secondary": b"",
        "realtime": b"",
        "rtde": _RTDE_START,
        "dashboard": 200 * _QUESTIONS,
        "modbus": 500 * _read(3, 128, 125),
        "control": 50 * get(box, "state"),
    }
    for port in said.keys() & set(box.open_ports):
        with crowd(box, port, 30, said[port]):
            time.sleep(seconds / len(said))


def _has_frames(client: socket.socket) -> bool:
    client.setblocking(False)
    with suppress(OSError):
        return bool(client.recv(1 << 16))
    return False
