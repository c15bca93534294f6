"""Attacks with bytes: too slow, too few, too many, of another protocol, by clients that stand still."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, suppress

import psutil
from attack_record import Section
from attackers import flood, get
from box_under_attack import ONE, BoxUnderAttack

BYTES = Section("Bytes that make no sense, or never come")

_READER = "import socket, sys, time\ns = [socket.create_connection((sys.argv[1], int(p))) for p in sys.argv[2:]]\nprint(flush=True)\nwhile True: [c.recv(65536) for c in s]"


@BYTES.attack("100 clients of each port send a byte every 0.1 s and never finish")
def slow_senders(box: BoxUnderAttack, seconds: float) -> None:
    said = get(box, "state")
    with ExitStack() as stack:
        clients = []
        for port in box.open_ports:
            for _ in range(max(10, min(100, round(12 * seconds)))):
                with suppress(OSError):
                    clients.append(stack.enter_context(box.connect(port)))
        end, k = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            for client in clients:
                with suppress(OSError):
                    client.send(said[k % 20 : k % 20 + 1])
            k += 1
            time.sleep(0.1)


@BYTES.attack("Requests byte by byte: a script, a question, a recipe, a register, a state")
def requests_byte_by_byte(box: BoxUnderAttack, seconds: float) -> None:
    said = {
        "dashboard": b"robotmode\n",
        "secondary": b"sec f():\n  textmsg(1)\nend\n",
        "rtde": b"\0\5V\0\2",
        "modbus": bytes.fromhex("000100000006010300800002"),
        "interpreter": b"statelastexecuted\n",
        "control": get(box, "state"),
    }
    for port in said.keys() & set(box.open_ports):
        data = said[port]
        with box.connect(port) as client:
            for at in range(len(data)):
                client.sendall(data[at : at + 1])
                time.sleep(0.0005)
            assert client.recv(1), port


@BYTES.attack("Random bytes, and the bytes of all other protocols, to every port")
def noise(box: BoxUnderAttack, seconds: float) -> None:
    rng = random.Random(7)
    for port in box.open_ports:
        data = b"".join((rng.randbytes(3000), b"\n", get(box, "state"), b"robotmode\ndef f():\n\0\5V\0\2\n"))
        flood(box, port, data, seconds / len(box.open_ports))


@BYTES.attack("Lengths that lie: RTDE packages of 0 and 65,535 bytes, Modbus of 65,535, headers without end")
def lying_lengths(box: BoxUnderAttack, seconds: float) -> None:
    said = {
        "rtde": (b"\0\0\0", b"\xff\xffV" + 70_000 * b"\0", b"\0\3\xff"),
        "modbus": (b"\0\0\0\0\xff\xff" + 70_000 * b"\1", b"\0\0\0\0\0\0\0", b"\0\0\7\7\0\6\1\3\0\0\0\1"),
        "control": (
            b"GET / HTTP/1.1\r\n" + 2000 * b"X: yyyyyyyyyyyyyyyy\r\n",
            b"POST /v1/push HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999\r\n\r\n",
            b"POST /v1/push HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffffff\r\n",
            100_000 * b"G",
        ),
        "dashboard": (1_000_000 * b"x",),
    }
    for port in said.keys() & set(box.open_ports):
        for data in said[port]:
            flood(box, port, data, seconds / 10, clients=4)


@BYTES.attack(
    "A client of all streams is stopped with SIGSTOP and goes on later", "it loses packages", kinds=ONE
)
def stopped_client(box: BoxUnderAttack, seconds: float) -> None:
    ports = (box.ports.primary, box.ports.secondary, box.ports.realtime)
    client = subprocess.Popen(
        [sys.executable, "-c", _READER, box.host, *map(str, ports)], stdout=subprocess.PIPE
    )
    assert client.stdout is not None
    try:
        assert client.stdout.readline()
        os.kill(client.pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(client.pid, signal.SIGCONT)
        time.sleep(min(1.0, seconds))
        assert client.poll() is None, "the client was cut off"
    finally:
        client.kill()
        client.wait()
        client.stdout.close()


@BYTES.attack(
    "The worker process is killed while it compiles, and once the server that it comes from too",
    "the program is refused; the next one runs",
)
def killed_worker(box: BoxUnderAttack, seconds: float) -> None:
    for k in range(max(2, min(4, round(seconds)))):
        box.run(*2000 * ("x = 1",))
        for worker in (*box.workers(), *psutil.Process(box.process.pid).children()[: k % 2]):
            with suppress(psutil.Error):
                worker.kill()
        time.sleep(0.2)


@BYTES.attack(
    "The worker process is stopped with SIGSTOP while it compiles; programs go on coming",
    "another one compiles them",
)
def stopped_worker(box: BoxUnderAttack, seconds: float) -> str:
    stopped = {}
    try:
        end = time.monotonic() + max(1.5, seconds)
        while time.monotonic() < end:
            box.run(*2000 * ("x = 1",))
            for worker in box.workers()[:1]:
                with suppress(psutil.Error):
                    worker.suspend()
                    stopped[worker.pid] = worker
            time.sleep(0.3)
    finally:
        for worker in stopped.values():
            with suppress(psutil.Error):
                worker.resume()
    return f"{len(stopped)} were stopped"
