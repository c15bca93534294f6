"""Clients that come and go in numbers, polite and rude ones: the box keeps nothing of them."""

import gc
import queue
import random
import socket
import struct
import sys
from collections import Counter
from contextlib import suppress
from types import FrameType, FunctionType

import psutil
import pytest
from integration_support import TIMEOUT, Frames, connect, finish, inside, serving

from ur_emulator import ControlBox
from ur_emulator.box_log import MAX_ENTRIES, LogEntry
from ur_emulator.controller.snapshot import Snapshot

NAMES = b"timestamp,actual_q,actual_qd"
SCRIPT = b"def f():\n  textmsg(1)\nend\n"
REQUESTS = {
    "dashboard": b"robotmode\n",
    "primary": SCRIPT,
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
    """Let the box have turns until it has noticed that all have gone."""
    for _ in range(5000):
        if condition():
            return
        exchange(dashboard)
    raise AssertionError("the box still holds something of clients that have gone")


def test_descriptors_are_back_and_no_reader_has_lost_a_frame(tmp_path):
    with serving(tmp_path, "--pace", "lockstep") as box, connect(box, "dashboard") as dashboard:
        dashboard.recv(100)
        process = psutil.Process(box.process.pid)
        before = process.num_fds()
        with Frames(box) as frames:
            frames.next()
            storm(box, 6, random.Random(2))
            settle(dashboard, lambda: process.num_fds() == before + 1)
            frames.until_stamp(frames.next().timestamp)
            assert frames.lost() == 0
        settle(dashboard, lambda: process.num_fds() == before)


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
        storm(box, 2, random.Random(seed))
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
        storm(box, 2, random.Random(2))
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


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on descriptors to run into")
def test_out_of_descriptors_new_clients_are_turned_away_and_those_inside_lose_nothing(tmp_path):
    import resource

    def few_descriptors():
        resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))

    with serving(tmp_path, "--pace", "lockstep", "--log", preexec_fn=few_descriptors) as box:
        with Frames(box) as frames:
            frames.next()
            inside = []
            for _ in range(64):
                sock = connect(box, "dashboard")
                if not sock.recv(100):
                    sock.close()
                    break
                inside.append(sock)
            else:
                raise AssertionError("there was no limit")
            for _ in range(3):  # and again, and nothing changes for those inside
                with connect(box, "dashboard") as sock:
                    assert sock.recv(100) == b""
            for sock in inside:
                exchange(sock)
            inside.pop().close()
            for _ in range(100):
                with connect(box, "dashboard") as sock:
                    if sock.recv(100):
                        break
            else:
                raise AssertionError("a place that has become free is not given away")
            assert frames.lost() == 0
            for sock in inside:
                sock.close()
        box.process.terminate()
        told = finish(box.process).err
    turned_away = [line for line in told.splitlines() if "turned away from dashboard" in line]
    assert len(turned_away) == 1
    assert "Too many open files" in turned_away[0]
