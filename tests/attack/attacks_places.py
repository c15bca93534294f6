"""Attacks that want out: of the folder of programs, of a browser's page, of a script."""

from __future__ import annotations

import time
from contextlib import suppress

from attack_record import Section
from attackers import log_since, request
from box_under_attack import WITH_DASHBOARD, BoxUnderAttack

PLACES = Section("Nothing leaves its place")

_SECRET = "textmsg(12345678987654321)\n"
_NAMES = (
    "../secret.script",
    "../../../../etc/passwd",
    "/etc/passwd",
    "/programs/../secret.script",
    "/programs//etc/passwd",
    "sub/../../secret.script",
    "..\\secret.script",
    "./../secret.script",
    "%2e%2e/secret.script",
    "~/secret.script",
    "x\0.script",
    "/proc/self/environ",
    "/dev/stdin",
    4000 * "x",
    300 * "x/",
    "",
    '"../secret.script"',
    "file:///etc/passwd",
)


@PLACES.attack(
    "Dashboard and control API load files by 18 names that lead out",
    "there is no such file",
    kinds=WITH_DASHBOARD,
)
def paths_that_lead_out(box: BoxUnderAttack, seconds: float) -> None:
    outside = box.programs.parent
    (outside / "secret.script").write_text(_SECRET)
    for name in _NAMES:
        for word in ("load", "load installation", "generate support file"):
            answer = box.ask(f"{word} {name}")[0] if "\0" not in name else ""
            assert not answer.startswith(("Loading", "Completed")), f"{word} {name[:40]}: {answer}"
            assert str(outside) not in answer, f"{word} {name[:40]} shows a path: {answer}"
        status, told = request(box, "POST", "run_program", {"file": name})
        assert status != 200, f"{name[:40]}: {told}"
        assert str(outside) not in str(told), f"{name[:40]} shows a path: {told}"


@PLACES.attack(
    "A web page posts a program and words to the ports of scripts, of grippers and to the dashboard",
    "it is closed",
)
def scripts_of_web_pages(box: BoxUnderAttack, seconds: float) -> None:
    body = b'def page():\n  textmsg("from a page")\nend\npower off\n'
    for port in {"primary", "secondary", "realtime", "dashboard", "gripper", "tool_line"} & set(
        box.open_ports
    ):
        for path in ("/", "/" + 700 * "a"):
            with box.connect(port) as sock, suppress(OSError):
                sock.sendall(f"POST {path} HTTP/1.1\r\nHost: {box.host}\r\n\r\n".encode() + body)
                while sock.recv(1 << 16):
                    pass
    said = [entry["text"] for entry in log_since(box, 0)[0]]
    assert not any("POST" in text or "from a page" in text for text in said), said
    assert request(box, "GET", "state")[1]["robot_mode"] == "RUNNING"


@PLACES.attack(
    "A script dials the box's own ports and sends itself programs without end", "they run one by one"
)
def script_that_dials_its_box(box: BoxUnderAttack, seconds: float) -> None:
    box.run(
        f'socket_open("{box.host}", {box.ports.secondary})',
        "while True:",
        '  socket_send_line("textmsg(1)")',
        '  socket_send_line("sec x():")',
        '  socket_send_line("end")',
        "  sync()",
        "end",
    )
    time.sleep(seconds)
    box.send("secondary", "stop program\n")
