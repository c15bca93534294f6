"""`ur-client draw` on a robot in memory: from a text file to a page; wrong words are one line."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from drawing_samples import one_part, recording_text, two_parts_and_a_dot
from fake_robot import FakeRobot
from page_support import check_needs_nothing

import pc_client.arm as arm_module
import pc_client.commands.draw as draw_module
import pc_client.driver.session as ur_driver_module
import pc_client.driver.transport as transport
from pc_client import cli
from pc_client.errors import ClientError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import robot_model
from pc_client.movements.movement import load_movement
from pc_client.recording.recording import load_recording

LETTER = Path(__file__).parents[2] / "examples" / "drawings" / "letter_i.txt"


@pytest.fixture
def robot(monkeypatch):
    """A robot in memory instead of the network."""
    fake = FakeRobot()
    fake.q = [0.4, -1.77, -2.1, -0.1, 1.3, 1.86]
    for module in (transport, ur_driver_module, arm_module):
        monkeypatch.setattr(module, "TcpNetwork", lambda: fake)
    return fake


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "letter a.txt"
    path.write_text(recording_text(two_parts_and_a_dot()))
    return path


def one_line(capsys):
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    return err


def test_a_drawing_becomes_recordings_tables_and_a_page(robot, file, tmp_path, capsys):
    out, saved = tmp_path / "out", tmp_path / "letter.toml"
    options = ["--out", str(out), "--save", str(saved), "--size", "60"]
    assert cli.run(["draw", str(file), "--robot", "127.0.0.1", *options]) == 0
    assert robot.at_rest
    written = {path.name for path in out.iterdir()}
    assert written == {"letter_a_r1.mcap", "draw.json", "draw.md", "report.html", "figures"}
    said = capsys.readouterr().out
    assert "letter_a: 3 marks" in said
    assert "report.html" in said
    table = json.loads((out / "draw.json").read_text())
    (one,) = table["drawings"]
    assert one["name"] == "letter_a"
    assert one["metres_per_unit"] > 0.0
    assert one["runs"][0]["planned"]["snr_v_db"] > 15.0
    page = (out / "report.html").read_text()
    check_needs_nothing(page)
    assert page.count('class="zoom"') == 3
    assert str(tmp_path) not in page
    movement = load_movement(saved)
    recording = load_recording(out / "letter_a_r1.mcap")
    moving = recording.rows_of(1)
    t, p = recording.column("ref_t")[moving], recording.column("ref_tcp_position")[moving]
    np.testing.assert_allclose(p, movement.sample(t).p, atol=1e-4)


def test_several_drawings_repeated_are_one_page_with_a_section_each(robot, tmp_path, capsys):
    archive = tmp_path / "two.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.writestr("a/same.txt", recording_text(one_part()))
        packed.writestr("b/same.txt", recording_text(one_part()))
    files = [f"{archive}:a/same.txt", f"{archive}:b/same.txt"]
    out = tmp_path / "out"
    options = ["--out", str(out), "--repeat", "2", "--size", "50", "--plane", "horizontal"]
    assert cli.run(["draw", *files, "--robot", "127.0.0.1", *options]) == 0
    names = {path.name for path in out.glob("*.mcap")}
    assert names == {"same_r1.mcap", "same_r2.mcap", "same_2_r1.mcap", "same_2_r2.mcap"}
    page = (out / "report.html").read_text()
    assert page.count('<section id="same') == 2
    table = json.loads((out / "draw.json").read_text())
    assert [[run["repetition"] for run in one["runs"]] for one in table["drawings"]] == [[1, 2], [1, 2]]
    assert "executed r2" in (out / "draw.md").read_text()


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
def test_wrong_usage_is_one_line_and_exit_2(robot, file, words, said, capsys, tmp_path):
    assert cli.run(["draw", str(file), "--robot", "127.0.0.1", "--out", str(tmp_path / "o"), *words]) == 2
    assert said in one_line(capsys)
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
def test_what_cannot_be_drawn_is_one_line_and_moves_nothing(robot, name, content, said, capsys, tmp_path):
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    out = tmp_path / "o"
    assert cli.run(["draw", str(path), "--robot", "127.0.0.1", "--out", str(out)]) == 1
    assert said in one_line(capsys)
    assert robot.programs == []
    assert not out.exists()


def test_a_real_arm_does_not_move_before_the_answer(robot, file, tmp_path, capsys, monkeypatch):
    robot.serial = "2017355123"

    def answer(question, abort):
        assert robot.programs == []
        raise typer.Abort

    monkeypatch.setattr(typer, "confirm", answer)
    out = tmp_path / "out"
    assert cli.run(["draw", str(file), "--robot", "192.0.2.7", "--out", str(out), "--size", "50"]) == 1
    assert robot.programs == []
    assert not out.exists()
    assert "box of motion" in capsys.readouterr().out


def test_ctrl_c_leaves_the_arm_at_rest_and_what_is_recorded(robot, file, tmp_path, capsys):
    out = tmp_path / "out"
    ticks = []

    def interrupt(r):
        if (out / "letter_a_r1.mcap").exists():
            ticks.append(r.tick)
        if len(ticks) == 150:
            robot.on_tick = None
            raise KeyboardInterrupt

    robot.on_tick = interrupt
    assert cli.run(["draw", str(file), "--robot", "127.0.0.1", "--out", str(out), "--size", "50"]) == 130
    assert [line for line in capsys.readouterr().err.splitlines() if line][-1].startswith(
        "ur-client: interrupted"
    )
    assert robot.at_rest
    assert load_recording(out / "letter_a_r1.mcap").n_rows > 100


def test_a_drawing_of_the_tree_within_an_archive(robot, tmp_path):
    with zipfile.ZipFile(tmp_path / "some.zip", "w") as archive:
        archive.write(LETTER, "Latin/i.txt")
    out = tmp_path / "out"
    path = f"{tmp_path / 'some.zip'}:Latin/i.txt"
    assert cli.run(["draw", path, "--robot", "127.0.0.1", "--out", str(out), "--size", "60"]) == 0
    (one,) = json.loads((out / "draw.json").read_text())["drawings"]
    assert one["marks"] == 2  # a stroke and a dot
    assert one["y_up"] is True  # rows of the screen as 0, -1, -2 ...
    assert one["reconstruction"]["snr_v_db"] > 15.0
    assert one["runs"][0]["human"]["snr_v_db"] > 10.0


def test_a_drawing_is_placed_in_the_box_of_the_arm_that_answers(robot, file, tmp_path, monkeypatch):
    drawings = []

    def stop(movements, *_):
        drawings.extend(movements)
        raise ClientError("far enough")

    monkeypatch.setattr(draw_module, "execute", stop)
    monkeypatch.setattr(draw_module, "reach", lambda *_: SimpleNamespace(model=robot_model("ur10")))
    assert cli.run(["draw", str(file), "--robot", "x", "--out", str(tmp_path / "o"), "--size", "max"]) == 1
    (movement,) = drawings
    p = movement.sample(np.linspace(0.0, movement.duration, 500)).p
    box = ROBOTS["ur10"].working_box
    assert box.contains(p, 1e-3)
    assert np.isclose(np.ptp(p, axis=0) / box.size, 1.0, atol=0.02).any()
