"""Garbage on the script ports: the box lives, every other client gets every frame, errors are told on 30001."""

import random
from contextlib import suppress

import pytest
from integration_support import HELLO_PROGRAM, STARTED, Frames, Messages, connect, in_background, send

from protocol.primary.messages import ErrorCodeMessage, KeyMessage, RuntimeExceptionMessage, TextMessage
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
    with in_background(frames.raw):
        said = primary.message(TextMessage, text="hello")
    frames.until_stamp(said.timestamp * 1e-6)
    assert frames.lost() == 0


def test_garbage_harms_nobody(lockstep_box):
    pieces = [*(("secondary", data) for data in GARBAGE.values()), ("primary", BINARY), ("realtime", BINARY)]
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        for port, data in pieces:
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
def test_a_program_runs_even_if_its_sender_closes_at_once(lockstep_box, port):
    with Messages(lockstep_box) as primary:
        primary.next()
        for i in range(20):
            send(lockstep_box, port, f'def now():\n  textmsg("run {i}")\nend\n')
            primary.message(TextMessage, text=f"run {i}")


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


def test_garbage_on_the_rtde_port_harms_nobody(lockstep_box):
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        for data in (BINARY, *RTDE_GARBAGE.values()):
            with connect(lockstep_box, "rtde") as rtde:  # stays, unlike that of `send`
                send(lockstep_box, "rtde", data)
                with suppress(OSError):  # it may be cut off in the middle
                    rtde.sendall(data)
                hello_still_runs(lockstep_box, primary, frames)
            with connect(lockstep_box, "rtde") as rtde:
                rtde.sendall(b"\x00\x05V\x00\x02")
                assert rtde.recv(64) == b"\x00\x04V\x01"
