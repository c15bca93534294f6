"""Attacks on the window of a box, a process beside it: nothing of them reaches the box but the window's own load."""

from __future__ import annotations

import logging
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from http.client import HTTPConnection

import viser
from attack_record import Section
from attackers import in_background, until
from box_under_attack import CONTROL_PORT, ONE, PATIENCE, PORT_BASE, BoxUnderAttack
from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from ur_emulator.host.control_api.http_client import ControlClient
from ur_emulator.host.control_api.operations import make
from ur_pendant.server import MOST_PAGES

WINDOW = Section("The window of a box")

_QUIET = logging.getLogger("pages that lie")
_QUIET.disabled = True
_JUNK = (b"", b"\xc1", b"\x81\xa4type\xa1x", b"\x91" * 500, random.Random(7).randbytes(1 << 16), "text", "{}")


@contextmanager
def _window(box: BoxUnderAttack) -> Iterator[int]:
    """A window that shows the box, before and after; gives its port."""

    def readers() -> int:
        clients = ControlClient(box.host, CONTROL_PORT, None).perform(make("state", {}))["clients"]
        return sum(" at rtde " in client or " at primary " in client for client in clients)

    def shows() -> bool:
        return readers() == others + 2

    others = readers()
    command = [sys.executable, "-m", "ur_emulator", "pendant", box.host, "--port", "0"]
    command += ["--port-base", str(PORT_BASE), "--control-port", str(CONTROL_PORT)]
    window = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert window.stdout is not None
    try:
        port = int(window.stdout.readline().rpartition(":")[2])
        until(shows, "the window shows the box")
        yield port
        until(shows, "the window shows the box, and has no other clients")
    finally:
        window.terminate()
        _, said = window.communicate(timeout=PATIENCE)
    assert (window.returncode, said) == (0, ""), (
        f"the window has ended with {window.returncode}: {said[-300:]}"
    )


def _page(port: int) -> ClientConnection:
    protocols = [Subprotocol(f"viser-v{viser.__version__}")]
    address = f"ws://127.0.0.1:{port}"
    return connect(address, subprotocols=protocols, max_size=None, proxy=None, logger=_QUIET)


@WINDOW.attack("Ten pages of a window on an arm that moves are open, five of them read nothing", kinds=ONE)
def ten_pages(box: BoxUnderAttack, seconds: float) -> str:
    n, end = 0, time.monotonic() + seconds
    with _window(box) as port, ExitStack() as stack:
        pages = [stack.enter_context(_page(port)) for _ in range(10)]
        sway = (f"  speedj([{speed}, 0, 0, 0, 0, 0], 2, 0.3)" for speed in (0.2, -0.2))
        box.run("while True:", *sway, "end")
        while time.monotonic() < end or not n:
            for page in pages[:5]:
                with suppress(TimeoutError):
                    page.recv(timeout=0.01)
                    n += 1
        box.send("secondary", "stop program\n")
    return f"{n:,} messages were read"


@WINDOW.attack(
    "Pages of a window send what is no message, others come and go without pause, and those of other sites ask",
    f"{MOST_PAGES} pages; the connection is closed",
    kinds=ONE,
)
def pages_that_lie(box: BoxUnderAttack, seconds: float) -> str:
    def lie(port: int) -> None:
        while time.monotonic() < end:
            for junk in _JUNK:
                with suppress(WebSocketException, OSError), _page(port) as page:
                    for _ in range(100):
                        page.send(junk)

    n = 0
    with _window(box) as port:
        with ExitStack() as stack:
            for _ in range(MOST_PAGES):
                stack.enter_context(_page(port))
            with suppress(InvalidStatus), _page(port):
                raise AssertionError(f"more than {MOST_PAGES} pages are open")
        end = time.monotonic() + seconds
        with in_background(lie, port), in_background(lie, port):
            while time.monotonic() < end or not n:
                asking = HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
                asking.request("GET", "/", headers={"Origin": "http://elsewhere.example"})
                assert asking.getresponse().status == 403
                asking.close()
                n += 1
    return f"{n:,} requests of another site were refused"
