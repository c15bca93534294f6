"""`ur-emulator serve` from the outside: exit codes, one-line errors, signals, ready file, log, what it loads."""

import dataclasses
import gc
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from types import SimpleNamespace

import pytest
from integration_support import (
    SPIN,
    TIMEOUT,
    Frames,
    Messages,
    connect,
    finish,
    free_port_base,
    send,
    serving,
    start,
)

from protocol.primary.messages import KeyMessage, RuntimeExceptionMessage
from protocol.ur_types import Ports
from ur_emulator import ControlBox
from ur_emulator.cli import WANTED_DESCRIPTORS
from ur_emulator.errors import EmulatorError
from ur_emulator.host.box_options import TOKEN_VARIABLE


def check_complaint(done, words, code=1):
    assert done.code == code
    complaint = done.complaint()
    assert complaint.startswith("ur-emulator: ")
    assert words in complaint
    assert done.out == ""


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--robot", "ur9"),
        ("--software", "5.11.0"),
        ("--version", "latest"),
        ("--pace", "warp"),
        ("--speed", "nan"),
        ("--seed", "-1"),
        ("--port-base", "60000"),
    ],
)
def test_a_value_that_is_not_allowed_is_one_line_and_exit_2(ur_emulator_command, option, value):
    done = ur_emulator_command("serve", "--port-base", free_port_base(), option, value)
    check_complaint(done, value.removeprefix("-"), code=2)


@pytest.mark.parametrize("host", ["192.0.2.1", "robot.invalid"])
def test_an_address_that_is_not_of_this_machine_is_one_line_and_exit_1(ur_emulator_command, host):
    check_complaint(ur_emulator_command("serve", "--port-base", free_port_base(), "--host", host), host)


def test_a_box_that_cannot_be_made_leaves_nothing_open():
    for options, words in (({"host": ""}, "no host given"), ({"fidelity": "perfect"}, "perfect")):
        with pytest.raises(EmulatorError, match=words):
            ControlBox(port_base=None, **options)
    gc.collect()  # what is open still would be an error now


def test_a_taken_port_is_one_line_and_exit_1(ur_emulator_command, tmp_path):
    base, ready = free_port_base(), tmp_path / "ready.json"
    taken = Ports.standard(base).realtime_ro
    with socket.create_server(("127.0.0.1", taken)):
        done = ur_emulator_command("serve", "--port-base", base, "--ready-file", ready)
    check_complaint(done, str(taken))
    assert "--port-base" in done.err
    assert not ready.exists()


