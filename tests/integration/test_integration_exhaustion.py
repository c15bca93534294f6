"""A process that gets nothing more from the system, neither descriptors nor threads: what needs them fails, and no more."""

import socket
import sys
import threading
from contextlib import ExitStack, contextmanager

import psutil
import pytest
from integration_support import TIMEOUT, Frames, Messages, connect, finish, send, serving

from protocol.primary.messages import RuntimeExceptionMessage, TextMessage

_WRITE = ("saveLog", "generate flight report", "generate support file .")


def few_descriptors():
    import resource

    resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))


@contextmanager
def without_descriptors(box):
    """Take all descriptors of a box for the length of the block."""
    with ExitStack() as stack:
        for _ in range(64):
            if not stack.enter_context(connect(box, "dashboard")).recv(100):
                yield
                return
    raise AssertionError("there was no limit")


def ask(stream, line):
    stream.write(line + "\n")
    stream.flush()
    return stream.readline().rstrip("\n")


def end_worker(box):
    (server,) = psutil.Process(box.process.pid).children()
    for process in server.children():
        process.kill()
        process.wait(TIMEOUT)


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on descriptors to run into")
def test_without_descriptors_nothing_is_written_or_loaded_and_later_it_is(tmp_path):
    options = ("--pace", "lockstep", "--programs", tmp_path)
    with (
        serving(tmp_path, *options, preexec_fn=few_descriptors) as box,
        connect(box, "dashboard") as sock,
        sock.makefile("rw") as dashboard,
        Frames(box) as frames,
    ):
        assert dashboard.readline()
        frames.next()
        end_worker(box)  # all of it needs a new process
        with without_descriptors(box):
            assert ask(dashboard, "saveLog") == "Failed to execute: saveLog"
            for line in _WRITE[1:]:
                assert "Too many open files" in ask(dashboard, line)
            assert ask(dashboard, "load x.urp") == "Error while loading program: x.urp"
        assert ask(dashboard, "saveLog") == "Log saved to disk"
        assert ask(dashboard, "generate flight report") == "Flight Report generated with id:1"
        assert ask(dashboard, "load x.urp") == "File not found: x.urp"
        assert frames.lost() == 0


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on descriptors to run into")
def test_without_descriptors_no_program_is_compiled_or_connected_and_later_it_is(tmp_path):
    with (
        serving(tmp_path, "--pace", "lockstep", "--log", preexec_fn=few_descriptors) as box,
        socket.create_server(("127.0.0.1", 0)) as server,
        Messages(box) as primary,
        connect(box, "secondary") as sock,
    ):
        calls = (
            f'def calls():\n  textmsg(socket_open("127.0.0.1", {server.getsockname()[1]}))\nend\n'.encode()
        )
        with without_descriptors(box):
            sock.sendall(calls)
            primary.message(TextMessage, text="False")
        end_worker(box)
        with without_descriptors(box):
            sock.sendall(b"def lost():\nend\n")
            primary.message(RuntimeExceptionMessage)
        with connect(box, "primary") as other:  # once there is room
            assert other.recv(1)
        sock.sendall(calls)
        primary.message(TextMessage, text="True")
        box.process.terminate()
        log = finish(box.process).err
    assert "the program cannot be compiled: the process for it cannot be started" in log
    assert "Traceback" not in log


CALLS = ('socket_open("localhost", 9)', 'rpc_factory("xmlrpc", "http://127.0.0.1:9").f()')


@pytest.mark.parametrize("call", CALLS, ids=["name", "xmlrpc"])
def test_without_threads_a_program_that_needs_one_ends_and_the_box_does_not(realtime_box, call, monkeypatch):
    with Frames(realtime_box) as frames, Messages(realtime_box) as primary:
        frames.next()
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", no_thread)
            send(realtime_box, "secondary", f"def calls():\n  x = {call}\nend\n")
            frames.until(lambda frame: has_stopped(realtime_box))
        send(realtime_box, "secondary", 'def next():\n  textmsg("next")\nend\n')
        primary.message(TextMessage, text="next")
        assert frames.lost() == 0


def no_thread(thread):
    raise RuntimeError("can't start new thread")


def has_stopped(box):
    return any(entry.text == "Program stopped: calls" for entry in box.log)
