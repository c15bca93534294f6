"""`ur-client run` against what may go wrong: one line on stderr, its exit code, the arm at rest, no traceback."""

import re
import socket
import threading
from contextlib import ExitStack, contextmanager

import pytest
from integration_support import (
    Frames,
    Messages,
    at,
    command,
    finish,
    free_port_base,
    port_base_of,
    programs_since,
    run_in_movement,
    send,
)

from pc_client import cli
from pc_client.driver import primary, questions, realtime
from protocol.primary.framing import PackageType
from protocol.ur_types import Ports, ProgramState

FAR = "t,x,y,z\n" + "".join(f"{0.2 * i:.1f},{0.3 + 0.05 * i:.2f},0.1,0.3\n" for i in range(20))
MOVEMENT_FILES = {
    "empty.toml": ("", "empty.toml"),
    "no.toml": ("this is not TOML [", "no.toml"),
    "nan.csv": (FAR.replace("0.30,", "nan,"), "nan"),
    "binary.toml": ("\udcff\udcfe", "UTF-8"),
}


@pytest.mark.parametrize("name", MOVEMENT_FILES)
def test_a_movement_file_that_cannot_be_done_is_refused_before_anything_is_asked_of_a_robot(
    ur_client, tmp_path, name
):
    text, words = MOVEMENT_FILES[name]
    (tmp_path / name).write_bytes(text.encode("utf-8", "surrogateescape"))
    done = ur_client("run", tmp_path / name, "--robot", "robot.invalid", "--yes", "--out", tmp_path / "out")
    assert done.code == 1
    complaint = done.complaint()
    assert words in complaint
    assert "robot.invalid" not in complaint
    assert not (tmp_path / "out").exists()


def test_a_movement_out_of_the_arm_s_reach_is_refused_before_anything_moves(
    standard_box, ur_client, tmp_path
):
    (tmp_path / "far.csv").write_text(FAR)
    with Messages(standard_box) as primary:
        done = ur_client("run", tmp_path / "far.csv", *at(standard_box), "--out", tmp_path / "out")
        assert done.code == 1
        assert "far" in done.complaint()
        assert not programs_since(primary, standard_box)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("host", "words"),
    [
        ("127.0.0.1", "refuses the connection"),
        ("robot.invalid", "cannot be looked up"),
        ("127.0.0.1:30003", "give the name or address alone; --port-base"),
        ("x" * 300, "xxx"),
    ],
)
def test_a_wrong_address_is_one_line(ur_client, tmp_path, host, words):
    options = ("--robot", host, "--yes", "--port-base", free_port_base())
    done = ur_client("run", "uniform_4_1", *options, "--out", tmp_path / "out")
    assert done.code == 1
    assert words in done.complaint()
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "code"), [(("run", "nowhere.toml", "--robot", "r", "--out", "o"), 1), (("fly",), 2)]
)
def test_the_process_leaves_with_that_code_and_one_line(arguments, code, tmp_path):
    done = command("pc_client", *arguments, cwd=tmp_path)
    assert done.code == code
    assert done.complaint()


# --- ports that are no robot's; time-outs are shortened, so these run in this process


@pytest.fixture
def hasty(monkeypatch):
    monkeypatch.setattr(primary, "VERSION_TIMEOUT", 0.1)
    monkeypatch.setattr(realtime, "FRAME_TIMEOUT", 0.1)
    monkeypatch.setattr(realtime, "_STOPPED_TIMEOUT", 0.1)  # the greeting is that of a box in lockstep
    monkeypatch.setattr(questions, "DASHBOARD_TIMEOUT", 0.1)


@contextmanager
def pretender(**answers):
    """Ports of a robot that say what they are told to, whatever they are asked, and then nothing."""
    base = free_port_base()
    ports = Ports.standard(base)
    with ExitStack() as stack:
        for name in ("dashboard", "primary", "secondary", "realtime"):
            server = stack.enter_context(socket.create_server(("127.0.0.1", getattr(ports, name))))
            thread = threading.Thread(target=_answer, args=(server, answers.get(name, b"")))
            thread.start()
            stack.callback(thread.join)
            stack.callback(server.shutdown, socket.SHUT_RDWR)
        yield base


