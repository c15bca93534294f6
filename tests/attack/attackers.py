"""What attacks are made of: floods, silent crowds, peers that scripts dial, requests over HTTP."""

from __future__ import annotations

import http.client
import json
import selectors
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from box_under_attack import ADDRESSES, CONTROL_PORT, PATIENCE, BoxUnderAttack

from ur_emulator.budgets import BUDGETS

RESET = struct.pack("ii", 1, 0)
_TURN = 1 << 16
_STILL = 0.01  # rad; the arm sways by less when fingers stop


def flood(
    box: BoxUnderAttack,
    port: str,
    data: bytes,
    seconds: float,
    *,
    clients: int = 8,
    reads: bool = True,
    most: int = 64 << 20,
    again: int = 0,
) -> None:
    """Send the same bytes again and again over some connections; one that the box closes is replaced.

    Args:
        box: to be flooded.
        port: by its name.
        data: what each connection sends.
        seconds: how long.
        clients: how many connections.
        reads: they read what comes.
        most: bytes in total.
        again: where in the bytes a connection begins anew.
    """
    sent, end = 0, time.monotonic() + seconds
    events = selectors.EVENT_WRITE | (selectors.EVENT_READ if reads else 0)
    at: dict[socket.socket, int] = {}
    with selectors.DefaultSelector() as selector, ExitStack() as stack:

        def join() -> None:
            with suppress(OSError):
                sock = box.connect(port, 2.0)
                stack.callback(reset, sock)  # what was sent and not read by then is lost
                sock.setblocking(False)
                at[sock] = 0
                selector.register(sock, events, sock)

        for _ in range(clients):
            join()
        while sent < most and (now := time.monotonic()) < end:
            if len(at) < clients:
                join()
            for key, ready in selector.select(min(0.1, end - now)):
                sock: socket.socket = key.data
                try:
                    if ready & selectors.EVENT_READ and not sock.recv(_TURN):
                        raise ConnectionError
                    if ready & selectors.EVENT_WRITE:
                        n = sock.send(memoryview(data)[at[sock] : at[sock] + _TURN])
                        at[sock] += n
                        if at[sock] == len(data):
                            at[sock] = again
                        sent += n
                except BlockingIOError:
                    pass
                except OSError:
                    selector.unregister(sock)
                    sock.close()
                    del at[sock]


@contextmanager
def crowd(
    box: BoxUnderAttack, port: str, n: int, data: bytes = b"", of_address: int = 0
) -> Iterator[list[socket.socket]]:
    """Connect so many clients that each send this and read nothing; those that are refused are left out.

    Args:
        box: to be crowded.
        port: by its name.
        n: how many clients.
        data: what each of them sends.
        of_address: so many come from an address before the next one; 0: they take turns.
    """
    with ExitStack() as stack:
        clients = []
        for k in range(n):
            source = ADDRESSES[k // of_address % len(ADDRESSES)] if of_address else ""
            with suppress(OSError):
                sock = stack.enter_context(box.connect(port, 2.0, source))
                sock.settimeout(0.2)
                with suppress(TimeoutError):
                    sock.sendall(data)
                clients.append(sock)
        yield clients


def reset(sock: socket.socket) -> None:
    """Close with RST instead of FIN."""
    with suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    sock.close()


def until(condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> float:
    """Wait until a condition holds, for at most `patience` [s]; return how long that took [s]."""
    began = time.monotonic()
    while not condition():
        assert time.monotonic() < began + patience, f"not within {patience:g} s: {what}"
        time.sleep(0.02)
    return time.monotonic() - began


def plays(box: BoxUnderAttack) -> bool:
    """Return whether a program runs."""
    return bool(box.state()["program_state"] == "PLAYING")


@contextmanager
def arm_at_rest(box: BoxUnderAttack) -> Iterator[None]:
    """The arm stands where it stood when the block ends."""
    before = request(box, "GET", "state")[1]["q"]
    yield
    after = request(box, "GET", "state")[1]["q"]
    moved = max(abs(a - b) for a, b in zip(after, before, strict=True))
    assert moved < _STILL, f"the arm has moved by {moved:.3f} rad"


@contextmanager
def in_background(
    run: Callable[..., object], *arguments: object, **options: object
) -> Iterator[threading.Thread]:
    """Run an attack in a thread; it has ended when the block ends."""
    thread = threading.Thread(target=run, args=arguments, kwargs=options, daemon=True)
    thread.start()
    try:
        yield thread
    finally:
        thread.join()


def asked_while(thread: threading.Thread, ask: Callable[[], None]) -> str:
    """Ask, as a client that is not part of an attack, as long as that lasts; return a remark."""
    n, longest = 0, 0.0
    while thread.is_alive() or not n:
        began = time.monotonic()
        ask()
        n, longest = n + 1, max(longest, time.monotonic() - began)
        time.sleep(0.005)
    return f"another client was answered within {1e3 * longest:.0f} ms"


def log_since(box: BoxUnderAttack, after: int, level: str = "DEBUG") -> tuple[list[dict[str, Any]], int]:
    """Return all entries of the log but the first so many, and how many there are.

    The API gives some at a time. A page that is not full is the last: a flood may fill it faster than it is read.
    """
    entries: list[dict[str, Any]] = []
    is_full = True
    while is_full:
        answer = request(box, "GET", f"log?after={after}&level={level}")[1]
        entries += answer["entries"]
        after, is_full = answer["next"], len(answer["entries"]) == BUDGETS.log_entries
    return entries, after


@contextmanager
def peer(serve: Callable[[socket.socket], None]) -> Iterator[int]:
    """Listen for scripts; each connection gets a thread that serves it. Gives the port."""
    with socket.create_server(("127.0.0.1", 0), backlog=512) as server, ExitStack() as stack:

        def handle(client: socket.socket) -> None:
            with client, suppress(OSError):
                serve(client)

        def accept() -> None:
            with suppress(OSError):
                while True:
                    client = server.accept()[0]
                    client.settimeout(PATIENCE)
                    stack.callback(reset, client)
                    threading.Thread(target=handle, args=(client,), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        try:
            yield server.getsockname()[1]
        finally:
            server.shutdown(socket.SHUT_RDWR)


def request(
    box: BoxUnderAttack, method: str, path: str, body: object = None, **headers: str
) -> tuple[int, Any]:
    """Ask the control API; return the status and the JSON of the answer.

    Args:
        box: to be asked.
        method: GET or POST.
        path: behind `/v1/`.
        body: sent as JSON, bytes as they are.
        headers: `_` stands for `-`.
    """
    connection = http.client.HTTPConnection(
        box.host, CONTROL_PORT, timeout=PATIENCE, source_address=(ADDRESSES[0], 0)
    )
    data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        connection.request(method, f"/v1/{path}", data, {"Content-Type": "application/json", **given})
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())
    finally:
        connection.close()


def post(box: BoxUnderAttack, path: str, body: bytes) -> bytes:
    """Return the bytes of a request that posts JSON."""
    head = f"POST /v1/{path} HTTP/1.1\r\nHost: {box.host}\r\nContent-Type: application/json\r\n"
    return f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body


def get(box: BoxUnderAttack, path: str) -> bytes:
    """Return the bytes of a request that reads."""
    return f"GET /v1/{path} HTTP/1.1\r\nHost: {box.host}\r\n\r\n".encode()
