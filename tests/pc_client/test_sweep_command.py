"""`ur-client sweep` as a user meets it: tables, plots, resuming, interruption, errors in one line."""

from __future__ import annotations

import csv
import sys
from contextlib import nullcontext

import pytest
import sweep_samples
from sweep_samples import write

from pc_client import cli
from pc_client.movements.movement import Movement
from pc_client.recording.recording import load_recording

GRID = """
movements = ["uniform_4_1", "lognorm_4_1"]
fidelities = ["typical", "poor"]
seeds = [1]
repeat = 2
[controller]
gain_p = [2.0, 5.0, 8.0]
gain_i = [0.0, 2.0]
"""


@pytest.fixture
def job(monkeypatch):
    """Runs invented jobs in this process instead of experiments; a list of the cases that ran."""
    ran = []

    def use(function):
        def side_by_side(job, *, workers, dask):
            def run(cases):
                for case in cases:
                    ran.append(case)
                    yield case, function(case, **job.keywords)

            return nullcontext(run)

        monkeypatch.setattr("pc_client.studies.sweep.schedule.side_by_side", side_by_side)
        return ran

    return use


@pytest.fixture
def quick_job(job, monkeypatch):
    """The same without plots, which take seconds."""
    monkeypatch.setattr("pc_client.studies.sweep.page.render_page", lambda name, table: name)
    return job


def run(path, out, *options):
    return cli.run(["sweep", str(path), "--out", str(out), *options])


def read_csv(out):
    with (out / "sweep.csv").open() as file:
        return list(csv.DictReader(file))


def test_a_sweep_finds_the_best_gains_and_a_second_call_does_nothing_again(job, tmp_path, capsys):
    ran = job(sweep_samples.invented)
    out, path = tmp_path / "out", write(tmp_path, GRID)
    assert run(path, out, "--format", "csv") == 0
    told = capsys.readouterr().out
    assert "24 cases, 0 of them done before" in told
    assert "5 of 6 settings; the table has all\n" in told  # five are shown
    assert "best of 6: gain_p = 5, gain_i = 2: 30.15 dB, 8 runs, gain margin 8.33" in told
    edge = "(gain_i = 2 is the largest of 2)"
    assert edge in told
    assert len(read_csv(out)) == 48
    page = (out / "sweep.html").read_text()
    assert "SIMULATED" in page
    assert page.count("<img") == 1 + 5  # the map; over movement, fidelity, both gains and repetition
    assert page.count("<h1>Sweep</h1>") == 1  # of the file sweep.toml
    assert edge in page
    assert page.index("gain_p = 5, gain_i = 2") < page.index("gain_p = 8, gain_i = 0")
    first = files_of(out)
    ran.clear()
    assert run(path, out, "--format", "csv") == 0
    assert ran == []
    assert "24 of them done before" in capsys.readouterr().out
    assert files_of(out) == first


def test_a_changed_configuration_uses_the_cases_that_it_shares(quick_job, tmp_path):
    ran = quick_job(sweep_samples.invented)
    out = tmp_path / "out"
    assert run(write(tmp_path, GRID), out, "--format", "csv") == 0
    ran.clear()
    assert run(write(tmp_path, GRID.replace("2.0, 5.0, 8.0", "5.0, 6.0")), out, "--format", "csv") == 0
    assert {case.controller.gain_p for case in ran} == {6.0}
    assert {row["gain_p"] for row in read_csv(out)} == {"5.0", "6.0"}


def test_ctrl_c_keeps_what_is_done_and_the_same_command_goes_on(quick_job, tmp_path, one_line):
    out, path = tmp_path / "out", write(tmp_path, GRID.replace("seeds = [1]", "seeds = [1, 13]"))
    quick_job(sweep_samples.interrupted)
    assert run(path, out, "--format", "csv") == 130
    assert "interrupted; 12 of 48 cases are kept" in one_line()
    assert len(read_csv(out)) == 24
    ran = quick_job(sweep_samples.invented)
    ran.clear()
    assert run(path, out, "--format", "csv") == 1  # seed 13 fails
    assert len(ran) == 36


