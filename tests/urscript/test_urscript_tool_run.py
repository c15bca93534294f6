"""What `urscript` tells; how `urscript run` ends, that it finds its robots."""

import json
import re
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from chunk_runner import matches
from program_texts import program_of
from typer.testing import CliRunner

import urscript.commands.run_command
from ur_emulator.machine.models.robots import ROBOTS
from ur_emulator.script_robots import MAKER
from urscript.cli import app
from urscript.robot import find_makers

ROOT = Path(__file__).parents[2]
HOME = "[0, -1.5708, 0, -1.5708, 0, 0]"


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(text, *words, command="run"):
        Path("a.script").write_text(text, encoding="utf-8")
        return CliRunner().invoke(app, [command, *words, "a.script"])

    return call


# --- what it tells ---------------------------------------------------------------------------------------


def sessions():
    """Command and options, program, exit code, standard output and error, of all programs of a file."""
    text = Path(__file__).with_name("tool_sessions.script").read_text(encoding="utf-8")
    for part in re.split(r"^--- ", text, flags=re.MULTILINE)[1:]:
        head, _, rest = part.partition("\n")
        name, words = head.split(":")
        out, err = ("".join(re.findall(rf"^#{mark} (.*\n)", rest, re.M)) for mark in ("out", "err"))
        code = int(next(iter(re.findall(r"^#exit (\d+)$", rest, re.M)), 0))
        program = re.sub(r"^#(out|err|exit) .*\n", "", rest, flags=re.M)
        yield pytest.param(words.split(), program, code, out, err, id=name)


@pytest.mark.parametrize(("words", "text", "code", "out", "err"), list(sessions()))
def test_what_a_command_tells(run, words, text, code, out, err):
    result = run(text, *words[1:], command=words[0])
    assert result.exit_code == code
    assert matches(out.replace("...\n", "..."), result.stdout), result.stdout
    assert matches(err.replace("...\n", "..."), result.stderr), result.stderr


def test_the_final_pose_is_that_of_the_last_move(run):
    lower = "pose_add(get_target_tcp_pose(), p[0, 0, -0.05, 0, 0, 0])"
    text = program_of("movej([0, -1.2, 1.2, -1.57, -1.57, 0])", f"movel({lower}, a=0.5, v=0.2)")
    document = json.loads(run(text, "--json", "--fidelity", "ideal").stdout)
    assert document["status"] == "finished"
    assert len(document["joints"]) == 6
    move = document["events"][-1]
    assert (move["kind"], move["name"], move["line"], move["calls"]) == ("move", "movel", 3, 1)
    assert document["tcp_pose"] == pytest.approx(move["arguments"]["pose"], abs=2e-4)
    assert move["time"] + move["duration"] == pytest.approx(document["robot_time"])


# --- how it ends -----------------------------------------------------------------------------------------


def test_a_wrong_program_is_not_run(run):
    result = run(program_of("movj(1)"), "--json")
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert (document["status"], document["events"]) == ("failed", [])
    assert document["diagnostics"][0]["hint"] == "did you mean 'movej'?"


def test_a_warning_and_a_failure_are_diagnostics_for_editors(run):
    (warning,) = json.loads(run("def a():\nend\ndef b():\nend\n", "--json").stdout)["diagnostics"]
    assert (warning["severity"], warning["code"]) == ("warning", "W121")
    result = run(program_of("x = [1]", "i = 7", "textmsg(x[i])"), "--json")
    assert result.exit_code == 1
    found = json.loads(result.stdout)["diagnostics"]
    assert [(item["line"], item["column"], item["code"]) for item in found] == [(4, 11, "E201")]


def test_the_same_seed_is_the_same_run(run):
    text = program_of(f"movej({HOME})", "textmsg(get_actual_joint_positions())")

    def told(*words):
        document = json.loads(run(text, "--json", *words).stdout)
        return document["joints"], document["events"]

    assert told("--seed", "1") == told("--seed", "1")
    assert told("--seed", "1") != told("--seed", "2")


