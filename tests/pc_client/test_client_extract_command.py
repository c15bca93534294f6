"""`ur-client extract`: what it writes, what it says, and its exit codes."""

from __future__ import annotations

import json
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from extraction_samples import own_strokes
from test_extraction_batch import write

import pc_client.studies.executors as executors
from pc_client import cli


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder to be in, with a movement; workers are threads, which start at once."""

    @contextmanager
    def threads(workers=None, dask=None):
        with ThreadPoolExecutor(1) as executor:
            yield executor

    monkeypatch.setattr(executors, "open_executor", threads)
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "one.csv", own_strokes(0, 2, n=2))
    return tmp_path


def rows(folder):
    return json.loads((folder / "extraction.json").read_text())


def test_one_file(here, capsys):
    assert cli.run(["extract", "one.csv", "--out", "out/deep"]) == 0
    (row,) = rows(here / "out/deep")
    assert (row["file"], row["n_strokes"], row["n_speed_peaks"]) == ("one.csv", 2, 2)
    assert min(row["snr_v_db"], row["snr_t_db"]) >= 60.0
    assert sorted(path.name for path in (here / "out/deep").rglob("*.*")) == [
        "1_one.png", "extraction.json", "overview.png", "strokes.csv",
    ]  # fmt: skip
    captured = capsys.readouterr()
    assert "one.csv" in captured.out
    assert "1 of 1 recordings; results in out/deep" in captured.out
    assert captured.err == ""


def test_broken_files_are_a_line_each_and_the_rest_is_done(here, capsys):
    (here / "bad.txt").write_text("hello\n")
    (here / "bad.zip").write_text("no archive")
    (here / "dot.txt").write_text("START\n1,2,0\nBREAK\n")
    files = ["bad.txt", "gone.csv", "bad.zip", "one.csv", "dot.txt"]
    assert cli.run(["extract", *files, "--out", "out", "--figures", "none"]) == 1
    assert [row["file"] for row in rows(here / "out")] == ["one.csv", "dot.txt"]
    assert rows(here / "out")[1] == {
        "file": "dot.txt", "snr_v_db": None, "snr_t_db": None, "n_strokes": 0, "n_speed_peaks": 0,
    }  # fmt: skip
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    named = [line.split(":")[1].strip().partition(",")[0] for line in lines]
    assert named == ["bad.zip", "bad.txt", "gone.csv"]
    assert all(line.startswith("ur-client: ") for line in lines)
    assert "2 of 5 recordings" in captured.out
    assert not list((here / "out").rglob("*.png"))


def test_nothing_that_can_be_used_still_gives_a_list(here, capsys):
    assert cli.run(["extract", "gone.csv", "--out", "out"]) == 1
    assert rows(here / "out") == []
    assert (
        capsys.readouterr().err
        == "ur-client: gone.csv: cannot be read (No such file or directory); give a file that exists\n"
    )


def test_archives_and_folders(here):
    with zipfile.ZipFile(here / "all.zip", "w") as archive:
        archive.write(here / "one.csv", "inside/one.csv")
    (here / "more").mkdir()
    (here / "one.csv").rename(here / "more" / "two.csv")
    assert cli.run(["extract", "all.zip", "more", "--out", "out", "--figures", "all"]) == 0
    assert [row["file"] for row in rows(here / "out")] == ["inside/one.csv", "more/two.csv"]
    assert sorted(path.name for path in (here / "out/figures").iterdir()) == ["1_one.png", "2_two.png"]


def test_pictures_lie_in_the_folder_whatever_names_an_archive_has(here, capsys):
    names = [
        "../../evil.csv",
        "a/../../evil.csv",
        "x" * 400 + ".csv",
        "..\\evil.csv",
        "CON.csv",
        "-a\x1b[2J.csv",
        "$x^$.csv",
    ]
    with zipfile.ZipFile(here / "all.zip", "w") as archive:
        for name in names:
            archive.write(here / "one.csv", name)
    before = set(here.rglob("*"))
    assert cli.run(["extract", "all.zip", "--out", "deep/out", "--figures", "all"]) == 0
    new = [path.relative_to(here).as_posix() for path in set(here.rglob("*")) - before if path.is_file()]
    assert {name.rpartition("/")[0] for name in new} == {"deep/out", "deep/out/figures"}
    assert sorted(name.rpartition("/")[2] for name in new if "figures" in name) == [
        "1_x.png", "2_a_2J.png", "3_evil.png", "4_evil.png", "5_evil.png", "6_recording.png", f"7_{'x' * 80}.png",
    ]  # fmt: skip
    assert "\x1b[2J" not in capsys.readouterr().out


def test_the_unit_of_time_can_be_given(here):
    assert cli.run(["extract", "one.csv", "--out", "out", "--time-unit", "ms", "--figures", "none"]) == 0
    assert rows(here / "out")[0]["n_strokes"] <= 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["extract"], "FILE"),
        (["extract", "one.csv"], "--out"),
        (
            ["extract", "one.csv", "--out", "o", "--time-unit", "hours"],
            "is not one of 'auto', 's', 'ms', 'us', 'ns'",
        ),
        (["extract", "one.csv", "--out", "o", "--figures", "some"], "is not one of 'few', 'all', 'none'"),
        (["extract", "one.csv", "--out", "o", "--workers", "0"], "workers"),
        (["extract", "one.csv", "--out", "o", "--workers", "2", "--dask", "tcp://h:1"], "give only one"),
        (["extract", "one.csv", "--out", "o", "--strokes-per-peak", "0"], "strokes-per-peak"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(here, capsys, words, message):
    assert cli.run(words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_folder_that_cannot_be_written(here, capsys):
    assert cli.run(["extract", "one.csv", "--out", "one.csv/out", "--figures", "none"]) == 1
    assert "cannot write" in capsys.readouterr().err
