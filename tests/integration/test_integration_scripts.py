"""What comes on the script ports: garbage, half programs, programs that leave sockets; the box lives and keeps nothing."""

import gc
import os
import random
import socket
from contextlib import ExitStack, contextmanager

import pytest
from integration_support import (
    HELLO_PROGRAM,
    STARTED,
    TIMEOUT,
    Frames,
    Messages,
    connect,
    in_background,
    send,
)

import ur_emulator.host.pacing as pacing
from protocol.primary.messages import ErrorCodeMessage, KeyMessage, RuntimeExceptionMessage, TextMessage
from protocol.ur_types import Ports, ProgramState
from ur_emulator import ControlBox
from ur_emulator.errors import PortError

BINARY = random.Random(1).randbytes(20_000)
GARBAGE = (
    BINARY,
    BINARY.replace(b"\x00", b"\n"),
    'textmsg("größe'.encode()[:-4],
    b'textmsg("\xc3\x28 \xff\xfe")\n',
    b"end\n" * 200,
    b"def f():\n" + b"if True:\n" * 1000 + b"end\n" * 1000 + b"end\n",
    b"x = " + b"1+" * 20_000 + b"1\n",
    b"__import__('os')._exit(3)\n",
    b"textmsg({0.__class__}%s%n)\n",
)


def hello_still_runs(box, primary, frames):
    """A program still works, and nothing was lost until it ran."""
    send(box, "secondary", HELLO_PROGRAM)
    with in_background(frames.raw):
        said = primary.message(TextMessage, text="hello")
    frames.until_stamp(said.timestamp * 1e-6)
    assert frames.lost() == 0


def test_garbage_harms_nobody(lockstep_box):
    pieces = [
        *(("secondary", data) for data in GARBAGE),
        ("primary", BINARY),
        ("realtime", BINARY),
        ("rtde", BINARY),
    ]
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        for port, data in pieces:
            send(lockstep_box, port, data)
            hello_still_runs(lockstep_box, primary, frames)


def test_read_only_twins_ignore_everything(lockstep_box):
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        first = frames.next()
        for port in ("primary_ro", "secondary_ro", "realtime_ro"):
            with connect(lockstep_box, port) as sock:
                for data in (HELLO_PROGRAM.encode(), b"power off\n", b"stop program\n", *GARBAGE):
                    sock.sendall(data)
                sock.recv(1)  # the box has had a turn since, and still talks to us
        hello_still_runs(lockstep_box, primary, frames)
        assert frames.next().robot_mode == first.robot_mode
        told = [
            m for m in primary.all if isinstance(m, (TextMessage, RuntimeExceptionMessage, ErrorCodeMessage))
        ]
        assert [m.text for m in told] == ["hello"]


@pytest.mark.parametrize("port", ["secondary", "realtime"])
def test_half_programs_do_not_mix_and_are_forgotten_with_their_connection(lockstep_box, port):
    with (
        Messages(lockstep_box) as primary,
        Frames(lockstep_box) as frames,
        connect(lockstep_box, port) as one,
        connect(lockstep_box, port) as two,
    ):
        frames.next()
        send(lockstep_box, port, 'def half():\n  textmsg("half")\n')
        send(lockstep_box, port, 'textmsg("whole")')  # its line never ends
        send(lockstep_box, port, "end\n")  # of nothing: a program of its own, and an error
        primary.message(RuntimeExceptionMessage)
        one.sendall(b'def one():\n  textmsg("o')
        two.sendall(b'def two():\n  textmsg("t')
        for sock, rest in ((one, b"ne"), (two, b"wo")):
            sock.sendall(rest + b'")\nend\n')
            primary.message(TextMessage)
        hello_still_runs(lockstep_box, primary, frames)
        assert [m.text for m in primary.all if isinstance(m, TextMessage)] == ["one", "two", "hello"]


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


def descriptors():
    return len(os.listdir("/proc/self/fd"))


@contextmanager
def listening(backlog=128):
    with socket.create_server(("127.0.0.1", 0), backlog=backlog) as server:
        server.settimeout(TIMEOUT)
        yield server, server.getsockname()[1]


@pytest.mark.parametrize("target", ["full backlog", "refused", "unknown name", "zero byte"])
def test_an_open_that_cannot_succeed_returns_false(lockstep_box, monkeypatch, target):
    monkeypatch.setattr(pacing, "HANG_LIMIT", 0.1)  # s, instead of a minute
    with ExitStack() as stack:
        host = {"unknown name": "robot.invalid", "zero byte": "a\0b"}.get(target, "127.0.0.1")
        server, port = stack.enter_context(listening(0))
        if target == "refused":
            server.close()
        elif target == "full backlog":
            stack.enter_context(silent_port(port))
        primary, frames = (
            stack.enter_context(Messages(lockstep_box)),
            stack.enter_context(Frames(lockstep_box)),
        )
        primary.next()
        begin = frames.next().timestamp
        send(lockstep_box, "secondary", f'def f():\n  textmsg(socket_open("{host}", {port}))\nend\n')
        frames.until(lambda f: f.runtime_state == ProgramState.PLAYING or f.timestamp > begin)
        frames.rest()
        assert frames.lost() == 0
        said = primary.message(TextMessage)
        assert said.text == "False"
        if target == "full backlog":
            assert said.timestamp * 1e-6 - begin >= 2.0 - 0.008


@contextmanager
def silent_port(port):
    """Fill the backlog of a listening port that nobody accepts from: further calls are neither taken nor refused."""
    with ExitStack() as stack:
        for _ in range(8):
            caller = stack.enter_context(socket.socket())
            caller.setblocking(False)
            caller.connect_ex(("127.0.0.1", port))
        yield


def test_programs_leave_no_sockets_whatever_ends_them(lockstep_box):
    opening = 'def f():\n  socket_open("127.0.0.1", PORT)\n'
    ends = ["end\n", "  halt\nend\n", "  x = 1 / 0\nend\n", "  socket_read_line()\nend\n"]
    before = descriptors()
    with listening() as (server, port), connect(lockstep_box, "dashboard") as dashboard:
        for end in ends * 10:
            send(lockstep_box, "secondary", (opening + end).replace("PORT", str(port)))
            peer, _ = server.accept()  # the program may still be about to learn that it is connected
            with peer:
                if "read" in end:
                    dashboard.sendall(b"stop\n")
                peer.settimeout(TIMEOUT)
                assert peer.recv(1) == b""
    with Frames(lockstep_box) as frames:
        frames.until(lambda _: descriptors() <= before + 2, frames.raw)  # both ends of these frames


def test_a_box_on_a_taken_port_gives_everything_back(lockstep_box):
    offset = lockstep_box.ports.realtime - Ports.standard().realtime
    before = 0
    for turn in range(6):
        box = ControlBox(in_process=turn % 2 == 0, port_base=offset)
        with pytest.raises(PortError):
            box.__enter__()
        del box
        if turn == 1:
            gc.collect()
            before = descriptors()  # with the server of processes
    gc.collect()
    assert descriptors() == before
