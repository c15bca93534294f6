"""Programs of the script ports: halves of them, those that do not compile, those that open sockets; the box keeps nothing."""

import gc
import os
import socket
from contextlib import ExitStack

import pytest
from integration_support import HELLO_PROGRAM, PERIOD, STARTED, TIMEOUT, Frames, Messages, connect, send

import ur_emulator.host.pacing as pacing
from protocol.primary.messages import KeyMessage, RuntimeExceptionMessage, TextMessage
from protocol.ur_types import Ports, ProgramState
from ur_emulator import ControlBox
from ur_emulator.errors import PortError


def test_read_only_twins_ignore_everything(lockstep_box):
    with Messages(lockstep_box) as primary:
        for port in ("primary_ro", "secondary_ro", "realtime_ro"):
            with connect(lockstep_box, port) as sock:
                sock.sendall(HELLO_PROGRAM.replace("hello", port).encode() + b"power off\nstop program\n")
                sock.recv(1)  # the box has had a turn since, and still talks to us
        send(lockstep_box, "secondary", HELLO_PROGRAM)
        primary.message(TextMessage, text="hello")
    assert [m.text for m in primary.all if isinstance(m, TextMessage)] == ["hello"]
    assert lockstep_box.state.robot_mode == "RUNNING"


def test_half_programs_do_not_mix_and_are_forgotten_with_their_connection(lockstep_box):
    with (
        Messages(lockstep_box) as primary,
        connect(lockstep_box, "secondary") as one,
        connect(lockstep_box, "realtime") as two,
    ):
        primary.next()
        send(lockstep_box, "secondary", 'def half():\n  textmsg("half")\n')
        send(lockstep_box, "secondary", 'textmsg("whole")')  # its line never ends
        send(lockstep_box, "secondary", "end\n")  # of nothing: a program of its own, and an error
        primary.message(RuntimeExceptionMessage)
        one.sendall(b'def one():\n  textmsg("o')
        two.sendall(b'def two():\n  textmsg("t')
        for sock, rest in ((one, b"ne"), (two, b"wo")):
            sock.sendall(rest + b'")\nend\n')
            primary.message(TextMessage)
        assert [m.text for m in primary.all if isinstance(m, TextMessage)] == ["one", "two"]


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


@pytest.mark.parametrize("target", ["full backlog", "refused", "unknown name"])
def test_an_open_that_cannot_succeed_returns_false(lockstep_box, monkeypatch, target):
    monkeypatch.setattr(pacing, "HANG_LIMIT", 0.1)  # s, instead of a minute
    host = "robot.invalid" if target == "unknown name" else "127.0.0.1"
    with ExitStack() as stack:
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        address = server.getsockname()
        if target == "refused":
            server.close()
        for _ in range(8 if target == "full backlog" else 0):
            caller = stack.enter_context(socket.socket())
            caller.setblocking(False)
            caller.connect_ex(address)
        primary = stack.enter_context(Messages(lockstep_box))
        frames = stack.enter_context(Frames(lockstep_box))
        primary.next()
        begin = frames.next().timestamp
        send(lockstep_box, "secondary", f'def f():\n  textmsg(socket_open("{host}", {address[1]}))\nend\n')
        frames.until(lambda f: f.runtime_state == ProgramState.PLAYING or f.timestamp > begin)
        frames.rest()
        assert frames.lost() == 0
        said = primary.message(TextMessage)
        assert said.text == "False"
        assert target != "full backlog" or said.timestamp * 1e-6 - begin >= 2.0 - PERIOD


def test_programs_leave_no_sockets_whatever_ends_them(lockstep_box):
    opening = 'def f():\n  socket_open("127.0.0.1", PORT)\n'
    ends = ["end\n", "  halt\nend\n", "  x = 1 / 0\nend\n", "  socket_read_line()\nend\n"]
    before = descriptors()
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        connect(lockstep_box, "dashboard") as dashboard,
    ):
        server.settimeout(TIMEOUT)
        port = server.getsockname()[1]
        for end in ends * 4:
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
    for turn in range(4):
        box = ControlBox(in_process=turn % 2 == 0, port_base=offset)
        with pytest.raises(PortError):
            box.__enter__()
        del box
        if turn == 1:
            gc.collect()
            before = descriptors()  # with the server of processes
    gc.collect()
    assert descriptors() == before
