"""Many clients, greedy ones: how many a box takes, and that each has its turn. Counted, not timed."""

import struct
import threading
from collections import Counter
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import pairwise

import pytest
from box_support import TIMEOUT, connect, inside
from rtde_support import RtdeClient, input_package

from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.loop import listener, served_box
from ur_emulator.loop.listener import ClientLimits, ClientLines
from ur_emulator.ports.dashboard import DashboardAnswers

REGISTER = "input_double_register_0"


@pytest.fixture
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7) as made:
        yield made


@contextmanager
def standing_still(box):
    """The loop of the box does nothing as long as the block lasts."""
    has_stopped, may_go_on = threading.Event(), threading.Event()

    def stand():
        has_stopped.set()
        may_go_on.wait(TIMEOUT)

    inside(box)._loop.call_soon_threadsafe(stand, pytest.fail)
    assert has_stopped.wait(TIMEOUT)
    try:
        yield
    finally:
        may_go_on.set()


def read_lines(sock, n):
    data = b""
    while data.count(b"\n") < n:
        got = sock.recv(65536)
        assert got, f"closed after {data.count(10)} of {n} lines"
        data += got
    return data.decode().splitlines()


def is_refused(box, port):
    with connect(box, port) as sock:
        return not sock.recv(1)


# --- how many clients


def test_a_client_too_many_is_closed_at_once_with_one_line_and_a_place_that_is_left_is_taken(
    box, monkeypatch
):
    monkeypatch.setattr(listener, "BUDGETS", replace(BUDGETS, clients_of_port=3))
    with ExitStack() as stack:
        inside = [stack.enter_context(connect(box, "dashboard")) for _ in range(3)]
        for sock in inside:
            read_lines(sock, 1)
        assert all(is_refused(box, "dashboard") for _ in range(5))
        assert not is_refused(box, "realtime")
        inside[0].sendall(b"robotmode\n")
        assert read_lines(inside[0], 1) == ["Robotmode: RUNNING"]
        inside.pop().close()
        for _ in range(1000):  # until the box has noticed
            if not is_refused(box, "dashboard"):
                break
        else:
            raise AssertionError("a place that was left is not taken")
    lines = [entry.text for entry in box.log if "turned away" in entry.text]
    number = box.ports.dashboard
    assert lines[0] == (
        f"clients are turned away from dashboard port {number}: 3 clients of 127.0.0.1 at this port are the most"
    )
    assert len(lines) == 1


def test_an_address_cannot_take_all_places_and_nobody_can_take_more_than_there_are(monkeypatch):
    monkeypatch.setattr(
        listener, "BUDGETS", replace(BUDGETS, clients_of_port=2, clients_of_address=3, clients=5)
    )
    taken, refused = ClientLimits(), Counter()
    for address in ("a", "b", "c"):
        for port in (1, 1, 1, 2, 2):
            refused[taken.take(address, port)] += 1
    assert refused == {
        "": 5,
        "2 clients of a at this port are the most": 1,
        "3 clients of a are the most": 1,
        "2 clients of b at this port are the most": 1,
        "5 clients are the most": 7,
    }
    for place in (("a", 1), ("a", 1), ("a", 2), ("b", 1), ("b", 1)):
        taken.release(*place)
    assert taken.take("c", 1) == ""
    taken.release("c", 1)
    assert not taken._taken


def test_a_storm_of_clients_leaves_room_in_the_log(monkeypatch):
    monkeypatch.setattr(listener, "BUDGETS", replace(BUDGETS, client_lines=3))
    now, written = 100.0, []
    lines = ClientLines(written.append, lambda: now)
    for k in range(1000):
        lines.write(f"client {k}")
    full = "clients come and go: beyond 3 lines a minute they are left out"
    assert written == ["client 0", "client 1", "client 2", full]
    now += 60.0
    lines.write("another")
    assert written[4:] == ["997 lines about clients that came and went were left out", "another"]
    now += 60.0
    lines.write("the next")
    assert written[6:] == ["the next"]


