"""`ur-emulator ctl`: every operation from the command line, exit codes, one-line errors."""

import json
import re
import subprocess
import sys

import pytest
from control_support import control_box

from ur_emulator.box_options import TOKEN_VARIABLE
from ur_emulator.budgets import BUDGETS
from ur_emulator.control_api.command_line import main, make_parser, plain
from ur_emulator.control_api.http_client import ControlClient
from ur_emulator.control_api.operations import OPERATIONS
from ur_emulator.errors import ControlError


@pytest.fixture(scope="module")
def box():
    with control_box() as box:
        yield box


@pytest.fixture
def ctl(box, capsys):
    """Run a command line against the box; returns exit code, output, complaint."""

    def run(*words):
        try:
            code = main([*words, "--host", box.host, "--control-port", str(box.control_port)])
        except SystemExit as end:
            code = end.code
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_has_a_sub_command_that_shows_its_options(name, capsys):
    with pytest.raises(SystemExit) as end:
        main([name, "--help"])
    assert end.value.code == 0
    shown = capsys.readouterr().out
    assert all(f"--{parameter.name.replace('_', '-')}" in shown for parameter in OPERATIONS[name].parameters)


def test_operations_are_listed():
    shown = make_parser().format_help()
    assert all(name in shown for name in OPERATIONS)


def test_the_state_for_people_and_as_json(box, ctl):
    code, out, err = ctl("state")
    assert (code, err) == (0, "")
    lines = dict(line.split(None, 1) for line in out.splitlines() if len(line.split()) > 1)
    assert lines["robot_mode"] == "RUNNING"
    assert lines["steady"] == "true"
    assert lines["digital_inputs.tool"] == "0 0"
    assert len(lines["q"].split()) == 6
    code, out, _ = ctl("state", "--json")
    assert json.loads(out)["q"] == pytest.approx(box.state.q)


def test_words_become_values(box, ctl):
    assert ctl("set_digital_input", "--group", "standard", "--n", "3", "--level", "on")[0] == 0
    assert box.state.digital_inputs["standard"][3]
    code, out, _ = ctl("push", "--force", "0", "0", "-20", "--duration", "0.1")
    assert code == 0
    assert re.fullmatch(r"done in cycle \d+\n", out)
    assert ctl("set_speed", "--fraction", "0.5")[0] == 0
    assert box.state.speed == 0.5
    assert ctl("set_speed", "--fraction", "1")[0] == 0
    assert (
        ctl(
            "add_obstacle",
            "--name",
            "wall",
            "--shape",
            "box",
            "--size",
            "1",
            "0.1",
            "1",
            "--pose",
            "0",
            "1",
            "0",
            "0",
            "0",
            "0",
        )[0]
        == 0
    )
    assert (
        ctl(
            "add_obstacle",
            "--name",
            "end",
            "--shape",
            "plane",
            "--size",
            "--pose",
            "0",
            "-1",
            "0",
            "-1.57",
            "0",
            "0",
        )[0]
        == 0
    )
    assert box.state.obstacles == ("wall", "end")


def test_a_program_of_this_machine_runs_and_its_question_is_answered(box, ctl, tmp_path):
    path = tmp_path / "ask.script"
    path.write_text('def ask():\n  textmsg("said ", request_integer_from_primary_client("how many?"))\nend\n')
    assert ctl("run_program", "--script-file", str(path))[0] == 0
    code, out, _ = ctl("wait_until", "--question", "true")
    assert code == 0
    assert "how many?" in out
    code, _, err = ctl("answer", "--value", "lots")
    assert code == 1
    assert "how many?" in err
    assert ctl("answer", "--value", "42")[0] == 0
    assert ctl("wait_until", "--log", "said 42")[0] == 0
    code, out, _ = ctl("log")
    assert code == 0
    assert "INFO Program: said 42" in out
    assert "said 42" not in ctl("log", "--after", str(10**6))[1]
    assert ctl("log", "--level", "FAULT")[1] == "\n"


def test_a_program_that_fails_is_a_failure_of_the_command_that_waits_for_it(ctl):
    fails = ("run_program", "--script", "def f():\n  sync()\n  x = 1 / 0\nend\n")
    assert ctl(*fails)[0] == 0
    code, _, err = ctl(*fails, "--wait")
    assert code == 1
    assert "program f ended with an error" in err
    assert ctl("run_program", "--script", "sleep(0.1)\n", "--wait")[0] == 0


def test_the_whole_log_comes_although_the_box_gives_some_entries_at_a_time(box, ctl):
    texts = [f"entry {k} of many" for k in range(2 * BUDGETS.log_entries + 1)]
    for text in texts:
        box.add_to_log(text)
    code, out, _ = ctl("log")
    assert code == 0
    assert [line.partition("Control: ")[2] for line in out.splitlines() if "of many" in line] == texts
    assert len(json.loads(ctl("log", "--json")[1])["entries"]) == len(out.splitlines())


