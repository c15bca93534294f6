"""`ur-client movements list | kinds | generate | duplicate`: every generator by its name, on one line when it cannot be."""

from __future__ import annotations

import pytest

from pc_client import cli
from pc_client.movements.generate import GENERATORS
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import load_movement


@pytest.mark.parametrize(
    "command", [["movements", "kinds"], ["movements", "new"], ["movements", "duplicate"], ["compare"]]
)
def test_every_command_has_help(command, capsys):
    assert cli.run([*command, "--help"]) == 0
    assert "Usage" in capsys.readouterr().out


def test_kinds_lists_every_generator(capsys):
    assert cli.run(["movements", "kinds"]) == 0
    out = capsys.readouterr().out
    for kind in GENERATORS:
        assert kind in out


def test_kinds_says_that_a_duplicate_has_its_own_target_points(capsys):
    assert [kind for kind, generator in GENERATORS.items() if not generator.same_targets] == ["duplicate"]
    assert cli.run(["movements", "kinds"]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if "own" in line]
    assert len(rows) == 1
    assert "duplicate" in rows[0]
    assert cli.run(["movements", "duplicate", "--help"]) == 0
    assert "Only the first target point stays" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "sets"),
    [([], ["paper", "arcs"]), (["--set", "arcs"], ["arcs"])],
)
def test_list_shows_all_sets_or_one(options, sets, capsys):
    assert cli.run(["movements", "list", *options]) == 0
    rows = [
        line.split()[0] for line in capsys.readouterr().out.splitlines() if "_5_" in line or "_4_" in line
    ]
    assert rows == [name for chosen in sets for name in library_names(chosen)]


def test_corners_of_a_generated_robot_like_movement_can_be_blended(tmp_path):
    file = tmp_path / "mine.toml"
    assert (
        cli.run(["movements", "generate", "--kind", "uniform", "--corners", "blend", "--out", str(file)]) == 0
    )
    assert (load_movement(file).trajectory.corners, load_movement(file).trajectory.blend) == ("blend", 0.03)


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
        (
            ["movements", "generate", "--kind", "fitts", "--corners", "blend", "--out", "x.toml"],
            "kind uniform",
            1,
        ),
        (
            ["movements", "generate", "--corners", "cut", "--out", "x.toml"],
            "'cut' is not one of 'stop', 'blend'",
            2,
        ),
        (["movements", "list", "--set", "all"], "give one of paper, arcs", 1),
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
