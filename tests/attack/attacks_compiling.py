"""Attacks on what waits: scripts for the compiler, program files, reports, the memory of all that."""

from __future__ import annotations

import time

from attack_record import Section
from attackers import crowd, flood, get, plays, until
from box_under_attack import ONE, WITH_DASHBOARD, BoxUnderAttack

from protocol.robot_api import BASE

COMPILING = Section("Budgets of what waits: scripts, files, reports")

_SPIN = ("while True:", "  sync()", "end")


def _program(size: int, line: str = "  x = [1, 2, 3, 4, 5, 6]\n") -> bytes:
    """A program of so many bytes."""
    return f"def long():\n{line * (size // len(line))}end\n".encode()


def _spins(box: BoxUnderAttack) -> None:
    box.run(*_SPIN)
    until(lambda: plays(box), "the program runs")


@COMPILING.attack("8 clients of 30002 send lines `a()`, 16 kB at a time", "the newest lines are refused")
def flood_of_statements(box: BoxUnderAttack, seconds: float) -> None:
    flood(box, "secondary", 4096 * b"a()\n", seconds)


@COMPILING.attack("53 MB of scripts over 60 connections", "the newest programs are refused", is_short=False)
def flood_of_programs(box: BoxUnderAttack, seconds: float) -> None:
    flood(box, "secondary", _program(30_000), seconds, clients=60, most=53_000_000)


@COMPILING.attack(
    "A program of nearly 4 MB; another client sends `stop program` while that is compiled",
    "words do not wait for the compiler",
    is_short=False,
)
def long_program_and_stop(box: BoxUnderAttack, seconds: float) -> str:
    _spins(box)
    box.send("secondary", _program((4 << 20) - 100))
    time.sleep(0.2)
    box.send("realtime", "stop program\n")
    return f"stopped after {until(lambda: not plays(box), 'the program stops'):.2f} s"


@COMPILING.attack("Clients of 30001 to 30003 send nothing but control words, as fast as they go")
def flood_of_words(box: BoxUnderAttack, seconds: float) -> None:
    for port in ("primary", "secondary", "realtime"):
        flood(box, port, 500 * b"set speed 0.5\nset real\nset speed 1.0\n", seconds / 3)


@COMPILING.attack("Programs whose blocks never close, lines of 8 MB without an end", "they are dropped")
def endless_text(box: BoxUnderAttack, seconds: float) -> None:
    flood(box, "secondary", b"def f():\n" + 10_000 * b"  if True:\n", seconds / 2, clients=20)
    flood(box, "primary", 8_000_000 * b"x", seconds / 2, clients=20)


# --- files


# --- memory of answers


@COMPILING.attack(
    "64 clients of the control API ask for a full log and do not read it",
    "they are closed",
    kinds=WITH_DASHBOARD,
)
def unread_answers_over_http(box: BoxUnderAttack, seconds: float) -> None:
    flood(box, "dashboard", 100 * (b"addToLog " + b"\xe9" * 900 + b"\n"), min(seconds, 3.0), most=6 << 20)
    with crowd(box, "control", 64, 20 * get(box, "log")):
        time.sleep(seconds)


@COMPILING.attack("64 clients of the control API send nearly 1 MiB of a body each, and no more", kinds=ONE)
def unfinished_bodies(box: BoxUnderAttack, seconds: float) -> None:
    head = f"POST /v1/push HTTP/1.1\r\nHost: {box.host}\r\nContent-Type: application/json\r\n"
    with crowd(box, "control", 64, f"{head}Content-Length: 1048576\r\n\r\n".encode() + 1_000_000 * b" "):
        time.sleep(seconds)


@COMPILING.attack(
    "20 clients of each port over HTTP send a body that never ends, in chunks or longer than it was said to be",
    "400, 411 or 413, and they are closed",
)
def uploads_without_end(box: BoxUnderAttack, seconds: float) -> None:
    paths = {"control": "POST /v1/run_program", "robot_api": f"POST {BASE}/programs/v1"}
    kinds = (
        "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n",
        "Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 1000000000000\r\n\r\n",
        "Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 1048576\r\n\r\n",
    )
    ports = paths.keys() & set(box.open_ports)
    for port in ports:
        for kind in kinds:
            head = f"{paths[port]} HTTP/1.1\r\nHost: {box.host}\r\n{kind}".encode()
            body = b"10000\r\n" + 0x10000 * b"x" + b"\r\n"
            share = seconds / len(kinds) / len(ports)
            flood(box, port, head + body, share, clients=20, again=len(head))
