"""Remote procedures of programs: handles on the bench, then a box, a server of the standard library and bad servers.

What values become is in `chunks/rpc.script`, what is no answer of XML-RPC in `test_protocol_xmlrpc.py`.
"""

import gzip
import socket
import threading
import xmlrpc.client
from contextlib import contextmanager, suppress
from dataclasses import replace
from socketserver import ThreadingMixIn
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest
from box_support import TIMEOUT, Bench, FakeNetwork, MessageReader, connect, inside, listening_socket, program

from protocol.primary.messages import KeyMessage, RuntimeExceptionMessage, TextMessage
from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.host.script_network import xmlrpc as module
from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.controller.io import network
from ur_emulator.machine.controller.io.network import CallEnded
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.scripting import rpc_builtins


class RpcNetwork(FakeNetwork):
    """Keeps the calls: (number, server, method, arguments), and the servers whose connection was closed."""

    def __init__(self):
        super().__init__()
        self.calls, self.closed = [], []

    def call(self, request, method, arguments):
        self.calls.append((request.call, request.server, method, arguments))

    def close_server(self, server):
        self.closed.append(server)


class RpcBench(Bench):
    """A bench whose remote procedures are the test."""

    def __init__(self, **kwargs):
        super().__init__(network=RpcNetwork(), **kwargs)

    def call(self, arguments=""):
        self.start(
            f'def p():\n  h = rpc_factory("xmlrpc", "http://x:1")\n  x = h.work({arguments})\n'
            '  textmsg("got ", x)\nend\n'
        )

    def answer(self, value):
        """End the last call, and give the program a cycle."""
        self.network._arrivals.append(CallEnded(self.network.calls[-1][0], value, ""))
        self.tick()

    @property
    def texts(self):
        return [event.text for event in self.events if hasattr(event, "text")]


def test_a_text_is_utf_8_in_a_program():
    bench = RpcBench()
    bench.call('"\xc3\xa9", "\xe9"')
    assert bench.network.calls[0][3] == ["\u00e9", "\xe9"]  # what is none goes out byte by byte
    bench.answer("\u00e9")
    assert bench.texts[-1] == "got \xc3\xa9"


@pytest.mark.parametrize("result", [object(), [[1], [1, 2]]])
def test_a_result_without_counterpart_ends_the_program_and_its_connection(result):
    bench = RpcBench()
    bench.call()
    bench.answer(result)
    assert any("the result" in text or "rows of equal length" in text for text in bench.texts)
    assert not bench.controller.programs.is_running
    assert bench.network.closed == [bench.network.calls[0][1]]


@pytest.mark.parametrize(("n", "told"), [(255, "got {"), (256, "has no counterpart in a script")])
def test_members_of_a_struct_have_names_of_a_script(n, told):
    bench = RpcBench(robot="ur5e", generation=E_SERIES)
    bench.call()
    bench.answer({"m" * n: 1})
    assert told in bench.texts[-1]


def test_a_program_that_is_stopped_closes_what_it_opened():
    bench = RpcBench()
    bench.call()
    bench.tick(1, StopProgram())
    assert bench.network.closed == [bench.network.calls[0][1]]
    bench.answer(1)
    assert not any(text.startswith("got") for text in bench.texts)


@pytest.mark.parametrize(("generation", "cycles"), [(CB3, 1), (E_SERIES, 4)])
def test_so_many_values_are_sent_in_8_ms_and_a_longer_call_takes_the_room_of_the_next_cycles(
    generation, cycles, monkeypatch
):
    monkeypatch.setattr(rpc_builtins, "BUDGETS", replace(BUDGETS, remote_values_sent=100))
    bench = RpcBench(generation=generation)
    bench.start(
        'def p():\n  thread t():\n    h.second([1])\n  end\n  h = rpc_factory("xmlrpc", "http://10.0.0.1/")\n'
        "  x = [0" + ", 0" * 98 + "]\n  sync()\n  run t()\n  h.first(x)\nend\n"
    )
    bench.tick(cycles)
    assert [method for _, _, method, _ in bench.network.calls] == ["first"]
    bench.tick()
    assert [method for _, _, method, _ in bench.network.calls] == ["first", "second"]


# --- over real sockets


class Handler(SimpleXMLRPCRequestHandler):
    """Keeps connections open, as the box does."""

    protocol_version = "HTTP/1.1"
    connections: list = []  # noqa: RUF012 - of the server that runs

    def setup(self):
        super().setup()
        self.connections.append(self.client_address)


class Server(ThreadingMixIn, SimpleXMLRPCServer):
    """Serves in a thread until it is closed."""

    daemon_threads = True


@contextmanager
def procedures(**functions):
    Handler.connections = []
    with Server(("127.0.0.1", 0), requestHandler=Handler, logRequests=False, allow_none=True) as server:
        for name, function in functions.items():
            server.register_function(function, name)
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        try:
            yield server.server_address[1]
        finally:
            server.shutdown()
            thread.join(TIMEOUT)


