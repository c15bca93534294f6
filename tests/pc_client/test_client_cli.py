"""The command line: exit codes, one-line errors, questions before a real arm moves."""

from __future__ import annotations

import errno
import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import pc_client.commands.experiment as experiment
import pc_client.studies.comparison as comparison
from pc_client import cli
from pc_client.arm import QUESTION
from pc_client.errors import DriverError
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import Movement
from pc_client.recording.recording import load_recording
from protocol.primary.layout import ConfigurationData, KinematicsInfo
from protocol.primary.packages import encode_state

CELL = Path(__file__).parents[2] / "examples" / "cell.toml"
HEAVY = ("pinocchio", "scipy", "mcap", "matplotlib", "numpy", "polars")
RUN = ("run", "uniform_4_1", "--robot", "127.0.0.1", "--out", "o")


def test_no_words_at_all_show_the_help(capsys):
    assert cli.run([]) == 0
    assert "experiment" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["experiment"], "--robot"),
        (["experiment", "--robot", "127.0.0.1"], "--out"),
        (["experiment", "--robot", "x", "--out", "y", "--repeat", "0"], "repeat"),
        (["experiment", "--robot", "127.0.0.1", "--out", "y", "--port-base", "70000"], "port offset"),
        (["experiment", "--robot", "x", "--out", "y", "--set", "arcs", "--movements", "z.toml"], "only one"),
        (["fly"], "fly"),
        (["movements"], "command"),
        (["doctor", "--robot", "x", "--quickly"], "quickly"),
        (["export", "x.mcap", "--to", "xlsx"], "is not one of 'csv', 'parquet', 'mat'"),
        ([*RUN, "--gain-p", "300"], "--gain-p: 300.0; give a number from 0 to 200 1/s"),
        ([*RUN, "--gain-i", "nan"], "--gain-i: nan; give a number"),
        ([*RUN, "--acceleration", "0"], "--acceleration: 0.0; give a number from 0.1 to 100 rad/s2"),
        ([*RUN, "--gain-p", "much"], "--gain-p"),
        ([*RUN, "--reverse-port", "65536"], "--reverse-port"),
        ([*RUN, "--reverse-port", "-1"], "--reverse-port"),
        (["run", "lognorm_9_9", "--robot", "127.0.0.1", "--out", "o"], "no movement"),
        (["movements", "show", "lognorm_9_9"], "no movement"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(arguments, words, one_line):
    assert cli.run(arguments) == 2
    assert words in one_line()


def free_offset():
    """A port offset at which nothing listens."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1] - 30001


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nowhere.toml", "--robot", "127.0.0.1", "--out", "o"], "nowhere.toml"),
        (["run", "uniform_4_1", "--robot", "127.0.0.1", "--out", "o", "--controller", "pid"], "preview"),
        ([*RUN, "--controller", "mine.toml"], "mine.toml: cannot be read"),
        ([*RUN, "--cell", "mine.toml"], "mine.toml: cannot be read"),
        (["doctor", "--robot", "127.0.0.1", "--cell", "mine.toml"], "mine.toml: cannot be read"),
        (
            ["experiment", "--robot", "127.0.0.1", "--out", "o", "--set", "mine"],
            'no set of movements "mine": give one of paper, arcs',
        ),
        (["report", "empty"], "no recordings"),
        (["export", "missing.mcap"], "missing.mcap"),
        (["run", "uniform_4_1", "--robot", "127.0.0.1", "--port-base", "FREE", "--out", "o"], "refuses"),
        (["run", "uniform_4_1", "--robot", "no.such.invalid", "--yes", "--out", "o"], "cannot be looked up"),
        (
            ["run", "uniform_4_1", "--robot", "127.0.0.1:30003", "--out", "o"],
            "give the name or address alone; --port-base",
        ),
        (["run", "uniform_4_1", "--robot", "x" * 300, "--out", "o"], "xxx"),
        (["run", "nan.csv", "--robot", "no.such.invalid", "--out", "o"], 'nan.csv, line 1: x is "nan"'),
    ],
)
def test_what_does_not_work_is_one_line_and_exit_1(arguments, words, one_line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nan.csv").write_text("nan 0 .3 0\n")
    arguments = [str(free_offset()) if a == "FREE" else a for a in arguments]
    assert cli.run(arguments) == 1
    assert words in one_line()
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(("words", "prefix"), [([], ""), (["--set", "arcs"], "arcs_")])
def test_an_experiment_has_the_ten_of_the_paper_or_of_the_set_that_is_named(
    words, prefix, tmp_path, monkeypatch
):
    chosen = []
    monkeypatch.setattr(experiment, "execute", lambda movements, *_: chosen.extend(movements))
    monkeypatch.setattr(experiment, "show_report", lambda out: None)
    assert cli.run(["experiment", "--robot", "x", "--out", str(tmp_path), *words]) == 0
    assert [movement.name for movement in chosen] == [prefix + name for name in library_names("paper")]


def test_a_box_in_the_way_refuses_the_run_before_anything_moves(robot, tmp_path, one_line):
    cell = tmp_path / "cell.toml"
    cell.write_text(
        'format = 1\nname = "c"\n[[spheres]]\nname = "ball"\ncentre = [0.35, 0, 0.25]\nradius = 0.1\n'
    )
    assert cli.run([*RUN[:-1], str(tmp_path / "out"), "--cell", str(cell)]) == 1
    assert "of sphere 'ball', at least 20 mm is asked" in one_line()
    assert not robot.programs


def test_a_run_in_its_cell_is_recorded_and_reported(robot, tmp_path, capsys, one_line):
    out = tmp_path / "out"
    given = [*RUN[:-1], str(out), "--cell", str(CELL)]
    # The file says that the arm carries 0.4 kg, the pendant that it carries nothing.
    assert cli.run(given) == 1
    assert "payload is 0.00 kg, must be 0.40 kg" in one_line()
    robot.payload = 0.4
    assert cli.run(given) == 0
    assert robot.at_rest
    assert robot.listener.port == 31000
    assert {p.name for p in out.iterdir()} >= {
        "uniform_4_1_r1.mcap",
        "table1.json",
        "table1.md",
        "report.html",
    }
    assert load_recording(out / "uniform_4_1_r1.mcap").provenance.cell_text == CELL.read_text()
    text, page = capsys.readouterr().out, (out / "report.html").read_text()
    assert "loop delay" in text
    assert "lag 0.0" not in text  # preview knows no lag, so none is shown
    assert "within 0.0" not in text + page
    assert "19.02" in text  # the paper's figure stands beside ours
    assert "bench by the window" in page
    assert "no cell file" not in page


@pytest.fixture
def short(tmp_path, monkeypatch):
    """A file of a short movement. Its report has no page: figures take as long as the movement."""
    monkeypatch.setattr("pc_client.analysis.report.render_page", lambda *_: "")
    points = [(0.35, -0.05, 0.25), (0.35, 0.05, 0.28)]
    Movement.through(points, "robot", [1.2], name="short").save(tmp_path / "short.toml")
    return str(tmp_path / "short.toml")


def test_own_numbers_reach_robot_recording_and_table(robot, short, tmp_path, capsys):
    (tmp_path / "mine.toml").write_text('base = "paper"\ngain_i = 3\nspeed_share = 0.9')
    out, recording = tmp_path / "out", tmp_path / "out" / "short_r1.mcap"
    own = ["--controller", str(tmp_path / "mine.toml"), "--gain-p", "5", "--acceleration", "3"]
    given = ["experiment", "--movements", short, "--repeat", "1", "--robot", "127.0.0.1", "--out", str(out)]
    given += [*own, "--reverse-port", "4321"]
    assert cli.run(given) == 0
    receivers = [program for program in robot.programs if "socket_open" in program]
    assert len(receivers) == 3  # approach, identification, run
    assert all("pc_port = 4321 " in program for program in receivers)
    title = "paper with gain_p 5, gain_i 3, speed_share 0.9"
    assert json.loads((out / "table1.json").read_text())["controller"] == title
    assert title in " ".join(capsys.readouterr().out.split())
    provenance = load_recording(recording).provenance
    assert (provenance.controller, provenance.cell_text) == (title, "")
    assert [provenance.controller_config[name] for name in ("gain_p", "gain_i")] == [5.0, 3.0]
    assert cli.run(["report", str(out)]) == 0
    assert "short" in capsys.readouterr().out
    assert cli.run(["export", str(recording), "--to", "csv"]) == 0
    assert "data: SIMULATED" in capsys.readouterr().out
    header, *rows = recording.with_suffix(".csv").read_text().splitlines()
    assert header.startswith("timestamp [s],")
    assert len(rows) > 200


def test_yes_skips_the_question_before_a_real_arm_moves(robot, short, tmp_path, monkeypatch):
    robot.serial = "2017355123"

    def answer(question):
        raise AssertionError("asked")

    monkeypatch.setattr("builtins.input", answer)
    assert cli.run(["run", short, "--robot", "192.0.2.7", "--yes", "--out", str(tmp_path / "out")]) == 0
    assert robot.programs


@pytest.mark.parametrize("command", ["experiment", "run", "draw", "compare"])
def test_commands_that_move_an_arm_share_their_options(command, capsys):
    assert cli.run([command, "--help"]) == 0
    text = capsys.readouterr().out
    for option in (
        "--controller",
        "--gain-p",
        "--gain-i",
        "--acceleration",
        "--port-base",
        "--overwrite",
        "--yes",
        "--dry-run",
    ):
        assert option in text


def test_a_real_arm_does_not_move_before_the_answer(robot, tmp_path, capsys, monkeypatch):
    robot.serial = "2017355123"
    asked = []

    def answer(question):
        asked.append(question)
        assert robot.programs == []
        assert set(robot.closed) == set(robot.pipes)
        return "n"

    monkeypatch.setattr("builtins.input", answer)
    code = cli.run(["run", "uniform_4_1", "--robot", "192.0.2.7", "--out", str(tmp_path / "out")])
    assert code == 1
    assert len(asked) == 1
    assert robot.programs == []
    assert not (tmp_path / "out").exists()
    told = capsys.readouterr()
    assert told.err.splitlines()[-1] == "ur-client: the arm was not moved: the answer was no"
    asked_about = ("UR3, software 3.15.8", "speed slider", "TCP offset", "box of motion", "joint range")
    for words in (*asked_about, "top TCP speed", "top joint speed", "duration"):
        assert words in told.out


@pytest.mark.parametrize("command", [("run", "uniform_4_1"), ("compare", "--targets", "2")])
def test_a_dry_run_shows_plan_and_question_also_of_a_simulated_arm(
    command, robot, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(comparison, "GENERATORS", {"lognormal": comparison.GENERATORS["lognormal"]})
    out = tmp_path / "out"
    assert cli.run([*command, "--robot", "127.0.0.1", "--dry-run", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    for words in ("SIMULATED", "speed slider", "box of motion", "first, slowly", QUESTION, "nothing moved"):
        assert words in text
    assert robot.programs == []
    assert not out.exists()


@pytest.mark.parametrize("library", ["matplotlib", "jinja2"])
def test_a_library_of_the_report_is_missed_before_the_arm_moves(
    library, robot, tmp_path, one_line, monkeypatch
):
    monkeypatch.setitem(sys.modules, library, None)
    assert cli.run(["run", "uniform_4_1", "--robot", "127.0.0.1", "--out", str(tmp_path)]) == 1
    assert f"the report needs {library}; install it with: pip install 'ur-hil[report]'" in one_line()
    assert robot.programs == []


def test_ctrl_c_is_one_line_and_leaves_the_arm_stopped(robot, short, tmp_path, capsys):
    def interrupt(r):
        if r.program == "receiver" and len(r.received) == 300:
            robot.on_tick = None
            raise KeyboardInterrupt

    robot.on_tick = interrupt
    assert cli.run(["run", short, "--robot", "127.0.0.1", "--out", str(tmp_path / "out")]) == 130
    err = [line for line in capsys.readouterr().err.splitlines() if line]
    assert err[-1].startswith("ur-client: interrupted")
    assert robot.at_rest


def test_protective_stop_is_one_line(robot, short, tmp_path, one_line):
    def stop(r):
        if len(r.received) == 300:
            r.safety_mode = 3

    robot.on_tick = stop
    assert cli.run(["run", short, "--robot", "127.0.0.1", "--out", str(tmp_path / "out")]) == 1
    assert "PROTECTIVE_STOP" in one_line()
    assert not list(tmp_path.rglob("table1.*"))


def test_doctor_says_ready(robot, capsys):
    assert cli.run(["doctor", "--robot", "127.0.0.1", "--seconds", "0.5"]) == 0
    out = capsys.readouterr().out
    assert "30003  realtime      open" in out
    assert "UR3, software 3.15.8, serial number 20993000007, SIMULATED" in out
    assert "1140 bytes" in out
    assert "streaming   ready" in out


def test_doctor_refuses_time_stamps_that_run_backwards(robot, capsys):
    robot.lockstep = False
    robot.on_tick = lambda fake: setattr(fake, "tick", fake.tick - 2)
    assert cli.run(["doctor", "--robot", "127.0.0.1", "--seconds", "0.5"]) == 1
    assert "NOT NOW: the robot's frames jump back from 8.000000 s to 7.992000 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("cause", "word"),
    [
        (ConnectionRefusedError(), "closed"),
        (TimeoutError(), "no answer"),
        (OSError(errno.EHOSTUNREACH, "No route to host"), "no route"),
    ],
)
def test_doctor_tells_a_closed_port_from_one_that_cannot_be_reached(robot, capsys, cause, word):
    reached = robot.connect

    def connect(host, port, timeout):
        if port == 502:
            raise DriverError("no connection") from cause
        return reached(host, port, timeout)

    robot.connect = connect
    assert cli.run(["doctor", "--robot", "127.0.0.1", "--seconds", "0.1"]) == 0
    assert f"port   502  modbus        {word}\n" in capsys.readouterr().out


def test_doctor_asks_rtde_and_does_not_only_dial(robot, capsys):
    took = robot.took
    robot.took = lambda pipe, data: (
        took(pipe, data) if pipe.kind != "rtde" else pipe.incoming.append(b"SSH-2.0")
    )
    assert cli.run(["doctor", "--robot", "127.0.0.1", "--seconds", "0.1"]) == 0
    out = capsys.readouterr().out
    assert "port 30004  rtde          open, but it does not answer as RTDE\n" in out
    assert out.endswith("streaming   ready; not reported by this software: payload, RTDE\n")


def test_doctor_shows_every_condition_and_only_reads(robot, capsys):
    robot.slider, robot.payload, robot.lockstep = 0.5, None, False
    assert cli.run(["doctor", "--robot", "127.0.0.1", "--seconds", "0.5"]) == 1
    lines = capsys.readouterr().out.splitlines()
    rows = {
        name: " ".join(line.removeprefix(name).split())
        for name in ("cycle", "speed slider", "payload", "TCP offset")
        for line in lines
        if line.startswith(name)
    }
    assert rows["cycle"].startswith("8.000 ms, 0 cycles lost")
    assert rows["speed slider"] == "50 % must be 100 % NOT OK"
    assert rows["payload"] == "- must be 0.00 kg within 0.05 kg not reported"
    assert rows["TCP offset"].endswith(" ok")
    assert lines[-1].startswith(
        "streaming   NOT NOW: the robot's speed slider is 50 %, must be 100 %; set it"
    )
    assert robot.programs == []


def test_doctor_names_the_calibration_of_the_arm_as_the_makers_driver_does(robot, capsys):
    nominal_ur5e = KinematicsInfo(
        dh_a=(0.0, -0.425, -0.3922, 0.0, 0.0, 0.0),
        dh_d=(0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996),
        dh_alpha=(1.570796327, 0.0, 0.0, 1.570796327, -1.570796327, 0.0),
    )
    robot.state = encode_state([ConfigurationData(), nominal_ur5e], robot.version)
    robot.lockstep = False
    cli.run(["doctor", "--robot", "127.0.0.1", "--seconds", "0.1"])
    assert "calibration calib_12788084448423163542\n" in capsys.readouterr().out


def test_doctor_where_nothing_answers(capsys):
    assert cli.run(["doctor", "--robot", "127.0.0.1", "--port-base", str(free_offset())]) == 1
    out = capsys.readouterr().out
    assert out.count("closed") >= 8
    assert "refuses the connection" in out


def test_a_movement_is_shown_for_people_and_as_json(capsys):
    assert cli.run(["movements", "show", "uniform_5_1", "--json"]) == 0
    assert '"duration_s"' in capsys.readouterr().out
    assert cli.run(["movements", "show", "uniform_5_1"]) == 0
    assert "box of motion" in capsys.readouterr().out


def test_missing_extras_name_the_command_to_install(tmp_path):
    """In an interpreter of its own: a module that is loaded anew is another one than its package has."""
    code = (
        "import sys; sys.modules['pinocchio'] = None; from pc_client.cli import run; "
        "sys.exit(run(['run', 'uniform_4_1', '--robot', '127.0.0.1', '--out', 'o']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 1
    assert "pip install 'ur-hil[client]'" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("code", "waits"),
    [
        ("from pc_client.cli import run; run(['--help'])", HEAVY),
        (
            "import pc_client.recording.recorder, pc_client.recording.recording, pc_client.analysis.report",
            ("matplotlib", "jinja2"),
        ),
        # what moves an arm, and what worker processes run
        (
            "import pc_client.arm, pc_client.analysis.run, pc_client.studies.extraction.batch, "
            "pc_client.studies.sweep.schedule, pc_client.commands.movements, pc_client.results.tables",
            ("polars",),
        ),
        ("import pc_client.studies.sweep.schedule, pc_client.commands.sweep", ("optuna",)),
    ],
    ids=["help", "report", "arm", "sweep"],
)
def test_what_is_heavy_is_loaded_only_when_it_is_needed(code, waits):
    asked = f"{code}; import sys; print([name for name in {waits} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", asked], check=True, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"
