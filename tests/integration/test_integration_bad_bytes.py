"""Garbage on the script ports: the box lives, every other client gets every frame, errors are told on 30001."""

import random
from contextlib import suppress

import pytest
from integration_support import HELLO_PROGRAM, STARTED, Frames, Messages, connect, send

from protocol.primary.layout import RobotModeData
from protocol.primary.messages import ErrorCodeMessage, KeyMessage, RuntimeExceptionMessage, TextMessage
from protocol.primary.packages import RobotState
from protocol.script_channel import MAX_LINE
from protocol.ur_types import ProgramState

RTDE_GARBAGE = {
    "no size": b"\x00\x00V",
    "size below the header": b"\x00\x02V",
    "size beyond sense": b"\xff\xffV" + bytes(70_000),
    "unknown type": b"\x00\x04\x00\x00" * 100,
    "short version": b"\x00\x03V",
    "odd version": b"\x00\x05V\xff\xff",
    "outputs of nothing": b"\x00\x05V\x00\x02\x00\x0bO" + bytes(8),
    "outputs at no rate": b"\x00\x05V\x00\x02\x00\x14O" + b"\x7f\xf8" + bytes(6) + b"timestamp",
    "unknown output": b"\x00\x05V\x00\x02\x00\x0fO" + bytes(8) + b"nope",
    "start of nothing": b"\x00\x05V\x00\x02\x00\x03S",
    "inputs never set up": b"\x00\x05V\x00\x02\x00\x10U" + bytes(13),
}
SCRIPT_PORTS = ["secondary", "realtime"]  # the primary is a secondary that has more to tell
READ_ONLY_PORTS = ["primary_ro", "secondary_ro", "realtime_ro"]
BINARY = random.Random(1).randbytes(20_000)
GARBAGE = {
    "binary": BINARY,
    "binary lines": BINARY.replace(b"\x00", b"\n"),
    "zeros": bytes(50_000),
    "half UTF-8": 'textmsg("größe'.encode()[:-4],
    "broken UTF-8 line": b'textmsg("\xc3\x28 \xff\xfe")\n',
    "quotes": b'"' * 1000 + b"\n",
    "ends without a begin": b"end\n" * 200,
    "HTTP": b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n",
    "RTDE handshake": b"\x00\x05V\x00\x02",
    "deep brackets": b"x = " + b"[" * 5000 + b"]" * 5000 + b"\n",
    "deep blocks": b"def f():\n" + b"if True:\n" * 1000 + b"end\n" * 1000 + b"end\n",
    "long sum": b"x = " + b"1+" * 20_000 + b"1\n",
    "huge number": b"x = " + b"9" * 5000 + b"\n",
    "Python": b"__import__('os')._exit(3)\n",
    "format fields": b"textmsg({0.__class__}%s%n)\n",
}


def hello_still_runs(box, primary, frames):
    """A program still works, and nothing was lost until it ran."""
    send(box, "secondary", HELLO_PROGRAM)
    frames.until_stamp(primary.message(TextMessage, text="hello").timestamp * 1e-6)
    assert frames.lost() == 0


@pytest.mark.parametrize(
    ("port", "data"),
    [*(("secondary", data) for data in GARBAGE.values()), ("primary", BINARY), ("realtime", BINARY)],
    ids=[*GARBAGE, "binary on primary", "binary on realtime"],
)
def test_garbage_harms_nobody(lockstep_box, port, data):
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        send(lockstep_box, port, data)
        hello_still_runs(lockstep_box, primary, frames)


@pytest.mark.parametrize("port", READ_ONLY_PORTS)
def test_read_only_twins_ignore_everything(lockstep_box, port):
    with (
        Messages(lockstep_box) as primary,
        Frames(lockstep_box) as frames,
        connect(lockstep_box, port) as sock,
    ):
        first = frames.next()
        for data in (HELLO_PROGRAM.encode(), b"power off\n", b"stop program\n", *GARBAGE.values()):
            sock.sendall(data)
        sock.recv(1)  # the box has had a turn since, and still talks to us
        hello_still_runs(lockstep_box, primary, frames)
        assert frames.next().robot_mode == first.robot_mode
        told = [
            m for m in primary.all if isinstance(m, (TextMessage, RuntimeExceptionMessage, ErrorCodeMessage))
        ]
        assert [m.text for m in told] == ["hello"]


@pytest.mark.parametrize("port", SCRIPT_PORTS)
def test_an_error_in_a_program_is_reported_with_its_line(lockstep_box, port):
    with Messages(lockstep_box) as primary:
        primary.next()
        send(lockstep_box, port, "def f():\n  x = 1\n  y = = 2\nend\n")
        assert primary.message(RuntimeExceptionMessage).line == 3
        send(lockstep_box, port, "def f():\n\n\n  jump(1)\nend\n")
        told = primary.message(RuntimeExceptionMessage)
        assert (told.line, told.text) == (4, "compile_error_name_not_found:jump:")
        send(lockstep_box, port, "def f():\n  x = 0\n  y = 1 / x\nend\n")
        assert primary.message(RuntimeExceptionMessage).line == 3


@pytest.mark.parametrize("port", SCRIPT_PORTS)
def test_a_program_without_its_end_is_forgotten_with_its_connection(lockstep_box, port):
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        send(lockstep_box, port, 'def half():\n  textmsg("half")\n')
        send(lockstep_box, port, 'textmsg("whole")')  # its line never ends
        send(lockstep_box, port, "end\n")  # of nothing: a program of its own, and an error
        primary.message(RuntimeExceptionMessage)
        hello_still_runs(lockstep_box, primary, frames)
        assert [m.text for m in primary.all if isinstance(m, TextMessage)] == ["hello"]