@pytest.fixture(scope="module")
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, control_port=0) as running:
        yield running


def send(sock, port, body):
    sock.sendall(program(f'h = rpc_factory("xmlrpc", "http://127.0.0.1:{port}/RPC2")', *body).encode())


def test_calls_go_there_and_back_on_one_connection(box):
    with procedures(add=lambda a, b: a + b, shift=lambda pose, by: {**pose, "x": pose["x"] + by}) as port:
        with connect(box, "primary") as sock:
            reader = MessageReader(sock)
            send(
                sock, port, ("textmsg(h.add(1, 2))", "q = h.shift(p[1, 0, 0, 0, 0, 0], 0.5)", "textmsg(q[0])")
            )
            assert [reader.message(TextMessage).text for _ in range(2)] == ["3", "1.5"]
            assert reader.message(KeyMessage).title.endswith(("STARTED", "STOPPED"))
        assert len(Handler.connections) == 1


def fail(box, port, body=("h.work()",)):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(sock, port, body)
        return reader.message(RuntimeExceptionMessage)


def http(body=b"", *headers, status="200 OK", length=None):
    """An HTTP answer."""
    lines = [f"HTTP/1.1 {status}", *headers, f"Content-Length: {len(body) if length is None else length}"]
    return "\r\n".join((*lines, "", "")).encode() + body


def value(inside):
    return (
        f"<methodResponse><params><param><value>{inside}</value></param></params></methodResponse>".encode()
    )


FAULT = xmlrpc.client.dumps(xmlrpc.client.Fault(1, "no \u20ac\n1")).encode()


@contextmanager
def answering(answer, then=b"", closes=True):
    """A server that answers every call with the same bytes, and may go on with others until the box has enough."""
    served = []
    with listening_socket() as server:

        def serve():
            while True:
                try:
                    peer, _ = server.accept()
                except OSError:
                    return
                served.append(peer)
                with peer, suppress(OSError):
                    while not peer.recv(65536).endswith(b"</methodCall>\n"):
                        pass
                    peer.sendall(answer)
                    while then:
                        peer.sendall(then)
                    while not closes and peer.recv(65536):
                        pass

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield server.getsockname()[1], served
        server.shutdown(socket.SHUT_RDWR)
    thread.join(TIMEOUT)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (http(b"abc"), "not XML"),
        (b"hello\r\n\r\n", "makes no sense"),
        (b"", "closed the connection"),
        (http(value("<array><data>" + "<value/>" * 6000 + "</data></array>")), "too many values"),
        (http(gzip.compress(bytes(1 << 20)), "Content-Encoding: gzip"), "packed with gzip"),
        (http(gzip.compress(value(""))), "not XML"),
        (http(length=1 << 30), "longer than 262144 bytes"),
        (http(length="-1"), "makes no sense"),
        (http(value(""), length=5000), "makes no sense"),
        (http(status="301 Moved"), "answered 301 Moved"),
        (http(status="500 \x1b[2J"), "remote procedure call failed"),
        (http(FAULT), "\xe2\x82\xac 1"),
        (b"HTTP/1.1 100 Continue\r\n\r\n" * 20_000, "longer than"),
        (b"HTTP/1.1 200 OK\r\nX: " + b"x" * 100_000, "makes no sense"),
        (b"HTTP/1.1 101 Switching Protocols\r\n\r\n", "remote procedure call failed"),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_an_answer_that_is_none_is_a_run_time_error(box, answer, words):
    with answering(answer) as (port, _):
        message = fail(box, port)
    assert message.line == 3
    assert message.text.startswith("work: remote procedure call failed: ")
    assert words in message.text
    assert "\n" not in message.text


