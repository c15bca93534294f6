"""What the scripts of a box open to the outside, over real sockets: budgets of a box, and what they must not reach."""

import socket
import threading
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace

import pytest
from box_support import (
    TIMEOUT,
    Bench,
    FakeNetwork,
    MessageReader,
    connect,
    inside,
    listening_socket,
    printed_by,
    program,
)
from hypothesis import given
from hypothesis import strategies as st

from protocol.primary.messages import RuntimeExceptionMessage, TextMessage
from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.script_network import addresses, loop_network, modbus_units, sockets
from ur_emulator.host.script_network.addresses import LookUp, LookUps
from ur_emulator.machine.controller.io import network
from ur_emulator.machine.controller.io.network import ScriptSocket
from ur_emulator.machine.scripting import socket_builtins
from ur_emulator.machine.scripting.socket_builtins import TextSearch

USERS = (addresses, loop_network, network, sockets, socket_builtins)


def lower(monkeypatch, **budgets):
    for module in USERS:
        monkeypatch.setattr(module, "BUDGETS", replace(BUDGETS, **budgets))


@pytest.fixture
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, control_port=0) as running:
        yield running


def log_lines(box, words):
    return [entry.text for entry in box.log if words in entry.text]


class OwnPorts(FakeNetwork):
    """Every connection leads to the box itself."""

    def make_socket(self, number, host, port):
        sock = super().make_socket(number, host, port)
        sock.is_own = True
        return sock


@pytest.mark.parametrize(
    "read", ['socket_read_byte_list(6, "g", 0.1)', 'socket_read_string("g", timeout=0.1)']
)
def test_time_waits_for_an_own_port_only_behind_a_question(read):
    bench = Bench(network=OwnPorts())
    opened, ask = 'socket_open("127.0.0.1", 63352, "g")', 'socket_send_line("GET STA", "g")'
    bench.start(program(opened, f'textmsg("first ", {read})', ask, f'textmsg("then ", {read})'))
    bench.tick()
    assert not bench.controller.waits_outside
    while not bench.texts:
        bench.tick()
    assert bench.controller.waits_outside
    bench.network.sockets[0].inbox += b"STA 3\n"
    bench.tick(2)
    assert bench.texts[1].startswith("then ")


# --- how many


def test_beyond_the_budget_of_connections_an_open_returns_false_and_says_why(box, monkeypatch):
    lower(monkeypatch, outgoing_connections=3)
    with listening_socket() as server:
        port = server.getsockname()[1]
        opens = [f'textmsg(socket_open("127.0.0.1", {port}, "s{i}"))' for i in range(5)]
        again = ('socket_close("s0")', f'textmsg(socket_open("127.0.0.1", {port}, "again"))')
        said = printed_by(box, *opens, *again, n=6)
    assert said == ["True"] * 3 + ["False"] * 2 + ["True"]
    assert len(log_lines(box, "the box has 3 connections, close one first")) == 2


def test_opens_that_fail_at_once_take_a_cycle_each():
    bench = Bench()
    bench.network.refuse = True
    bench.start('def f():\n  while True:\n    socket_open("10.0.0.1", 1)\n  end\nend\n')
    bench.tick(10)
    assert len(bench.network.sockets) <= 12
    assert bench.controller.programs.is_running


# --- names


class Resolver:
    """A name server that answers when the test says so."""

    def __init__(self, monkeypatch):
        self.answer = threading.Event()
        self.asked = []
        self.threads = set()
        self._begun = threading.Semaphore(0)
        monkeypatch.setattr(
            addresses, "socket", SimpleNamespace(**{**vars(socket), "getaddrinfo": self._ask})
        )

    def wait_for(self, n):
        """Wait until n more names are being looked up."""
        assert all(self._begun.acquire(timeout=TIMEOUT) for _ in range(n))

    def end(self):
        self.answer.set()
        for thread in tuple(self.threads):
            thread.join(TIMEOUT)

    def _ask(self, host, *_):
        self.asked.append(host)
        self.threads.add(threading.current_thread())
        self._begun.release()
        assert self.answer.wait(TIMEOUT)
        return [(0, 0, 0, "", ("127.0.0.1", 0))]


def test_a_box_has_a_share_of_the_look_ups_and_forgets_those_whose_script_is_gone(monkeypatch):
    resolver = Resolver(monkeypatch)
    names = LookUps()
    found = []
    asked = [LookUp("box", f"name{i}", found.append) for i in range(20)]
    assert all(names.start(one) for one in asked)
    other = LookUp("other box", "elsewhere", found.append)
    assert names.start(other)
    resolver.wait_for(3)
    for one in asked[2:]:
        names.forget(one)
    resolver.end()
    assert sorted(resolver.asked) == ["elsewhere", "name0", "name1"]
    assert found == ["127.0.0.1"] * 3


