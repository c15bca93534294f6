"""Batches of extractions and `ur-client extract`: every outcome in its place, broken files beside good ones, figures.

Pictures of extractions are made of anything that moves.
"""

from __future__ import annotations

import csv
import io
import json
import zipfile
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest
from extraction_samples import DRAWINGS, DRAWINGS_OF_PEOPLE, needs_omniglot, own_strokes, recorded
from matplotlib.image import imread

import pc_client.studies.executors as executors
import pc_client.studies.extraction.batch as batch
import pc_client.studies.extraction.figures as extraction_figures
from pc_client import cli
from pc_client.errors import ClientError
from pc_client.movements.lognormal import Lognormal
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.results.tables import frame_of, to_csv
from pc_client.studies.executors import open_executor
from pc_client.studies.extraction.batch import (
    STROKE_COLUMNS,
    extract_many,
    figures_of,
    strokes_of,
    table_of,
    to_json,
)
from pc_client.studies.extraction.extract import extract
from pc_client.studies.extraction.figures import draw_extraction, draw_overview
from pc_client.studies.extraction.pen import PenPart, PenRecording, pen_sources


class AtOnce(Executor):
    """Does each job when it is submitted; from `broken_from` on, its workers are dead."""

    def __init__(self, broken_from=99):
        self.events, self.broken_from = [], broken_from

    def submit(self, function, *arguments):
        self.events.append("job")
        future = Future()
        try:
            if self.events.count("job") > self.broken_from:
                raise BrokenExecutor("out of memory")
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


