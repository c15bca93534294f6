"""`urscript run`: what it tells, how it ends, that it finds its robots; the lines that `--trace` shows."""

import json
import re
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest
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

    def call(text, *words):
        Path("a.script").write_text(text, encoding="utf-8")
        return CliRunner().invoke(app, ["run", *words, "a.script"])

    return call


# --- what it tells ---------------------------------------------------------------------------------------


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


def test_a_stream_ends_where_the_program_stops_calling(run):
    text = program_of(
        "i = 0",
        "while i < 4:",
        "speedj([0, 0, 0, 0, 0, 0.1], 1, 0.008)",
        "i = i + 1",
        "end",
        "sleep(0.4)",
        "speedj([0, 0, 0, 0, 0, 0.1], 1, 0.008)",
        "speedl([0, 0, 0.01, 0, 0, 0], 1, 0.008)",
    )
    events = json.loads(run(text, "--json").stdout)["events"]
    assert [(event["name"], event["calls"]) for event in events] == [
        ("speedj", 4),
        ("speedj", 1),
        ("speedl", 1),
    ]
    assert [event["duration"] for event in events] == [0.032, 0.008, 0.008]


def test_threads_beside_the_moving_one_are_reported_in_between(run):
    text = "def p():\n  thread t():\n    sleep(0.1)\n    textmsg(1)\n  end\n  run t()\n"
    lines = run(f"{text}  movej({HOME})\n  textmsg(2)\nend\n").stdout.splitlines()
    mover = run(f"{text.replace('textmsg(1)', f'movej({HOME})')}  sleep(5)\nend\n").stdout.splitlines()[0]
    assert "s  line 4 (t): movej " in mover
    assert [lines[0], lines[1][13:27], lines[2]] == ["1", "line 7: movej ", "2"]


def test_popups_are_closed_and_questions_answered(run):
    text = program_of(
        'popup("mind", "Caution", True, blocking=True)',
        'n = request_integer_from_primary_client("how many")',
        'b = request_boolean_from_primary_client("sure")',
        "textmsg(n + 1, b)",
    )
    result = run(text, "--answer", "41", "--answer", "yes")
    assert result.exit_code == 0
    assert "s  popup Caution: mind (closed)\n" in result.stdout
    assert "s  question how many 41\n" in result.stdout
    assert "42True\n" in result.stdout


def test_a_question_that_nobody_answers_ends_the_run_with_its_place(run):
    result = run(program_of('n = request_integer_from_primary_client("how many")'), "--answer", "no idea")
    assert result.exit_code == 1
    assert (
        "a.script:2:7: Runtime error: the program asks for an integer: 'how many', but the answer is 'no idea' (--answer)\n"
        '      n = request_integer_from_primary_client("how many")\n          ^\n'
    ) in result.stderr


# --- how it ends -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("move", "said"),
    [
        ("movel(p[1.4, -0.1, 0.2, 0, 3.14, 0])", "Robot: the target p[1.4, -0.1, 0.2, 0, 3.14, 0] is out of reach; C204"),
        ("movej([0, -90, 0, 0, 0, 0])", "joint 1 cannot be at -90 rad"),
        ("movej(p[1.4, -0.1, 0.2, 0, 3.14, 0])", "The robot cannot reach the requested pose"),
    ],
)  # fmt: skip
def test_a_target_that_the_arm_cannot_reach_is_named(run, move, said):
    result = run(program_of(move))
    assert result.exit_code == 1
    assert result.stderr.startswith("a.script:2:3: ")
    assert said in result.stderr


def test_an_endless_program_ends_at_the_limit_and_says_so(run):
    result = run("while True:\n  sync()\nend\n", "--limit", "0.8")
    assert result.exit_code == 0
    assert "stopped: still running after 0.8 s of robot time (--limit)" in result.stderr


def test_a_wrong_program_is_not_run(run):
    result = run(program_of("movj(1)"), "--json")
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert (document["status"], document["events"]) == ("failed", [])
    assert document["diagnostics"][0]["hint"] == "did you mean 'movej'?"