def test_a_thousand_names_wait_in_a_few_threads_and_none_is_lost(monkeypatch):
    monkeypatch.setattr(addresses, "BUDGETS", replace(BUDGETS, look_ups_waiting=100))
    resolver = Resolver(monkeypatch)
    names = LookUps()
    done = threading.Semaphore(0)
    asked = [LookUp(i // 100, f"name{i}", lambda address: done.release()) for i in range(1000)]
    assert all(names.start(one) for one in asked)
    resolver.answer.set()
    assert all(done.acquire(timeout=TIMEOUT) for _ in asked)
    assert len(resolver.threads) <= BUDGETS.look_up_threads
    assert sorted(resolver.asked) == sorted(one.host for one in asked)


def test_beyond_the_queue_and_without_threads_a_look_up_is_refused(monkeypatch):
    resolver = Resolver(monkeypatch)
    names = LookUps()
    asked = [LookUp("box", "name", lambda address: None) for _ in range(BUDGETS.look_ups_waiting + 3)]
    assert not all(names.start(one) for one in asked)
    resolver.wait_for(BUDGETS.look_ups_at_once)
    for one in asked:
        names.forget(one)
    resolver.end()

    def start(self):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", start)
    assert not LookUps().start(asked[0])


def test_a_script_that_waits_for_a_name_may_be_stopped(box, monkeypatch):
    resolver = Resolver(monkeypatch)
    with connect(box, "secondary") as sock:
        sock.sendall(program('socket_open("name.example", 80)').encode())
        resolver.wait_for(1)
        sock.sendall(b"stop program\n")
        assert printed_by(box, 'textmsg("next")') == ["next"]
    resolver.end()
    assert printed_by(box, 'textmsg("on")') == ["on"]


def test_names_that_are_not_known_or_not_looked_up_are_not_connected(box, monkeypatch):
    assert printed_by(box, 'textmsg(socket_open("no such name", 80))') == ["False"]
    monkeypatch.setattr(
        sockets, "LOOK_UPS", SimpleNamespace(start=lambda one: False, forget=lambda one: None)
    )
    assert printed_by(box, 'textmsg(socket_open("name.example", 80))') == ["False"]
    assert log_lines(box, "the name is not known")
    assert log_lines(box, "names are being looked up already")


# --- bytes


def flood(server, n, data):
    """Accept n callers; each gets all of the data as fast as it takes it."""
    senders = []
    for _ in range(n):
        peer, _ = server.accept()

        def send(peer=peer):
            with peer:
                peer.sendall(data)

        senders.append(threading.Thread(target=send, daemon=True))
        senders[-1].start()
    return senders


COUNT_LINES = """k = 0
while k < {n}:
  i = 0
  while i < {lines}:
    if to_num(socket_read_line(str_cat("s", to_str(k)))) != i:
      textmsg("wrong ", i)
      halt
    end
    i = i + 1
  end
  k = k + 1
end
textmsg("all")"""


def test_an_inbox_is_bounded_and_held_back_is_not_lost(box, monkeypatch):
    lower(monkeypatch, inbox_bytes=5_000)
    monkeypatch.setattr(sockets, "_READ_SIZE", 1_000)
    n, lines = 2, 2_000
    data = b"".join(b"%07d\n" % i for i in range(lines))
    network = inside(box)._network
    with listening_socket() as server, connect(box, "primary") as sock:
        opens = [f'socket_open("127.0.0.1", {server.getsockname()[1]}, "s{i}")' for i in range(n)]
        sock.sendall(
            program(*opens, 'textmsg("open")', "sleep(1)", COUNT_LINES.format(n=n, lines=lines)).encode()
        )
        senders = flood(server, n, data)
        reader = MessageReader(sock)
        assert reader.message(TextMessage).text == "open"
        most = 0
        while not (said := log_lines(box, "all") + log_lines(box, "wrong")):
            most = max([most, *(one._unread for one in tuple(network._buffers.connections))])
        assert said == ["all"]
        assert 5_000 <= most < 6_000
        for sender in senders:
            sender.join(TIMEOUT)


def test_all_outboxes_together_are_bounded(box, monkeypatch):
    lower(monkeypatch, all_unsent_bytes=100_000)
    n = 8
    with listening_socket() as server, connect(box, "primary") as sock:
        opens = [f'socket_open("127.0.0.1", {server.getsockname()[1]}, "s{i}")' for i in range(n)]
        double = ('s = "0123456789abcdef"', "i = 0", "while i < 10:", "s = s + s", "i = i + 1", "end")
        fill = [f'while socket_send_string(s, "s{i}"):\n    sync()\n  end' for i in range(n)]
        sock.sendall(program(*opens, *double, *fill, 'textmsg("full")', "sleep(5)").encode())
        with ExitStack() as peers:
            for _ in range(n):
                peers.enter_context(server.accept()[0])
            reader = MessageReader(sock)
            while reader.message(TextMessage).text != "full":
                pass
            held = [len(one._outbox) for one in tuple(inside(box)._network._buffers.connections)]
            assert sum(held) == inside(box)._network._buffers.unsent
            assert 0 < sum(held) <= 100_000
            sock.sendall(b"stop program\n")
            peers.close()
        sock.sendall(program('textmsg("next")').encode())
        while reader.message(TextMessage).text != "next":
            pass
    assert inside(box)._network._buffers.unsent == 0


# --- reading


@given(
    st.binary(max_size=60).map(lambda data: bytes(b"ab;"[byte % 3] for byte in data)),
    st.lists(st.integers(0, 60)),
    st.sampled_from([b"", b"a", b"ab"]),
    st.sampled_from([b";", b"a;", b"b;;"]),
)
def test_a_search_finds_the_same_however_the_bytes_come(data, cuts, start, end):
    begin = data.find(start) + len(start) if start in data else -1
    stop = data.find(end, begin) if begin >= 0 else -1
    expected = stop + len(end) if stop >= 0 else 0
    sock, search = ScriptSocket(1), TextSearch(start, end)
    found = 0
    for before, after in zip([0, *sorted(cuts)], [*sorted(cuts), len(data)], strict=True):
        sock.inbox += data[before:after]
        found = search.find(sock)
    assert found == expected
    assert search.n_searched <= len(data) + (len(cuts) + 2) * (len(start) + len(end))


def test_a_search_begins_again_when_another_thread_has_read():
    sock = ScriptSocket(1)
    sock.inbox += b"abcdef"
    search = TextSearch(b"", b";")
    assert not search.find(sock)
    assert sock.take(5) == b"abcde"
    sock.inbox += b";rest of it"
    assert search.find(sock) == 2


class CountingInbox(bytearray):
    """Counts the bytes that searches look at."""

    searched = 0

    def find(self, mark, begin=0):
        found = super().find(mark, begin)
        CountingInbox.searched += (len(self) if found < 0 else found) - begin
        return found


@pytest.mark.parametrize("is_open", [True, False], ids=["open", "closed by the peer"])
def test_reads_that_find_no_end_in_a_full_inbox_go_on_in_later_cycles(is_open):
    bench = Bench()
    bench.start(
        'def f():\n  socket_open("10.0.0.1", 1)\n  sync()\n  while True:\n'
        '    socket_read_string(suffix="x", timeout=0.001)\n    socket_read_string(suffix="y", timeout=0.001)\n'
        "    socket_read_ascii_float(1, timeout=0.001)\n  end\nend\n"
    )
    bench.tick()
    (peer,) = bench.controller.state.network._sockets.values()
    peer.inbox = CountingInbox(b"z" * (BUDGETS.inbox_bytes - 1))
    peer.is_open = is_open
    bench.tick(2)
    CountingInbox.searched = 0
    bench.tick(20)
    assert bench.controller.programs.is_running
    assert BUDGETS.search_bytes < CountingInbox.searched <= 20 * (BUDGETS.search_bytes + BUDGETS.inbox_bytes)


def test_a_line_that_comes_byte_by_byte_is_looked_at_once():
    bench = Bench()
    bench.start(
        'def f():\n  socket_open("10.0.0.1", 1)\n  textmsg(str_len(socket_read_line(timeout=0)))\nend\n'
    )
    bench.tick()
    (peer,) = bench.controller.state.network._sockets.values()
    peer.inbox = CountingInbox()
    bench.tick()
    CountingInbox.searched = 0
    for _ in range(300):
        peer.inbox += b"z"
        bench.tick()
    peer.inbox += b"\n"
    bench.tick(2)
    assert bench.texts == ["300"]
    assert CountingInbox.searched <= 2 * 301


# --- the control API


def test_scripts_cannot_connect_to_the_control_port(box):
    hosts = ["127.0.0.1", "127.1", "127.0.0.9", "0.0.0.0", "0", "2130706433", "0x7f000001", "localhost"]
    opens = [f'textmsg(socket_open("{host}", {box.control_port}))' for host in hosts]
    assert printed_by(box, *opens, n=len(hosts)) == ["False"] * len(hosts)
    lines = log_lines(box, "Not able to open socket")
    assert len(lines) == len(hosts)
    assert all("control API" in line for line in lines)


def test_nor_to_that_of_another_box_of_the_process_until_it_is_closed(box):
    with ControlBox(in_process=True, port_base=None, control_port=0) as other:
        port = other.control_port
        assert printed_by(box, f'textmsg(socket_open("127.0.0.1", {port}))') == ["False"]
    with socket.create_server(("127.0.0.1", port)):
        assert printed_by(box, f'textmsg(socket_open("127.0.0.1", {port}))') == ["True"]


def test_nor_through_a_modbus_unit(box, monkeypatch):
    monkeypatch.setattr(modbus_units, "TOLERANCE", 0.05)
    with connect(box, "primary") as sock:
        add = f'modbus_add_signal("127.0.0.1:{box.control_port}", 255, 1, 2, "s")'
        wait = ("while True:", '  modbus_get_signal_status("s", False)', "  sync()", "end")
        sock.sendall(program(add, *wait).encode())
        assert "control API" in MessageReader(sock).message(RuntimeExceptionMessage).text