def test_a_storm_of_clients_writes_few_lines(box, monkeypatch):
    monkeypatch.setattr(listener, "BUDGETS", replace(BUDGETS, client_lines=4))
    for _ in range(50):
        with connect(box, "dashboard") as sock:
            read_lines(sock, 1)
    assert sum(entry.source == "Client" for entry in box.log) <= 4 + 3


# --- turns


def test_a_client_that_sends_a_thousand_lines_does_not_keep_another_waiting(box, monkeypatch):
    answered = []
    original = DashboardAnswers.answer

    def answer(answers, event, host):
        answered.append(event.command.name)
        return original(answers, event, host)

    monkeypatch.setattr(DashboardAnswers, "answer", answer)
    with connect(box, "dashboard") as greedy, connect(box, "dashboard") as polite:
        for sock in (greedy, polite):
            read_lines(sock, 1)
        with standing_still(box):
            greedy.sendall(b"robotmode\n" * 1000)
            polite.sendall(b"PolyscopeVersion\n")
        assert len(read_lines(greedy, 1000)) == 1000
        assert len(read_lines(polite, 1)) == 1
    assert Counter(answered) == {"robotmode": 1000, "PolyscopeVersion": 1}
    assert answered.index("PolyscopeVersion") <= BUDGETS.client_work


def test_lines_of_a_client_that_is_gone_are_not_worked_off(box, monkeypatch):
    answered = []
    original = DashboardAnswers.answer

    def answer(answers, event, host):
        answered.append(event.command.name)
        return original(answers, event, host)

    monkeypatch.setattr(DashboardAnswers, "answer", answer)
    with connect(box, "dashboard") as greedy:
        read_lines(greedy, 1)
        with standing_still(box):
            greedy.sendall(b"robotmode\n" * 4000)
            greedy.close()
    with connect(box, "dashboard") as other:
        read_lines(other, 1)
        for _ in range(1000):
            other.sendall(b"PolyscopeVersion\n")
            read_lines(other, 1)
            if len(inside(box)._port_set._listeners["dashboard"].connections) == 1:
                break
        else:
            raise AssertionError("a client that is gone is still connected")
    assert 0 < answered.count("robotmode") <= 2 * BUDGETS.read_bytes // len("robotmode\n") + 1


def test_inputs_beyond_those_that_a_cycle_takes_wait_for_the_next_and_keep_their_order(box, monkeypatch):
    monkeypatch.setattr(served_box, "BUDGETS", replace(BUDGETS, commands=10))
    taken, values = [], []
    controller = inside(box)._box.controller
    tick = controller.tick

    def counted(commands):
        commands = tuple(commands)
        taken.append(len(commands))
        values.extend(value for submitted in commands for _, value in submitted.command.values)
        return tick(commands)

    monkeypatch.setattr(controller, "tick", counted)
    n = 500
    with connect(box, "rtde") as sock, connect(box, "rtde") as reader:
        client = RtdeClient(sock)
        recipe = client.own(REGISTER)
        types = client.input_types[recipe]
        watcher = RtdeClient(reader)
        watcher.subscribe(REGISTER)
        with standing_still(box):
            sock.sendall(b"".join(input_package(recipe, types, float(k)) for k in range(n)))
        while watcher.data()[REGISTER] != n - 1:
            pass
    assert values == [float(k) for k in range(n)]
    assert max(taken) == 10


def test_twenty_masters_that_ask_ahead_get_all_answers_in_order(box):
    """Each sends some 20 KiB before it reads: what is not answered yet waits outside of the box."""
    n = 1600
    requests = b"".join(struct.pack(">HHHBBHH", k, 0, 6, 1, 3, 128, 10) for k in range(n))
    with ExitStack() as stack:
        masters = [stack.enter_context(connect(box, "modbus")) for _ in range(20)]
        with standing_still(box):
            for master in masters:
                master.sendall(requests)
        for master in masters:
            data = b""
            while len(data) < n * 29:
                data += master.recv(65536)
            transactions = [struct.unpack_from(">H", data, 29 * k)[0] for k in range(n)]
            assert all(b - a == 1 for a, b in pairwise(transactions))
