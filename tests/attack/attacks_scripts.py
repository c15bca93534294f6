"""Attacks by running programs: what a script does in a cycle is paid by the script, not by the box."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from attack_record import Section
from attackers import log_since, peer, plays, request, until
from box_under_attack import BoxUnderAttack

SCRIPTS = Section("Budgets of running programs")

_POSE = "p[-0.2, -0.3, 0.3, 2.2, -2.2, 0.0]"


def _spend(box: BoxUnderAttack, seconds: float, *lines: str, setup: tuple[str, ...] = ()) -> str:
    """Run `lines` in an endless loop for so many seconds; the program ends with the stop."""
    box.send("secondary", "stop program\n")
    after = log_since(box, 0)[1]
    box.run(*setup, "while True:", *(f"  {line}" for line in lines), "end")
    until(lambda: _has_begun(box, after), "the program starts")
    time.sleep(seconds)
    remark = _state(box, after)
    box.send("secondary", "stop program\n")
    return remark


def _has_begun(box: BoxUnderAttack, after: int) -> bool:
    first = request(box, "GET", f"log?after={after}")[1]["entries"]
    return any(entry["source"] in ("Program", "Controller") for entry in first)


def _state(box: BoxUnderAttack, after: int) -> str:
    if plays(box):
        return "the program runs on"
    faults, _ = log_since(box, after, "FAULT")
    return f"the program was ended: {faults[-1]['text'][:90]}" if faults else "no program runs"


def _times(n: int, *lines: str) -> tuple[str, ...]:
    return ("i = 0", f"while i < {n}:", *(f"  {line}" for line in lines), "  i = i + 1", "end", "sync()")


@SCRIPTS.attack("`get_inverse_kin` 300 times a cycle", "the script gets slower")
def inverse_kinematics(box: BoxUnderAttack, seconds: float) -> str:
    return _spend(box, seconds, *_times(300, f"q = get_inverse_kin({_POSE})"))


@SCRIPTS.attack(
    "`textmsg` 300 and 3,000 times a cycle, with a reader of 30001", "the script gets slower, or is ended"
)
def text_messages(box: BoxUnderAttack, seconds: float) -> str:
    text = f'textmsg("{100 * "x"}", i)'
    with _reader(box, "primary"):
        remarks = [_spend(box, seconds / 2, *_times(n, *10 * (text,))) for n in (30, 300)]
    return f"{sum(remark.endswith('on') for remark in remarks)} of 2 run on"


@SCRIPTS.attack("Loops of 3,000 to 100,000 steps between two `sync()`", "the script gets slower, or is ended")
def long_loops(box: BoxUnderAttack, seconds: float) -> str:
    remarks = [_spend(box, seconds / 4, *_times(n, "x = i")) for n in (3_000, 10_000, 30_000, 100_000)]
    return f"{sum(remark.endswith('on') for remark in remarks)} of 4 run on"


@SCRIPTS.attack("50 threads, each with loops just short of its time", "the script gets slower")
def many_threads(box: BoxUnderAttack, seconds: float) -> str:
    lines = (
        "thread work():",
        "  while True:",
        *(f"    {line}" for line in _times(2000, "x = i")),
        "  end",
        "end",
    )
    return _spend(box, seconds, "sync()", setup=(*lines, *50 * ("run work()",)))


@SCRIPTS.attack("Strings are doubled, lists copied, numbers grow without end", "the program is ended")
def growing_values(box: BoxUnderAttack, seconds: float) -> None:
    _spend(box, seconds / 3, "s = str_cat(s, s)", setup=('s = "0123456789"',))
    _spend(box, seconds / 3, *_times(1000, "s = str_cat(s, to_str(i))"), setup=('s = ""',))
    _spend(box, seconds / 3, "s = [s, s]", "sync()", setup=("s = [1, 2]",))


@SCRIPTS.attack(
    "190 threads, each in a chain of 900 or 190 calls, or in 190 calls of itself; 50 in a chain of 190",
    "the program is refused or ended",
)
def threads_in_deep_calls(box: BoxUnderAttack, seconds: float) -> str:
    end = ("def f0(a):", "  while True:", "    sync()", "  end", "end")
    itself = ("def f0(a):", "  if a > 0:", "    f0(a - 1)", "  end", "  sync()", "end")
    remarks = []
    for threads, calls, last in ((190, 900, end), (190, 190, end), (50, 190, end), (190, 0, itself)):
        chain = (line for n in range(1, calls) for line in (f"def f{n}(a):", f"  f{n - 1}(a + 1)", "end"))
        work = ("thread work():", "  while True:", f"    f{max(0, calls - 1)}(190)", "  end", "end")
        setup = (*last, *chain, *work, *threads * ("run work()",))
        remarks.append(_spend(box, seconds / 4, "sync()", setup=setup))
    return f"{sum(remark.endswith('on') for remark in remarks)} of 4 run on"


@contextmanager
def _reader(box: BoxUnderAttack, port: str) -> Iterator[None]:
    with box.connect(port) as sock:

        def read() -> None:
            with suppress(OSError):
                while sock.recv(1 << 16):
                    pass

        thread = threading.Thread(target=read, daemon=True)
        thread.start()
        try:
            yield
        finally:
            sock.shutdown(socket.SHUT_RDWR)
            thread.join()


def _pour(client: socket.socket) -> None:
    """Send a text without end, as fast as it is taken, and no more than 64 MiB."""
    for _ in range(64):
        client.sendall(bytes([120]) * (1 << 20))


@SCRIPTS.attack("A program opens 300 sockets to peers that flood them, and does not read", "held back")
def flooded_inboxes(box: BoxUnderAttack, seconds: float) -> str:
    with peer(_pour) as port:
        opening = (
            "i = 0",
            "while i < 300:",
            f'  socket_open("127.0.0.1", {port}, to_str(i))',
            "  i = i + 1",
            "end",
        )
        return _spend(box, seconds, "sync()", setup=opening)
