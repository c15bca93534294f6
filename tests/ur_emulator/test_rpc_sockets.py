"""XML-RPC over real sockets: a box, a server of the standard library, and servers that misbehave."""

import threading
from contextlib import contextmanager
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest
from box_support import TIMEOUT, MessageReader, connect, listening_socket

from protocol.primary.messages import KeyMessage, RuntimeExceptionMessage, TextMessage
from ur_emulator.emulator import ControlBox


class Handler(SimpleXMLRPCRequestHandler):
    """Keeps connections open, as the box does."""

    protocol_version = "HTTP/1.1"
    connections: list = []  # noqa: RUF012 - of the server that runs

    def setup(self):
        super().setup()
        self.connections.append(self.client_address)


class Server(SimpleXMLRPCServer):
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
    with ControlBox(pace="lockstep", port_base=None) as running:
        yield running


def send(sock, port, body):
    lines = "".join(f"  {line}\n" for line in body)
    sock.sendall(
        f'def p():\n  h = rpc_factory("xmlrpc", "http://127.0.0.1:{port}/RPC2")\n{lines}end\n'.encode()
    )


def test_calls_go_there_and_back_on_one_connection(box):
    with procedures(add=lambda a, b: a + b, shift=lambda pose, by: {**pose, "x": pose["x"] + by}) as port:
        with connect(box, "primary") as sock:
            reader = MessageReader(sock)
            send(
                sock,
                port,
                ("textmsg(h.add(1, 2))", "q = h.shift(p[1, 0, 0, 0, 0, 0], 0.5)", "textmsg(q[0])"),
            )
            assert [reader.message(TextMessage).text for _ in range(2)] == ["3", "1.5"]
            assert reader.message(KeyMessage).title.endswith(("STARTED", "STOPPED"))
        assert len(Handler.connections) == 1


def test_closing_the_connection_makes_a_new_one(box):
    with procedures(one=lambda: 1) as port, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(sock, port, ("h.one()", "h.closeXMLRPCClientConnection()", "textmsg(h.one())"))
        assert reader.message(TextMessage).text == "1"
        assert len(Handler.connections) == 2


def fail(box, port, body=("h.work()",)):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        send(sock, port, body)
        return reader.message(RuntimeExceptionMessage)


def test_a_procedure_that_does_not_exist(box):
    with procedures() as port:
        message = fail(box, port)
    assert message.line == 3
    assert 'method "work" is not supported' in message.text


def test_a_server_that_does_not_run(box):
    with listening_socket() as server:
        port = server.getsockname()[1]
    assert "does not answer" in fail(box, port).text


@pytest.mark.parametrize(
    "answer", [b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc", b"hello\r\n\r\n", b""]
)
def test_a_server_that_speaks_nonsense(box, answer):
    with listening_socket() as server:
        port = server.getsockname()[1]

        def serve():
            for _ in range(2):  # a connection that breaks is tried once more
                try:
                    peer, _ = server.accept()
                except OSError:
                    return
                with peer:
                    peer.recv(65536)
                    peer.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        text = fail(box, port).text
    assert "work: remote procedure call failed" in text


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
