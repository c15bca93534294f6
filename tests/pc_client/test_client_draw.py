"""`ur-client draw` on a robot in memory: from a text file to a page; wrong words are one line."""

from __future__ import annotations

import json
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from drawing_samples import one_part, recording_text
from page_support import check_needs_nothing

import pc_client.commands.draw as draw_module
from pc_client import cli
from pc_client.errors import ClientError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import robot_model
from pc_client.movements.movement import load_movement
from pc_client.recording.recording import load_recording
from pc_client.studies.drawing import figures
from pc_client.studies.drawing.figures import figures_of


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "letter a.txt"
    path.write_text(recording_text(one_part()))
    return path


def test_drawings_become_recordings_tables_and_a_page_with_a_section_each(
    robot, tmp_path, capsys, monkeypatch
):
    # One of the three figures: the others are drawn by `test_drawing_judgement`.
    monkeypatch.setattr(figures, "figures_of", lambda shown: {"paths": figures_of(shown)["paths"]})
    archive, out, saved = tmp_path / "two.zip", tmp_path / "out", tmp_path / "one.toml"
    with zipfile.ZipFile(archive, "w") as packed:
        for folder in "ab":
            packed.writestr(f"{folder}/same one.txt", recording_text(one_part()))
    first, second = f"{archive}:a/same one.txt", f"{archive}:b/same one.txt"
    options = ["--robot", "127.0.0.1", "--out", str(out), "--size", "25", "--plane", "horizontal"]
    assert cli.run(["draw", second, *options, "--save", str(saved), "--dry-run"]) == 0
    assert not out.exists()
    assert cli.run(["draw", first, second, *options]) == 0
    assert robot.at_rest
    recordings = {"same_one_r1.mcap", "same_one_2_r1.mcap"}
    written = {path.name for path in out.iterdir()}
    assert written == {*recordings, "draw.json", "draw.md", "report.html", "figures"}
    said = capsys.readouterr().out
    assert "same_one: 1 marks" in said
    assert "report.html" in said
    drawings = json.loads((out / "draw.json").read_text())["drawings"]
    assert [one["name"] for one in drawings] == ["same_one", "same_one_2"]
    assert all(one["runs"][0]["planned"]["snr_v_db"] > 15.0 for one in drawings)
    page = (out / "report.html").read_text()
    check_needs_nothing(page)
    assert all(f'<section id="{one["name"]}">' in page for one in drawings)
    assert page.count('<img src="data:image/svg+xml') == 2
    assert str(tmp_path) not in page
    assert "executed" in (out / "draw.md").read_text()
    recording = load_recording(out / "same_one_2_r1.mcap")
    moving = recording.rows_of(1)
    t, p = recording.column("ref_t")[moving], recording.column("ref_tcp_position")[moving]
    np.testing.assert_allclose(p, load_movement(saved).sample(t).p, atol=1e-4)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--plane", "ceiling"], "ceiling"),
        (["--size", "large"], "give a number or max"),
        (["--size", "-3"], "more than 0"),
        (["--rotate", "left"], "give a number or auto"),
        (["--lift", "0"], "lift of 0 mm"),
        (["--time-unit", "min"], "is not one of 'auto', 's', 'ms', 'us', 'ns'"),
        (["--y", "left"], "'left' is not one of 'auto', 'up', 'down'"),
        (["other.txt", "--save", "x.toml"], "one drawing"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(robot, file, words, said, one_line, tmp_path):
    assert cli.run(["draw", str(file), "--robot", "127.0.0.1", "--out", str(tmp_path / "o"), *words]) == 2
    assert said in one_line()
    assert robot.programs == []


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("missing.txt", None, "cannot be read"),
        ("dots.txt", "START\n1,2,0\nBREAK\n5,5,700\nBREAK\n", "only dots"),
        ("words.txt", "hello\nworld\n", "words.txt"),
        ("some.zip", None, "many recordings"),
        ("some.zip:inside.txt", None, "inside.txt"),
    ],
)
def test_what_cannot_be_drawn_is_one_line_and_moves_nothing(robot, name, content, said, one_line, tmp_path):
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    out = tmp_path / "o"
    assert cli.run(["draw", str(path), "--robot", "127.0.0.1", "--out", str(out)]) == 1
    assert said in one_line()
    assert robot.programs == []
    assert not out.exists()


def test_a_drawing_is_placed_in_the_box_of_the_arm_that_answers(robot, file, tmp_path, monkeypatch):
    drawings = []

    def stop(movements, *_):
        drawings.extend(movements)
        raise ClientError("far enough")

    monkeypatch.setattr(draw_module, "execute", stop)
    monkeypatch.setattr(draw_module, "reach", lambda *_: SimpleNamespace(model=robot_model("ur10")))
    assert cli.run(["draw", str(file), "--robot", "x", "--out", str(tmp_path / "o"), "--size", "25"]) == 1
    (movement,) = drawings
    p = movement.sample(np.linspace(0.0, movement.duration, 500)).p
    middle = 0.5 * (p.min(axis=0) + p.max(axis=0))
    assert np.linalg.norm(middle - ROBOTS["ur10"].working_box.centre) < 0.03
