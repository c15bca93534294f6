"""Recordings as CSV and Parquet."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest
from recording_samples import SIGNALS, append_rows, provenance
from scipy.io import loadmat

from pc_client.errors import RecordingError
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import Recording, export, load_recording


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
        append_rows(recorder, 70)
    return load_recording(tmp_path / "a.mcap")


def test_csv_keeps_every_bit_and_says_the_units(recording: Recording, tmp_path: Path) -> None:
    path = export(recording, tmp_path / "a.csv", "csv")
    header = path.read_text().splitlines()[0].split(",")
    assert header[:3] == ["timestamp [s]", "actual_q_0 [rad]", "actual_q_1 [rad]"]
    assert "actual_TCP_pose_2 [m]" in header
    assert "actual_TCP_pose_3 [rad]" in header
    assert "robot_mode" in header
    assert "ref_tcp_velocity_0 [m/s]" in header
    assert header[-5:] == ["phase", "robot", "software", "serial", "simulated"]
    table = np.loadtxt(path, delimiter=",", skiprows=1, usecols=range(len(header) - 4))
    np.testing.assert_array_equal(table[:, 0], recording.t)
    np.testing.assert_array_equal(
        table[:, header.index("cmd_qd_3 [rad/s]")], recording.column("cmd_qd")[:, 3]
    )


@pytest.mark.parametrize("simulated", [True, False, None])
@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_every_row_says_whose_data_it_is(tmp_path: Path, simulated: bool | None, format: str) -> None:
    with Recorder(tmp_path / "a.mcap", replace(provenance(), simulated=simulated), SIGNALS) as recorder:
        append_rows(recorder, 3)
    path = export(load_recording(tmp_path / "a.mcap"), tmp_path / "a", format)  # type: ignore[arg-type]
    table = polars.read_parquet(path) if format == "parquet" else polars.read_csv(path, infer_schema_length=9)
    whose = provenance()
    rows = table.select("robot", "software", "serial", "simulated").rows()
    assert [tuple(map(str, row)) for row in rows] == [
        (whose.robot_model, whose.firmware, whose.serial, str(simulated))
    ] * 3


def test_parquet_has_names_units_and_provenance(recording: Recording, tmp_path: Path) -> None:
    path = export(recording, tmp_path / "a.parquet", "parquet")
    np.testing.assert_array_equal(
        polars.read_parquet(path)["actual_q_5"].to_numpy(), recording.column("actual_q")[:, 5]
    )
    facts = polars.read_parquet_metadata(path)
    assert facts["movement"] == "lognorm_4_1"
    assert json.loads(facts["units"])["actual_TCP_pose_3"] == "rad"


def test_mat_has_matrices_and_a_struct_of_the_provenance(recording: Recording, tmp_path: Path) -> None:
    held = loadmat(export(recording, tmp_path / "a.mat", "mat"), simplify_cells=True)
    for name, signal in {"t": "timestamp", "q": "actual_q", "qd_cmd": "cmd_qd", "ref_q": "ref_q"}.items():
        np.testing.assert_array_equal(held[name], recording.column(signal))
    whose = recording.provenance
    told = held["provenance"]
    assert (told["movement"], told["serial"], bool(told["simulated"])) == (whose.movement, whose.serial, True)
    assert told["identified_delay_s"] == whose.identified_delay_s
    assert told["controller_config"]["kp"] == whose.controller_config["kp"]
    np.testing.assert_array_equal(told["target_points"], np.array(whose.target_points))


def test_unknown_format_and_unwritable_path(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="'xlsx'; use one of csv, parquet, mat"):
        export(recording, tmp_path / "a.xlsx", "xlsx")  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="cannot write"):
        export(recording, tmp_path / "none" / "a.csv", "csv")
