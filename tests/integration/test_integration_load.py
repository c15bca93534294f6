"""Clients that come and go in numbers, read late or never, and a process that gets nothing more from the system.

The box keeps nothing of clients that have gone. Without descriptors what needs one fails, and no more.
"""

import gc
import queue
import random
import socket
import struct
import time
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType, FunctionType

import psutil
import pytest
from box_support import inside
from integration_support import (
    PERIOD,
    TIMEOUT,
    Frames,
    Messages,
    connect,
    finish,
    in_background,
    send,
    serving,
)

import ur_emulator.host.pacing as pacing
from protocol.primary.messages import RuntimeExceptionMessage, TextMessage
from ur_emulator import ControlBox
from ur_emulator.host.box_log import MAX_ENTRIES, LogEntry
from ur_emulator.machine.controller.snapshot import Snapshot

NAMES = b"timestamp,actual_q,actual_qd"
REQUESTS = {
    "dashboard": b"robotmode\n",
    "primary": b"def f():\n  textmsg(1)\nend\n",
    "secondary": b"def f():\n  x =\nend\n",
    "realtime": b"textmsg(2)\n",
    "rtde": struct.pack(">HBHHBd", 5, 86, 2, 11 + len(NAMES), 79, 125.0) + NAMES + b"\0\3S",
    "modbus": bytes.fromhex("000100000006010300800002"),
    "primary_ro": b"",
    "secondary_ro": b"",
    "realtime_ro": b"",
}
MANNERS = ("silent", "garbage", "half a request", "reset", "answered")
RESET = struct.pack("ii", 1, 0)
OURS = ("ur_emulator", "protocol", "urscript")


def storm(box, rounds, rng):
    """Every port in every manner, so many times."""
    for _ in range(rounds):
        for port, request in REQUESTS.items():
            for manner in MANNERS:
                with connect(box, port) as sock, suppress(ConnectionResetError, BrokenPipeError):
                    if manner == "garbage":
                        sock.sendall(rng.randbytes(200))
                    elif manner == "half a request":
                        sock.sendall(request[: len(request) // 2])
                    elif manner == "reset":
                        sock.sendall(request)
                        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
                    elif manner == "answered" and request:
                        sock.sendall(request)
                        sock.recv(4096)
    for port in REQUESTS:  # clients are let in in the order in which they came: all others have been by then
        with connect(box, port) as sock:
            sock.sendall(REQUESTS[port] if port in ("rtde", "modbus") else b"")
            assert sock.recv(1)


def exchange(dashboard):
    """One command and its reply: the box has had a turn."""
    dashboard.sendall(b"robotmode\n")
    assert dashboard.recv(100)


def settle(dashboard, condition):
    """Let the box have turns until it has noticed that all have gone; what it keeps ends the test by its time-out."""
    while not condition():
        exchange(dashboard)


@pytest.fixture
def quiet_box():
    """A box in lockstep, and a client of its dashboard that stays."""
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7) as box,
        connect(box, "dashboard") as dashboard,
    ):
        dashboard.recv(100)
        box.dashboard = dashboard
        yield box
        del box.dashboard


def everybody_has_gone(box):
    n_clients = sum(len(listener.connections) for listener in inside(box)._port_set._listeners.values())
    return n_clients == 1 and not inside(box)._intake._senders and not inside(box)._box.controller.is_active


def between_cycles(box, ask):
    """Let the loop's thread answer: nothing is half done then."""
    answers = queue.Queue()
    inside(box)._loop.call_soon_threadsafe(lambda: answers.put(ask()), answers.put)
    return answers.get(timeout=TIMEOUT)


def our_objects():
    """How many there are of each class of ours, without what is kept on purpose: last lines, last states."""
    gc.collect()
    found = Counter(type(o) for o in gc.get_objects() if str(type(o).__module__).split(".")[0] in OURS)
    del found[LogEntry], found[Snapshot]
    return found


def test_nothing_of_a_client_outlives_it(quiet_box):
    box = quiet_box
    before = Counter()
    for seed in range(6):  # tables are made when they are first needed; a leak is there every time
        storm(box, 1, random.Random(seed))
        settle(box.dashboard, lambda: everybody_has_gone(box))
        counts = between_cycles(box, our_objects)
        more, before = counts - before, counts
        if not more:
            break
    assert more == Counter()
    assert len(box.log) <= MAX_ENTRIES