def started(tmp_path, text, *words):
    (tmp_path / "a.script").write_text(text)
    words = [
        sys.executable,
        "-c",
        "from urscript.cli import main; main()",
        "run",
        *words,
        str(tmp_path / "a.script"),
    ]
    return subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_ctrl_c_ends_it_with_a_line_and_without_a_traceback(tmp_path):
    loop = "while True:\n  speedj([0,0,0,0,0,0.1], 1, 0.1)\n  speedj([0,0,0,0,0,-0.1], 1, 0.1)\nend\n"
    with started(tmp_path, f'textmsg("on")\n{loop}', "--limit", "1e9") as process:
        assert process.stdout.readline() == "on\n"
        process.send_signal(signal.SIGINT)
        output, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert re.match(r"interrupted after [\d.]+ s of robot time", error)
    assert error.count("\n") == 1
    assert "\njoints [" in f"\n{output}"


def test_run_ends_quietly_when_nobody_reads_on(tmp_path):
    # Far more than a pipe holds: it cannot end before its reader does.
    words = ["--robot", "none", "--trace", "--trace-lines", "100000"]
    with started(tmp_path, "while True:\n  sync()\nend\n", *words) as process:
        assert "while True:" in process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1


# --- the outside -----------------------------------------------------------------------------------------


def test_sockets_reach_real_peers(run):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def peer():
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"(1.5, 2.5)\n")
                assert connection.recv(100) == b"4"

        thread = threading.Thread(target=peer)
        thread.start()
        text = program_of(
            f'socket_open("127.0.0.1", {server.getsockname()[1]})',
            "r = socket_read_ascii_float(2)",
            "socket_send_string(r[1] + r[2])",
            "textmsg(r)",
        )
        result = run(text)
        thread.join()
    assert (result.exit_code, result.stdout.splitlines()[0]) == (0, "[2,1.5,2.5]")


def test_nobody_answers_is_no_error(run):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    assert run(f'textmsg(socket_open("127.0.0.1", {port}))\n').stdout.splitlines()[0] == "False"


# --- robots ----------------------------------------------------------------------------------------------


def test_the_package_offers_its_arms():
    assert [maker for maker in find_makers() if maker is MAKER] == [MAKER]
    assert tuple(MAKER.robots) == tuple(ROBOTS)


@pytest.mark.parametrize(
    ("words", "title"),
    [
        (("--robot", "UR3"), ROBOTS["ur3"].title),
        (("--robot", str(ROOT / "examples" / "arms" / "long_ur5e.toml")), "UR5e, long forearm"),
        (("--software", "5.12"), "UR5e"),
        (("--software", "10.11"), "UR5e"),
    ],
)
def test_an_arm_is_chosen_by_its_name_its_file_or_its_software(run, words, title):
    assert json.loads(run("textmsg(get_steptime())", *words, "--json").stdout)["robot"].startswith(title)


@pytest.mark.parametrize(
    ("words", "allowed"),
    [
        (("--robot", "kuka"), "there are ur3, "),
        (("--robot", "nowhere.toml"), "nowhere.toml: cannot be read"),
        (("--robot", "ur3", "--software", "5.12"), "give software such as 3.15.8, or another robot"),
        (("--fidelity", "perfect"), "there are typical, "),
        (("--seed", "-1"), "greater than or equal to 0"),
        (("--trace", "--json"), "choose one"),
    ],
)
def test_wrong_options_say_what_is_allowed(run, words, allowed):
    result = run("sync()", *words)
    assert result.exit_code == 2
    assert allowed in " ".join(result.stderr.replace("│", " ").split())


def test_without_a_robot_it_only_writes_down(run, monkeypatch):
    monkeypatch.setattr(urscript.commands.run_command, "find_makers", list)
    result = run(program_of(f"movej({HOME})"))
    assert (
        result.stdout == "    0.000 s  p: movej([0, -1.5708, 0, -1.5708, 0, 0], 1.396263, 1.047198, 0, 0)\n"
    )
    assert result.stderr == "finished after 0.024 s of robot time (no robot)\n"
    assert result.stdout == run(program_of(f"movej({HOME})"), "--robot", "none").stdout


# --- --trace


@pytest.mark.parametrize("text", ["halt", "x = [1]\ny = x[1]", "while True:\nend"])
def test_the_tracing_of_others_is_as_before_whatever_happens(run, text):
    before = sys.gettrace()
    run(text, "--robot", "none", "--trace", "--trace-lines", "5")
    assert sys.gettrace() is before
