"""What bad, hasty and vanishing clients of the dashboard do, and a box that is switched off."""

import random
import re
import socket
import subprocess
import sys

import pytest
from box_support import FrameReader, connect
from dashboard_support import Dashboard, external_control, urp, write_programs

from protocol.dashboard.commands import COMMANDS
from ur_emulator.emulator import ControlBox


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "programs").mkdir()
    return write_programs(tmp_path / "programs")


@pytest.fixture(params=["lockstep", "realtime"])
def box(folder, request):
    with ControlBox(pace=request.param, port_base=None, seed=7, programs=folder) as box:
        yield box


def is_cut_off(sock, data):
    """Send without reading; return whether the other end closes before it has taken all."""
    try:
        for _ in range(2_000):
            sock.sendall(data)
    except (ConnectionResetError, BrokenPipeError):
        return True
    return False


def still_serves(box):
    with Dashboard(box) as other:
        assert other.ask("robotmode") == "Robotmode: RUNNING"


def a_pc_that_never_answers(folder):
    """A program that asks a PC which takes the connection and says nothing."""
    server = socket.create_server(("127.0.0.1", 0))
    (folder / "silent.urp").write_bytes(urp(external_control("127.0.0.1", server.getsockname()[1])))
    return server


def test_a_thousand_commands_in_one_write_are_answered_in_order(box):
    lines = ["load wait.urp", "load hello.urp", "get loaded program", "popup x", "nonsense"] * 200
    expected = [
        "Loading program: /programs/wait.urp",
        "Loading program: /programs/hello.urp",
        "Loaded program: /programs/hello.urp",
        "showing popup",
        "could not understand: 'nonsense'",
    ] * 200
    with Dashboard(box) as dashboard:
        assert dashboard.ask_all(*lines) == expected


def test_a_client_that_says_no_more_still_hears_all_answers(box):
    """As `printf 'load x\\nplay\\n' | nc -N` does it."""
    with Dashboard(box) as dashboard:
        dashboard.send("load wait.urp", "play", "programState", "stop", "saveLog")
        dashboard.sock.shutdown(socket.SHUT_WR)
        assert [dashboard.reply() for _ in range(5)] == [
            "Loading program: /programs/wait.urp", "Starting program", "PLAYING wait.urp", "Stopped", "Log saved to disk",
        ]  # fmt: skip
        assert dashboard.is_closed()
    still_serves(box)


def test_a_client_that_ends_without_a_word_is_closed(box):
    with Dashboard(box) as dashboard:
        dashboard.sock.shutdown(socket.SHUT_WR)
        assert dashboard.is_closed()


def test_what_a_client_asked_before_it_went_is_done(box):
    dashboard = Dashboard(box)
    dashboard.send("load wait.urp", "play")
    dashboard.sock.shutdown(socket.SHUT_WR)
    with dashboard:
        pass
    with Dashboard(box) as other:
        other.until("programState", "PLAYING wait.urp")


def test_a_line_without_end_is_waited_for_without_harm(box):
    with Dashboard(box) as dashboard:
        dashboard.sock.sendall(b"robot")
        still_serves(box)
        dashboard.sock.sendall(b"mode\r\n")
        assert dashboard.reply() == "Robotmode: RUNNING"


@pytest.mark.parametrize("data", [b"x" * 70_000, b"\0" * 70_000, b"load " + b"y" * 70_000 + b"\n"])
def test_a_line_that_never_ends_ends_the_connection(box, data):
    with Dashboard(box) as dashboard:
        dashboard.sock.sendall(data)
        assert dashboard.is_closed()
    still_serves(box)


@pytest.mark.parametrize(
    "data",
    [
        b"\xff\xfe\x00load\n",
        b"load \x00\x01.urp\n",
        b"load ../../\xe9\n",
        b"popup \x7f\x1b[2J\n",
        b"\r\n",
        b"\n",
    ],
)
def test_odd_bytes_get_one_line_each(box, data):
    with Dashboard(box) as dashboard:
        dashboard.sock.sendall(data + b"get robot model\n")
        dashboard.reply()
        assert dashboard.reply() == "UR3"


def test_a_flood_behind_a_command_that_takes_its_time_ends_the_connection(folder, box):
    with a_pc_that_never_answers(folder), Dashboard(box) as dashboard:
        dashboard.send("load silent.urp", "play")
        assert dashboard.reply() == "Loading program: /programs/silent.urp"
        assert is_cut_off(dashboard.sock, b"robotmode\n" * 6_000)
    still_serves(box)


