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


class Clients:
    """A port that only remembers who came and what they sent."""

    def __init__(self):
        self.connections = []
        self.heard = []

    def opened(self, connection):
        self.connections.append(connection)

    def received(self, connection, data):
        self.heard.append(data)

    def closed(self, connection):
        self.connections.remove(connection)


class Turns:
    """Notes how many clients there are before each turn of the loop; stops it after so many turns."""

    def __init__(self, loop, clients, n):
        self.counts = []
        self._loop, self._clients, self._n = loop, clients, n

    def advance(self, now):
        self.counts.append(len(self._clients.connections))
        if len(self.counts) > self._n:
            self._loop.stop()
        return now


@pytest.fixture
def loop():
    made = EventLoop()
    yield made
    made.close()


def listen(loop, clients, notices=None, **options):
    report = print if notices is None else notices.append
    who = options.get("host", "127.0.0.1"), 0, clients, set()
    limits, spare = options.get("limits") or ClientLimits(), options.get("spare") or SpareDescriptor()
    return Listener(loop, *who, report, pytest.fail, "dashboard", limits, spare)


def close_all(port, clients, *socks):
    for connection in tuple(clients.connections):
        connection.close()
    port.close()
    for sock in socks:
        sock.close()


def test_a_crowd_is_let_in_a_few_at_a_time(loop):
    clients, n = Clients(), 2 * BUDGETS.accepted_at_once + 2
    port = listen(loop, clients)
    socks = [socket.create_connection(("127.0.0.1", port.number), timeout=TIMEOUT) for _ in range(n)]
    turns = Turns(loop, clients, 4)
    loop.add(turns)
    loop.run()
    assert turns.counts == [0, BUDGETS.accepted_at_once, 2 * BUDGETS.accepted_at_once, n, n]
    close_all(port, clients, *socks)


