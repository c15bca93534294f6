"""The error barrier: an error ends what has caused it, the log says so in one line, and everybody else goes on."""

import pytest
from box_support import FrameReader, MessageReader, connect, inside, listening_socket
from control_support import Http, control_box
from dashboard_support import Dashboard

from protocol.primary.messages import LONGEST_TITLE, PopupMessage, ReportLevel
from ur_emulator.host.control_api.step_operations import ReadState
from ur_emulator.host.ports.dashboard import DashboardAnswers
from ur_emulator.host.ports.session import Session
from ur_emulator.host.runtime import listener
from ur_emulator.host.script_network.sockets import ScriptConnection
from ur_emulator.machine.commands.power import PowerOff

DEFECT = "KeyError('defect') in fail, line "


def fail(*args, **options):
    raise KeyError("defect")


@pytest.fixture
def box():
    with control_box(pace="realtime", in_process=True) as running, connect(running, "realtime") as sock:
        running.frames = FrameReader(sock)
        running.frames.next()
        yield running
        stamps = [running.frames.next().timestamp for _ in range(10)]
        assert len(set(stamps)) == 10
        assert running.failure is None


def faults(box):
    return [entry.text for entry in box.log if entry.level is ReportLevel.FAULT]


def is_closed(sock):
    """Whether the box closes a connection; what it has said before is read."""
    try:
        while sock.recv(4096):
            pass
    except ConnectionResetError:
        pass
    return True


def open_port(box, name):
    if name == "control":
        return Http(box).sock
    return connect(box, name)


@pytest.mark.parametrize(
    ("name", "method"), [("primary", "received"), ("rtde", "opened"), ("control", "received")]
)
def test_an_error_of_a_port_ends_the_connection_that_has_caused_it(box, name, method, monkeypatch):
    port, connections = inside(box)._port_set._ports[name], inside(box)._port_set._listeners[name].connections
    with open_port(box, name) as other:
        until(box, lambda: connections)  # it is let in
        with monkeypatch.context() as patch:
            patch.setattr(port, method, fail)
            with open_port(box, name) as sock:
                sock.sendall(b"x")
                assert is_closed(sock)
                address = "{}:{}".format(*sock.getsockname())
        (line,) = faults(box)
        assert line.startswith(f"{address} is disconnected: {DEFECT}")
        until(box, lambda: len(connections) == 1)
        assert [c.peer for c in connections] == ["{}:{}".format(*other.getsockname())]


def test_an_error_of_a_port_that_forgets_a_client_harms_nobody(box, monkeypatch):
    connections = inside(box)._port_set._listeners["rtde"].connections
    monkeypatch.setattr(inside(box)._port_set._ports["rtde"], "closed", fail)
    with connect(box, "rtde") as sock:
        until(box, lambda: connections)
        address = "{}:{}".format(*sock.getsockname())
    until(box, lambda: not connections and faults(box))
    (line,) = faults(box)
    assert line.startswith(f"{address} is not forgotten: {DEFECT}")


@pytest.mark.parametrize(
    ("owner", "method", "line", "replies"),
    [
        (DashboardAnswers, "answer", "robotmode", []),
        (Session, "_finished", "robotmode", ["Robotmode: RUNNING"]),
        (PowerOff, "apply", "power off", []),
    ],
    ids=["while requests are answered", "after the last answer", "in a command"],
)
def test_an_error_ends_the_connection_that_has_asked(box, monkeypatch, owner, method, line, replies):
    with Dashboard(box) as other, Dashboard(box) as dashboard:
        with monkeypatch.context() as patch:
            patch.setattr(owner, method, fail)
            dashboard.send(line)
            assert [dashboard.reply() for _ in replies] == replies
            assert dashboard.is_closed()
        assert other.ask("robotmode") == "Robotmode: RUNNING"
    (text,) = faults(box)
    assert DEFECT in text


def test_an_error_in_a_command_of_nobody_is_reported(box, monkeypatch):
    monkeypatch.setattr(PowerOff, "apply", fail)
    box.submit(PowerOff())
    until(box, lambda: faults(box))
    assert faults(box)[0].startswith(f"a command is lost: {DEFECT}")


@pytest.mark.parametrize("method", ["publish", "_package"], ids=["states", "messages"])
def test_a_port_that_cannot_publish_is_reported_once_and_the_others_publish(box, method, monkeypatch):
    with connect(box, "primary") as reader, connect(box, "secondary") as sock:
        assert reader.recv(1)
        monkeypatch.setattr(inside(box)._port_set._ports["primary"], method, fail)
        for k in range(3):
            sock.sendall(f"def p():\n  textmsg({k})\nend\n".encode())
            until(box, lambda k=k: any(entry.text == str(k) for entry in box.log))
    (line,) = faults(box)
    assert line.startswith(f"a port cannot publish: {DEFECT}")


def test_a_popup_with_a_long_title_is_shown(box):
    """A title of 256 letters once ended the box."""
    with connect(box, "primary") as reader, connect(box, "secondary") as sock:
        sock.sendall(f'def p():\n  popup("x", "{"t" * 300}")\nend\n'.encode())
        popup = MessageReader(reader).message(PopupMessage)
    assert popup.title == "t" * LONGEST_TITLE
    assert not faults(box)


def test_an_error_of_an_operation_is_reported_to_the_caller(box, monkeypatch):
    monkeypatch.setattr(ReadState, "steps", fail)
    with pytest.raises(KeyError, match="defect"):
        box.state()
    assert not faults(box)
    with Http(box) as http:
        http.send(http.request("GET", "/v1/state"))
        assert is_closed(http.sock)
    assert len(faults(box)) == 1


def close_and_fail(loop, sock, *more):
    sock.close()
    fail()


def test_an_error_in_accepting_costs_a_pause_of_that_port(box, monkeypatch):
    with Dashboard(box) as inside:
        with monkeypatch.context() as patch:
            patch.setattr(listener, "Connection", close_and_fail)
            with connect(box, "dashboard") as sock:
                assert is_closed(sock)
        assert inside.ask("robotmode") == "Robotmode: RUNNING"
        with Dashboard(box) as later:
            assert later.ask("robotmode") == "Robotmode: RUNNING"
    (line,) = faults(box)
    assert line.startswith(f"dashboard port {box.ports.dashboard} pauses: {DEFECT}")


def test_an_error_after_a_task_is_reported_to_the_caller(box, monkeypatch):
    with connect(box, "secondary") as sock:
        with monkeypatch.context() as patch:
            patch.setattr(inside(box)._intake, "_start", fail)
            sock.sendall(b"def lost():\nend\n")
            until(box, lambda: any("a program is lost" in entry.text for entry in box.log))
        sock.sendall(b"def next():\n  textmsg(1)\nend\n")
        until(box, lambda: any(entry.text == "1" for entry in box.log))


def test_an_error_in_a_connection_of_a_script_closes_it(box, monkeypatch):
    monkeypatch.setattr(ScriptConnection, "_on_connected", fail)
    with listening_socket() as server, connect(box, "secondary") as sock:
        port = server.getsockname()[1]
        sock.sendall(f'def p():\n  textmsg(socket_open("127.0.0.1", {port}))\nend\n'.encode())
        until(box, lambda: any(entry.text == "False" for entry in box.log))
    (line,) = faults(box)
    assert line.startswith(f"the connection of a script to 127.0.0.1:{port} is closed: {DEFECT}")


def until(box, condition):
    box.frames.until(lambda frame: condition())
