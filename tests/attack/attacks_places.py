"""Attacks that want out: of the folder of programs, of a browser's page, of a script."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import zipfile
from contextlib import suppress

from attack_record import Section
from attackers import flood, log_since, request, run_to_end, until
from box_under_attack import CONTROL_PORT, ONE, PATIENCE, PORT_BASE, WITH_DASHBOARD, BoxUnderAttack

from protocol.robot_api import BASE

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


@PLACES.attack("Programs are loaded by a path of 32,000 parts: dashboard, Robot API", "there is no such file")
def paths_of_many_parts(box: BoxUnderAttack, seconds: float) -> None:
    name = 32_000 * "a/" + "x"
    if box.ports.dashboard:
        answer = box.ask(f"load {name}")[0]
        assert not answer.startswith("Loading"), answer
        flood(box, "dashboard", f"load {name}.urp\nload installation {name}\n".encode(), seconds)
    else:
        body = json.dumps({"programName": name}).encode()
        head = (
            f"PUT {BASE}/program/v1/load HTTP/1.1\r\nHost: {box.host}\r\nContent-Type: application/json\r\n"
        )
        said = f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body
        with box.connect("robot_api") as sock:
            sock.sendall(said)
            first = sock.recv(1 << 16).split(b"\r\n")[0]
        assert b" 200" not in first, first
        flood(box, "robot_api", said, seconds)
    status, told = request(box, "POST", "run_program", {"file": name})
    assert status != 200, told


@PLACES.attack(
    "The folder of programs holds links that lead out, to files and to folders", "not followed", kinds=ONE
)
def links_that_lead_out(box: BoxUnderAttack, seconds: float) -> None:
    outside = box.programs.parent / "outside"
    outside.mkdir()
    (outside / "secret.script").write_text(_SECRET)
    (outside / "flightreport_1.zip").write_bytes(_SECRET.encode())
    (outside / "kept.txt").write_text("kept")
    links = {"link.script": "secret.script", "log_history.txt": "kept.txt", "flightreports": "", "sub": ""}
    for name, target in links.items():
        (box.programs / name).symlink_to(outside / target)
    (box.programs / "prog.urp").write_bytes(b"<URProgram/>")
    (box.programs / "prog.script").symlink_to(outside / "secret.script")
    (box.programs / "log_history.txt.part").symlink_to(outside / "kept.txt")
    before = sorted((path.name, path.read_bytes()) for path in outside.iterdir())
    lines = ["load link.script", "load prog.urp", "play", "stop", "load sub/secret.script", "play", "stop"]
    lines += ["saveLog", "generate flight report", "generate support file .", "generate support file sub"]
    answers = box.ask(*lines)
    assert "secret" not in " ".join(answers[:1]), answers
    after = sorted((path.name, path.read_bytes()) for path in outside.iterdir())
    assert after == before, f"written outside: {[name for name, _ in after]}"
    said = str(log_since(box, 0))
    assert "12345678987654321" not in said, "the linked script was run"
    for path in box.programs.glob("*.zip"):
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                assert _SECRET.encode() not in archive.read(name), f"{name} of a support file leaks"


@PLACES.attack("Reports are asked for and broken off: no `.part` file stays", kinds=WITH_DASHBOARD)
def files_half_written(box: BoxUnderAttack, seconds: float) -> None:
    for _ in range(max(3, round(seconds))):
        with box.connect("dashboard") as sock:
            sock.sendall(b"saveLog\ngenerate flight report\ngenerate support file .\n")
    until(lambda: not list(box.programs.rglob("*.part")), "no .part file is left")


@PLACES.attack(
    "A script opens a socket to the control port and triggers a fault", "the connection is refused"
)
def control_port_from_a_script(box: BoxUnderAttack, seconds: float) -> None:
    for name in (box.host, "127.0.0.1", "localhost"):
        run_to_end(
            box,
            f'if socket_open("{name}", {CONTROL_PORT}):',
            '  socket_send_line("POST /v1/trigger_fault HTTP/1.1")',
            '  socket_send_line("Host: localhost")',
            '  socket_send_line("Content-Length: 0")',
            '  socket_send_line("")',
            "  sleep(0.3)",
            "end",
        )
        state = request(box, "GET", "state")[1]
        assert state["safety_mode"] == "NORMAL", f"the script has triggered: {state['safety_mode']}"


@PLACES.attack(
    "Requests as a web page would send them: other hosts, origins, sites, content types",
    "403 or 400",
    kinds=ONE,
)
def requests_of_web_pages(box: BoxUnderAttack, seconds: float) -> None:
    own = f"{box.host}:{CONTROL_PORT}"
    bad = [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example"},
        {"Host": f"evil.example@{box.host}"},
        {"Host": own, "Origin": "http://evil.example"},
        {"Host": own, "Origin": "null"},
        {"Host": own, "Sec_Fetch_Site": "cross-site"},
        {"Host": own, "Sec_Fetch_Site": "same-site"},
        {"Host": own, "Content_Type": "text/plain"},
        {"Host": own, "Content_Type": "application/x-www-form-urlencoded"},
    ]
    for headers in bad:
        status, _ = request(box, "POST", "power_off", b"{}", **headers)
        assert status in (400, 403), f"{headers} was answered {status}"
    assert request(box, "GET", "state")[1]["robot_mode"] == "RUNNING"


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


@PLACES.attack("A second box wants the same ports", "it ends with one line; the first goes on", kinds=ONE)
def taken_ports(box: BoxUnderAttack, seconds: float) -> None:
    command = [
        sys.executable,
        "-m",
        "ur_emulator",
        "serve",
        "--host",
        box.host,
        "--port-base",
        str(PORT_BASE),
    ]
    second = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert second.returncode == 1, second
    assert second.stderr.count("\n") == 1, second.stderr


_FULL = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))"


@PLACES.attack(
    "No file may grow beyond 2 kB; log, reports and support files are asked for",
    "refused",
    prelude=_FULL,
    kinds=ONE,
)
def full_disk(box: BoxUnderAttack, seconds: float) -> None:
    box.ask(*20 * ["addToLog " + 900 * "x"])
    for _ in range(max(1, round(seconds / 2))):
        answers = box.ask("saveLog", "generate flight report", "generate support file .")
        assert all(answers), answers
    assert not list(box.programs.rglob("*.part")), "half a file was left"


@PLACES.attack(
    "Nothing can be written into the folder of programs (`/sys/fs`)",
    "refused",
    options=("--programs", "/sys/fs"),
    kinds=ONE,
)
def read_only_disk(box: BoxUnderAttack, seconds: float) -> None:
    answers = box.ask("saveLog", "generate flight report", "generate support file .", "load x.urp")
    assert all(answers), answers
    assert not any(answer.startswith("Completed") for answer in answers), answers


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
