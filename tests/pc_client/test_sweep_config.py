"""The file of a sweep: what it spans, and what is refused before anything starts.

The search: its settings depend on its seed and on the results, and get better.
"""

from __future__ import annotations

import shutil
import sys
from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_samples import PREVIEW, case, invented, table_with, write

from pc_client import cli
from pc_client.control.controller import CONTROLLERS
from pc_client.errors import ClientError
from pc_client.movements.library_sets import library_path
from pc_client.studies.sweep.case import Case, GivenRobot, SimulatedArm, all_cases, failed
from pc_client.studies.sweep.schedule import plan_case
from pc_client.studies.sweep.settings import FIDELITIES, Range, Search, SweepFile, read_config, searched

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples" / "sweeps").glob("*.toml"))


def cases_of(config):
    return all_cases(config.movements, config.arms, next(config.batches(None)), config.file.repeat)


def test_the_shortest_file(tmp_path):
    config = read_config(write(tmp_path, 'movements = ["uniform_4_1"]'))
    (case,) = cases_of(config)
    assert case.arm == SimulatedArm("ur3", "typical", 0)
    assert case.controller == PREVIEW
    assert (config.file.repeat, config.file.keep_recordings, config.file.output) == (1, False, None)


def test_every_combination(tmp_path):
    text = """
        movements = ["uniform_4_1", "lognorm_4_1"]
        controllers = ["paper", "preview"]
        robots = ["ur3", "ur5"]
        fidelities = ["ideal", "poor"]
        seeds = [1, 2, 3]
        repeat = 2
        output = "out/here"
        [controller]
        gain_p = [1, 2.5]
        uses_preview = [true, false]
        path_tolerance = 0.02
    """
    config = read_config(write(tmp_path, text))
    cases = cases_of(config)
    assert len(cases) == len({case.identity for case in cases}) == 2 * 2 * 2 * 2 * 3 * 4
    assert {case.controller.gain_p for case in cases} == {1.0, 2.5}
    assert {case.controller.path_tolerance for case in cases} == {0.02}
    assert {case.controller.name for case in cases} == {"paper", "preview"}
    assert config.file.output == "out/here"


def test_movement_files_lie_beside_the_configuration(tmp_path):
    shutil.copy(library_path("uniform_5_1"), tmp_path / "mine.toml")
    config = read_config(write(tmp_path, 'movements = ["mine.toml"]'))
    assert config.movements[0].name == "uniform_5_1"
    assert config.movements[0].file_name == "mine.toml"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_make_sense(path):
    config = read_config(path)
    assert config.file.output is not None
    assert config.n_cases > 10


