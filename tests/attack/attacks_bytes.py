"""Attacks with bytes: too slow, too few, too many, of another protocol, by clients that stand still."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, suppress

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


@BYTES.attack("Random bytes, and the bytes of all other protocols, to every port")
def noise(box: BoxUnderAttack, seconds: float) -> None:
    rng = random.Random(7)
    for port in box.open_ports:
        data = b"".join((rng.randbytes(3000), b"\n", get(box, "state"), b"robotmode\ndef f():\n\0\5V\0\2\n"))
        flood(box, port, data, seconds / len(box.open_ports))


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
