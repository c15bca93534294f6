"""The pages of the ports suffice: clients that know no more than docs/protocol says read and command a box.

Layouts, types, numbers, scales and answers are taken from the pages as they stand; nothing of `protocol` is used.
"""

import json
import re
import shlex
import socket
import struct
import subprocess
from pathlib import Path
from shutil import which

import pytest

from ur_emulator import ControlBox

ROOT = Path(__file__).parents[2]
CB3 = (3, 15)


class Page:
    """A page of docs/protocol: the rows of its tables by heading, and its text."""

    def __init__(self, name):
        self.text = (ROOT / "docs" / "protocol" / name).read_text(encoding="utf-8")
        self.tables, heads, heading = {}, None, ""
        for line in self.text.splitlines():
            if line.startswith("#"):
                heading = line.lstrip("# ")
            if not line.startswith("|"):
                heads = None
                continue
            cells = [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            cells = [re.sub(r"^`([^`]*)`$", r"\1", cell) for cell in cells]
            if heads is None:
                heads = cells
            elif not set("".join(cells)) <= set("-: "):
                self.tables.setdefault(heading, []).append(dict(zip(heads, cells, strict=True)))

    def numbers(self, name):
        """Names by number from a line such as `- RobotMode: -1 NO_CONTROLLER, 0 DISCONNECTED.`."""
        (found,) = re.findall(rf"^- [^:]*\b{name}\b[^:]*: (.*?)\.$", self.text, re.MULTILINE | re.DOTALL)
        return {int(n): word for n, word in re.findall(r"(-?\d+)\s+(\w+)", found)}


def is_there(since):
    """Whether a cell such as `3.10 / 5.4` includes software 3.15."""
    first = since.split("/")[0].strip()
    return not first or (first != "-" and tuple(map(int, first.split("."))) <= CB3)


def received(sock, n):
    data = b""
    while len(data) < n:
        piece = sock.recv(n - len(data))
        assert piece, "the box has closed the connection"
        data += piece
    return data


@pytest.fixture(scope="module")
def box():
    with ControlBox(in_process=True, version="3.15.8", pace="lockstep", port_base=None, seed=7) as box:
        box.set_digital_input("standard", 2, True)
        yield box


@pytest.fixture
def dial(box):
    """Connect to a port of the box by its name."""
    socks = []

    def dial(name):
        socks.append(socket.create_connection((box.host, getattr(box.ports, name)), timeout=20.0))
        return socks[-1]

    yield dial
    for sock in socks:
        sock.close()


def test_realtime(box, dial):
    page = Page("realtime.md")
    sizes = {row["from software"]: int(row["bytes"]) for row in page.tables["Sizes"]}
    sock = dial("realtime")
    (size,) = struct.unpack(">i", received(sock, 4))
    assert size == sizes["3.14"]
    frame = b"\0\0\0\0" + received(sock, size - 4)
    values, end = {}, 4
    for row in page.tables["Columns"]:
        if "byte" in row and is_there(row["from"]):
            assert int(row["byte"]) == end
            values[row["name"]] = struct.unpack_from(f">{row['floats']}d", frame, end)
            end += 8 * int(row["floats"])
    assert end == size
    assert values["actual_q"] == pytest.approx(box.state.q)
    assert int(values["actual_digital_input_bits"][0]) == 1 << 2
    shown = {name: page.numbers(kind)[int(values[name][0])] for name, kind in (
        ("robot_mode", "RobotMode"), ("joint_mode", "JointMode"), ("safety_status", "SafetyStatus"),
        ("runtime_state", "ProgramState"))}  # fmt: skip
    assert [*shown.values()] == ["RUNNING", "RUNNING", "NORMAL", "STOPPED"]


class Rtde:
    """A client of port 30004 in protocol version 2."""

    def __init__(self, sock, page):
        self.sock = sock
        self.sizes = {row["type"]: int(row["bytes"]) for row in page.tables["Types"]}
        self.kinds = {row["type"]: row["what"] for row in page.tables["Types"]}

    def send(self, kind, payload=b""):
        self.sock.sendall(struct.pack(">HB", 3 + len(payload), ord(kind)) + payload)

    def receive(self):
        size, kind = struct.unpack(">HB", received(self.sock, 3))
        return chr(kind), received(self.sock, size - 3)

    def ask(self, kind, payload=b""):
        self.send(kind, payload)
        answer, data = self.receive()
        assert answer == kind
        return data

    def form(self, kind):
        """The letters of `struct` for a type."""
        what = self.kinds[kind]
        n = int((re.match(r"(\d+) numbers", what) or [0, 1])[1])
        bits = re.search(r"(\d+) bits", what)
        letter = "d" if "float" in what else "B" if not bits else {8: "b", 32: "i", 64: "q"}[int(bits[1])]
        form = n * (letter.upper() if "unsigned" in what else letter)
        assert struct.calcsize(">" + form) == self.sizes[kind]
        return form

    def values(self, data, names, kinds):
        """The values of a data package by name; one number alone, several as a list."""
        found, at = {}, 1
        for name, kind in zip(names, kinds, strict=True):
            numbers = struct.unpack_from(">" + self.form(kind), data, at)
            at += self.sizes[kind]
            found[name] = numbers[0] if len(numbers) == 1 else list(numbers)
        assert at == len(data)
        return found


def test_rtde(box, dial):
    page = Page("rtde.md")
    outputs = {row["name"]: row for row in page.tables["Outputs"] if "name" in row}
    names = ["timestamp", "actual_q", "joint_mode", "robot_mode", "runtime_state", "elbow_position",
             "actual_digital_input_bits", "actual_digital_output_bits", "safety_status_bits"]  # fmt: skip
    client = Rtde(dial("rtde"), page)
    assert client.ask("V", struct.pack(">H", 2)) == b"\1"
    assert struct.unpack(">4I", client.ask("v"))[:3] == (3, 15, 8)
    answer = client.ask("O", struct.pack(">d", 125.0) + ",".join(names).encode())
    kinds = answer[1:].decode().split(",")
    assert kinds == [outputs[name]["type"] for name in names]
    assert client.ask("I", b"standard_digital_output_mask,standard_digital_output,nothing")[:1] == b"\0"
    recipe = client.ask("I", b"standard_digital_output_mask,standard_digital_output")
    assert recipe[1:] == b"UINT8,UINT8"
    assert client.ask("S") == b"\1"
    client.send("U", recipe[:1] + bytes((0b10, 0b10)))
    seen = {"actual_digital_output_bits": 0}
    while not seen["actual_digital_output_bits"]:
        kind, data = client.receive()
        assert (kind, data[0]) == ("U", answer[0])
        seen = client.values(data, names, kinds)
    assert seen["actual_digital_output_bits"] == 0b10
    assert seen["actual_digital_input_bits"] == 0b100
    assert seen["actual_q"] == pytest.approx(box.state.q, abs=1e-3)
    assert page.numbers("RobotMode")[seen["robot_mode"]] == "RUNNING"
    assert {page.numbers("JointMode")[mode] for mode in seen["joint_mode"]} == {"RUNNING"}
    assert page.numbers("ProgramState")[seen["runtime_state"]] == "STOPPED"
    bits = re.search(r"`safety_status_bits`: (.*?)\.$", page.text, re.MULTILINE | re.DOTALL)[1]
    assert f"{seen['safety_status_bits'].bit_length() - 1} normal mode" in bits
    client.send("v")  # the page: one reply to each request, between data
    while (answer := client.receive())[0] != "v":
        assert answer[0] == "U"


def test_robot_api(tmp_path):
    """The examples of the page, as they stand, with curl."""
    if not which("curl"):
        pytest.skip("no curl")
    page = Page("robot_api.md")
    programs = tmp_path / "my_programs"
    programs.mkdir()
    (programs / "pick.script").write_text("def pick():\n  sleep(5)\nend\n")
    (tmp_path / "other.script").write_text("def other():\n  sleep(5)\nend\n")
    (block,) = re.findall(r"^```console\n(.*?)^```$", page.text, re.MULTILINE | re.DOTALL)
    form = re.search(r"`(curl -F [^`]*)`", page.text)[1].replace("\n", " ")
    serve = shlex.split(re.search(r"^ur-emulator serve .*$", page.text, re.MULTILINE)[0])
    given = dict(zip(serve[2::2], serve[3::2], strict=True))
    options = {
        "robot": given["--robot"],
        "version": given["--software"],
        "programs": tmp_path / given["--programs"],
    }
    with ControlBox(in_process=True, pace="lockstep", port_base=None, **options) as box:

        def told(command):
            words = shlex.split(command.replace("127.0.0.1:1080", f"{box.host}:{box.ports.robot_api}"))
            return subprocess.run(
                [*words, "-sS"], capture_output=True, text=True, cwd=tmp_path, check=True
            ).stdout.strip()

        for command, answer in re.findall(r"^\$ (.*)\n(.*)$", block, re.MULTILINE):
            assert told(command) == answer, command
        assert json.loads(told(form.replace("pick.script", "other.script")))["programName"] == "other"