def test_a_text_that_runs_nothing_is_warned_of(run):
    definitions = "def a():\nend\ndef b():\nend\n"
    result = run(definitions)
    assert result.exit_code == 0
    said = "a.script:1:5: Warning: nothing runs: the text only defines 'a' and 'b' (write a() at its end) [W121]\n"
    assert result.stderr.startswith(said)
    told = json.loads(run(definitions, "--json").stdout)["diagnostics"]
    assert [(one["severity"], one["code"]) for one in told] == [("warning", "W121")]
    for text in (f"{definitions}b()\n", "def a():\nend\n"):
        assert "Warning" not in run(text).stderr


def test_a_failure_is_a_diagnostic_for_editors(run):
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


def test_ctrl_c_ends_it_with_a_line_and_without_a_traceback(tmp_path):
    (tmp_path / "a.script").write_text(
        'textmsg("on")\nwhile True:\n  speedj([0,0,0,0,0,0.1], 1, 0.1)\n  speedj([0,0,0,0,0,-0.1], 1, 0.1)\nend\n'
    )
    start = [sys.executable, "-c", "from urscript.cli import main; main()"]
    words = ["run", "--limit", "1e9", str(tmp_path / "a.script")]
    with subprocess.Popen(
        [*start, *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "on\n"
        process.send_signal(signal.SIGINT)
        output, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert re.match(r"interrupted after [\d.]+ s of robot time", error)
    assert error.count("\n") == 1
    assert "\njoints [" in f"\n{output}"


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


def test_what_the_parser_takes_is_no_error_of_the_parser(run):
    said = "a.script:1:29: Syntax error: positional argument after a named argument\n"
    assert run("movej(q=[0, 0, 0, 0, 0, 0], 1.2)\n").stderr.startswith(said)


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


PROGRAM = """def p():
  def f(x):
    return x + 1
  end
  thread t():
    while True:
      sync()
    end
  end
  h = run t()
  # a comment
  a = 1 b = f(a)
  sync()
  if a == b:
    halt
  elif a < b:
    kill h
  end
end
"""


def traced(run, text, *words):
    result = run(text, "--robot", "none", "--quiet", "--trace", *words)
    shown = [
        re.fullmatch(r" *(\d+)  (\w+):(\d+): (.*)", line).groups() for line in result.stdout.splitlines()
    ]
    return [(int(cycle), thread, int(line), text) for cycle, thread, line, text in shown], result.stderr


def test_every_line_is_shown_once_before_it_is_executed_with_cycle_and_thread(run):
    result = run(PROGRAM, "--robot", "none", "--quiet", "--trace")
    assert [line.strip() for line in result.stdout.splitlines()] == [
        "0  p:1: def p():",
        "0  p:10: h = run t()",
        "0  p:12: a = 1 b = f(a)",
        "0  p:2: def f(x):",
        "0  p:3: return x + 1",
        "0  p:13: sync()",
        "0  t:5: thread t():",
        "0  t:6: while True:",
        "0  t:7: sync()",
        "1  p:14: if a == b:",
        "1  p:16: elif a < b:",
        "1  p:17: kill h",
    ]
    assert result.stderr == ""


@pytest.mark.parametrize("text", ["halt", "x = [1]\ny = x[1]", "while True:\nend"])
def test_the_tracing_of_others_is_as_before_whatever_happens(run, text):
    before = sys.gettrace()
    run(text, "--robot", "none", "--trace", "--trace-lines", "5")
    assert sys.gettrace() is before


def test_run_trace_mixes_lines_and_effects_in_their_order(run):
    result = run('textmsg("\u00e4")\nset_flag(0, True)\n', "--robot", "none", "--trace")
    assert result.stdout == (
        '     0  textmsg:1: textmsg("\u00e4")\n\u00e4\n'
        "     0  textmsg:2: set_flag(0, True)\n    0.000 s  textmsg: set_flag(0, True)\n"
    )


def test_run_ends_quietly_when_nobody_reads_on(tmp_path):
    (tmp_path / "a.script").write_text("while True:\n  sync()\nend\n")
    start = [sys.executable, "-c", "from urscript.cli import main; main()"]
    # Far more than a pipe holds: it cannot end before its reader does.
    words = ["run", "--robot", "none", "--trace", "--trace-lines", "100000", str(tmp_path / "a.script")]
    with subprocess.Popen(
        [*start, *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert "while True:" in process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1