def test_refused_and_failed_cases_are_rows_and_the_sweep_goes_on(job, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("pc_client.results.figures.svg_text", lambda figure: "")
    job(sweep_samples.invented)
    text = GRID.replace("seeds = [1]", "seeds = [1, 13]").replace("8.0]", "30.0]")
    out = tmp_path / "out"
    assert run(write(tmp_path, text), out, "--format", "csv") == 1
    rows = read_csv(out)
    assert [sum(row["status"] == s for row in rows) for s in ("done", "refused", "failed")] == [32, 16, 16]
    assert {row["gain_margin"] for row in rows if row["status"] == "refused"} == {"0.5"}
    told = capsys.readouterr().out
    assert "no setting has all its cases done" in told
    assert "failed: 11 more" in told
    page = (out / "sweep.html").read_text()
    assert "the simulated box died" in page


def test_refused_cases_alone_are_no_failure(quick_job, tmp_path, capsys):
    quick_job(sweep_samples.invented)
    assert run(write(tmp_path, GRID.replace("8.0]", "30.0]")), tmp_path / "out", "--format", "csv") == 0
    assert "best of 6: gain_p = 5, gain_i = 2" in capsys.readouterr().out


SEARCH = """
movements = ["uniform_4_1", "lognorm_4_1"]
[search]
trials = 12
batch = 4
[controller]
gain_p = { low = 1.0, high = 40.0, log = true }
gain_i = { low = 0.0, high = 5.0 }
"""


def test_the_settings_of_a_search_are_drawn_as_dots(job, tmp_path, capsys):
    ran = job(sweep_samples.invented)
    assert run(write(tmp_path, SEARCH), tmp_path / "out", "--format", "csv") == 0
    assert (tmp_path / "out" / "sweep.html").read_text().count("<img") == 4
    assert "best of 12" in capsys.readouterr().out
    assert len(ran) == 24


@pytest.mark.parametrize("after", [0, 9, 23])
def test_an_interrupted_search_goes_on_as_if_it_had_not_been(quick_job, after, tmp_path):
    path = write(tmp_path, SEARCH)
    ran = quick_job(sweep_samples.invented)
    assert run(path, tmp_path / "whole", "--format", "csv") == 0
    whole = list(ran)
    ran.clear()

    def interrupt(case, keep_recordings):
        if len(ran) > after:
            raise KeyboardInterrupt
        return sweep_samples.invented(case)

    quick_job(interrupt)
    assert run(path, tmp_path / "parts", "--format", "csv") == 130
    ran.clear()
    quick_job(sweep_samples.invented)
    assert run(path, tmp_path / "parts", "--format", "csv") == 0
    assert ran == whole[after:]
    assert files_of(tmp_path / "parts") == files_of(tmp_path / "whole")


def files_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_one_case_alone_needs_no_plots(job, tmp_path, capsys):
    job(sweep_samples.invented)
    assert run(write(tmp_path, 'movements = ["uniform_4_1"]'), tmp_path / "out", "--format", "csv") == 0
    assert "<img" not in (tmp_path / "out" / "sweep.html").read_text()
    assert "best of 1: controller = preview" in capsys.readouterr().out


def test_without_matplotlib_there_is_a_table(job, tmp_path, capsys, monkeypatch):
    job(sweep_samples.invented)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    assert run(write(tmp_path, GRID), tmp_path / "out", "--format", "csv") == 0
    assert "no plots: they need jinja2" in capsys.readouterr().out
    assert (tmp_path / "out" / "sweep.csv").exists()


def test_a_disk_that_fills_up_ends_the_sweep_in_one_line(quick_job, tmp_path, monkeypatch, one_line):
    from pc_client.studies.sweep.store import ResultStore

    stored = []
    real = ResultStore.settle

    def settle(self, case, outcome):
        if len(stored) == 5:
            (self.path / "cases").rename(self.path / "gone")
            (self.path / "cases").write_text("")
        real(self, case, outcome)
        stored.append(case)

    ran = quick_job(sweep_samples.invented)
    monkeypatch.setattr(ResultStore, "settle", settle)
    assert run(write(tmp_path, GRID), tmp_path / "out", "--format", "csv") == 1
    assert "cannot write" in one_line()
    assert len(ran) == 6


@pytest.mark.parametrize(
    ("text", "options", "code", "words"),
    [
        (GRID, ["--workers", "0"], 2, "workers"),
        (GRID, ["--workers", "2", "--dask", "tcp://x:1"], 2, "only one"),
        (GRID, ["--format", "xlsx"], 2, "'parquet', 'csv'"),
        (GRID + "gain_d = 3", [], 1, "did you mean gain_"),
        ('movements = ["uniform_4_1"]\nrobot = "127.0.0.1"', ["--workers", "2"], 2, "one robot"),
        ('movements = ["uniform_4_1"]\nrobot = "no.such.invalid"', ["--yes"], 1, "cannot be looked up"),
        (GRID, ["--out", "sweep.toml"], 1, "cannot write"),
        (GRID, ["--dask", "tcp://127.0.0.1:1"], 1, "no Dask scheduler answers"),
    ],
)
def test_what_does_not_work_is_one_line(text, options, code, words, tmp_path, monkeypatch, one_line):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pc_client.studies.executors._DASK_TIMEOUT", "300ms")
    path = write(tmp_path, text)
    assert (
        cli.run(["sweep", str(path), *(["--out", "out"] if "--out" not in options else []), *options]) == code
    )
    assert words in one_line()


def test_a_sweep_needs_a_folder(tmp_path, one_line):
    assert cli.run(["sweep", str(write(tmp_path, GRID))]) == 1
    assert "--out DIR" in one_line()


GIVEN = """
movements = ["short.toml"]
robot = "127.0.0.1"
keep_recordings = true
[controller]
gain_p = [4.0, 6.0]
"""


@pytest.fixture
def given(tmp_path):
    """A sweep of a short movement over two gains, on a robot that is there."""
    points = [(0.35, -0.05, 0.25), (0.35, 0.05, 0.28)]
    Movement.through(points, "robot", [1.2], name="short").save(tmp_path / "short.toml")
    return write(tmp_path, GIVEN)


def test_a_robot_that_is_there_runs_one_case_after_the_other(robot, given, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(given, out, "--format", "csv") == 0
    assert robot.at_rest
    rows = read_csv(out)
    assert [row["status"] for row in rows] == ["done", "done"]
    assert {(row["robot"], row["fidelity"], row["seed"]) for row in rows} == {("ur3", "", "")}
    assert len(list(out.glob("recordings/*/short_r1.mcap"))) == 2
    assert "best of 2" in capsys.readouterr().out


def test_a_real_arm_does_not_move_before_the_answer(robot, given, tmp_path, capsys, monkeypatch):
    robot.serial = "2017355123"

    def answer(question):
        assert robot.programs == []
        return "n"

    monkeypatch.setattr("builtins.input", answer)
    assert run(given, tmp_path / "out") == 1
    assert robot.programs == []
    told = capsys.readouterr()
    assert "2 runs of each" in told.out
    assert told.err == "ur-client: the arm was not moved: the answer was no\n"


def test_a_robot_that_is_not_as_it_must_be_is_refused(robot, given, tmp_path, capsys):
    robot.tcp_offset = (0.0, 0.0, 0.15, 0.0, 0.0, 0.0)
    assert run(given, tmp_path / "out", "--yes") == 1
    told = capsys.readouterr().err
    assert told.startswith("ur-client: the robot's TCP offset is (0.0, 0.0, 150.0) mm")
    assert told.count("\n") == 1
    assert robot.programs == []


def test_a_robot_that_stops_ends_the_sweep(robot, given, tmp_path, capsys):
    received = []

    def stop(r):
        received.append(r.program == "receiver")
        if sum("velocity_receiver" in text for text in r.programs) == 3 and sum(received[-100:]) == 100:
            r.safety_mode = 3

    robot.on_tick = stop
    assert run(given, tmp_path / "out", "--format", "csv") == 1
    (row,) = read_csv(tmp_path / "out")
    assert row["status"] == "failed"
    assert "PROTECTIVE_STOP" in row["error"]
    (incident,) = tmp_path.glob("out/incidents/*/short_r1.mcap")
    assert row["error"].endswith(f"recorded until then: {incident.relative_to(tmp_path / 'out')}")
    assert load_recording(incident).aborted
    assert "1 cases have not begun: look at the arm" in capsys.readouterr().out