def test_others_are_answered_while_one_waits(folder, box):
    with a_pc_that_never_answers(folder), Dashboard(box) as waiting:
        waiting.send("load silent.urp", "play", "robotmode")
        assert waiting.reply() == "Loading program: /programs/silent.urp"
        still_serves(box)
        with Dashboard(box) as other:
            assert other.ask_all("programState", "power off", "robotmode") == [
                "STOPPED silent.urp", "Powering off", "Robotmode: POWER_OFF",
            ]  # fmt: skip


def test_a_client_that_reads_nothing_is_left_behind(folder, box):
    """Its replies cannot be dropped one by one, the rest would answer the wrong lines."""
    with connect(box, "realtime") as frames, connect(box, "dashboard") as greedy:
        reader = FrameReader(frames)
        first = reader.next()
        assert is_cut_off(greedy, b"load " + b"z" * 60_000 + b"\n")
        assert reader.next().timestamp >= first.timestamp
    still_serves(box)


ARGUMENTS = [
    "wait.urp",
    "hello.urp",
    "strange.urp",
    "cell/count me.script",
    "default.installation",
    "x",
    "OPERATOR",
    ".",
    "system",
]


@pytest.mark.parametrize("seed", range(6))
def test_random_sessions_get_one_fitting_reply_a_line(folder, seed):
    draw = random.Random(seed)
    rows = [row for row in COMMANDS if row.since.cb3 and row.name not in ("quit", "shutdown")]
    patterns = {
        row.name: "|".join(re.sub(r"\\\{\w+\\\}", ".*", re.escape(reply)) for reply in row.replies.values())
        for row in rows
    }
    with ControlBox(pace="lockstep", port_base=None, seed=seed, programs=folder) as box:
        clients = [Dashboard(box) for _ in range(3)]
        for _ in range(60):
            asked = []
            for client in clients:
                row = draw.choice(rows)
                line = (
                    f"{row.name} {draw.choice(ARGUMENTS)}"
                    if row.argument and draw.random() < 0.9
                    else row.name
                )
                client.send(line)
                asked.append((client, row, line))
            for client, row, line in asked:
                reply = client.reply()
                assert re.fullmatch(patterns[row.name], reply), (line, reply)
        clients[0].until("stop", "Stopped")
        assert clients[0].ask("running") == "Program running: false"
        for client in clients:
            with client:
                pass


def test_many_clients_at_once(box):
    clients = [Dashboard(box) for _ in range(60)]
    for client in clients:
        client.send("running", "get robot model")
    for client in clients:
        assert [client.reply(), client.reply()] == ["Program running: false", "UR3"]
    for client in clients:
        with client:
            pass


# --- switched off


def is_off(box):
    for name in ("dashboard", "primary", "rtde"):
        with pytest.raises(ConnectionRefusedError):
            connect(box, name)
    return box.is_shut_down


def test_shutdown_closes_all_ports(box):
    with Dashboard(box) as dashboard, connect(box, "realtime") as frames:
        assert not box.is_shut_down
        assert dashboard.ask("shutdown") == "Shutting down"
        assert dashboard.is_closed()
        with pytest.raises((EOFError, OSError)):
            FrameReader(frames).until(lambda frame: False)
    assert is_off(box)
    assert any(entry.text.startswith("Shut down by 127.0.0.1") for entry in box.log)


def test_a_box_of_a_rack_is_switched_off_alone():
    with ControlBox.many(2, pace="lockstep", port_base=None) as (first, second):
        with Dashboard(first) as dashboard:
            assert dashboard.ask("shutdown") == "Shutting down"
            assert dashboard.is_closed()
        assert is_off(first)
        still_serves(second)
        with Dashboard(second) as dashboard:
            dashboard.ask("shutdown")
            assert dashboard.is_closed()
        assert is_off(second)


def test_serve_ends_when_its_box_is_switched_off(tmp_path, folder):
    command = [
        sys.executable,
        "-m",
        "ur_emulator",
        "serve",
        "--port-base",
        "4000",
        "--programs",
        folder,
        "--host",
        "127.0.0.93",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert " ready at " in process.stdout.readline()
        with socket.create_connection(("127.0.0.93", 33999)) as sock, sock.makefile("rb") as lines:
            sock.sendall(b"load hello.urp\nshutdown\n")
            assert [lines.readline() for _ in range(3)][1:] == [
                b"Loading program: /programs/hello.urp\n",
                b"Shutting down\n",
            ]
        assert process.wait(timeout=20) == 0


def test_a_programs_folder_that_does_not_exist_is_one_line(tmp_path):
    command = [sys.executable, "-m", "ur_emulator", "serve", "--programs", tmp_path / "nowhere"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2  # a wrong option
    assert (
        done.stderr
        == f"ur-emulator: programs folder {tmp_path}/nowhere given: there is no such folder, make it first\n"
    )
