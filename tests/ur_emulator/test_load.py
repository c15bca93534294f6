"""Many clients, greedy ones: how they are accepted, how many a box takes, and that each has its turn. Counted, not timed."""

import errno
import os
import selectors
import socket
import sys
import threading
from collections import Counter
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from types import SimpleNamespace

import pytest
from box_support import TIMEOUT, connect, inside
from rtde_support import RtdeClient, input_package

from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import PortError
from ur_emulator.host import served_box
from ur_emulator.host.ports.dashboard import DashboardAnswers
from ur_emulator.host.runtime import listener
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.runtime.listener import PAUSE, ClientLimits, ClientLines, Listener, SpareDescriptor


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
    budgets = replace(BUDGETS, clients_of_port=2, clients_of_address=3, clients=5)
    monkeypatch.setattr(listener, "BUDGETS", budgets)
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


# --- turns


@pytest.fixture
def answered(monkeypatch):
    """The dashboard commands that have been answered, in order."""
    names = []
    original = DashboardAnswers.answer

    def answer(answers, event, host):
        names.append(event.command.name)
        return original(answers, event, host)

    monkeypatch.setattr(DashboardAnswers, "answer", answer)
    return names


def test_a_client_that_sends_a_thousand_lines_does_not_keep_another_waiting(box, answered):
    with ExitStack() as stack:
        greedy, polite, other = (stack.enter_context(connect(box, "dashboard")) for _ in range(3))
        for sock in (greedy, polite, other):
            read_lines(sock, 1)
        with standing_still(box):
            for sock in (greedy, other):
                sock.sendall(b"robotmode\n" * 1000)
            polite.sendall(b"PolyscopeVersion\n")
        for sock, n in ((greedy, 1000), (other, 1000), (polite, 1)):
            assert len(read_lines(sock, n)) == n
    assert Counter(answered) == {"robotmode": 2000, "PolyscopeVersion": 1}
    assert answered.index("PolyscopeVersion") <= BUDGETS.client_work  # two turns at two units a line


def test_lines_of_a_client_that_is_gone_are_not_worked_off(box, answered):
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
        values.extend(value for command in commands for _, value in command.values)
        return tick(commands)

    monkeypatch.setattr(controller, "tick", counted)
    n = 500
    with connect(box, "rtde") as sock, connect(box, "rtde") as reader:
        client = RtdeClient(sock)
        recipe = client.own("input_double_register_0")
        types = client.input_types[recipe]
        watcher = RtdeClient(reader)
        watcher.subscribe("input_double_register_0")
        with standing_still(box):
            sock.sendall(b"".join(input_package(recipe, types, float(k)) for k in range(n)))
        while watcher.data()["input_double_register_0"] != n - 1:
            pass
    assert values == [float(k) for k in range(n)]
    assert max(taken) == 10


# --- accepting: some at a time, and what happens when descriptors are out


class Entrance:
    """A listening port that only remembers who came and what they sent; its loop turns when the test says so."""

    def __init__(self, loop, host="127.0.0.1", limits=None):
        self.connections, self.heard, self.notices, self.counts, self.socks = [], [], [], [], []
        self.loop, self.spare = loop, SpareDescriptor()
        self.port = Listener(
            loop, host, 0, self, set(), self.notices.append, pytest.fail, "dashboard", limits or ClientLimits(), self.spare
        )  # fmt: skip
        self.address = host, self.port.number

    def opened(self, connection):
        self.connections.append(connection)

    def received(self, connection, data):
        self.heard.append(data)

    def closed(self, connection):
        self.connections.remove(connection)

    def advance(self, now):
        self.counts.append(len(self.connections))
        if len(self.counts) > self._n_turns:
            self.loop.stop()
        return now

    def turn(self, n):
        """Let the loop take n turns; return how many clients there are before each, and after the last."""
        self._n_turns, self.counts = n, []
        self.loop._stopping = False
        self.loop.add(self)
        self.loop.run()
        self.loop.remove(self)
        return self.counts

    def run_for(self, duration):
        self.loop._stopping = False
        self.loop.call_later(duration, self.loop.stop, pytest.fail)
        self.loop.run()

    def connect(self):
        self.socks.append(socket.create_connection(self.address, timeout=TIMEOUT))
        return self.socks[-1]

    @property
    def is_watched(self):
        return self.port._sock in self.loop._selector.get_map()

    def close(self):
        for each in (*self.connections, self.port, *self.socks, self.spare):
            each.close()


@pytest.fixture
def enter():
    """Make an entrance, which is closed at the end."""
    with ExitStack() as stack:

        def make(**options):
            loop = EventLoop()
            stack.callback(loop.close)
            entrance = Entrance(loop, **options)
            stack.callback(entrance.close)
            return entrance

        yield make


def test_a_crowd_is_let_in_a_few_at_a_time(enter):
    entrance, few = enter(), BUDGETS.accepted_at_once
    n = 2 * few + 2
    for _ in range(n):
        entrance.connect()
    assert entrance.turn(4) == [0, few, 2 * few, n, n]


