"""Attacks by running programs: what a script does in a cycle is paid by the script, not by the box."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from attack_record import Section
from attackers import crowd, log_since, peer, plays, request, reset, until
from box_under_attack import ONE, PATIENCE, BoxUnderAttack

SCRIPTS = Section("Budgets of running programs")

_POSE = "p[-0.2, -0.3, 0.3, 2.2, -2.2, 0.0]"
_RTDE_LINE = struct.pack(">HBHHBd", 5, ord("V"), 2, 11 + 19, ord("O"), 125.0) + b"script_control_line\0\3S"
# Names that end in `.invalid` are looked up for long, and no server of this machine is asked.
_SLOW_NAMES = """
import socket, time
_look_up = socket.getaddrinfo
def look_up(host, *rest, **more):
    if str(host).endswith(".invalid"):
        time.sleep(3)
        raise socket.gaierror("no such name")
    return _look_up(host, *rest, **more)
socket.getaddrinfo = look_up
"""


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


@SCRIPTS.attack(
    "Ten globals of 30,000 elements, changed every cycle, with a reader of 30001",
    "the program needs too much memory, or the values are not reported whole",
    is_short=False,
)
def long_globals(box: BoxUnderAttack, seconds: float) -> str:
    names = [f"g{n}" for n in range(10)]
    setup = (f"global g0 = [{','.join('0' * 30_000)}]", *(f"global {name} = g0" for name in names[1:]))
    with _reader(box, "primary"):
        return _spend(box, seconds, *(f"{name}[7] = {name}[7] + 1" for name in names), "sync()", setup=setup)


@SCRIPTS.attack(
    "RTDE clients ask for `script_control_line` while a function of 100,000 statements runs",
    is_short=False,
    kinds=ONE,
)
def line_of_a_long_function(box: BoxUnderAttack, seconds: float) -> str:
    with crowd(box, "rtde", 4, _RTDE_LINE):
        after = log_since(box, 0)[1]
        n = min(100_000, round(12_500 * seconds))
        box.run("while True:", *n * ("  x = 1",), "  sync()", "end")
        until(lambda: _has_begun(box, after), "the program starts", 90.0)
        time.sleep(seconds / 2)
    time.sleep(seconds / 2)  # the clients have gone
    return _state(box, after)


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
    "`popup`, `request_boolean_from_primary_client` and `write_output_integer_register` without pause"
)
def flood_of_requests(box: BoxUnderAttack, seconds: float) -> None:
    _spend(box, seconds, *_times(1000, 'popup("x", "y")', "write_output_integer_register(0, i)"))
    request(box, "POST", "close_popups", {})


# --- much of all


@SCRIPTS.attack("Globals hold 9,000 strings of 32 kB", "the program is ended")
def many_strings(box: BoxUnderAttack, seconds: float) -> str:
    lists = (f"global g{n} = [{','.join(3_000 * ('s',))}]" for n in range(3))
    put = (f'g{n}[i] = s + "x"' for n in range(3))
    doubled = ('s = "0123456789abcdef"', *11 * ("s = s + s",))
    return _hold(box, 2 * seconds, *doubled, *lists, *_times(3_000, *put, "sync()"))


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
        remarks.append(_hold(box, seconds / 4, *last, *chain, *work, *threads * ("run work()",)))
    return f"{sum(remark.endswith('on') for remark in remarks)} of 4 run on"


@SCRIPTS.attack(
    "2,000 globals with names of 900 or 250 characters, while 245 clients a second connect to 30001",
    "the program is refused, or names are not reported",
)
def long_names(box: BoxUnderAttack, seconds: float) -> str:
    remarks = []
    for length in (900, 250):
        after = log_since(box, 0)[1]
        names = (f"global v{n:04}{(length - 5) * 'x'} = {n}" for n in range(2_000))
        box.run(*names, "while True:", "  sync()", "end")
        began, n = time.monotonic(), 0
        while (passed := time.monotonic() - began) < seconds / 2:
            if n < 245 * passed:
                with suppress(OSError):
                    reset(box.connect("primary", 1.0))
                n += 1
            else:
                time.sleep(0.002)
        remarks.append(_state(box, after))
    return f"{sum(remark.endswith('on') for remark in remarks)} of 2 run on"


def _hold(box: BoxUnderAttack, seconds: float, *lines: str) -> str:
    """Run `lines`, then nothing, for so many seconds."""
    return _spend(box, seconds, "sync()", setup=lines)


# --- sockets


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


def _listen(client: socket.socket) -> None:
    client.settimeout(PATIENCE)
    while client.recv(1 << 16):
        pass


def _keep(client: socket.socket) -> None:
    time.sleep(PATIENCE)


@SCRIPTS.attack("`socket_read_string` with a suffix that never comes, over an inbox that is flooded")
def search_in_a_flooded_inbox(box: BoxUnderAttack, seconds: float) -> str:
    with peer(_pour) as port:
        read = 'socket_read_string(suffix="never", timeout=0.1)'
        return _spend(box, seconds, read, setup=(f'socket_open("127.0.0.1", {port})', "sleep(0.5)"))


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


@SCRIPTS.attack("A program opens and closes sockets in an endless loop", "the next open fails")
def flood_of_sockets(box: BoxUnderAttack, seconds: float) -> str:
    with peer(_keep) as port:
        return _spend(
            box,
            min(seconds, 4.0),
            f'socket_open("127.0.0.1", {port}, to_str(i))',
            "i = i + 1",
            setup=("i = 0",),
        )


@SCRIPTS.attack("A program sends 3,000 lines a cycle to a peer, which reads them, or does not")
def flood_of_sendings(box: BoxUnderAttack, seconds: float) -> None:
    for serve in (_listen, _keep):
        with peer(serve) as port:
            opening = (f'socket_open("127.0.0.1", {port})',)
            _spend(box, seconds / 2, *_times(3000, f'socket_send_line("{100 * "x"}")'), setup=opening)


@SCRIPTS.attack(
    "Programs look up names that take 3 s each, in 20 threads, and are replaced by others",
    "further look-ups fail at once",
    prelude=_SLOW_NAMES,
    kinds=ONE,
)
def flood_of_look_ups(box: BoxUnderAttack, seconds: float) -> str:
    most = 0
    for n in range(max(4, min(20, round(3 * seconds)))):
        threads = [
            line
            for k in range(20)
            for line in (
                f"thread t{k}():",
                f'  socket_open("h{n}-{k}.invalid", 9, "s{k}")',
                "end",
                f"run t{k}()",
            )
        ]
        box.run(*threads, "sleep(1)")
        time.sleep(min(0.2, seconds / 20))
        most = max(most, box.usage()[1])
    assert most < 100, f"{most} threads"
    return f"at most {most} threads"


# --- XML-RPC