@pytest.mark.parametrize("port", SCRIPT_PORTS)
def test_two_half_programs_on_two_connections_do_not_mix(lockstep_box, port):
    with (
        Messages(lockstep_box) as primary,
        connect(lockstep_box, port) as one,
        connect(lockstep_box, port) as two,
    ):
        one.sendall(b'def one():\n  textmsg("o')
        two.sendall(b'def two():\n  textmsg("t')
        one.sendall(b'ne")\nend\n')
        assert primary.message(TextMessage).text == "one"
        two.sendall(b'wo")\nend\n')
        assert primary.message(TextMessage).text == "two"


@pytest.mark.parametrize("port", SCRIPT_PORTS)
def test_a_line_without_an_end_is_dropped_and_said(lockstep_box, port):
    with Messages(lockstep_box) as primary, connect(lockstep_box, port) as sock:
        sock.sendall(b"x" * (MAX_LINE + 1000))
        assert f"line of more than {MAX_LINE} bytes was dropped" in primary.message(ErrorCodeMessage).text
        sock.sendall(b"rest of it\n" + HELLO_PROGRAM.encode())
        primary.message(TextMessage, text="hello")
        assert not [m for m in primary.all if isinstance(m, RuntimeExceptionMessage)]


def test_a_program_that_never_ends_is_dropped_and_said(lockstep_box):
    with Messages(lockstep_box) as primary, connect(lockstep_box, "secondary") as sock:
        body = b"  x = 1" + b" " * 10_000 + b"\n"
        sock.sendall(b"def f():\n" + body * ((4 << 20) // len(body) + 2) + b"end\n" + HELLO_PROGRAM.encode())
        assert "program of more than 4194304 bytes was dropped" in primary.message(ErrorCodeMessage).text
        primary.message(TextMessage, text="hello")
        assert not [m for m in primary.all if isinstance(m, RuntimeExceptionMessage)]


@pytest.mark.parametrize("port", SCRIPT_PORTS)
def test_a_program_runs_even_if_its_sender_closes_at_once(lockstep_box, port):
    with Messages(lockstep_box) as primary:
        primary.next()
        for i in range(40):
            send(lockstep_box, port, f'def now():\n  textmsg("run {i}")\nend\n')
            primary.message(TextMessage, text=f"run {i}")


def test_a_program_byte_by_byte_is_the_same_program(lockstep_box):
    with Messages(lockstep_box) as primary, connect(lockstep_box, "secondary") as sock:
        for byte in HELLO_PROGRAM.replace("\n", "\r\n").encode():
            sock.sendall(bytes([byte]))
        primary.message(TextMessage, text="hello")


@pytest.mark.parametrize("line", ["set speed nan", "set speed 1e999", "set speed -1", "set speed fast"])
def test_a_speed_that_is_no_fraction_changes_nothing(lockstep_box, line):
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        send(lockstep_box, "secondary", line + "\n")
        hello_still_runs(lockstep_box, primary, frames)
        assert primary.message(RobotState).find(RobotModeData).target_speed_fraction == 1.0


def test_a_running_program_is_replaced_only_by_one_that_compiles(lockstep_box):
    with Messages(lockstep_box) as primary:
        send(lockstep_box, "secondary", "def wait():\n  while True:\n    sync()\n  end\nend\n")
        primary.message(KeyMessage, title=STARTED, text="wait")
        send(lockstep_box, "secondary", "def bad():\n  x = \nend\n")
        primary.message(RuntimeExceptionMessage)
        with Frames(lockstep_box) as frames:
            assert frames.next().runtime_state == ProgramState.PLAYING
        send(lockstep_box, "secondary", "stop program\n")
        primary.message(KeyMessage, title="PROGRAM_XXX_STOPPED", text="wait")
        assert [m.text for m in primary.all if isinstance(m, KeyMessage)] == ["wait", "wait"]


DASHBOARD_GARBAGE = {
    "binary": BINARY,
    "binary lines": GARBAGE["binary lines"],
    "line break inside": b"load a\rb\n",
    "longest line": b"y" * (1 << 16) + b"\n",
    "longest argument": b"load " + b"x" * 65_000 + b"\n",
    "commands after quit": b"quit\nrobotmode\nrobotmode\n",
    "many commands": b"robotmode\n" * 20_000,
}


@pytest.mark.parametrize("data", DASHBOARD_GARBAGE.values(), ids=DASHBOARD_GARBAGE.keys())
def test_garbage_on_the_dashboard_harms_nobody(lockstep_box, data):
    send(lockstep_box, "dashboard", data + b"\n")
    with connect(lockstep_box, "dashboard") as sock, sock.makefile("rb") as lines:
        sock.sendall(b"robotmode\n")
        assert lines.readline() == b"Connected: Universal Robots Dashboard Server\n"
        assert lines.readline() == b"Robotmode: RUNNING\n"


@pytest.mark.parametrize("data", [BINARY, *RTDE_GARBAGE.values()], ids=["binary", *RTDE_GARBAGE])
def test_garbage_on_the_rtde_port_harms_nobody(lockstep_box, data):
    with (
        Messages(lockstep_box) as primary,
        Frames(lockstep_box) as frames,
        connect(lockstep_box, "rtde") as rtde,
    ):
        frames.next()
        send(lockstep_box, "rtde", data)
        with suppress(OSError):  # it may be cut off in the middle
            rtde.sendall(data)
        hello_still_runs(lockstep_box, primary, frames)
    with connect(lockstep_box, "rtde") as rtde:
        rtde.sendall(b"\x00\x05V\x00\x02")
        assert rtde.recv(64) == b"\x00\x04V\x01"