MOVES = 'movements = ["uniform_4_1"]'
SEARCH = "[search]\ntrials = 3\n[controller]"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("movements = [", "not TOML"),
        ("", "movements: missing"),
        ("movements = []", "a list of 1 or more"),
        ('movements = ["uniform_4_11"]', "did you mean uniform_4_1?"),
        ('movements = ["nowhere.toml"]', "nowhere.toml"),
        ('movements = ["uniform_4_1", "uniform_4_1"]', "twice"),
        ('MOVES\nmovment = ["uniform_4_1"]', "did you mean movements?"),
        ("MOVES\ngain_p = 3", "put it under [controller]"),
        ('MOVES\nfidelities = ["flawless"]', "give one of exact, ideal, typical, poor"),
        ('MOVES\nrobots = ["ur4"]', "give one of ur3, ur5, ur10, ur3e"),
        ('MOVES\ncontrollers = ["pid"]', "give one of paper, preview, best"),
        ("MOVES\nrepeat = 0", "1 to 99"),
        ("MOVES\nport_base = 3", "goes with robot"),
        ("MOVES\nreverse_port = 3", "goes with robot"),
        ('MOVES\ncell = "cell.toml"', "goes with robot"),
        ('MOVES\nrobot = "10.0.0.2"\nreverse_port = 70000', "0 to 65535"),
        ('MOVES\nrobot = "10.0.0.2"\nseeds = [1]', "is for simulated arms"),
        ("MOVES\n[search]\ntrials = 5", "nothing to choose"),
        ("MOVES\n[search]\n[controller]\ngain_p = [1]", "trials: missing"),
        ("MOVES\n[search]\ntrials = 0\n[controller]\ngain_p = [1]", "search.trials: 0"),
        ("MOVES\n[search]\ntrials = 5\nsampler = 'best'\n[controller]\ngain_p = [1]", "one of tpe, random"),
        ('MOVES\n[controller]\nname = "mine"', "controller.name: no such key"),
        ("MOVES\n[controller]\ngain_p = []", "an empty list"),
        ("MOVES\n[controller]\ngain_p = [1, 1.0]", "twice"),
        ("MOVES\n[controller]\ngain_p = -1", "0 to 200 1/s"),
        ("MOVES\n[controller]\nspeed_share = 1.2", "0.1 to 1"),
        ("MOVES\n[controller]\ngain_p = { low = 1, high = 2 }", "give a table [search]"),
        ("MOVES\nSEARCH\ngain_p = { low = 2, high = 1 }", "above low"),
        ("MOVES\nSEARCH\ngain_p = { low = 1, high = 201 }", "high: 201.0; give a number from 0 to 200 1/s"),
        ("MOVES\nSEARCH\ngain_p = { low = 0, high = 1, log = true }", "above 0"),
        ("MOVES\nSEARCH\nuses_preview = { low = 0, high = 1 }", "a range is of numbers"),
        (f"MOVES\nseeds = {list(range(2000))}\n[controller]\ngain_p = {list(range(100))}", "at most 100000"),
    ],
)
def test_what_makes_no_sense_is_one_line_with_file_and_key(text, words, tmp_path):
    path = write(tmp_path, text.replace("MOVES", MOVES).replace("SEARCH", SEARCH))
    with pytest.raises(ClientError) as caught:
        read_config(path)
    message = str(caught.value)
    assert words in message
    assert message.startswith(str(path))
    assert "\n" not in message


def test_a_given_robot_stands_in_its_cell(tmp_path):
    (tmp_path / "cell.toml").write_text('format = 1\nname = "bench"\n[tool]\nmass = 0.5\n')
    text = 'movements = ["uniform_4_1"]\nrobot = "10.0.0.2"\n'
    bare = read_config(write(tmp_path, text))
    config = read_config(write(tmp_path, text + 'cell = "cell.toml"\nreverse_port = 0\n'))
    assert (bare.cell.name, bare.file.reverse_port) == ("", None)
    assert (config.cell.name, config.cell.tool.mass, config.file.reverse_port) == ("bench", 0.5, 0)
    robots = [
        GivenRobot("10.0.0.2", 0, "ur3", "1", cell, port)
        for cell, port in ((bare.cell, None), (config.cell, None), (config.cell, 0))
    ]
    cases = [Case(config.movements[0], robot, PREVIEW, 1) for robot in robots]
    # The cell belongs to what a case is; the port does not.
    assert cases[0].identity != cases[1].identity == cases[2].identity
    assert plan_case(cases[1]).model.cell is config.cell
    assert plan_case(cases[1]).planned[0].joints.report.cell == config.cell


def test_a_case_of_the_library_is_planned_where_its_arm_can_do_it():
    small, large = (replace(case(), arm=SimulatedArm(robot, "typical", 7)) for robot in ("ur3e", "ur5e"))
    x = [plan_case(one).planned[0].movement.target_points[:, 0] for one in (small, large)]
    assert x[1] - x[0] == pytest.approx([0.075] * 4)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ClientError, match="cannot be read"):
        read_config(tmp_path / "none.toml")


def test_fidelities_are_those_of_the_box():
    from ur_emulator.machine.models.generations import CB3

    assert set(FIDELITIES) == {it.name for it in CB3.fidelities}


