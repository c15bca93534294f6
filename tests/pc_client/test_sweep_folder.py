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

import pytest
from sweep_samples import case, figures, invented

from pc_client.errors import SweepError
from pc_client.sweep.case import Case, GivenRobot
from pc_client.sweep.columns import COLUMNS
from pc_client.sweep.folder import SweepFolder, table_rows
from pc_client.sweep.outcome import Outcome, failed
from pc_client.sweep.table import table_content, table_format

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


def test_what_is_stored_comes_back_to_the_last_bit(tmp_path):
    folder = SweepFolder(tmp_path / "new" / "folder")
    folder.prepare()
    assert folder.load(case(), False) is None
    folder.store(case(), DONE)
    assert folder.load(case(), False) == DONE
    assert folder.load(case(seed=8), False) is None
    assert sorted(p.name for p in (folder.path / "cases").iterdir()) == [f"{case().identity}.json"]


def test_refused_cases_are_settled_and_failed_ones_tried_again(tmp_path):
    folder = SweepFolder(tmp_path)
    refused = Outcome("refused", "too much", ({"gain_margin": 1.2, "delay_ms": 32.0},))
    folder.store(case(), refused)
    folder.store(case(seed=8), failed("the robot does not answer"))
    assert folder.load(case(), True) == refused
    assert folder.load(case(seed=8), False) is None


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b'{"status": "done"}', b"\xff"])
def test_a_file_that_is_not_ours_does_not_count(content, tmp_path):
    folder = SweepFolder(tmp_path)
    folder.write(f"cases/{case().identity}.json", content)
    assert folder.load(case(), False) is None


def test_recordings_are_kept_and_missed(tmp_path):
    folder = SweepFolder(tmp_path)
    twice = case(repeat=2)
    folder.store(twice, invented(twice, False))
    assert folder.load(twice, False) is not None
    assert folder.load(twice, True) is None
    folder.store(twice, invented(twice, True))
    assert folder.load(twice, True) is not None
    kept = sorted(path.name for path in (tmp_path / "recordings" / twice.identity).iterdir())
    assert kept == ["uniform_4_1_r1.mcap", "uniform_4_1_r2.mcap"]


def test_a_full_disk_leaves_no_half_file(tmp_path, monkeypatch):
    folder = SweepFolder(tmp_path)
    folder.store(case(seed=8), DONE)
    real = Path.write_bytes

    def full(path, data):
        real(path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(SweepError, match="No space left on device; make room"):
        folder.store(case(), DONE)
    monkeypatch.undo()
    assert folder.load(case(), False) is None
    assert folder.load(case(seed=8), False) == DONE
    assert [p.name for p in (tmp_path / "cases").iterdir()] == [f"{case(seed=8).identity}.json"]


def test_what_a_killed_sweep_has_left_goes_but_not_what_is_being_written(tmp_path):
    SweepFolder(tmp_path).prepare()
    for folder in ("cases", "recordings/abc"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "old.1.part").write_bytes(b"half")
        (tmp_path / folder / "new.2.part").write_bytes(b"half")
        os.utime(tmp_path / folder / "old.1.part", (0, 0))
    SweepFolder(tmp_path).prepare()
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == {"new.2.part"}


def test_a_folder_that_cannot_be_written_is_found_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SweepError, match="cannot write"):
        SweepFolder(tmp_path / "file").prepare()


def some_rows():
    twice = case(repeat=2)
    return table_rows(
        [
            (twice, invented(twice, False)),
            (case(gain_p=30.0), Outcome("refused", "too much", ({"gain_margin": 1.2, "delay_ms": 32.0},))),
            (case(seed=13), failed('died, "badly",\nin two lines')),
        ]
    )


def test_rows_of_the_table():
    rows = some_rows()
    assert [row["status"] for row in rows] == ["done", "done", "refused", "failed"]
    assert [row.get("repetition") for row in rows] == [1, 2, None, None]
    assert rows[2]["gain_margin"] == 1.2
    assert rows[3]["error"] == 'died, "badly", in two lines'
    names = {column.name for column in COLUMNS}
    assert all(set(row) <= names for row in rows)


def test_csv_holds_every_value(tmp_path):
    table = list(csv.DictReader(io.StringIO(table_content(some_rows(), "csv").decode())))
    assert list(table[0]) == [column.name for column in COLUMNS]
    assert float(table[0]["snr_db"]) == figures(case(), 1)["snr_db"]
    assert table[0]["uses_preview"] == "true"
    assert table[3]["snr_db"] == ""
    assert table[3]["error"] == 'died, "badly", in two lines'


def test_parquet_holds_the_same_with_types():
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = some_rows()
    content = table_content(rows, "parquet")
    assert content == table_content(rows, "parquet")
    table = parquet.read_table(io.BytesIO(content)).to_pylist()
    for row, stored in zip(rows, table, strict=True):
        assert stored == {column.name: row.get(column.name) for column in COLUMNS}


def test_an_empty_table_has_its_columns():
    assert table_content([], "csv").decode().strip() == ",".join(column.name for column in COLUMNS)


def test_without_pyarrow_the_table_is_csv(monkeypatch):
    monkeypatch.setattr("pc_client.sweep.table.find_spec", lambda name: None)
    assert table_format(None) == "csv"
    with pytest.raises(SweepError, match=r"ur-hil\[export\]"):
        table_format("parquet")
    with pytest.raises(SweepError, match="parquet, csv"):
        table_format("xlsx")


def test_stored_cases_say_what_they_are(tmp_path):
    folder = SweepFolder(tmp_path)
    folder.store(case(gain_p=3.5), DONE)
    (path,) = (tmp_path / "cases").iterdir()
    stored = json.loads(path.read_text())
    assert stored["case"]["controller"]["gain_p"] == 3.5
    assert stored["case"]["arm"] == {"robot": "ur3", "fidelity": "typical", "seed": 7}