def test_two_hundred_clients_may_wait_to_be_let_in(loop):
    """Those beyond the backlog would wait for a second and more before they try again."""
    clients = Clients()
    limits = SimpleNamespace(take=lambda host, port: "", release=lambda host, port: None)  # nobody is refused
    port = listen(loop, clients, limits=limits)
    n = min(200, socket.SOMAXCONN)
    socks = [socket.socket() for _ in range(n)]
    for sock in socks:
        sock.setblocking(False)
        assert sock.connect_ex(("127.0.0.1", port.number)) in (0, errno.EINPROGRESS)
    turns = Turns(loop, clients, n // BUDGETS.accepted_at_once)
    loop.add(turns)
    loop.run()
    assert turns.counts[-1] == n
    close_all(port, clients, *socks)


class NoDescriptors(socket.socket):
    """A listening socket of a process that has no descriptor for its clients, unless one is given up for them."""

    given_up = None

    def accept(self):
        if self.given_up is None or not self.given_up():
            raise OSError(errno.EMFILE, "Too many open files")
        return super().accept()


def test_without_descriptors_clients_are_closed_at_once_and_the_log_says_so_once(loop, monkeypatch):
    monkeypatch.setattr(listener.socket, "socket", NoDescriptors)
    clients, notices, spare = Clients(), [], SpareDescriptor()
    spare.take()
    monkeypatch.setattr(NoDescriptors, "given_up", lambda sock: spare._descriptor is None)
    port = listen(loop, clients, notices, spare=spare)
    monkeypatch.undo()
    socks = [socket.create_connection(("127.0.0.1", port.number), timeout=TIMEOUT) for _ in range(3)]
    loop.add(Turns(loop, clients, 3))
    monkeypatch.setattr(NoDescriptors, "given_up", lambda sock: spare._descriptor is None)
    loop.run()
    assert [sock.recv(1) for sock in socks] == [b"", b"", b""]
    assert notices == [
        f"clients are turned away from dashboard port {port.number}: Too many open files",
    ]
    assert os.fstat(spare._descriptor)
    spare.close()
    close_all(port, clients, *socks)


def test_a_port_that_cannot_even_refuse_pauses_instead_of_spinning(loop, monkeypatch):
    monkeypatch.setattr(listener.socket, "socket", NoDescriptors)
    clients = Clients()
    port = listen(loop, clients)
    assert is_watched(loop, port)
    port._accept(selectors.EVENT_READ)
    assert not is_watched(loop, port)
    seen = []
    loop.call_later(0.9 * PAUSE, lambda: seen.append(is_watched(loop, port)), pytest.fail)
    run_for(loop, 1.1 * PAUSE)
    assert seen == [False]
    assert is_watched(loop, port)
    port._accept(selectors.EVENT_READ)
    assert not is_watched(loop, port)
    close_all(port, clients)
    run_for(loop, 1.1 * PAUSE)
    assert not loop._timers


def run_for(loop, duration):
    loop._stopping = False
    loop.call_later(duration, loop.stop, pytest.fail)
    loop.run()


def is_watched(loop, port):
    return port._sock in loop._selector.get_map()


def test_a_client_that_has_gone_while_it_waited_harms_nobody(loop, monkeypatch):
    class Gone(socket.socket):
        left = 1

        def accept(self):
            if Gone.left:
                Gone.left -= 1
                raise ConnectionAbortedError(errno.ECONNABORTED, "Software caused connection abort")
            return super().accept()

    monkeypatch.setattr(listener.socket, "socket", Gone)
    clients = Clients()
    port = listen(loop, clients)
    monkeypatch.undo()
    sock = socket.create_connection(("127.0.0.1", port.number), timeout=TIMEOUT)
    port._accept(selectors.EVENT_READ)
    assert len(clients.connections) == 1
    close_all(port, clients, sock)


@pytest.mark.parametrize(
    ("data", "is_let_in"), [(b"POST / HTTP/1.1\r\n\r\nstop program\n", False), (b"POSTED = 1\n", True)]
)
def test_a_page_in_a_browser_reaches_no_port_that_speaks_no_http(loop, data, is_let_in):
    clients, notices = Clients(), []
    port = listen(loop, clients, notices)
    with socket.create_connection(("127.0.0.1", port.number), timeout=TIMEOUT) as sock:
        sock.sendall(data)
        loop.add(Turns(loop, clients, 5))
        loop.run()
        assert clients.heard == [data] * is_let_in
        assert len(clients.connections) == is_let_in
        refused = f"is a browser, which dashboard port {port.number} is not for"
        assert any(refused in line for line in notices) is not is_let_in
    close_all(port, clients)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not say what a client has read")
@pytest.mark.parametrize("buffer", [4096, 1 << 20])
def test_the_box_knows_whether_a_client_has_ever_read(loop, buffer):
    clients = Clients()
    port = listen(loop, clients)
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        sock.connect(("127.0.0.1", port.number))
        loop.add(Turns(loop, clients, 1))
        loop.run()
        (connection,) = clients.connections
        while connection.send(bytes(1000)):
            pass
        for _ in range(50):  # bytes between the kernels count for neither side, until they have come
            loop.add(Turns(loop, clients, 100))
            loop.run()
            if not connection.has_read:
                break
        assert not connection.has_read
        assert sock.recv(1)
        while not connection.has_read:
            pass  # what it has confirmed late is counted twice until then
    close_all(port, clients)


def test_silent_clients_are_asked_whether_they_are_still_there(loop):
    clients = Clients()
    port = listen(loop, clients)
    sock = socket.create_connection(("127.0.0.1", port.number), timeout=TIMEOUT)
    loop.add(Turns(loop, clients, 1))
    loop.run()
    (connection,) = clients.connections
    assert connection._sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    close_all(port, clients, sock)


def test_an_address_of_another_machine_is_distinguished_from_a_taken_port(loop):
    with pytest.raises(PortError, match=r"192\.0\.2\.1 is not an address of this machine"):
        listen(loop, Clients(), host="192.0.2.1")
