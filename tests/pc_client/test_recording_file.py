"""The file itself: valid MCAP, decodable with ROS 2 rules, equal for equal runs; its rows as tables."""

from __future__ import annotations

import json
import re
import struct
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import polars
import pytest
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import MessageIndex
from recording_samples import N_VALUES, SIGNALS, append_rows, provenance
from scipy.io import loadmat

from pc_client.errors import RecordingError
from pc_client.recording.export import export
from pc_client.recording.recorder import ROWS_PER_CHUNK, Recorder
from pc_client.recording.recording import Recording, load_recording
from pc_client.recording.rows import Phase, parse_schema_text, row_topics, schema_text


def write(path: Path, n: int) -> Path:
    with Recorder(path, provenance(), SIGNALS) as recorder:
        append_rows(recorder, n)
        recorder.close({"snr_db": 31.5, "stopped": False})
    return path


@pytest.mark.parametrize("n", [0, 1, ROWS_PER_CHUNK, ROWS_PER_CHUNK + 1, 3 * ROWS_PER_CHUNK - 1])
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
        assert schema.encoding == "ros2msg"
        assert channel.message_encoding == "cdr"
        assert message.sequence == index
        assert message.log_time == round((50.0 + 0.008 * index) * 1e9)
        values = struct.unpack(f"<4x{N_VALUES}d", message.data)
        assert values[1:] == tuple(1000.0 * index + np.arange(1, N_VALUES))


def test_indexes_lead_to_their_messages(tmp_path: Path) -> None:
    data = write(tmp_path / "a.mcap", 200).read_bytes()
    summary = make_reader(BytesIO(data)).get_summary()
    assert summary is not None
    seen = 0
    for chunk in summary.chunk_indexes:
        rows = chunk.chunk_start_offset + 9 + 40  # head of a chunk that is not compressed
        for channel, offset in chunk.message_index_offsets.items():
            index = MessageIndex.read(ReadDataStream(BytesIO(data[offset + 9 :])))
            assert data[offset] == Opcode.MESSAGE_INDEX
            assert index.channel_id == channel
            for log_time, at in index.records:
                opcode, _, its_channel, _, its_time = struct.unpack_from("<BQHIQ", data, rows + at)
                assert (opcode, its_channel, its_time) == (Opcode.MESSAGE, channel, log_time)
                seen += 1
    assert seen == 600


def test_schemas_keep_to_the_rules_of_ros_2() -> None:
    for topic in row_topics(SIGNALS):
        for line in schema_text(topic.signals).splitlines():
            assert re.fullmatch(r"(float64|uint8)(\[\d+\])? [a-z](_?[a-z0-9]+)*  # .*", line)
        assert parse_schema_text(schema_text(topic.signals)) == topic.signals


def test_everything_comes_back(tmp_path: Path) -> None:
    recording = load_recording(write(tmp_path / "a.mcap", 150))
    i = np.arange(150)
    assert recording.complete
    assert recording.damage == ""
    assert recording.provenance == provenance()
    assert recording.summary == {"snr_db": 31.5, "stopped": False}
    assert recording.n_rows == 150
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


def test_equal_runs_give_equal_bytes(tmp_path: Path) -> None:
    first = write(tmp_path / "first.mcap", 300).read_bytes()
    (tmp_path / "elsewhere").mkdir()
    assert write(tmp_path / "elsewhere" / "second.mcap", 300).read_bytes() == first


def test_unknown_signal_names_what_there_is(tmp_path: Path) -> None:
    recording = load_recording(write(tmp_path / "a.mcap", 3))
    with pytest.raises(RecordingError, match="no signal 'actual_Q'; it has timestamp, actual_q"):
        recording.column("actual_Q")


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
def test_provenance_separates_a_real_arm_from_an_unknown_one(tmp_path: Path, simulated: bool | None) -> None:
    real = provenance(simulated=simulated, seed=None, identified_delay_s=None)
    with Recorder(tmp_path / "a.mcap", real, SIGNALS) as recorder:
        append_rows(recorder, 1)
    assert load_recording(tmp_path / "a.mcap").provenance == real


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
