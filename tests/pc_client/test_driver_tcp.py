"""The TCP transport on real sockets of this machine: what users meet as one-line errors."""

from __future__ import annotations

import socket
import struct
from types import SimpleNamespace

import pytest
from fake_robot import LAYOUT, FakeRobot

from pc_client.driver import realtime, transport
from pc_client.driver.realtime import RealtimeClient
from pc_client.driver.transport import PortTakenError, TcpNetwork, TcpTransport
from pc_client.errors import DriverError


@pytest.fixture
def pair():
    listener = socket.create_server(("127.0.0.1", 0))
    ours = TcpNetwork().connect("127.0.0.1", listener.getsockname()[1], 2.0)
    theirs, _ = listener.accept()
    listener.close()
    yield ours, theirs
    ours.close()
    theirs.close()


def test_bytes_go_in_both_directions_without_delay(pair):
    ours, theirs = pair
    ours.send(b"abc")
    assert theirs.recv(10) == b"abc"
    theirs.sendall(b"defg")
    assert ours.receive(1.0) == b"defg"
    assert ours.receive(0.0) is None
    assert ours.receive(0.001) is None
    assert ours.local_address == ours.peer_address == "127.0.0.1"
    assert ours._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_end_of_stream_and_broken_connection(pair):
    ours, theirs = pair
    # an abrupt close: reset instead of end
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    theirs.close()
    with pytest.raises(DriverError, match="closed the connection"):
        ours.receive(1.0)
    with pytest.raises(DriverError, match="cannot send"):
        ours.send(b"x")


def test_clean_end_of_stream(pair):
    ours, theirs = pair
    theirs.close()
    assert ours.receive(1.0) == b""


class Scripted:
    """A socket that takes so many bytes at a time; None: its buffer is full."""

    def __init__(self, real, takes):
        self.real, self.takes, self.taken = real, list(takes), b""
        self.fileno, self.close = real.fileno, real.close

    def send(self, data):
        n = self.takes.pop(0)
        if n is None:
            raise BlockingIOError
        self.taken += bytes(data[:n])
        return n


@pytest.mark.parametrize(
    "takes", [[28], [None, 28], [10, None, 18], [10, None, None, 5, 13], [None, 1, None, 27]]
)
def test_every_byte_is_sent_once_however_the_system_takes_them(pair, takes):
    ours, _ = pair
    ours._socket = scripted = Scripted(ours._socket, takes)
    message = bytes(range(28))
    ours.send(message)
    assert scripted.taken == message


def test_a_peer_that_takes_nothing_is_one_line_and_gets_nothing_after_half_a_message(pair, monkeypatch):
    ours, theirs = pair
    monkeypatch.setattr(transport, "_SEND_TIMEOUT", 0.01)
    with pytest.raises(DriverError, match=r"cannot send, the other end took nothing for 0\.01 s"):
        ours.send(bytes(1 << 24))
    with pytest.raises(DriverError):
        ours.send(b"stop")
    with pytest.raises(DriverError):
        ours.receive(0.0)
    taken = b""
    while data := theirs.recv(1 << 20):
        taken += data
    assert not taken.strip(b"\0")  # of the first message only, then the end


def test_connection_refused_names_address_and_cure():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(DriverError, match=rf"127\.0\.0\.1:{port} refuses the connection.*--port-base"):
        TcpNetwork().connect("127.0.0.1", port, 1.0)


def test_unknown_name():
    with pytest.raises(DriverError, match="cannot be looked up"):
        TcpNetwork().connect("no-such-robot.invalid", 30003, 1.0)


def test_listening_on_a_foreign_address_is_refused():
    with pytest.raises(DriverError, match=r"cannot listen on 192\.0\.2\.1"):
        TcpNetwork().listen("192.0.2.1", 0)


def test_a_port_is_listened_on_once_and_again_right_after_a_session():
    first = TcpNetwork().listen("127.0.0.1", 0)
    port = first.port
    with pytest.raises(PortTakenError, match=rf"127\.0\.0\.1:{port}: another program.*--reverse-port"):
        TcpNetwork().listen("127.0.0.1", port)
    # The end that closes first keeps the port in the system for a while.
    with socket.create_connection(("127.0.0.1", port)) as caller:
        first.accept(1.0).close()
        assert caller.recv(1) == b""
    first.close()
    again = TcpNetwork().listen("127.0.0.1", port)
    assert again.port == port
    again.close()


@pytest.mark.parametrize(("system", "shared"), [("posix", True), ("nt", False)])
def test_no_system_lets_a_second_program_listen(monkeypatch, system, shared):
    """On Windows the option that a POSIX system needs would let it."""
    monkeypatch.setattr(transport, "os", SimpleNamespace(name=system))
    listener = TcpNetwork().listen("127.0.0.1", 0)
    assert bool(listener._socket.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)) is shared
    with pytest.raises(PortTakenError):
        TcpNetwork().listen("127.0.0.1", listener.port)
    listener.close()


def test_time_comes_from_the_clock_that_is_fine_on_every_system(monkeypatch):
    """time.monotonic may have steps of 16 ms on Windows."""
    monkeypatch.setattr(transport, "time", SimpleNamespace(perf_counter=lambda: 5.001))
    assert TcpNetwork().now() == 5.001


def test_listener_accepts_and_times_out():
    listener = TcpNetwork().listen("127.0.0.1", 0)
    assert listener.accept(0.0) is None
    with socket.create_connection(("127.0.0.1", listener.port)) as caller:
        accepted = listener.accept(1.0)
        assert isinstance(accepted, TcpTransport)
        caller.sendall(b"hi")
        assert accepted.receive(1.0) == b"hi"
        accepted.close()
    listener.close()


def frames(n):
    robot = FakeRobot()
    out = []
    for _ in range(n):
        robot.tick += 1
        out.append(robot.frame())
    return out


def test_frames_split_and_merged_anyhow(pair):
    ours, theirs = pair
    client = RealtimeClient(ours, TcpNetwork(), time_waits=True)
    a, b, c = frames(3)
    theirs.sendall(a[:500])
    assert client.drain() is None
    theirs.sendall(a[500:])
    first = client.receive()
    assert [f.timestamp for f in first.new] == [pytest.approx(1001 * 0.008)]
    assert client.layout is LAYOUT
    theirs.sendall(a + b + b + c)
    second = client.receive()
    assert len(second.new) == 2
    assert second.n_heartbeats == 2
    assert second.latest is second.new[-1]
    theirs.sendall(c)
    third = client.receive()
    assert third.new == []
    assert third.n_heartbeats == 1
    assert client.drain() is None


def test_drain_takes_everything(pair):
    ours, theirs = pair
    client = RealtimeClient(ours, TcpNetwork(), time_waits=False)
    theirs.sendall(b"".join(frames(100)))
    total = 0
    while (arrival := client.drain()) is not None:
        total += len(arrival.new)
    assert total == 100
    assert client.last_stamp == pytest.approx(1100 * 0.008)


def test_no_frames_and_no_realtime_port(pair, monkeypatch):
    ours, theirs = pair
    client = RealtimeClient(ours, TcpNetwork(), time_waits=False)
    monkeypatch.setattr(realtime, "FRAME_TIMEOUT", 0.01)
    with pytest.raises(DriverError, match=r"no new realtime frame for 0\.01 s"):
        client.receive()
    theirs.sendall(b"HTTP/1.0 400 Bad Request\r\n\r\n")
    with pytest.raises(DriverError, match="no realtime frames"):
        client.receive()