def write(path, trajectory, dim=2):
    (part,) = recorded(trajectory, dim).parts
    header = ",".join("txyz"[: dim + 1])
    np.savetxt(path, np.column_stack((part.t, part.p)), "%.17g", ",", header=header, comments="")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two movements, one of them in space, a dot, and two broken files."""
    path = tmp_path_factory.mktemp("pens")
    write(path / "a.csv", own_strokes(0, 2, n=2))
    (path / "b.csv").write_text("t,x,y\n0,nothing,1\n")
    write(path / "c.csv", own_strokes(1, 3, n=2), 3)
    (path / "d.txt").write_text("START\n1,2,0\nBREAK\n")
    (path / "e.txt").write_bytes(b"\xff\xfe\x00")
    return path


FIGURES = ("file", "snr_v_db", "snr_t_db", "raw_snr_v_db", "raw_snr_t_db", "n_strokes", "n_speed_peaks")


def row(*values):
    return dict(zip(FIGURES, values, strict=True))


DOT = (None, None, None, None, 0, 0)


def test_every_recording_has_an_outcome_in_its_place(folder):
    told = []
    with open_executor(workers=1) as executor:
        outcomes = extract_many(pen_sources([folder]), executor, on_outcome=told.append)
    names = [str(folder / name) for name in ("a.csv", "b.csv", "c.csv", "d.txt", "e.txt")]
    assert [outcome.name for outcome in outcomes] == names
    assert sorted(outcome.name for outcome in told) == names
    a, b, c, d, e = outcomes
    assert (a.error, c.error, d.error) == (None, None, None)
    assert (a.row["n_strokes"], c.row["n_strokes"]) == (2, 2)
    assert d.row == row(d.name, *DOT)
    assert min(a.row["snr_v_db"], c.row["snr_v_db"]) >= 60.0
    assert 'line 2: "nothing" is not a number' in b.error
    assert "no text file" in e.error
    assert (b.row, e.row) == (None, None)
    assert [outcome.picture for outcome in outcomes] == [None] * 5


def test_an_executor_that_breaks_down_is_one_line(folder):
    with pytest.raises(ClientError, match=r"a worker ended .*out of memory.*fewer workers"):
        extract_many(pen_sources([folder]), AtOnce(broken_from=1))


@pytest.fixture
def no_ink(monkeypatch):
    """Pictures of recordings are drawn at once."""
    monkeypatch.setattr(extraction_figures, "draw_extraction", lambda extraction: b"PNG")


def test_a_fault_of_ours_costs_one_recording_and_few_jobs_are_in_flight(folder, monkeypatch, no_ink):
    monkeypatch.setattr(batch, "_IN_FLIGHT", 2)
    executor = AtOnce()

    def faulty(recording, options):
        if recording.name.endswith("a.csv"):
            raise ZeroDivisionError("division by zero")
        return extract(recording, options)

    monkeypatch.setattr(batch, "extract", faulty)

    def tell(outcome):
        executor.events.append("told")

    outcomes = extract_many(2 * pen_sources([folder]), executor, n_pictures=5, on_outcome=tell)
    assert "job job job" not in " ".join(executor.events)
    assert "a.csv: the extraction failed (ZeroDivisionError" in outcomes[0].error
    assert outcomes[2].row is not None
    assert [outcome.picture for outcome in outcomes] == [None, None, b"PNG", *[None] * 7]


def test_json_has_no_nan_and_the_stated_keys():
    rows = [row("a/ä.txt", 20.5, 30.25, 9.5, 25.5, 4, 5), row("dot", *DOT)]
    assert json.loads(to_json(rows)) == rows
    assert json.loads(to_json([])) == []
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json([row("a", float("nan"), 1.0, 1.0, 1.0, 1, 1)])
    derived = table_of(rows)["lognormality", "strokes_per_peak"]
    assert derived.rows() == [(5.125, 0.8), (None, None)]


@pytest.mark.parametrize("dim", [2, 3])
def test_the_movement_comes_back_from_the_table_of_strokes_alone(dim):
    result = extract(recorded(own_strokes(2, dim, n=3), dim))
    rows = list(csv.DictReader(io.StringIO(to_csv(frame_of(strokes_of(result), STROKE_COLUMNS)))))
    assert list(rows[0]) == [column.name for column in STROKE_COLUMNS]
    numbers = [{key: float(value) for key, value in row.items() if key != "file"} for row in rows]
    targets = [[row[f"{axis}0"] for axis in "xyz"] for row in numbers]
    targets.append([numbers[-1][f"{axis}1"] for axis in "xyz"])
    strokes = [
        Stroke(Lognormal(row["t0"], row["mu"], row["sigma"]), row["arc_angle"], row["tilt"])
        for row in numbers
    ]
    trajectory = SigmaLognormal(np.array(targets), tuple(strokes), 1.0)
    (part,) = result.parts
    assert trajectory.evaluate(part.t).p == pytest.approx(part.trajectory.evaluate(part.t).p, abs=1e-12)
    assert trajectory.lengths == pytest.approx([row["length"] for row in numbers])
    assert figures_of(result)["n_strokes"] == 3


def test_the_drawings_of_the_tree_reach_the_figures():
    """Of five kinds: straight marks, loops, a dot, sharp corners, a flourish; from a browser and a tablet."""
    table = table_of([outcome.row for outcome in extract_many(pen_sources([DRAWINGS]), AtOnce())])
    assert len(table) == 5
    assert table["snr_v_db"].min() >= 20.0
    assert table["snr_t_db"].min() >= 30.0
    assert table["n_strokes"].sum() <= 1.2 * table["n_speed_peaks"].sum()


@needs_omniglot
def test_drawings_drawn_at_random_reach_the_figures():
    sources = pen_sources([DRAWINGS_OF_PEOPLE])
    chosen = [sources[i] for i in np.random.default_rng(7).choice(len(sources), 30, replace=False)]
    with open_executor() as executor:
        rows = [outcome.row for outcome in extract_many(chosen, executor)]
    table = table_of(rows)
    snr_v = table["snr_v_db"].drop_nulls()
    assert len(snr_v) >= 29
    assert snr_v.mean() >= 20.0
    assert (snr_v > 15.0).mean() >= 0.95
    assert table["snr_t_db"].mean() >= 25.0
    assert table["n_strokes"].sum() <= 1.2 * table["n_speed_peaks"].sum()


def ink(png):
    """Share of pixels that are not white."""
    return float(np.mean(imread(io.BytesIO(png))[..., :3].min(axis=2) < 0.9))


@pytest.mark.parametrize("dim", [2, 3])
def test_the_picture_of_a_recording_shows_what_moves(dim, caplog):
    (part,) = recorded(own_strokes(0, dim, n=2), dim).parts
    dot = PenPart([9.0], [[0.0] * dim])
    assert ink(draw_extraction(extract(PenRecording("folder/own.csv", (part, dot))))) > 0.02
    assert caplog.text == ""  # nothing that matplotlib complains about


def test_the_overview_of_a_batch_shows_what_moves():
    empty = ink(draw_overview(table_of([row("dot", *DOT)])))
    one = ink(draw_overview(table_of([row("a.txt", 20.0, 30.0, 9.0, 25.0, 5, 6)])))
    assert one > empty + 0.01


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


def extracted(folder):
    return json.loads((folder / "extraction.json").read_text())


def test_one_file(here, capsys):
    assert cli.run(["extract", "one.csv", "--out", "out/deep"]) == 0
    (row,) = extracted(here / "out/deep")
    assert (row["file"], row["n_strokes"], row["n_speed_peaks"]) == ("one.csv", 2, 2)
    assert min(row["snr_v_db"], row["snr_t_db"], row["raw_snr_v_db"]) >= 60.0
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
    assert [row["file"] for row in extracted(here / "out")] == ["one.csv", "dot.txt"]
    assert extracted(here / "out")[1] == row("dot.txt", *DOT)
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    named = [line.split(":")[1].strip().partition(",")[0] for line in lines]
    assert named == ["bad.zip", "bad.txt", "gone.csv"]
    assert all(line.startswith("ur-client: ") for line in lines)
    assert "2 of 5 recordings" in captured.out
    assert not list((here / "out").rglob("*.png"))


def test_nothing_that_can_be_used_still_gives_a_list(here, capsys):
    assert cli.run(["extract", "gone.csv", "--out", "out"]) == 1
    assert extracted(here / "out") == []
    why = "gone.csv: cannot be read (No such file or directory); give a file that exists"
    assert capsys.readouterr().err == f"ur-client: {why}\n"


def test_archives_and_folders_and_pictures_that_lie_in_the_folder_whatever_names_an_archive_has(
    here, capsys, no_ink
):
    inside = ["inside/one.csv", "../../evil.csv", "-a\x1b[2J.csv"]
    with zipfile.ZipFile(here / "all.zip", "w") as archive:
        for name in inside:
            archive.write(here / "one.csv", name)
    (here / "more").mkdir()
    (here / "one.csv").rename(here / "more" / "two.csv")
    before = set(here.rglob("*"))
    assert cli.run(["extract", "all.zip", "more", "--out", "deep/out", "--figures", "all"]) == 0
    assert sorted(row["file"] for row in extracted(here / "deep/out")) == sorted([*inside, "more/two.csv"])
    new = {path.relative_to(here).as_posix() for path in set(here.rglob("*")) - before if path.is_file()}
    pictures = {f"deep/out/figures/{name}.png" for name in ("1_a_2J", "2_evil", "3_one", "4_two")}
    assert {name for name in new if name.endswith(".png")} == {*pictures, "deep/out/overview.png"}
    assert "\x1b[2J" not in capsys.readouterr().out


def test_the_unit_of_time_can_be_given(here):
    assert cli.run(["extract", "one.csv", "--out", "out", "--time-unit", "ms", "--figures", "none"]) == 0
    assert extracted(here / "out")[0]["n_strokes"] <= 1


def test_a_folder_that_cannot_be_written(here, capsys):
    assert cli.run(["extract", "one.csv", "--out", "one.csv/out", "--figures", "none"]) == 1
    assert "cannot write" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "FILE"),
        (["one.csv"], "--out"),
        (["one.csv", "--out", "o", "--time-unit", "hours"], "is not one of 'auto', 's', 'ms', 'us', 'ns'"),
        (["one.csv", "--out", "o", "--figures", "some"], "is not one of 'few', 'all', 'none'"),
        (["one.csv", "--out", "o", "--workers", "0"], "workers"),
        (["one.csv", "--out", "o", "--workers", "2", "--dask", "tcp://h:1"], "give only one"),
        (["one.csv", "--out", "o", "--strokes-per-peak", "0"], "strokes-per-peak"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(here, one_line, words, message):
    assert cli.run(["extract", *words]) == 2
    assert message in one_line()