def test_what_others_have_said_is_shown_and_not_obeyed(box, ctl):
    box.add_to_log("\x1b[2J\r\x9b\u202e")
    assert r"Control: \x1b[2J\r\x9b\u202e" in ctl("log")[1]


def test_a_program_that_is_too_long_is_not_sent_and_the_message_says_where_to(ctl, tmp_path):
    path = tmp_path / "long.script"
    path.write_text("def f():\n" + "# x\n" * BUDGETS.body_bytes + "end\n")
    code, _, err = ctl("run_program", "--script-file", str(path))
    assert code == 1
    assert "the control API takes 65536; send a longer program to port 30002" in err


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["push", "--force", "0", "0", "1e9"], 2, "at most 250 N"),
        (["push", "--force", "0", "0"], 2, "expected 3 arguments"),
        (["push", "--force", "a", "b", "c"], 2, "three numbers"),
        (["push"], 2, "needs force"),
        (["push", "--strength", "3"], 2, "--strength"),
        (["set_digital_input", "--group", "tool", "--n", "x", "--level", "on"], 2, "n 'x' given"),
        (["nope"], 2, "nope"),
        (["run_program", "--script-file", "/nowhere.script"], 2, "/nowhere.script"),
        (["run_program"], 1, "either"),
        (["run_program", "--script", "def f("], 1, "does not compile"),
        (["unlock_protective_stop"], 1, "no protective stop"),
        (["wait_until", "--robot-mode", "IDLE", "--timeout", "0"], 1, "robot_mode is RUNNING"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_and_its_exit_code(ctl, words, code, says):
    got, out, err = ctl(*words)
    assert (got, out) == (code, "")
    assert says in err
    assert err.startswith("ur-emulator ctl: ")
    assert err.count("\n") == 1


def test_no_box_is_one_line_and_exit_1(capsys):
    assert main(["state", "--control-port", "1"]) == 1
    err = capsys.readouterr().err
    assert "no box answers at 127.0.0.1:1" in err
    assert err.count("\n") == 1


def test_another_server_is_no_box(box, capsys):
    assert main(["state", "--control-port", str(box.ports.dashboard)]) == 1
    assert "no box answers" in capsys.readouterr().err


def test_the_log_is_followed_until_the_box_ends(tmp_path):
    with control_box() as box:
        command = ["ctl", "log", "--follow", "--control-port", str(box.control_port)]
        process = subprocess.Popen(
            [sys.executable, "-m", "ur_emulator", *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        box.add_to_log("one")
        assert process.stdout.readline().endswith("Control: one\n")
        box.add_to_log("two")
        assert process.stdout.readline().endswith("Control: two\n")
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (1, "")
    assert "no box answers" in err or "ended" in err


def test_the_command_itself_shows_its_own_help(ur_emulator_main):
    for words in (["ctl", "--help"], ["ctl", "push", "--help"]):
        code, out, _ = ur_emulator_main(*words)
        assert code == 0
        assert "usage: ur-emulator ctl" in out
    code, _, err = ur_emulator_main("ctl")
    assert code == 2
    assert err.count("\n") == 1


@pytest.fixture
def ur_emulator_main():
    def run(*words):
        done = subprocess.run(
            [sys.executable, "-m", "ur_emulator", *words],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        return done.returncode, done.stdout, done.stderr

    return run


def test_the_token_comes_from_the_option_or_from_the_environment(capsys, monkeypatch):
    with control_box(control_token="s3cret/+") as box:
        words = ["close_popups", "--host", box.host, "--control-port", str(box.control_port)]
        assert main(words) == 1
        assert "Authorization: Bearer" in capsys.readouterr().err
        assert main([*words, "--token", "S3cret/+"]) == 1
        assert main([*words, "--token", "s3cret/+"]) == 0
        monkeypatch.setenv(TOKEN_VARIABLE, "s3cret/+")
        assert main(words) == 0
        assert main([*words, "--token", "other"]) == 1
    assert main(["state", "--token", "a\nb"]) == 2
    assert capsys.readouterr().err.endswith("200 printed characters of ASCII, no blanks\n")


def test_python_may_ask_over_http_as_well(box):
    client = ControlClient(box.host, box.control_port)
    assert client.perform("identity", {})["robot"] == "UR3"
    with pytest.raises(ControlError):
        client.perform("push", {"force": 1})


def test_results_for_people():
    assert plain({"tick": 3}) == "done in cycle 3"
    assert (
        plain({"a": True, "long": [1.0, 0.123456], "b": {"c": [True, False]}})
        == "a     true\nlong  1 0.12346\nb.c   1 0"
    )
    assert plain({"questions": [{"id": 1, "text": "?"}]}) == "questions  id 1, text ?"
