"""Results of a sweep: what is kept on disk and found again, its table, and which setting is the best."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_samples import case, figures, invented, table_of, table_with

from pc_client.control.controller import CONTROLLERS
from pc_client.errors import SweepError
from pc_client.recording.provenance import origin_of
from pc_client.studies.sweep.case import COLUMNS, Case, GivenRobot, Outcome, failed, origin_of_rows
from pc_client.studies.sweep.page import map_axes
from pc_client.studies.sweep.settings import edge_of, rank_settings, spans_grid, varying
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


def test_the_best_setting_has_the_largest_mean_over_all_its_runs():
    settings = rank_settings(
        table_of(
            *(
                case(name, repeat=2, gain_p=g)
                for name in ("uniform_4_1", "lognorm_4_1")
                for g in (2.0, 4.0, 7.0)
            )
        )
    )
    assert settings["setting"].to_list() == ["gain_p = 4", "gain_p = 7", "gain_p = 2"]
    best = settings.row(0, named=True)
    assert best["complete"]
    assert best["n_runs"] == 4
    assert best["mean_snr_db"] == pytest.approx(30.0 - 1.0 - 1.0 + 0.15)
    assert best["gain_margin"] == 10.0
    assert best["max_position_error_mm"] == 5.0


def test_a_setting_with_a_case_missing_stands_below_all_complete_ones():
    cases = [case(seed=seed, gain_p=g, gain_i=2.0) for g in (5.0, 9.0) for seed in (1, 2)]
    cases += [case(seed=3, gain_p=g, gain_i=2.0) for g in (5.0, 9.0, 30.0)]
    outcomes = [(it, invented(it)) for it in cases]
    outcomes[4] = (cases[4], failed("broken"))
    settings = rank_settings(table_with(outcomes))
    assert settings["gain_p"].to_list() == [9.0, 5.0, 30.0]
    assert settings["complete"].to_list() == [True, False, False]
    assert settings.select("n_refused", "n_failed").rows() == [(0, 0), (0, 1), (1, 0)]
    assert settings["mean_snr_db"][2] is None
    assert settings["gain_margin"][2] == 0.5


def test_without_anything_to_compare_the_controller_is_named():
    settings = rank_settings(table_of(case(), case("lognorm_4_1")))
    assert settings["setting"].to_list() == ["controller = preview"]


@pytest.mark.parametrize(
    ("own", "states", "simulated"),
    [
        (True, [None], True),  # a box of the sweep's own, whatever came of the case
        (False, [True, False], True),
        (False, [None, False], None),
        (False, [False, False], False),
    ],
)
def test_a_table_is_of_a_real_arm_only_if_every_row_is(own, states, simulated):
    rows = [{"fidelity": "typical" if own else None, "simulated": state} for state in states]
    assert origin_of_rows(rows) is origin_of(simulated)


@pytest.mark.parametrize(
    ("ps", "qs", "said"),
    [
        ((3.0, 5.0, 7.0), (1.0, 2.0, 3.0), ""),
        ((6.0, 8.0), (1.0, 2.0, 3.0), "gain_p = 6 is the smallest of 2"),
        ((2.0, 4.0), (0.5, 1.5), "gain_p = 4 is the largest of 2, gain_i = 1.5 is the largest of 2"),
        ((4.0, 5.0, 6.0), (0.0, 9.0), ""),  # there is no gain below 0
        ((5.0, 30.0), (2.0,), "gain_p = 5 is the smallest of 2"),  # 30 is refused
        ((30.0, 40.0), (2.0,), ""),  # nothing is the best
    ],
)
def test_a_best_setting_at_the_edge_is_named_with_its_side(ps, qs, said):
    table = table_of(*(case(gain_p=p, gain_i=q) for p in ps for q in qs))
    whole = f"the best lies at the edge of what was tried ({said}): a better one may lie beyond"
    assert edge_of(table, rank_settings(table)) == (whole if said else "")


def test_axes_are_what_varies():
    rows = table_of(case(gain_p=2.0, uses_preview=True), case("lognorm_4_1", gain_p=3.0, uses_preview=False))
    assert varying(rows) == ["movement", "gain_p", "uses_preview"]


def test_what_follows_from_the_name_of_a_controller_is_no_axis():
    paper = {**asdict(CONTROLLERS["paper"]), "gain_i": 2.0}
    others = [case(**{**paper, "gain_p": gain}) for gain in (3.0, 4.0)]
    rows = table_of(*others, *(case(gain_p=gain, gain_i=2.0) for gain in (3.0, 4.0)))
    assert varying(rows) == ["controller", "gain_p"]
    assert spans_grid(rows)
    assert len(rank_settings(rows)) == 4


def test_the_map_prefers_the_gains():
    assert map_axes(table_of(case(gain_p=1.0), case(gain_p=2.0))) is None
    rows = table_of(
        case(gain_p=1.0, gain_i=1.0, slew_limit=1.0), case(gain_p=2.0, gain_i=2.0, slew_limit=2.0)
    )
    assert map_axes(rows) == ("gain_p", "gain_i")
    rows = table_of(case(gain_i=1.0, slew_limit=1.0), case(gain_i=2.0, slew_limit=2.0))
    assert map_axes(rows) == ("gain_i", "slew_limit")


@settings(max_examples=20)
@given(
    ps=st.sets(st.integers(1, 9), min_size=2, max_size=4),
    qs=st.sets(st.integers(1, 9), min_size=2, max_size=4),
    missing=st.booleans(),
)
def test_a_grid_is_known_by_its_corners(ps, qs, missing):
    settings = [(float(p), float(q)) for p in sorted(ps) for q in sorted(qs)]
    rows = table_of(*(case(gain_p=p, gain_i=q) for p, q in settings[missing:]))
    assert spans_grid(rows) is not missing
