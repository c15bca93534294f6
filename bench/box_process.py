"""A box in a process of its own, and what the operating system says of that process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from protocol.ur_types import Ports

START_LIMIT = 30.0  # s
# On Linux and Windows all of 127.0.0.0/8 is this machine: runs at the same time have an address each.
_NUMBER = os.getpid()
HOST = "127.0.0.1" if sys.platform == "darwin" else f"127.{128 + _NUMBER // 256 % 64}.{_NUMBER % 256}.1"
# Away from the standard ports, where a box may run, and from those that the kernel gives to clients.
PORT_BASE = 31_100


@dataclass(frozen=True, slots=True)
class BoxProcess:
    """A running box, or several.

    Attributes:
        process: for its memory and processor time.
        host: address of the box, of the first of several.
        hosts: addresses of all.
        ports: where it listens, the same for all.
        startup_s: from the start of the process until all ports accepted.
    """

    process: psutil.Process
    host: str
    hosts: tuple[str, ...]
    ports: Ports
    startup_s: float


@contextmanager
def box_process(*arguments: str) -> Iterator[BoxProcess]:
    """Run `ur-emulator serve` with these arguments as long as the block lasts."""
    with tempfile.TemporaryDirectory() as folder:
        ready = Path(folder) / "ready.json"
        where = ("--host", HOST, "--port-base", str(PORT_BASE))
        command = [sys.executable, "-m", "ur_emulator", "serve", *where]
        began = time.monotonic()
        child = subprocess.Popen(
            [*command, "--ready-file", str(ready), *arguments],
            stdout=subprocess.DEVNULL,
            # Compiled modules are kept, as pip keeps them for those who install the box.
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": ""},
        )
        try:
            while not ready.exists():
                if child.poll() is not None or time.monotonic() - began > START_LIMIT:
                    sys.exit("bench: the box did not start")
                time.sleep(0.001)
            startup = time.monotonic() - began
            facts = json.loads(ready.read_text())
            hosts = tuple(box["host"] for box in facts["boxes"])
            yield BoxProcess(psutil.Process(child.pid), hosts[0], hosts, Ports(**facts["ports"]), startup)
        finally:
            child.terminate()
            child.wait(10)
