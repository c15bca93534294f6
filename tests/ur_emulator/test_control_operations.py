"""The operations: what follows from their dataclasses (methods, checks, JSON), and `ur-emulator ctl`."""

import inspect
import json
import math
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest
from control_support import control_box
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator import cli
from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ArgumentError
from ur_emulator.host.box_options import TOKEN_VARIABLE
from ur_emulator.host.control_api.command_line import main, plain
from ur_emulator.host.control_api.operations import OPERATIONS, BoxOperations, ReadProperty, describe, make
from ur_emulator.host.control_api.step_operations import CONDITIONS
from ur_emulator.machine.commands.operation import Kind
from ur_emulator.machine.models.things import SIZES
from ur_emulator.machine.plant.shapes import SHAPES

ROOT = Path(__file__).parents[2]
EVERY = pytest.mark.parametrize("name", OPERATIONS)
# A value of each kind that must fit, beside ranges.
FITTING = {Kind.BOOLEAN: True, Kind.TEXT: "text", Kind.SCRIPT: "text", Kind.ANSWER: 7, Kind.OBJECT: {"x": 1}}


def fitting(parameter):
    if parameter.kind is Kind.CHOICE:
        return parameter.choices[0]
    if parameter.kind is Kind.VECTOR:
        return (0.1,) * parameter.lengths[1]
    return FITTING.get(parameter.kind, 1 if parameter.high is None else parameter.high)


@EVERY
def test_an_operation_that_acts_is_a_method_with_its_parameters_and_its_sentence(name):
    operation, method = OPERATIONS[name], getattr(ControlBox, name)
    assert inspect.getdoc(method).splitlines()[0] == operation.meaning
    if operation.only_reads:
        assert isinstance(method, ReadProperty)
        return
    assert method.__name__ == name
    parameters = list(inspect.signature(method).parameters.values())[1:]
    assert [p.name for p in parameters] == [p.name for p in operation.parameters]
    for mine, row in zip(parameters, operation.parameters, strict=True):
        assert (mine.default is inspect.Parameter.empty) == row.is_required
        if not row.is_required:
            assert mine.default == row.default
        assert f"\n    {row.name}: {row.meaning} ({row.allowed})." in method.__doc__


class Recorder(BoxOperations):
    """Notes the operations that it shall do."""

    def __init__(self):
        self.asked = {}

    def _perform(self, operation):
        self.asked[operation.api_name] = operation.as_given
        return {"tick": 3}


@pytest.mark.parametrize("name", [name for name, operation in OPERATIONS.items() if not operation.only_reads])
def test_a_method_hands_all_its_arguments_on(name):
    box = Recorder()
    values = {p.name: fitting(p) for p in OPERATIONS[name].parameters}
    assert getattr(box, name)(**values) == 3
    assert box.asked == {name: values}


def test_conditions_are_those_of_wait_until():
    names = {p.name for p in OPERATIONS["wait_until"].parameters}
    assert names == set(CONDITIONS) | {"time", "log", "after", "timeout"}


def test_the_shapes_of_obstacles_are_those_of_the_plant():
    assert list(SIZES) == list(SHAPES)


@EVERY
def test_what_fits_is_taken_and_defaults_are_filled_in(name):
    operation = OPERATIONS[name]
    required = {p.name: fitting(p) for p in operation.parameters if p.is_required}
    assert list(asdict(make(name, required))) == [p.name for p in operation.parameters]
    everything = {p.name: fitting(p) for p in operation.parameters}
    assert asdict(make(name, everything)) == everything


@EVERY
def test_what_is_missing_or_unknown_is_named(name):
    rows = OPERATIONS[name].parameters
    with pytest.raises(ArgumentError, match="no parameter 'colour'"):
        make(name, {p.name: fitting(p) for p in rows} | {"colour": 1})
    for parameter in rows:
        if parameter.is_required:
            others = {p.name: fitting(p) for p in rows if p is not parameter}
            with pytest.raises(ArgumentError, match=f"{name} needs {parameter.name}"):
                make(name, others)


ODD = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
)


@given(ODD)
def test_whatever_comes_fits_or_is_refused_in_one_line(value):
    for parameter in {p for operation in OPERATIONS.values() for p in operation.parameters}:
        try:
            checked, complaint = parameter.check(value), ""
        except ArgumentError as error:
            complaint = str(error)
        if complaint:
            assert "\n" not in complaint
            assert complaint.startswith(parameter.name)
            continue
        for number in checked if isinstance(checked, tuple) else [checked]:
            if isinstance(number, float):
                assert math.isfinite(number)
                assert parameter.low is None or number >= parameter.low
                assert parameter.high is None or number <= parameter.high
        json.dumps(checked).encode()


