"""Programs that misbehave: the box lives, time goes on where it should, nothing is left behind."""

import gc
import os
import socket
import threading
from contextlib import ExitStack, contextmanager

import pytest
from integration_support import (
    HELLO_PROGRAM,
    SPIN,
    TIMEOUT,
    Frames,
    Messages,
    connect,
    in_background,
    send,
    serving,
)

import ur_emulator.loop.pacing as pacing
from protocol.primary.messages import KeyMessage, RuntimeExceptionMessage, TextMessage
from protocol.ur_types import Ports, ProgramState
from ur_emulator import ControlBox
from ur_emulator.errors import PortError


@contextmanager
def listening(backlog=128):
    with socket.create_server(("127.0.0.1", 0), backlog=backlog) as server:
        server.settimeout(TIMEOUT)
        yield server, server.getsockname()[1]


def descriptors():
    return len(os.listdir("/proc/self/fd"))


def until_descriptors(frames, at_most):
    """Read frames until the box has closed what it had to close."""
    frames.until(lambda _: descriptors() <= at_most, frames.raw)


def test_a_loop_without_sync_ends_with_the_controllers_error(lockstep_box):
    with Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        frames.next()
        send(lockstep_box, "secondary", "def loop():\n  x = 0\n  while True:\n    x = x + 1\n  end\nend\n")
        with in_background(frames.raw):
            told = primary.message(RuntimeExceptionMessage)
            ended = primary.message(KeyMessage, title="PROGRAM_XXX_STOPPED")
        assert "used too much time without instructing the robot" in told.text
        assert told.line in (3, 4)
        frames.until_stamp(ended.timestamp * 1e-6)
        assert frames.lost() == 0
        send(lockstep_box, "secondary", HELLO_PROGRAM)
        primary.message(TextMessage, text="hello")


def test_two_hundred_sockets_are_opened_and_closed_with_their_program(lockstep_box):
    with listening(256) as (server, port), Messages(lockstep_box) as primary, ExitStack() as peers:
        primary.next()
        before = descriptors()
        text = (
            "def many():\n  i = 0\n  n = 0\n  while i < 200:\n"
            f'    if socket_open("127.0.0.1", {port}, to_str(i)):\n      n = n + 1\n    end\n    i = i + 1\n  end\n'
            "  textmsg(n)\nend\n"
        )
        send(lockstep_box, "secondary", text)
        callers = [peers.enter_context(server.accept()[0]) for _ in range(200)]
        primary.message(TextMessage, text="200")
        for caller in callers:
            caller.settimeout(TIMEOUT)
            assert caller.recv(1) == b""
            caller.close()
        with Frames(lockstep_box) as frames:
            until_descriptors(frames, before + 2)  # both ends of these frames


def test_a_script_that_was_flooded_reads_on_where_it_was(lockstep_box):
    """Held back is not lost: every number arrives, in order."""
    n = 200_000
    text = (
        'def sum():\n  socket_open("127.0.0.1", PORT)\n  sleep(1)\n  i = 0\n  while i < N:\n'
        '    v = socket_read_binary_integer(30)\n    if v[1] != i:\n      textmsg("wrong ", i)\n      halt\n    end\n'
        '    i = i + 30\n  end\n  textmsg("all")\nend\n'
    )
    numbers = b"".join(i.to_bytes(4, "big") for i in range(n - n % 30))
    with listening() as (server, port), Messages(lockstep_box) as primary:
        primary.next()
        send(lockstep_box, "secondary", text.replace("PORT", str(port)).replace("N", str(n - n % 30)))
        peer, _ = server.accept()
        sender = threading.Thread(target=peer.sendall, args=(numbers * 1,))
        sender.start()
        assert primary.message(TextMessage).text == "all"
        sender.join()
        peer.close()


def test_a_script_that_sends_to_a_peer_that_never_reads_is_reported(lockstep_box):
    text = (
        'def talk():\n  socket_open("127.0.0.1", PORT)\n  s = "0123456789"\n  i = 0\n  while i < 6:\n    s = str_cat(s, s)\n'
        "    i = i + 1\n  end\n  sent = 0\n  while socket_send_string(s):\n    sent = sent + 1\n    if sent % 100 == 0:\n"
        '      sync()\n    end\n  end\n  textmsg("full")\nend\n'
    )
    with listening() as (server, port), Messages(lockstep_box) as primary:
        primary.next()
        send(lockstep_box, "secondary", text.replace("PORT", str(port)))
        peer, _ = server.accept()
        with peer:
            assert primary.message(TextMessage, limit=50_000).text == "full"


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


def test_fifty_programs_one_after_the_other_each_replace_the_last(lockstep_box):
    with (
        Messages(lockstep_box) as primary,
        Frames(lockstep_box) as frames,
        connect(lockstep_box, "secondary") as scripts,
    ):
        frames.next()
        before = descriptors()
        for i in range(50):
            scripts.sendall(SPIN.replace("spin", f"spin{i}").encode())
        with in_background(frames.raw):
            for i in range(50):
                primary.message(KeyMessage, title="PROGRAM_XXX_STARTED", text=f"spin{i}")
        frames.until(lambda f: f.target_qd[0] == pytest.approx(0.3))
        scripts.sendall(b"stop program\n")
        with in_background(frames.raw):
            primary.message(KeyMessage, title="PROGRAM_XXX_STOPPED", text="spin49")
        keys = [
            (m.title.removeprefix("PROGRAM_XXX_"), m.text) for m in primary.all if isinstance(m, KeyMessage)
        ]
        assert keys == [(kind, f"spin{i}") for i in range(50) for kind in ("STARTED", "STOPPED")]
        frames.rest()
        assert frames.lost() == 0
        assert descriptors() == before


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
        until_descriptors(frames, before + 2)  # both ends of these frames


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


def test_a_program_cannot_hold_up_time_by_starting_threads(tmp_path):
    text = "def f():\n  thread t():\n    while True:\n      sync()\n    end\n  end\n  while True:\n    run t()\n  end\nend\n"
    with serving(tmp_path, "--pace", "lockstep") as box, Messages(box) as primary:
        primary.sock.settimeout(1.0)
        send(box, "secondary", text)
        try:
            assert primary.message(RuntimeExceptionMessage).text
        finally:
            box.process.kill()