def test_every_key_is_explained_in_the_documentation():
    page = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    for key in (field.name for field in fields(SweepFile)):
        assert f"`{key}`" in page or f"`[{key}]`" in page


AXES = {
    "gain_p": Range(low=1.0, high=30.0, log=True),
    "gain_i": Range(low=0.0, high=20.0),
    "slew_limit": (10.0, 20.0),
}


def tried(search, axes=AXES, bases=(PREVIEW,), job=invented):
    """The settings of a search, batch by batch."""
    batches = []

    def results():
        cases = [replace(case(), controller=controller) for controller in batches[-1]]
        return table_with((it, job(it)) for it in cases)

    for batch in searched(bases, axes, search, results):
        batches.append(batch)
    return batches


def mean_level(controllers):
    return sum(
        invented(replace(case(), controller=it)).rows[0].get("snr_db", 0.0) for it in controllers
    ) / len(controllers)


@pytest.mark.parametrize("sampler", ["tpe", "random"])
@settings(max_examples=5)
@given(seed=st.integers(0, 2**32 - 1), trials=st.integers(1, 20), batch=st.integers(1, 6))
def test_the_settings_lie_in_their_ranges_and_come_again(sampler, seed, trials, batch):
    search = Search(trials=trials, batch=batch, sampler=sampler, seed=seed)
    batches = tried(search)
    assert [len(it) for it in batches[:-1]] == [batch] * (len(batches) - 1)
    chosen = [it for one in batches for it in one]
    assert len(chosen) == trials
    for setting in chosen:
        assert 1.0 <= setting.gain_p <= 30.0
        assert 0.0 <= setting.gain_i <= 20.0
        assert setting.slew_limit in (10.0, 20.0)
    assert tried(search) == batches
    more = [it for one in tried(replace(search, trials=trials + 3)) for it in one]
    assert more[:trials] == chosen


def test_another_seed_chooses_other_settings():
    assert tried(Search(trials=4, seed=1)) != tried(Search(trials=4, seed=2))


def test_a_search_learns_from_its_results_and_a_random_one_does_not():
    best, plain = (
        [it for one in tried(Search(trials=60, sampler=name)) for it in one] for name in ("tpe", "random")
    )
    assert best[:8] == plain[:8]  # nothing is known yet
    assert mean_level(best[-20:]) > mean_level(plain[-20:]) + 10.0


def test_what_is_refused_is_avoided_and_what_failed_says_nothing():
    def refused(it):
        return invented(replace(it, controller=replace(it.controller, gain_p=25.0)))

    all_refused = tried(Search(trials=24), job=refused)
    all_failed = tried(Search(trials=24), job=lambda it: failed("broken"))
    assert all_refused[0] == all_failed[0]
    assert all_refused != all_failed
    wide = {"gain_p": Range(low=1.0, high=200.0)}  # nine of ten are refused
    first, *_, last = tried(Search(trials=64), wide)
    assert sum(it.gain_p > 20.0 for it in first) > sum(it.gain_p > 20.0 for it in last)


def test_named_controllers_are_chosen_from_too():
    bases = [CONTROLLERS["paper"], CONTROLLERS["preview"]]
    chosen = [it for one in tried(Search(trials=12), {}, bases) for it in one]
    assert {it.name for it in chosen} == {"paper", "preview"}
    assert all(it == CONTROLLERS[it.name] for it in chosen)


def test_missing_optuna_names_the_extra(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "optuna", None)
    path = tmp_path / "sweep.toml"
    path.write_text('movements = ["uniform_4_1"]\n[search]\ntrials = 2\n[controller]\ngain_p = [1.0, 2.0]')
    assert cli.run(["sweep", str(path), "--out", str(tmp_path / "out")]) == 1
    assert "pip install 'ur-hil[search]'" in capsys.readouterr().err