@pytest.mark.parametrize(
    ("operation", "name", "text", "value"),
    [
        ("set_digital_input", "level", "ON", True),
        ("set_digital_input", "level", "false", False),
        ("set_digital_input", "n", "3", 3),
        ("set_speed", "fraction", "0.5", 0.5),
        ("push", "force", "1 2 -3", [1.0, 2.0, -3.0]),
        ("push", "force", "1,2,x", [1.0, 2.0, "x"]),
        ("answer", "value", "true", True),
        ("answer", "value", "3.5", 3.5),
        ("answer", "value", '"3"', "3"),
        ("answer", "value", "some words", "some words"),
        ("answer", "value", "[" * 100_000, "[" * 100_000),
        ("add_to_log", "text", "3", "3"),
    ],
)
def test_words_of_a_command_line_become_values(operation, name, text, value):
    parameter = {p.name: p for p in OPERATIONS[operation].parameters}[name]
    parsed = parameter.parse(text)
    assert (parsed, type(parsed)) == (value, type(value))


def test_the_table_is_json():
    rows = json.loads(json.dumps(describe(), allow_nan=False))
    assert [row["name"] for row in rows] == list(OPERATIONS)
    assert all(row["meaning"].endswith(".") for row in rows)


def test_the_command_line_loads_no_physics():
    code = "import sys, ur_emulator.host.control_api.command_line; print(*sorted({'mujoco', 'numpy', 'lark'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == ""


@pytest.fixture(scope="module")
def box():
    with control_box(in_process=True) as box:
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


@EVERY
def test_every_operation_has_a_sub_command_that_shows_its_options(name, capsys):
    with pytest.raises(SystemExit) as end:
        main([name, "--help"])
    assert end.value.code == 0
    shown = capsys.readouterr().out
    assert all(f"--{parameter.name.replace('_', '-')}" in shown for parameter in OPERATIONS[name].parameters)


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
    def done(line):
        code, out, _ = ctl(*line.split())
        assert code == 0
        return out

    done("set_digital_input --group standard --n 3 --level on")
    assert box.state.digital_inputs["standard"][3]
    assert re.fullmatch(r"done in cycle \d+\n", done("push --force 0 0 -20 --duration 0.1"))
    done("set_speed --fraction 0.5")
    assert box.state.speed == 0.5
    done("set_speed --fraction 1")
    done("add_obstacle --name wall --shape box --size 1 0.1 1 --pose 0 1 0 0 0 0")
    done("add_obstacle --name end --shape plane --size --pose 0 -1 0 -1.57 0 0")
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
    for text in (*texts, "\x1b[2J\r\x9b\u202e"):
        box.add_to_log(text)
    code, out, _ = ctl("log")
    assert code == 0
    assert r"Control: \x1b[2J\r\x9b\u202e" in out  # it is shown and not obeyed
    assert [line.partition("Control: ")[2] for line in out.splitlines() if "of many" in line] == texts
    assert len(json.loads(ctl("log", "--json")[1])["entries"]) == len(out.splitlines())


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


def test_nobody_and_another_server_are_no_box(box, capsys):
    for port in (1, box.ports.dashboard):
        assert main(["state", "--control-port", str(port)]) == 1
        err = capsys.readouterr().err
        assert f"no box answers at 127.0.0.1:{port}" in err
        assert err.count("\n") == 1


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


@pytest.mark.parametrize(("words", "code"), [(["ctl", "--help"], 0), (["ctl"], 2)])
def test_the_command_itself_shows_its_own_help(words, code, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["ur-emulator", *words])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == code
    out, err = capsys.readouterr()
    assert err.count("\n") == 1 if code else "usage: ur-emulator ctl" in out


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


def test_results_for_people():
    assert plain({"tick": 3}) == "done in cycle 3"
    assert (
        plain({"a": True, "long": [1.0, 0.123456], "b": {"c": [True, False]}})
        == "a     true\nlong  1 0.12346\nb.c   1 0"
    )
    assert plain({"questions": [{"id": 1, "text": "?"}]}) == "questions  id 1, text ?"
