"""Boxes as other people's clients meet them: a process of its own, an address of its own, the standard ports.

The clients hard-code the ports and some of them hold the interpreter's lock while they wait for the box, so the
box runs as `ur-emulator serve` on a loopback address that nobody else uses. Time-outs are limits for hangs.
"""

import json
import os
import random
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from protocol.ur_types import Ports

TIMEOUT = 20.0  # s
PROGRAMS = Path(__file__).parents[1] / "programs"
E_SERIES = ("--robot", "ur5e", "--software", "5.25.1")
# Parameters of `box`: of a CB3, and of an e-Series box.
BOTH_GENERATIONS = pytest.mark.parametrize(
    "box",
    [pytest.param((), id="cb3"), pytest.param(E_SERIES, id="e-series", marks=pytest.mark.nightly)],
    indirect=True,
)


def is_free(host, port):
    """Return whether a box could listen there; Modbus needs privileges and may be missing."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except PermissionError:
            return True
        except OSError:
            return False
    return True


def free_port():
    """Return a free port below those that the system gives to whoever calls, who may take it before it is used."""
    luck = random.Random(os.getpid() + time.monotonic_ns())
    return next(port for port in luck.sample(range(20_000, 30_000), 100) if is_free("0.0.0.0", port))


def free_address():
    """Return a loopback address with all standard ports free."""
    luck = random.Random(os.getpid() + time.monotonic_ns())
    ports = [getattr(Ports.standard(), name) for name in Ports.__dataclass_fields__]
    for _ in range(50):
        host = f"127.{luck.randrange(64, 255)}.{luck.randrange(256)}.{luck.randrange(2, 255)}"
        if all(is_free(host, port) for port in ports):
            return host
    pytest.skip("this machine has no second loopback address (127.x.y.z), which these clients need")


@contextmanager
def served_box(folder, *options):
    """Run `ur-emulator serve` on an address of its own in real time; gives its host and ports."""
    host = free_address()
    ready, log = folder / f"{host}.json", folder / f"{host}.log"
    command = [sys.executable, "-m", "ur_emulator", "serve", "--host", host, "--ready-file", str(ready), "-v"]
    with log.open("wb") as log_file:
        process = subprocess.Popen(
            [*command, *map(str, options)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log_file,
            text=True,
        )
    try:
        line = process.stdout.readline()
        assert " ready at " in line, log.read_text()
        facts = json.loads(ready.read_text())
        yield SimpleNamespace(
            host=host, ports=SimpleNamespace(**facts["ports"]), serial_number=facts["serial_number"], log=log
        )
        assert process.poll() is None, f"the box ended: {log.read_text()[-2000:]}"
    finally:
        process.terminate()
        process.communicate(timeout=TIMEOUT)
    assert "Traceback" not in log.read_text()


def wait_until(condition, what="what was waited for"):
    """Ask again and again, without hurry: a client's own threads need the processor."""
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end, f"{what} did not come"
        time.sleep(0.005)


def connect(box, port):
    """Connect to a port of a box by its name in `Ports`."""
    sock = socket.create_connection((box.host, getattr(box.ports, port)), timeout=TIMEOUT)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return sock


def receive_exactly(sock, size):
    """Return `size` bytes."""
    data = bytearray()
    while len(data) < size:
        piece = sock.recv(size - len(data))
        if not piece:
            raise EOFError("the box closed the connection")
        data += piece
    return bytes(data)


def submit(box, text, port="secondary"):
    """Send a program to a port of scripts."""
    with connect(box, port) as sock:
        sock.sendall(text.encode())