def test_no_client_leaves_work_for_the_garbage_collector(quiet_box):
    """A full collection takes longer than a cycle has to spare; what holds itself alive waits for it for long."""
    box = quiet_box
    storm(box, 1, random.Random(1))
    settle(box.dashboard, lambda: everybody_has_gone(box))
    gc.collect()
    gc.disable()
    try:
        storm(box, 1, random.Random(2))
        settle(box.dashboard, lambda: everybody_has_gone(box))
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        left = [
            o
            for o in gc.garbage
            if isinstance(o, (FunctionType, FrameType, BaseException))
            or str(type(o).__module__).split(".")[0] in OURS
        ]
        assert left == []
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()


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


def end_worker(box):
    """End the process for long tasks, which begins a moment after the box: its server loads the compiler first."""
    (server,) = psutil.Process(box.process.pid).children()
    begun = time.monotonic()
    while not (workers := server.children()):
        assert time.monotonic() - begun < TIMEOUT
        time.sleep(0.01)
    for process in workers:
        process.kill()
        process.wait(TIMEOUT)


@pytest.mark.nightly
def test_without_descriptors_nothing_is_written_compiled_or_connected_and_later_it_is(tmp_path):
    options = ("--pace", "lockstep", "--programs", tmp_path, "--log")
    with (
        serving(tmp_path, *options, preexec_fn=few_descriptors) as box,
        socket.create_server(("127.0.0.1", 0)) as server,
        Messages(box) as primary,
        connect(box, "secondary") as secondary,
        connect(box, "dashboard") as sock,
        sock.makefile("rw") as dashboard,
    ):

        def answers(*lines):
            dashboard.write("".join(f"{line}\n" for line in lines))
            dashboard.flush()
            return [dashboard.readline().rstrip("\n") for _ in lines]

        dashboard.readline()
        port = server.getsockname()[1]
        calls = f'def calls():\n  textmsg(socket_open("127.0.0.1", {port}))\nend\n'.encode()
        with without_descriptors(box):
            secondary.sendall(calls)
            primary.message(TextMessage, text="False")
        end_worker(box)  # all that follows needs a new process
        with without_descriptors(box):
            secondary.sendall(b"def lost():\nend\n")
            primary.message(RuntimeExceptionMessage)
            saved, report, loaded = answers("saveLog", "generate flight report", "load x.urp")
            assert saved == "Failed to execute: saveLog"
            assert "Too many open files" in report
            assert loaded == "Error while loading program: x.urp"
        with connect(box, "primary") as other:  # once there is room
            assert other.recv(1)
        assert answers("saveLog", "generate flight report", "load x.urp") == [
            "Log saved to disk",
            "Flight Report generated with id:1",
            "File not found: x.urp",
        ]
        secondary.sendall(calls)
        primary.message(TextMessage, text="True")
        box.process.terminate()
        log = finish(box.process).err
    assert "the program cannot be compiled: the process for it cannot be started" in log
    assert "Traceback" not in log


def test_several_clients_see_the_same_frames(lockstep_box):
    ports = ("realtime", "realtime", "realtime_ro")
    with ExitStack() as stack:
        readers = [stack.enter_context(Frames(lockstep_box, port)) for port in ports]
        begins = [reader.next().timestamp for reader in readers]
        send(lockstep_box, "secondary", "def f():\n  sleep(1)\nend\n")
        seen = [{} for _ in readers]
        while min(reader.stamps[-1] for reader in readers) < begins[0] + 1.0:
            for reader, frames in zip(readers, seen, strict=True):
                frame = reader.raw()
                frames[reader.stamps[-1]] = frame
        shared = set.intersection(*map(set, seen))
        assert len(shared) > 100
        for stamp in shared:
            assert len({frames[stamp] for frames in seen}) == 1
        assert [reader.lost() for reader in readers] == [0, 0, 0]


@pytest.mark.nightly
def test_a_reader_that_comes_back_gets_whole_frames_again(lockstep_box, monkeypatch):
    monkeypatch.setattr(pacing, "READER_LIMIT", 0.2)  # s, instead of what a box waits in lockstep
    with Frames(lockstep_box) as late, Frames(lockstep_box) as frames:
        begin = frames.next().timestamp
        send(lockstep_box, "secondary", "def minute():\n  sleep(60)\nend\n")
        frames.until_stamp(begin + 50.0)
        late.until_stamp(begin + 40.0)  # asserts that every package is whole
        with in_background(late.raw):
            frames.until_stamp(begin + 60.0)
        assert frames.lost() == 0
        assert late.lost() > 1000
        after = [round(s / PERIOD) for s in late.stamps if s > begin + 52.0]
        assert after[-1] - after[0] + 1 == len(set(after))
