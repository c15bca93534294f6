"""A simulated arm of a case's own: `ur-emulator serve` as a process, in lockstep, on free ports.

Only the command line is used: the client never imports the box. The process hangs on a guard (`guard.py`)
that ends it together with whoever started it.
"""

from __future__ import annotations

import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path

from pc_client.errors import ClientError, SweepError, full_message
from pc_client.studies.sweep.case import SimulatedArm
from pc_client.studies.sweep.guard import ENDED_FILE
from protocol.errors import ProtocolError
from protocol.ur_types import Ports

HOST = "127.0.0.1"

_START_TIMEOUT = 60.0
"""A box is ready after about a second [s]; a machine that is busy may take its time."""

_NOTICE = 0.5
"""The end of a box is noted within this [s] after it broke off."""

_ATTEMPTS = 5
"""Another program may take a port between our look and the box's start."""

# All ports of a box between 10000 and 29600: above those of common services, below those that kernels give
# to clients, where they would be taken and freed while we look.
_OFFSETS = range(-19_980, -400, 20)


@dataclass(frozen=True, slots=True)
class SimulatedBox:
    """A box that is ready: its address and ports, and a scratch folder that goes away with it."""

    host: str
    ports: Ports
    folder: Path


@contextmanager
def simulated_box(arm: SimulatedArm) -> Iterator[SimulatedBox]:
    """Start a box and end it on leaving; SweepError if it does not start, or dies while it is used."""
    for _ in range(_ATTEMPTS - 1):
        offset = _free_offset()
        try:
            with _started(arm, offset) as box:
                yield box
                return
        except _PortTakenError:
            continue
    with _started(arm, _free_offset()) as box:
        yield box


class _PortTakenError(SweepError):
    """Another program has taken a port."""


@contextmanager
def _started(arm: SimulatedArm, offset: int) -> Iterator[SimulatedBox]:
    folder = Path(tempfile.mkdtemp(prefix="ur-sweep-"))
    ready, log = folder / "ready.json", folder / "box.log"
    try:
        with log.open("wb") as errors:
            guard = subprocess.Popen(
                [
                    sys.executable,
                    "-m",
                    "pc_client.studies.sweep.guard",
                    str(folder),
                    *_command(arm, offset, ready),
                ],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,  # Ctrl-C on the terminal is not for the box
            )
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise SweepError(f"a simulated box cannot be started: {error.strerror or error}") from error
    with guard:  # leaving it closes the guard's standard input and waits for it
        _wait_until_ready(ready, folder, guard)
        try:
            yield SimulatedBox(HOST, Ports.standard(offset), folder)
        except (ClientError, ProtocolError) as error:
            if not _has_ended(folder):
                raise
            raise SweepError(f"the simulated box died{_last_words(folder)}: {full_message(error)}") from error


def _command(arm: SimulatedArm, offset: int, ready: Path) -> list[str]:
    options = {
        "--robot": arm.robot,
        "--fidelity": arm.fidelity,
        "--seed": str(arm.seed),
        "--pace": "lockstep",
        "--host": HOST,
        "--port-base": str(offset),
        "--ready-file": str(ready),
    }
    words = [word for option in options.items() for word in option]
    return [sys.executable, "-m", "ur_emulator", "serve", *words]


def _wait_until_ready(ready: Path, folder: Path, guard: subprocess.Popen[bytes]) -> None:
    """Wait for the ready file; SweepError if the box ended, or takes too long."""
    deadline = time.monotonic() + _START_TIMEOUT
    while not ready.exists():
        if (folder / ENDED_FILE).exists() or guard.poll() is not None:
            words = _last_words(folder)
            kind = _PortTakenError if "in use" in words else SweepError
            raise kind(f"the simulated box does not start{words}")
        if time.monotonic() > deadline:
            raise SweepError(f"the simulated box is not ready after {_START_TIMEOUT:.0f} s")
        time.sleep(0.01)


def _has_ended(folder: Path) -> bool:
    """Whether the box is the culprit; its connections close a moment before its end is noted."""
    deadline = time.monotonic() + _NOTICE
    while not (folder / ENDED_FILE).exists():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _last_words(folder: Path) -> str:
    """The exit code of a box that ended, and the last line that it wrote."""
    try:
        code = (folder / ENDED_FILE).read_text()
        lines = (folder / "box.log").read_text(errors="replace").split("\n")
    except OSError:
        return ""
    line = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f" (exit code {code}{': ' if line else ''}{line})"


def _free_offset() -> int:
    """A port offset at which nothing listens; SweepError if there is none."""
    offsets = list(_OFFSETS)
    random.Random(os.urandom(8)).shuffle(offsets)  # workers beside this one look at the same moment
    for offset in offsets:
        ports = Ports.standard(offset)
        if all(_is_free(getattr(ports, field.name)) for field in fields(ports)):
            return offset
    raise SweepError(f"no ports for a simulated box are free at {HOST}: end what holds them")


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return False
        return True
