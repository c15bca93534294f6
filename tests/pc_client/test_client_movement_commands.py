"""`ur-client movements kinds | generate | duplicate`: every generator by its name, on one line when it cannot be."""

from __future__ import annotations

import pytest

from pc_client import cli
from pc_client.movements import load_movement
from pc_client.movements.twins import GENERATORS


@pytest.mark.parametrize("command", [["movements", "kinds"], ["movements", "duplicate"], ["compare"]])
def test_every_command_has_help(command, capsys):
    assert cli.run([*command, "--help"]) == 0
    assert "Usage" in capsys.readouterr().out


def test_kinds_lists_every_generator(capsys):
    assert cli.run(["movements", "kinds"]) == 0
    out = capsys.readouterr().out
    for kind in GENERATORS:
        assert kind in out


@pytest.mark.parametrize("kind", GENERATORS)
def test_every_kind_can_be_generated_planned_and_shown(kind, tmp_path, capsys):
    file = tmp_path / "mine.toml"
    arguments = ["movements", "generate", "--kind", kind, "--targets", "4", "--seed", "2", "--out", str(file)]
    assert cli.run(arguments) == 0
    assert "top joint speed" in capsys.readouterr().out
    assert load_movement(file).name == "mine"
    assert cli.run(["movements", "show", str(file), "--json"]) == 0
    assert '"n_target_points": 4' in capsys.readouterr().out


def test_duplicate_varies_a_movement_of_the_library(tmp_path, capsys):
    file = tmp_path / "again.toml"
    arguments = ["movements", "duplicate", "lognorm_4_1", "--seed", "5", "--share", "0.5", "--out", str(file)]
    assert cli.run(arguments) == 0
    assert "saved" in capsys.readouterr().out
    made = load_movement(file)
    assert made.provenance["duplicate_of"] == "lognorm_4_1"
    assert made.provenance["variation_share"] == 0.5


@pytest.mark.parametrize(
    ("arguments", "words", "code"),
    [
        (["movements", "generate", "--kind", "jerk", "--out", "x.toml"], "minimum_jerk_via", 1),
        (["movements", "duplicate", "uniform_4_1", "--out", "x.toml"], "give a lognormal", 1),
        (["movements", "duplicate", "lognorm_4_1", "--out", "x.csv"], "saved as a .toml", 1),
        (["movements", "duplicate", "lognorm_4_1", "--share", "2", "--out", "x.toml"], "share", 2),
        (["compare"], "--out", 2),
        (["compare", "--out", "o", "--sets", "0"], "sets", 2),
        (["compare", "--out", "o", "--robot", "127.0.0.1", "--controller", "pid"], "preview", 1),
    ],
)
def test_what_does_not_work_is_one_line(arguments, words, code, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.run(arguments) == code
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert words in err
    assert not list(tmp_path.iterdir())