@pytest.mark.parametrize(
    ("options", "end"),
    [
        (("--pace", "lockstep"), signal.SIGTERM),
        pytest.param(("--speed", "10"), signal.SIGINT, marks=pytest.mark.nightly),
    ],
)
def test_a_signal_ends_the_box_in_motion_with_exit_0_and_without_a_word(tmp_path, options, end):
    with (
        serving(tmp_path, *options) as box,
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
    with serving(tmp_path, "--seed", 7) as box, Frames(box) as frames:
        frames.next()
        assert box.facts["host"] == "127.0.0.1"
        assert box.facts["serial_number"] == "20993000007"
        numbers = {name: number for name, number in box.facts["ports"].items() if number}
        assert numbers == {
            name: number
            for name, number in dataclasses.asdict(Ports.standard(box.base)).items()
            if name not in ("interpreter", "robot_api", "gripper", "onrobot", "tool_line")
        }
        for name in numbers:
            connect(box, name).close()
        assert [p.name for p in tmp_path.iterdir()] == [p.name for p in tmp_path.glob("ready-*.json")]
    # The ports are free again at once.
    ready = tmp_path / "nowhere" / "ready.json"
    again = finish(start("ur_emulator", "serve", "--port-base", box.base, "--ready-file", ready))
    check_complaint(again, f"--ready-file {ready} cannot be written (No such file or directory)")


def test_beyond_loopback_a_control_port_demands_a_token_and_the_user_is_warned(ur_emulator_command, tmp_path):
    refused = ur_emulator_command(
        "serve", "--port-base", free_port_base(), "--host", "0.0.0.0", "--control-port", "0"
    )
    check_complaint(refused, "--token", code=2)
    environment = {**os.environ, TOKEN_VARIABLE: "correct-horse"}
    with serving(tmp_path, "--host", "0.0.0.0", "--control-port", "0", env=environment) as box:
        box.process.send_signal(signal.SIGINT)
        told = finish(box.process)
    assert told.code == 0
    assert told.err.count("\n") == 1
    assert "(30002)" in told.err
    assert "correct-horse" not in told.out + told.err


def test_the_log_goes_to_stderr_if_asked_for(tmp_path):
    with serving(tmp_path, "--log", "--pace", "lockstep") as box:
        with Messages(box) as primary:
            send(box, "secondary", 'def f():\n  textmsg("hello")\nend\n')
            primary.message(KeyMessage, title="PROGRAM_XXX_STOPPED")
            send(box, "secondary", "def g():\n  x = nowhere\nend\n")
            primary.message(RuntimeExceptionMessage)
        box.process.send_signal(signal.SIGINT)
        told = finish(box.process).err
    lines = [line.split(" ", 1)[1] for line in told.splitlines() if "Client" not in line]
    assert lines == [
        "INFO Program: Starting program: f",
        "INFO Program: hello",
        "INFO Program: Program stopped: f",
        "FAULT Program: Compile error: name 'nowhere' is not defined (line 2, column 7)",
    ]


@pytest.mark.nightly
def test_a_full_pipe_for_output_and_messages_keeps_nothing_from_starting_and_ending(tmp_path):
    near, far = os.pipe()
    os.set_blocking(far, False)
    with suppress(BlockingIOError):
        while True:
            os.write(far, bytes(1 << 16))
    os.set_blocking(far, True)
    ready, base = tmp_path / "ready.json", free_port_base()
    options = ("--log", "--port-base", base, "--ready-file", ready)
    process = start("ur_emulator", "serve", *options, stdout=far, stderr=far)
    try:
        while not ready.exists():
            assert process.poll() is None
            time.sleep(0.01)
        box = SimpleNamespace(host="127.0.0.1", ports=Ports.standard(base))
        with Frames(box) as frames:
            frames.new()
            frames.new()
        process.terminate()
        assert process.wait(TIMEOUT) == 0
    finally:
        process.kill()
        process.wait()
        os.close(near)
        os.close(far)


# Each costs time or memory that no box needs before somebody asks for it.
LATE = {
    "lark": "nothing at all: programs are compiled in a process of their own",
    "pymodbus": "tests",
    "xmlrpc": "nothing at all",
    "http": "nothing at all",
    "ssl": "nothing at all",
    "rich": "help and errors of the command line",
    "asyncio": "nothing at all",
    "glfw": "nothing at all: a box draws nothing",
    "scipy": "the client",
    "pinocchio": "the client",
    "matplotlib": "the report",
    "pytest": "tests",
}
START = (
    "import atexit, gc, json, sys\n"
    "from ur_emulator import cli\n"
    "atexit.register(lambda: print(json.dumps([gc.get_freeze_count(), sorted(sys.modules)])))\n"
    "cli.main()\n"
)


def test_a_box_that_serves_has_loaded_nothing_that_can_wait():
    process = subprocess.Popen(
        [sys.executable, "-c", START, "serve", "--port-base", str(free_port_base())],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert " ready at " in process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    done = finish(process)
    assert (done.code, done.err) == (0, "")
    frozen, names = json.loads(done.out)
    assert frozen > 10_000  # what exists at start is never collected
    loaded = {name.split(".")[0] for name in names}
    assert {"mujoco", "numpy"} <= loaded
    assert loaded & LATE.keys() == set()


RAISE = """
import resource
from ur_emulator.cli import raise_descriptor_limit
now = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
for hard in (now, 300):
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, hard))
    raise_descriptor_limit()
    print(*resource.getrlimit(resource.RLIMIT_NOFILE))
"""


def test_the_limit_of_descriptors_is_raised_as_far_as_the_system_allows():
    done = subprocess.run([sys.executable, "-c", RAISE], capture_output=True, text=True, check=True)
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    most = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    assert done.stdout.splitlines() == [f"{most} {hard}", "300 300"]


def ignore_interrupts():
    """As a shell has it for a command in the background."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def test_a_window_in_the_background_of_a_shell_ends_with_an_interrupt():
    process = start("ur_emulator", "pendant", "127.0.0.1", "--port", 0, preexec_fn=ignore_interrupts)
    assert process.stdout.readline().startswith("window at http://127.0.0.1:")
    process.send_signal(signal.SIGINT)
    done = finish(process)
    assert (done.code, done.err) == (0, "")


@pytest.mark.nightly
def test_a_taken_port_of_the_window_is_one_line_with_the_options_of_serve(ur_emulator_command):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        options = ("--pendant", "--window-host", "127.0.0.1", "--window-port", port)
        process = start("ur_emulator", "serve", "--port-base", free_port_base(), *options)
        said = process.stderr.readline()
        process.terminate()
        finish(process)
    assert said.startswith(f"window: port {port} of 127.0.0.1 cannot be opened")
    known = ur_emulator_command("serve", "--help").out
    for option in ("--window-port", "--window-host"):
        assert option in said
        assert option in known
