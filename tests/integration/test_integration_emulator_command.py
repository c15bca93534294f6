"""`ur-emulator serve` from the outside: exit codes, one-line errors, signals, the ready file."""

import dataclasses
import signal
import socket
from contextlib import suppress

import pytest
from integration_support import (
    SPIN,
    Frames,
    Messages,
    command,
    connect,
    finish,
    free_port_base,
    send,
    serving,
)

from protocol.ur_types import Ports


def serve(*arguments):
    """Run the command with a mistake in it; --port-base comes first, so that another one wins."""
    return command("ur_emulator", "serve", "--port-base", free_port_base(), *arguments)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--robot", "ur9"),
        ("--version", "5.11.0"),
        ("--version", "latest"),
        ("--fidelity", "perfect"),
        ("--pace", "warp"),
        ("--speed", "0"),
        ("--speed", "nan"),
        pytest.param(
            "--speed", "inf", marks=pytest.mark.xfail(strict=True, reason="ends in a ZeroDivisionError")
        ),
        ("--seed", "-1"),
        ("--port-base", "60000"),
        ("--host", "192.0.2.1"),
        ("--host", "robot.invalid"),
        ("--ready-file", "/nowhere/ready.json"),
    ],
)
def test_a_mistake_is_one_line_and_exit_1(option, value):
    done = serve(option, value)
    assert done.code == 1
    complaint = done.complaint()
    assert complaint.startswith("ur-emulator: ")
    assert value.removeprefix("-") in complaint
    assert done.out == ""


@pytest.mark.parametrize("arguments", [("--pase", "lockstep"), ("--seed", "many"), ("again",)])
def test_wrong_usage_is_exit_2_without_a_traceback(arguments):
    done = serve(*arguments)
    assert done.code == 2
    assert "Traceback" not in done.err
    assert arguments[-1] in done.err or arguments[0] in done.err


@pytest.mark.parametrize("port", ["dashboard", "secondary", "realtime", "realtime_ro"])
def test_a_taken_port_is_one_line_and_exit_1(port, tmp_path):
    base = free_port_base()
    with socket.create_server(("127.0.0.1", getattr(Ports.standard(base), port))):
        done = serve("--port-base", base, "--ready-file", tmp_path / "ready.json")
    assert done.code == 1
    assert str(getattr(Ports.standard(base), port)) in done.complaint()
    assert "--port-base" in done.err
    assert not (tmp_path / "ready.json").exists()


def test_a_second_box_on_the_same_ports_is_refused_and_the_first_goes_on(tmp_path):
    with serving(tmp_path) as box, Frames(box) as frames:
        frames.next()
        assert serve("--port-base", box.base).code == 1
        frames.new()


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("pace", ["realtime", "lockstep"])
def test_a_signal_ends_the_box_in_motion_with_exit_0_and_without_a_word(tmp_path, pace, end):
    with (
        serving(tmp_path, "--pace", pace) as box,
        Messages(box),
        Frames(box) as frames,
        connect(box, "dashboard"),
    ):
        send(box, "secondary", SPIN)
        frames.until(lambda f: f.target_qd[0] > 0.2)
        box.process.send_signal(end)
        with suppress(EOFError, ConnectionResetError):
            frames.until(lambda _: False, frames.raw)  # the stream ends
        done = finish(box.process)
    assert (done.code, done.err) == (0, "")


def test_the_ready_file_says_what_answers(tmp_path):
    with serving(tmp_path, "--seed", 7) as box:
        assert box.facts["host"] == "127.0.0.1"
        assert box.facts["serial_number"] == "20993000007"
        assert box.facts["ports"] == dataclasses.asdict(Ports.standard(box.base))
        for name in set(box.facts["ports"]) - {"rtde"}:  # nothing serves RTDE yet
            connect(box, name).close()
        assert [p.name for p in tmp_path.iterdir()] == [p.name for p in tmp_path.glob("ready-*.json")]


def test_ports_are_free_again_at_once(tmp_path):
    with serving(tmp_path) as box, Frames(box) as frames:
        frames.next()
    again = command("ur_emulator", "serve", "--port-base", box.base, "--ready-file", "/nowhere/ready.json")
    assert "cannot listen" not in again.complaint()