def _answer(server, data):
    with ExitStack() as callers:
        while True:
            try:
                caller, _ = server.accept()
            except OSError:
                return
            callers.enter_context(caller)
            try:
                caller.sendall(data)
                if data.endswith(b"bye"):
                    caller.close()
            except OSError:
                pass


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("command_name", ["run", "doctor"])
@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({}, "says nothing about its version"),
        ({"primary": b"HTTP/1.1 400 Bad Request\r\n\r\n"}, "does not speak its protocol"),
        ({"primary": b"\xff" * 5000}, "does not speak its protocol"),
        ({"primary": b"bye"}, "primary"),
    ],
)
def test_a_port_that_is_no_robots_is_one_line(answers, words, command_name, tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")] if command_name == "run" else ["--seconds", "0.1"]
    movement = ["uniform_4_1"] if command_name == "run" else []
    with pretender(**answers) as base:
        code = cli.run([command_name, *movement, "--robot", "127.0.0.1", "--port-base", str(base), *out])
    assert code == 1
    told = capsys.readouterr()
    said = told.err if command_name == "run" else told.out
    assert words in said
    assert "Traceback" not in told.err + told.out
    if command_name == "run":
        assert told.err.count("\n") == 1


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("realtime", [b"", b"garbage!" * 400])
def test_a_realtime_port_that_gives_no_frames_is_one_line(lockstep_box, realtime, tmp_path, capsys):
    with Messages(lockstep_box) as primary:
        greeting = _greeting(primary.sock)
    with pretender(primary=greeting, secondary=greeting, realtime=realtime) as base:
        code = cli.run(
            [
                "run",
                "uniform_4_1",
                "--robot",
                "127.0.0.1",
                "--port-base",
                str(base),
                "--out",
                str(tmp_path / "out"),
            ]
        )
    assert code == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "realtime" in error


def _greeting(sock):
    """All packages up to the first state: they tell software and arm."""
    data = b""
    end = 0
    while True:
        while len(data) < end + 5:
            data += sock.recv(4096)
        size, kind = int.from_bytes(data[end : end + 4], "big"), data[end + 4]
        end += size
        while len(data) < end:
            data += sock.recv(4096)
        if kind == PackageType.ROBOT_STATE:
            return data[:end]


# --- what goes wrong in the middle of a run


# Whether the client first sees that its socket is closed or that its program has gone is a matter of timing.
REPLACED = r"program|closed the connection"


@pytest.mark.parametrize(
    ("meddling", "words"),
    [
        ("sec p():\n  protective_stop()\nend\n", "PROTECTIVE_STOP"),
        ("def bad():\n  x = 1 / 0\nend\n", REPLACED),
        ("power off\n", "must be RUNNING"),
    ],
    ids=["protective stop", "program error", "power off"],
)
def test_what_stops_the_robot_in_a_run_is_one_line_and_the_arm_rests(standard_box, tmp_path, meddling, words):
    with Frames(standard_box) as frames, run_in_movement(standard_box, frames, tmp_path) as client:
        send(standard_box, "secondary", meddling)
        frames.until(lambda f: not f.target_qd.any() and f.runtime_state == ProgramState.STOPPED)
        reader = threading.Thread(target=frames.until, args=(lambda _: client.poll() is not None, frames.raw))
        reader.start()
        done = finish(client)
        reader.join()
    assert done.code == 1
    assert re.search(words, done.complaint())
    assert list(tmp_path.glob("*.mcap")), "what was recorded stays"
    assert not list(tmp_path.glob("table1.*"))


HOST = "127.0.0.1"


@pytest.fixture
def run_movement(ur_client, standard_box, tmp_path, without_page):
    def run(*options):
        where = ("--robot", standard_box.host, "--port-base", port_base_of(standard_box))
        return ur_client("run", "uniform_4_1", *where, "--out", tmp_path / "out", *options)

    return run


def test_a_given_port_serves_all_programs_of_a_session_and_the_next_session(run_movement, tmp_path):
    # The approach, the excitation and a run: a program each, and each leaves a connection behind.
    with socket.create_server((HOST, 0)) as found:
        port = found.getsockname()[1]
    for _ in range(2):
        done = run_movement("--reverse-port", port, "--repeat", 1, "--overwrite")
        assert done.code == 0, done.err
    assert len(list(tmp_path.glob("out/*.mcap"))) == 1
