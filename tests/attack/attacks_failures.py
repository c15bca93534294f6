"""Attacks on the loop itself: whatever fails in a callback must end the connection or the program, not the box."""

from __future__ import annotations

import time
from contextlib import ExitStack, suppress

from attack_record import Section
from attackers import flood, get, reset, until
from box_under_attack import ONE, WITH_DASHBOARD, BoxUnderAttack

FAILURES = Section("One boundary for failures")


@FAILURES.attack(
    "`--log` goes to a pipe that nobody reads; dashboards add lines of 500 bytes",
    "lines are left out",
    unread_log=True,
    kinds=ONE,
)
def unread_log(box: BoxUnderAttack, seconds: float) -> None:
    line = b"addToLog " + b"x" * 500 + b"\n"
    flood(box, "dashboard", 50 * line, seconds, clients=4, most=4 << 20)


@FAILURES.attack(
    "A program is stopped, replaced and stopped again while its sockets connect and its file is loaded",
    kinds=WITH_DASHBOARD,
)
def programs_in_all_states(box: BoxUnderAttack, seconds: float) -> None:
    (box.programs / "spin.script").write_text("while True:\n  sync()\nend\n")
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        box.ask("load spin.script", "play", "stop", "play", "pause", "load nothing.urp", "stop")
        box.run('socket_open("127.0.0.1", 9)', "while True:", "  sync()", "end")
        box.send("secondary", "stop program\n")
    until(lambda: box.ask("running")[0].endswith("false"), "the program stops")


@FAILURES.attack("Clients of all ports are reset in the middle of what they send and of what they get")
def resets(box: BoxUnderAttack, seconds: float) -> None:
    said = {
        "dashboard": b"addToLog a\nload x.urp\n",
        "primary": b"def f():\n",
        "realtime": b"def f():\n  sync()\nend\n",
        "rtde": b"\0\5V\0\2\0\3",
        "modbus": bytes.fromhex("0001000000060103008000020001"),
        "control": get(box, "log")[:-3],
    }
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with ExitStack() as stack:
            for port, data in said.items():
                for _ in range(4 * box.has(port)):
                    with suppress(OSError):
                        sock = box.connect(port)
                        stack.callback(reset, sock)
                        sock.sendall(data)
