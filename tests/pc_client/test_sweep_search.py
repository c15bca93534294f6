"""The search: its settings depend on its seed and on the results, and get better."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_samples import PREVIEW, case, invented, table_with

from pc_client import cli
from pc_client.control.controller import CONTROLLERS
from pc_client.studies.sweep.case import failed
from pc_client.studies.sweep.settings import Range, Search, searched

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
@settings(max_examples=10)
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


def test_a_sweep_without_a_search_loads_no_optuna(tmp_path):
    import subprocess

    code = "import sys; import pc_client.studies.sweep.schedule, pc_client.commands.sweep; print('optuna' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"
