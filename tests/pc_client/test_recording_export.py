"""Recordings as CSV and Parquet."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from recording_samples import SIGNALS, append_rows, provenance

from pc_client.errors import RecordingError
from pc_client.recording.export import export
from pc_client.recording.loader import Recording, load_recording
from pc_client.recording.recorder import Recorder


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
        append_rows(recorder, 70)
    return load_recording(tmp_path / "a.mcap")


def test_csv_keeps_every_bit(recording: Recording, tmp_path: Path) -> None:
    path = export(recording, tmp_path / "a.csv", "csv")
    header = path.read_text().splitlines()[0].split(",")
    assert header[:3] == ["timestamp", "actual_q_0", "actual_q_1"]
    assert "actual_TCP_pose_5" in header
    assert header[-1] == "phase"
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 0], recording.t)
    np.testing.assert_array_equal(table[:, header.index("cmd_qd_3")], recording.column("cmd_qd")[:, 3])


def test_parquet(recording: Recording, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(export(recording, tmp_path / "a.parquet", "parquet"))
    np.testing.assert_array_equal(table["actual_q_5"].to_numpy(), recording.column("actual_q")[:, 5])
    assert table.schema.metadata[b"movement"] == b"lognorm_4_1"


def test_parquet_without_pyarrow_says_what_to_install(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecordingError, match=r"pip install 'ur-hil\[export\]'"):
        export(recording, tmp_path / "a.parquet", "parquet")


def test_unknown_format_and_unwritable_path(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="'xlsx'; use one of csv, parquet"):
        export(recording, tmp_path / "a.xlsx", "xlsx")  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="cannot write"):
        export(recording, tmp_path / "none" / "a.csv", "csv")
