"""Every name, path and line that arrives has a length at which it is refused: one row for each."""

import json
import socket
import struct
import time

import pytest
from box_support import TIMEOUT, inside, program
from dashboard_support import script_line, urp

from protocol.dashboard import connection as dashboard
from protocol.interpreter import MAX_LINE as INTERPRETER_LINE
from protocol.robot_api import BASE
from protocol.rtde.codec import MAX_NAMES_SIZE
from protocol.rtde.server_connection import request_limits
from protocol.script_channel import MAX_LINE
from protocol.ur_types import SoftwareVersion
from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.host.box_log import MAX_TEXT
from ur_emulator.host.ports.http import MAX_HEADER
from urscript.dialect import LONGEST_LABEL, LONGEST_NAME, LONGEST_STRING
from urscript.values import TEXT_LIMIT

NAME, LABEL, STRING = "n" * (LONGEST_NAME + 1), "l" * (LONGEST_LABEL + 1), "s" * (LONGEST_STRING // 2 + 1)
HOST = "h" * (BUDGETS.host_length + 1)
PARTS, PATH = "a/" * BUDGETS.path_parts, "p" * (BUDGETS.path_length + 1)
RTDE = request_limits(SoftwareVersion(3, 15)).package
LOAD = f"{BASE}/program/v1/load"
IS_CLOSED = object()


@pytest.fixture(scope="module")
def boxes(tmp_path_factory):
    """A CB3, and an e-Series box of PolyScope X."""
    folder = tmp_path_factory.mktemp("programs")
    (folder / "call.urp").write_bytes(
        urp(
            f'<CallSubProgram><subprogram name="s"><programFile>{PATH}</programFile></subprogram></CallSubProgram>'
        )
    )
    (folder / "far.urp").write_bytes(urp(script_line("sync()"), installation=f"{PARTS}far"))
    options = {"in_process": True, "pace": "lockstep", "port_base": None, "programs": folder}
    with (
        ControlBox(control_port=0, **options) as cb3,
        ControlBox("ur5e", "10.12.0", services=["primary", "rtde"], **options) as x,
    ):
        yield {"cb3": cb3, "x": x}


# What the box has not read when it closes can cost its answer: nothing comes behind what is too long.
def head(begin):
    return begin.ljust(MAX_HEADER + 1, b"x")


def http(method, path, body, content_type="application/json"):
    return (
        f"{method} {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {content_type}\r\n"
        f"Connection: close\r\nContent-Length: {len(body)}\r\n\r\n"
    ).encode() + body


def form(name):
    begin = f'--XX\r\nContent-Disposition: form-data; name="file"; filename="{name}"\r\n\r\n'
    body = begin.encode() + b"sync()\r\n--XX--\r\n"
    return http("POST", f"{BASE}/programs/v1", body, "multipart/form-data; boundary=XX")


def rtde(kind, payload, version=2):
    ask = b"\0\5V\0\2" if version == 2 else b""
    return ask + struct.pack(">HB", 3 + len(payload), ord(kind)) + payload


# Box, port, bytes, and what they are answered with: bytes, the end of the connection, or a line of the log.
ROWS = {
    "dashboard line": ("cb3", "dashboard", b"x" * (dashboard.MAX_LINE + 1), IS_CLOSED),
    "dashboard path": ("cb3", "dashboard", f"load {PARTS}x.urp\n".encode(), b"File not found: a/a/"),
    "path in a program": ("cb3", "dashboard", b"load call.urp\n", "is missing: a path of 4097 characters"),
    "path of an installation": ("cb3", "dashboard", b"load far.urp\n", "far.urp needs the installation far"),
    "line on 30001": ("cb3", "primary", b"x" * (MAX_LINE + 1), f"line of more than {MAX_LINE} bytes was dr"),
    "line on 30002": ("cb3", "secondary", b"x" * (MAX_LINE + 1), f"line of more than {MAX_LINE} bytes was"),
    "name of a program": ("cb3", "primary", f"def {NAME}():\nend\n".encode(), "a name of 256 characters"),
    "name of a variable": ("cb3", "secondary", program(f"{NAME} = 1").encode(), "a name of 256 characters"),
    "label": ("cb3", "secondary", program(f'$ 1 "{LABEL}"').encode(), "a label of "),
    "joined strings": (
        "cb3", "secondary", program(f's = "{STRING}"', f's = str_cat(s, "{STRING}")').encode(), f"limit is {TEXT_LIMIT}"
    ),
    "socket name": (
        "cb3", "secondary", program(f'socket_open("127.0.0.1", 9, "{NAME}")').encode(), "a socket name of 256 char"
    ),
    "host": ("cb3", "secondary", program(f'socket_open("{HOST}", 9)').encode(), "a host has up to 253"),
    "statement on 30020": ("x", "interpreter", b"x" * (INTERPRETER_LINE + 1), IS_CLOSED),
    "RTDE package": ("cb3", "rtde", struct.pack(">HB", RTDE + 1, ord("M")), f"at most {RTDE}, are possible".encode()),
    "RTDE recipe": ("cb3", "rtde", rtde("I", b"speed_slider_mask," * (MAX_NAMES_SIZE // 18 + 1)), b",NOT_FOUND"),
    "RTDE text": ("cb3", "rtde", rtde("M", b"t" * (MAX_TEXT + 1), version=1), "t" * (MAX_TEXT - 10) + "..."),
    "Modbus frame": ("cb3", "modbus", struct.pack(">HHHB", 1, 0, 255, 0), IS_CLOSED),
    "control head": ("cb3", "control", b"GET /v1/state HTTP/1.1\r\nHost: " + head(b"x") + b"\r\n\r\n", b" 431 "),
    "control path": ("cb3", "control", head(b"GET /v1/"), b" 431 "),
    "control body": (
        "cb3", "control", http("POST", "/v1/set_speed", bytes(BUDGETS.body_bytes + 1)), b" 413 "
    ),
    "Robot API path": ("x", "robot_api", head(f"GET {BASE}/programs/v1/".encode()), b" 431 "),
    "Robot API program": ("x", "robot_api", http("PUT", LOAD, json.dumps({"programName": PARTS}).encode()), b" 404 "),
    "Robot API upload": ("x", "robot_api", form(f"{NAME}.script"), b" 422 "),
    "Robot API body": ("x", "robot_api", http("PUT", LOAD, bytes(BUDGETS.upload_bytes + 1)), b" 413 "),
}  # fmt: skip


@pytest.mark.parametrize(("name", "port", "data", "answer"), ROWS.values(), ids=ROWS)
def test_what_is_too_long_is_refused(boxes, name, port, data, answer):
    box = boxes[name]
    count = inside(box).log.count
    number = box.control_port if port == "control" else getattr(box.ports, port)
    with socket.create_connection((box.host, number), timeout=TIMEOUT) as sock:
        try:
            sock.sendall(data)
            if isinstance(answer, str):
                wait_for_line(box, count, answer)
                return
            received = b""
            while (part := sock.recv(65536)) and (answer is IS_CLOSED or answer not in received + part):
                received += part
        except (BrokenPipeError, ConnectionResetError):
            part = b""
    assert (part == b"") is (answer is IS_CLOSED)


def wait_for_line(box, count, text):
    end = time.monotonic() + TIMEOUT
    while time.monotonic() < end:
        if any(text in str(entry) for entry in inside(box).log.since(count)):
            return
        time.sleep(0.002)
    raise AssertionError(f"not in the log: {text!r}, but {[str(e) for e in inside(box).log.since(count)]}")
