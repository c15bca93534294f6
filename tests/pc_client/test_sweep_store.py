"""Results on disk: identity, resuming, recordings, what a full disk or a read-only folder does."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest
from sweep_samples import case, figures, invented, table_with

from pc_client.errors import SweepError
from pc_client.studies.sweep.case import COLUMNS, Case, GivenRobot, Outcome, failed
from pc_client.studies.sweep.store import ResultStore

DONE = Outcome("done", rows=({"repetition": 1, "snr_db": 0.1 + 0.2, "kind": "uniform"},))


def test_identity_is_the_content():
    assert case().identity == case().identity
    others = [
        case(gain_p=5.5),
        case(uses_preview=False),
        case(fidelity="poor"),
        case(seed=8),
        case(repeat=2),
        case("uniform_4_2"),
    ]
    assert len({case().identity, *(other.identity for other in others)}) == len(others) + 1


def test_identity_is_the_same_in_another_process():
    code = "from sweep_samples import case; print(case(gain_p=3.25).identity)"
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == case(gain_p=3.25).identity


def test_a_robot_is_its_serial_number_not_its_address():
    def at(host, serial):
        return Case(case().movement, GivenRobot(host, 0, "ur3", serial), case().controller, 1).identity

    assert at("10.0.0.1", "2017355123") == at("robot.local", "2017355123")
    assert at("10.0.0.1", "2017355123") != at("10.0.0.1", "2018355124")


def is_known(path, case, keep_recordings=False):
    """Whether a later call finds what came of a case."""
    return ResultStore(path, keep_recordings).waiting([case]) == []


def test_what_is_stored_comes_back_to_the_last_bit(tmp_path):
    store = ResultStore(tmp_path / "new" / "folder", False)
    store.prepare()
    assert store.waiting([case(), case(seed=8)]) == [case(), case(seed=8)]
    store.settle(case(), DONE)
    assert store.waiting([case(), case(seed=8)]) == [case(seed=8)]
    assert [p.name for p in (store.path / "cases").iterdir()] == [f"{case().identity}.json"]
    later = ResultStore(store.path, False)
    assert later.waiting([case(), case(seed=8)]) == [case(seed=8)]
    assert later.table().equals(store.table())
    assert later.table()["snr_db"].to_list() == [0.1 + 0.2]


def test_refused_cases_are_settled_and_failed_ones_tried_again(tmp_path):
    store = ResultStore(tmp_path, False)
    store.settle(case(), Outcome("refused", "too much", ({"gain_margin": 1.2, "delay_ms": 32.0},)))
    store.settle(case(seed=8), failed("the robot does not answer"))
    assert store.waiting([case(), case(seed=8)]) == []
    assert is_known(tmp_path, case(), keep_recordings=True)
    assert not is_known(tmp_path, case(seed=8))


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b'{"status": "done"}', b"\xff"])
def test_a_file_that_is_not_ours_does_not_count(content, tmp_path):
    ResultStore(tmp_path, False).write(f"cases/{case().identity}.json", content)
    assert not is_known(tmp_path, case())


def test_recordings_are_kept_and_missed(tmp_path):
    store = ResultStore(tmp_path, False)
    twice = case(repeat=2)
    store.settle(twice, invented(twice, False))
    assert is_known(tmp_path, twice)
    assert not is_known(tmp_path, twice, keep_recordings=True)
    store.settle(twice, invented(twice, True))
    assert is_known(tmp_path, twice, keep_recordings=True)
    kept = sorted(path.name for path in (tmp_path / "recordings" / twice.identity).iterdir())
    assert kept == ["uniform_4_1_r1.mcap", "uniform_4_1_r2.mcap"]


def test_a_full_disk_leaves_no_half_file(tmp_path, monkeypatch):
    store = ResultStore(tmp_path, False)
    store.settle(case(seed=8), DONE)
    real = Path.write_bytes

    def full(path, data):
        real(path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(SweepError, match="No space left on device; make room"):
        store.settle(case(), DONE)
    monkeypatch.undo()
    assert not is_known(tmp_path, case())
    assert is_known(tmp_path, case(seed=8))
    assert [p.name for p in (tmp_path / "cases").iterdir()] == [f"{case(seed=8).identity}.json"]


def test_what_a_killed_sweep_has_left_goes_but_not_what_is_being_written(tmp_path):
    ResultStore(tmp_path, False).prepare()
    for folder in ("cases", "recordings/abc"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "old.1.part").write_bytes(b"half")
        (tmp_path / folder / "new.2.part").write_bytes(b"half")
        os.utime(tmp_path / folder / "old.1.part", (0, 0))
    ResultStore(tmp_path, False).prepare()
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == {"new.2.part"}


def test_a_folder_that_cannot_be_written_is_found_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SweepError, match="cannot write"):
        ResultStore(tmp_path / "file", False).prepare()


def some_table():
    twice = case(repeat=2)
    return table_with(
        [
            (twice, invented(twice)),
            (case(gain_p=30.0), Outcome("refused", "too much", ({"gain_margin": 1.2, "delay_ms": 32.0},))),
            (case(seed=13), failed('died, "badly",\nin two lines')),
        ]
    )


def test_rows_of_the_table():
    table = some_table()
    assert table.columns == [column.name for column in COLUMNS]
    assert table["status"].to_list() == ["done", "done", "refused", "failed"]
    assert table["repetition"].to_list() == [1, 2, None, None]
    assert table["gain_margin"][2] == 1.2
    assert table["error"][3] == 'died, "badly", in two lines'


def written(tmp_path, format):
    """The table's file of a case of two runs and of one that failed."""
    store = ResultStore(tmp_path, False)
    cases = [case(repeat=2), case(seed=13)]
    store.waiting(cases)
    for it in cases:
        store.settle(it, invented(it))
    return store.table(), store.write_table(format).read_bytes()


def test_csv_holds_every_value(tmp_path):
    table = list(csv.DictReader(io.StringIO(written(tmp_path, "csv")[1].decode())))
    assert list(table[0]) == [column.name for column in COLUMNS]
    assert float(table[0]["snr_db"]) == figures(case(), 1)["snr_db"]
    assert table[0]["uses_preview"] == "true"
    assert table[2]["snr_db"] == ""
    assert table[2]["error"] == "the simulated box died"


def test_parquet_holds_the_same_with_types_and_says_what_its_columns_are(tmp_path):
    table, content = written(tmp_path, "parquet")
    assert written(tmp_path, "parquet")[1] == content
    assert pl.read_parquet(io.BytesIO(content)).equals(table)
    texts = pl.read_parquet_metadata(io.BytesIO(content))
    assert texts["snr_db"].startswith("SNR of the TCP speed")


def test_a_table_without_cases_has_its_columns(tmp_path):
    content = ResultStore(tmp_path, False).write_table("csv").read_text()
    assert content.strip() == ",".join(column.name for column in COLUMNS)


def test_stored_cases_say_what_they_are(tmp_path):
    ResultStore(tmp_path, False).settle(case(gain_p=3.5), DONE)
    (path,) = (tmp_path / "cases").iterdir()
    stored = json.loads(path.read_text())
    assert stored["case"]["controller"]["gain_p"] == 3.5
    assert stored["case"]["arm"] == {"robot": "ur3", "fidelity": "typical", "seed": 7}