@pytest.mark.parametrize(
    ("answer", "then"),
    [
        (b"HTTP/1.1 200 OK\r\n\r\n" + b"<methodResponse>", b" " * 65536),
        (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n", b"1\r\n \r\n" * 1000),
        (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n", b"X: x\r\n" * 1000),
        (b"", b"HTTP/1.1 100 Continue\r\n\r\n" * 1000),
        (b"HTTP/1.1 200 OK\r\n", b"X: x\r\n" * 1000),
    ],
    ids=["body", "chunks", "trailer", "continue", "header"],
)
def test_an_answer_without_end_is_a_run_time_error(box, answer, then, monkeypatch):
    monkeypatch.setattr(module, "BUDGETS", replace(BUDGETS, remote_answer_bytes=30_000))
    with answering(answer, then) as (port, _):
        text = fail(box, port).text
    assert "longer than" in text or "makes no sense" in text


def test_an_answer_that_comes_too_slowly_is_a_run_time_error(box, monkeypatch):
    monkeypatch.setattr(module, "BUDGETS", replace(BUDGETS, remote_answer_time=0.05))
    with answering(http(value(""))[:-4], closes=False) as (port, _):
        assert "takes longer than 0.05 s" in fail(box, port).text


@pytest.mark.parametrize(
    "url",
    [
        "http://h:99999999", "http://[::1", "http://h:abc", "http://user:word@127.0.0.1:8080/", "ftp://127.0.0.1/",
        "https://127.0.0.1/", "http://", "://", "http://127.0.0.1:80 80/", "http://b\xfccher.example/", "http://a..b/",
        "http://127.0.0.1/a b", "http://127.0.0.1:0/", "http://-1/", "http://[v1.x]/", "http://" + "a" * 300 + "/",
    ],
)  # fmt: skip
def test_an_address_that_is_none_is_a_run_time_error(box, url):
    with connect(box, "primary") as sock:
        sock.sendall(f'def p():\n  h = rpc_factory("xmlrpc", "{url}")\n  h.work()\nend\n'.encode("latin-1"))
        message = MessageReader(sock).message(RuntimeExceptionMessage)
    assert message.line == 3
    assert "is not an address" in message.text or "does not answer" in message.text


def test_the_control_port_is_closed_to_remote_procedures(box):
    assert "control API" in fail(box, box.control_port).text


def test_a_text_with_a_control_character_is_not_sent_and_who_does_not_run_does_not_answer(box):
    with answering(http(value(""))) as (port, served):
        assert "XML does not have it" in fail(box, port, ('h.work("\x1b")',)).text
        assert not served
    assert "does not answer" in fail(box, port).text


def test_an_answer_that_nobody_asked_for_is_not_taken_for_that_of_the_next_call(box):
    with answering(http(value("first")) + http(value("forged")), closes=False) as (port, served):
        with connect(box, "primary") as sock:
            reader = MessageReader(sock)
            send(sock, port, ("textmsg(h.a())", "sleep(0.1)", "textmsg(h.b())"))
            assert [reader.message(TextMessage).text for _ in range(2)] == ["first", "first"]
            sock.sendall(b"stop program\n")
        assert len(served) == 2


def test_handles_in_a_loop_share_a_few_connections(box, monkeypatch):
    monkeypatch.setattr(network, "BUDGETS", replace(BUDGETS, remote_connections=3))
    with procedures(one=lambda: 1) as port, connect(box, "primary") as sock:
        most = 0
        make = f'k = rpc_factory("xmlrpc", "http://127.0.0.1:{port}/RPC2")'
        send(sock, port, ("i = 0", "while i < 30:", make, "k.one()", "i = i + 1", "end", 'textmsg("done")'))
        while not [entry for entry in box.log if entry.text == "done"]:
            most = max(most, len(inside(box)._network._remotes._servers))
        MessageReader(sock).message(TextMessage)
        assert len(Handler.connections) == 30
    assert 1 <= most <= 3


def test_more_calls_at_the_same_time_than_connections_fail(box, monkeypatch):
    monkeypatch.setattr(network, "BUDGETS", replace(BUDGETS, remote_connections=2))
    with listening_socket() as server, connect(box, "primary") as sock:
        url = f"http://127.0.0.1:{server.getsockname()[1]}/RPC2"
        threads = [
            f'thread t{i}():\n    k = rpc_factory("xmlrpc", "{url}")\n    k.work()\n  end' for i in range(3)
        ]
        send(sock, server.getsockname()[1], (*threads, *[f"run t{i}()" for i in range(3)], "sleep(9)"))
        text = MessageReader(sock).message(RuntimeExceptionMessage).text
    assert "2 remote procedures of other handles are being called" in text


def test_calls_are_made_again_after_an_error_of_ours(box, monkeypatch):
    def break_down(reader, data):
        raise KeyError("broken")

    with procedures(work=lambda: 1) as port:
        for _ in range(2):
            with monkeypatch.context() as patch:
                patch.setattr(module.AnswerReader, "feed", break_down)
                assert "KeyError" in fail(box, port).text
            with connect(box, "primary") as sock:
                send(sock, port, ("textmsg(h.work())",))
                assert MessageReader(sock).message(TextMessage).text == "1"


def test_calls_leave_no_thread_and_no_connection(box):
    before = set(threading.enumerate())
    with procedures(one=lambda: 1) as port, connect(box, "primary") as sock:
        send(sock, port, ("textmsg(h.one())",))
        reader = MessageReader(sock)
        reader.message(TextMessage)
        while not reader.message(KeyMessage).title.endswith("STOPPED"):
            pass
    # The server of this test answers each connection in a thread, which may outlast the connection.
    since = [thread.name for thread in set(threading.enumerate()) - before]
    assert not [name for name in since if "process_request_thread" not in name]
    assert not any(one.is_open for one in tuple(inside(box)._network._buffers.connections))


def test_stopping_the_program_breaks_off_a_call_that_nobody_answers(box):
    with listening_socket() as server, connect(box, "primary") as sock:
        send(sock, server.getsockname()[1], ("h.work()",))
        peer, _ = server.accept()
        with peer:
            peer.settimeout(TIMEOUT)
            assert peer.recv(65536).startswith(b"POST")
            sock.sendall(b"stop program\n")
            while peer.recv(65536):
                pass  # what is left of the request; then the end, or this test times out
