"""The file itself: valid MCAP, decodable with ROS 2 rules, equal for equal runs; its rows as tables."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import Literal

import numpy as np
import polars
import pytest
from mcap.reader import make_reader
from recording_samples import N_VALUES, SIGNALS, append_rows, provenance
from scipy.io import loadmat

from pc_client.errors import RecordingError
from pc_client.recording.export import export
from pc_client.recording.provenance import Provenance
from pc_client.recording.recorder import ROWS_PER_CHUNK, Recorder
from pc_client.recording.recording import Recording, load_recording
from pc_client.recording.rows import Phase, parse_schema_text, row_topics, schema_text


def write(path: Path, n: int, whose: Provenance | None = None) -> Path:
    with Recorder(path, whose or provenance(), SIGNALS) as recorder:
        append_rows(recorder, n)
        recorder.close({"snr_db": 31.5, "stopped": False})
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return load_recording(write(tmp_path / "a.mcap", 70))


@pytest.mark.parametrize("n", [0, ROWS_PER_CHUNK, ROWS_PER_CHUNK + 1])
def test_mcaps_own_reader_finds_every_message(tmp_path: Path, n: int) -> None:
    with write(tmp_path / "a.mcap", n).open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        messages = list(reader.iter_messages())
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.channel_message_counts == ({1: n, 2: n, 3: n} if n else {})
    assert len(summary.chunk_indexes) == -(-n // ROWS_PER_CHUNK)
    assert len(messages) == 3 * n
    assert metadata["provenance"]["movement"] == "lognorm_4_1"
    assert metadata["summary"] == {"snr_db": "31.5", "stopped": "false"}
    for index, (schema, channel, message) in enumerate(m for m in messages if m[1].topic == "/robot_state"):
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
        assert message.sequence == index
        assert message.log_time == round((50.0 + 0.008 * index) * 1e9)
        values = struct.unpack(f"<4x{N_VALUES}d", message.data)
        assert values[1:] == tuple(1000.0 * index + np.arange(1, N_VALUES))


def test_schemas_keep_to_the_rules_of_ros_2() -> None:
    for topic in row_topics(SIGNALS):
        for line in schema_text(topic.signals).splitlines():
            assert re.fullmatch(r"(float64|uint8)(\[\d+\])? [a-z](_?[a-z0-9]+)*  # .*", line)
        assert parse_schema_text(schema_text(topic.signals)) == topic.signals


def test_everything_comes_back(recording: Recording) -> None:
    i = np.arange(70)
    assert recording.complete
    assert recording.damage == ""
    assert recording.provenance == provenance()
    assert recording.summary == {"snr_db": 31.5, "stopped": False}
    assert recording.n_rows == 70
    np.testing.assert_array_equal(recording.t, 50.0 + 0.008 * i)
    np.testing.assert_array_equal(recording.column("actual_TCP_pose"), 1000.0 * i[:, None] + np.arange(7, 13))
    np.testing.assert_array_equal(recording.column("robot_mode"), 1000.0 * i + 13)
    np.testing.assert_array_equal(recording.column("ref_t"), 0.008 * i)
    np.testing.assert_array_equal(recording.column("ref_q"), i[:, None] + np.arange(6))
    np.testing.assert_array_equal(recording.column("ref_qd"), np.arange(6) - i[:, None])
    np.testing.assert_array_equal(recording.column("ref_tcp_position")[:, 0], 0.1 * i)
    np.testing.assert_array_equal(recording.column("ref_tcp_velocity")[:, 2], 0.01 * i)
    np.testing.assert_array_equal(recording.column("cmd_qd"), np.arange(6) * 0.5 + i[:, None])
    np.testing.assert_array_equal(recording.rows_of(Phase.SETTLE_AFTER), i % 3 == 2)
    with pytest.raises(RecordingError, match="no signal 'actual_Q'; it has timestamp, actual_q"):
        recording.column("actual_Q")


def test_equal_runs_give_equal_bytes(tmp_path: Path) -> None:
    first = write(tmp_path / "first.mcap", 100).read_bytes()
    assert write(tmp_path / "second.mcap", 100).read_bytes() == first


@pytest.mark.parametrize(
    ("signals", "message"),
    [
        ([("timestamp", 1), ("a__b", 1)], "a__b"),
        ([("timestamp", 1), ("phase", 1)], "appears twice"),
        ([("timestamp", 1), ("actual_Q", 6), ("actual_q", 6)], "appears twice"),
        ([("actual_q", 6)], "no scalar 'timestamp'"),
    ],
)
def test_signals_that_cannot_be_recorded_are_refused(
    tmp_path: Path, signals: list[tuple[str, int]], message: str
) -> None:
    with pytest.raises(RecordingError, match=message):
        Recorder(tmp_path / "a.mcap", provenance(), signals)
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize("simulated", [True, False, None])
@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_the_file_and_every_row_of_a_table_say_whose_data_they_are(
    tmp_path: Path, simulated: bool | None, format: Literal["csv", "parquet"]
) -> None:
    whose = provenance(simulated=simulated, seed=None, identified_delay_s=None)
    recording = load_recording(write(tmp_path / "a.mcap", 3, whose))
    assert recording.provenance == whose
    path = export(recording, tmp_path / "a", format)
    table = polars.read_parquet(path) if format == "parquet" else polars.read_csv(path, infer_schema_length=9)
    rows = table.select("robot", "software", "serial", "simulated").rows()
    assert [tuple(map(str, row)) for row in rows] == [
        (whose.robot_model, whose.firmware, whose.serial, str(simulated))
    ] * 3


def test_csv_keeps_every_bit_and_says_the_units(recording: Recording, tmp_path: Path) -> None:
    path = export(recording, tmp_path / "a.csv", "csv")
    header = path.read_text().splitlines()[0].split(",")
    assert header[:3] == ["timestamp [s]", "actual_q_0 [rad]", "actual_q_1 [rad]"]
    assert {"actual_TCP_pose_2 [m]", "actual_TCP_pose_3 [rad]", "robot_mode"} <= set(header)
    assert header[-5:] == ["phase", "robot", "software", "serial", "simulated"]
    table = np.loadtxt(path, delimiter=",", skiprows=1, usecols=range(len(header) - 4))
    np.testing.assert_array_equal(table[:, 0], recording.t)
    np.testing.assert_array_equal(
        table[:, header.index("cmd_qd_3 [rad/s]")], recording.column("cmd_qd")[:, 3]
    )


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
    whose, told = recording.provenance, held["provenance"]
    assert (told["movement"], told["serial"], bool(told["simulated"])) == (whose.movement, whose.serial, True)
    assert told["identified_delay_s"] == whose.identified_delay_s
    assert told["controller_config"]["kp"] == whose.controller_config["kp"]
    np.testing.assert_array_equal(told["target_points"], np.array(whose.target_points))


def test_unknown_formats_and_unwritable_paths_are_refused(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="'xlsx'; use one of csv, parquet, mat"):
        export(recording, tmp_path / "a.xlsx", "xlsx")  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="cannot write"):
        export(recording, tmp_path / "none" / "a.csv", "csv")