def test_two_hundred_clients_may_wait_to_be_let_in(enter):
    """Those beyond the backlog would wait for a second and more before they try again."""
    nobody_is_refused = SimpleNamespace(take=lambda host, port: "", release=lambda host, port: None)
    entrance, n = enter(limits=nobody_is_refused), min(200, socket.SOMAXCONN)
    entrance.socks = [socket.socket() for _ in range(n)]
    for sock in entrance.socks:
        sock.setblocking(False)
        assert sock.connect_ex(entrance.address) in (0, errno.EINPROGRESS)
    assert entrance.turn(n // BUDGETS.accepted_at_once)[-1] == n


class Troubled(socket.socket):
    """A listening socket that cannot accept while it is told why."""

    trouble = staticmethod(lambda: None)

    def accept(self):
        if (error := self.trouble()) is not None:
            raise error
        return super().accept()


NO_DESCRIPTORS = OSError(errno.EMFILE, "Too many open files")
GONE = ConnectionAbortedError(errno.ECONNABORTED, "Software caused connection abort")


@pytest.fixture
def troubled(enter, monkeypatch):
    """An entrance, and the reasons why it cannot accept."""
    with monkeypatch.context() as patch:
        patch.setattr(listener.socket, "socket", Troubled)
        return enter()


def test_without_descriptors_clients_are_closed_at_once_and_the_log_says_so_once(troubled, monkeypatch):
    """The one that is kept for it is given up for a moment."""
    spare = troubled.spare
    spare.take()
    monkeypatch.setattr(
        Troubled, "trouble", lambda sock: None if spare._descriptor is None else NO_DESCRIPTORS
    )
    socks = [troubled.connect() for _ in range(3)]
    troubled.turn(3)
    assert [sock.recv(1) for sock in socks] == [b"", b"", b""]
    number = troubled.port.number
    assert troubled.notices == [f"clients are turned away from dashboard port {number}: Too many open files"]
    assert os.fstat(spare._descriptor)


def test_a_port_that_cannot_even_refuse_pauses_instead_of_spinning(troubled, monkeypatch):
    monkeypatch.setattr(Troubled, "trouble", lambda sock: NO_DESCRIPTORS)
    assert troubled.is_watched
    troubled.port._accept(selectors.EVENT_READ)
    assert not troubled.is_watched
    seen = []
    troubled.loop.call_later(0.9 * PAUSE, lambda: seen.append(troubled.is_watched), pytest.fail)
    troubled.run_for(1.1 * PAUSE)
    assert seen == [False]
    assert troubled.is_watched
    troubled.port._accept(selectors.EVENT_READ)
    assert not troubled.is_watched
    troubled.port.close()
    troubled.run_for(1.1 * PAUSE)
    assert not troubled.loop._timers


def test_a_client_that_has_gone_while_it_waited_harms_nobody(troubled, monkeypatch):
    errors = [GONE]
    monkeypatch.setattr(Troubled, "trouble", lambda sock: errors.pop() if errors else None)
    troubled.connect()
    troubled.port._accept(selectors.EVENT_READ)
    assert len(troubled.connections) == 1
    assert not errors


BROWSERS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "CONNECT", "TRACE")


@pytest.mark.parametrize("words", [*BROWSERS, "POSTED = 1"])
def test_a_page_in_a_browser_reaches_no_port_that_speaks_no_http(enter, words):
    is_let_in = words not in BROWSERS
    data = words.encode() + (b"\n" if is_let_in else b" / HTTP/1.1\r\n\r\nstop program\n")
    entrance = enter()
    entrance.connect().sendall(data)
    entrance.turn(5)
    assert entrance.heard == [data] * is_let_in
    assert len(entrance.connections) == is_let_in
    refused = f"is a browser, which dashboard port {entrance.port.number} is not for"
    assert any(refused in line for line in entrance.notices) is not is_let_in


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not say what a client has read")
@pytest.mark.parametrize("buffer", [4096, 1 << 20])
def test_the_box_knows_whether_a_client_has_ever_read(enter, buffer):
    entrance, sock = enter(), socket.socket()
    entrance.socks.append(sock)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    sock.connect(entrance.address)
    entrance.turn(1)
    (connection,) = entrance.connections
    assert connection._sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)  # a silent one is asked
    while connection.send(bytes(1000)):
        pass
    for _ in range(50):  # bytes between the kernels count for neither side, until they have come
        entrance.turn(100)
        if not connection.has_read:
            break
    assert not connection.has_read
    assert sock.recv(1)
    while not connection.has_read:
        pass  # what it has confirmed late is counted twice until then


def test_an_address_of_another_machine_is_distinguished_from_a_taken_port(enter):
    with pytest.raises(PortError, match=r"192\.0\.2\.1 is not an address of this machine"):
        enter(host="192.0.2.1")
