"""Accepting clients: some at a time, and what happens when descriptors are out."""

import errno
import os
import selectors
import socket

import pytest
from box_support import TIMEOUT

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import PortError
from ur_emulator.loop import listener
from ur_emulator.loop.event_loop import EventLoop
from ur_emulator.loop.listener import PAUSE, ClientLimits, Listener, SpareDescriptor


class Clients:
    """A port that only remembers who came."""

    def __init__(self):
        self.connections = []

    def opened(self, connection):
        self.connections.append(connection)

    def received(self, connection, data):
        pass

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


class ForAll(ClientLimits):
    """Nobody is refused."""

    def take(self, host, port):
        return ""

    def release(self, host, port):
        pass


def listen(loop, clients, notices=None, **options):
    notices = [] if notices is None else notices
    limits = options.pop("limits", None) or ClientLimits()
    return Listener(
        loop, "127.0.0.1", 0, clients, set(), notices.append, pytest.fail, "dashboard", limits, **options
    )


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
    port = listen(loop, clients, limits=ForAll())
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
    assert port in loop._services
    assert port.advance(10.0) == 10.0 + PAUSE
    assert port.advance(10.0 + 0.5 * PAUSE) == 10.0 + PAUSE
    assert not is_watched(loop, port)
    port.advance(10.0 + PAUSE)
    assert is_watched(loop, port)
    assert port not in loop._services
    port._accept(selectors.EVENT_READ)
    assert port.advance(20.0) == 20.0 + PAUSE
    close_all(port, clients)
    assert port not in loop._services


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
        Listener(loop, "192.0.2.1", 0, Clients(), set(), print, pytest.fail, "dashboard", ClientLimits())
