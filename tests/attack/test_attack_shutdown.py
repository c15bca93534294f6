"""SIGTERM ends a served box whatever it is doing, with exit code 0 and without a word."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager

import psutil
import pytest
from attackers import crowd, until
from box_under_attack import KINDS, BoxUnderAttack, serving

_LONG_PROGRAM = b"def long():\n" + b"  x = [1, 2, 3]\n" * 250_000 + b"end\n"  # 4 MB
_NO_NAMES = "import socket, threading\nsocket.getaddrinfo = lambda *names: threading.Event().wait()"


def worker_of(box: BoxUnderAttack) -> psutil.Process:
    """The worker process; its parent is the server of processes."""
    (server,) = psutil.Process(box.process.pid).children()
    until(server.children, "the worker process, for which the server loads the compiler first")
    (worker,) = server.children()
    return worker


@contextmanager
def compiling(box: BoxUnderAttack) -> Iterator[None]:
    with box.connect("secondary") as sock:
        worker = worker_of(box)
        before = worker.cpu_times().user
        sock.sendall(_LONG_PROGRAM)
        until(lambda: worker.cpu_times().user > before + 0.1, "the worker process works")
        yield


@contextmanager
def unread(box: BoxUnderAttack) -> Iterator[None]:
    with ExitStack() as stack:
        for port in ("primary", "realtime"):
            stack.enter_context(crowd(box, port, 200))
        yield


@contextmanager
def looking_up(box: BoxUnderAttack) -> Iterator[None]:
    box.run('socket_open("robot.invalid", 9)')
    until(
        lambda: psutil.Process(box.process.pid).num_threads() > box.at_rest[1], "a thread looks up the name"
    )
    yield


@pytest.mark.parametrize(
    "busy", [compiling, *(pytest.param(busy, marks=pytest.mark.nightly) for busy in (unread, looking_up))]
)
def test_a_busy_box_ends(busy: Callable[[BoxUnderAttack], AbstractContextManager[None]]) -> None:
    with serving(KINDS["CB3"], prelude=_NO_NAMES if busy is looking_up else "") as box:
        with busy(box):
            assert box.stop() < math.inf
        assert box.process.returncode == 0
        assert box.errors.read_text() == ""
