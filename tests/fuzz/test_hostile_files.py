"""The client against hostile files: crafted, packed to burst. Always one line, never a traceback.

Those that are valid but for random damage are in `test_fuzz_files.py`.
"""

from __future__ import annotations

import json
import os
import struct
import tracemalloc
import zipfile
from pathlib import Path, PurePosixPath, PureWindowsPath
from zlib import crc32

import pytest
from fuzz_files import TARGETS
from fuzz_mutations import mutate_toml
from hypothesis import given
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC
from recording_samples import SIGNALS, provenance, record_movement

from pc_client import cli
from pc_client.analysis.report import build_tables
from pc_client.analysis.run import analyse_run
from pc_client.errors import ClientError, MovementError, RecordingError, one_line
from pc_client.experiment.experiment import _refuse_to_lose
from pc_client.files import FILE_KINDS, MOST_BYTES, as_file_name, is_file_name
from pc_client.movements.library_sets import LIBRARY_FOLDER
from pc_client.movements.movement import load_movement
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import row_topics, schema_text
from pc_client.studies.extraction.pen import MOST_SAMPLES, contents, parse_pen, pen_sources
from ur_hil.input_files import MIB


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return record_movement(tmp_path_factory.mktemp("whole") / "a.mcap", duration=0.2, rest=0.1)


def complaint(act, *arguments):
    """The line of the project's error, "" when there is none; any other error ends the test."""
    try:
        act(*arguments)
    except ClientError as error:
        return one_line(error)
    return ""


def crafted(*, topics=None, facts=None, compression="", rows=b"", schema=None, twice=False, size=None):
    """A recording with parts that nobody wrote."""
    builder = RecordBuilder()
    builder.write(MAGIC)
    Header(profile="ros2", library="x").write(builder)
    for number, topic in enumerate(topics or row_topics(SIGNALS), start=1):
        text = schema_text(topic.signals) if schema is None or number > 1 else schema
        Schema(id=number, data=text.encode(), encoding="ros2msg", name="x").write(builder)
        for _ in range(1 + twice):
            Channel(id=number, topic=topic.name, message_encoding="cdr", metadata={}, schema_id=number).write(
                builder
            )
            if twice:
                Schema(id=number, data=b"float64 x  # x\n", encoding="ros2msg", name="x").write(builder)
    Metadata(name="provenance", metadata={**provenance().to_metadata(), **(facts or {})}).write(builder)
    Chunk(
        compression=compression,
        data=rows,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=crc32(rows),
        uncompressed_size=len(rows) if size is None else size,
    ).write(builder)
    return builder.end()


DEEP = "[" * 100_000
LOOP = {"gain_margin": 1.0, "phase_margin_deg": 1.0, "delay_margin_s": 1.0, "sensitivity_peak": 1.0}
CRAFTED = {
    "empty schema": crafted(schema=""),
    "no numbers": crafted(schema="float64[0] timestamp  # timestamp\n"),
    "number of a thousand digits": crafted(schema=f"float64[{'9' * 1000}] timestamp  # timestamp\n"),
    "arabic digits": crafted(schema="float64[٣] timestamp  # timestamp\n"),
    "name twice": crafted(schema="float64 a  # timestamp\nfloat64 b  # timestamp\n"),
    "no time stamp": crafted(schema="float64 a  # a\n"),
    "scalar pose": crafted(
        schema="float64 timestamp  # timestamp\nfloat64 actual_tcp_pose  # actual_TCP_pose\n"
    ),
    "topic defined twice": crafted(twice=True),
    "no topics": crafted(topics=row_topics(SIGNALS)[:1]),
    "packed": crafted(compression="lz4", rows=b"\x04\x22\x4d\x18", size=1 << 40),
    "unknown packing": crafted(compression="\x1b[2J", rows=b"x"),
    "wrong type of a number": crafted(facts={"repetition": '"one"'}),
    "a list for a number": crafted(facts={"cycle_time_s": "[]"}),
    "NaN": crafted(facts={"identified_delay_s": "NaN"}),
    "endless integer": crafted(facts={"seed": "9" * 400}),
    "more digits than are read": crafted(facts={"seed": "9" * 5000}),
    "a text for settings": crafted(facts={"controller_config": '"x"'}),
    "nested settings": crafted(facts={"controller_config": '{"name": [1]}'}),
    "deep JSON": crafted(facts={"loop": DEEP}),
    "texts in the loop": crafted(facts={"loop": json.dumps({**LOOP, "gain_margin": "x"})}),
    "endless dead time": crafted(facts={"loop": '{"dead_time_s": 1e300, "lag_s": 0.1, "joint_spread_s": 0}'}),
    "points that are none": crafted(facts={"target_points": "[[1, 2]]"}),
    "points of texts": crafted(facts={"target_points": '[["a", "b", "c"]]'}),
    "points that are a number": crafted(facts={"target_points": "7"}),
    "simulated is a text": crafted(facts={"simulated": '"no"'}),
    "long name": crafted(facts={"movement": "x" * 100_000}),
    "name that a terminal obeys": crafted(facts={"movement": "\x1b]0;evil\x07"}),
    "chunk that is cut in its head": MAGIC + b"\x06" + struct.pack("<Q", 3) + b"abc",
    "nothing": MAGIC,
}


VALUES = (float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 0.0, 5e-324)


@given(
    signal=st.sampled_from(
        ["timestamp", "ref_t", "ref_q", "ref_tcp_position", "actual_q", "actual_TCP_pose"]
    ),
    value=st.sampled_from(VALUES),
    rows=st.sampled_from([slice(None), slice(20, 21), slice(10, 40, 2)]),
)
def test_values_that_no_robot_reports_are_refused(whole, signal, value, rows):
    recording = load_recording(whole)
    recording.column(signal)[rows] = value
    line = complaint(analyse_run, recording)
    assert line or value in (0.0, 5e-324)


def test_one_bad_file_does_not_end_the_report_of_the_others(tmp_path, whole, capsys, monkeypatch):
    (tmp_path / "good_r1.mcap").write_bytes(whole.read_bytes())
    for number, data in enumerate(CRAFTED.values()):
        (tmp_path / f"bad_{number:02}.mcap").write_bytes(data)
    report = build_tables(tmp_path)
    assert len(report.table.runs) == 1
    names, reasons = zip(*(line.split(": ", 1) for line in report.left_out), strict=True)
    assert list(names) == [f"bad_{k:02}.mcap" for k in range(len(CRAFTED))]
    for name, reason in zip(CRAFTED, reasons, strict=True):
        assert reason.isprintable(), name
        assert "cannot be measured (" not in reason, name
    monkeypatch.setattr("pc_client.commands.recordings.show_report", lambda folder, **options: report)
    assert cli.run(["report", str(tmp_path)]) == 1


def test_a_fault_of_ours_in_one_file_is_named_and_does_not_end_the_report(tmp_path, whole, monkeypatch):
    for name in ("a", "b"):
        (tmp_path / f"{name}.mcap").write_bytes(whole.read_bytes())

    def fails_once(recording, of=analyse_run, **options):
        if recording.path.name == "a.mcap":
            raise ZeroDivisionError("x\x1b[2J")
        return of(recording)

    monkeypatch.setattr("pc_client.analysis.report.analyse_run", fails_once)
    assert build_tables(tmp_path).left_out == ("a.mcap: cannot be measured (ZeroDivisionError: x\\x1b[2J)",)


def test_recordings_that_cannot_be_read_are_not_overwritten(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(CRAFTED["wrong type of a number"])
    with pytest.raises(RecordingError, match="not overwritten"):
        _refuse_to_lose(path, overwrite=True)


def test_a_file_beyond_its_limit_is_refused_before_it_is_in_memory(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        file.truncate(8 << 30)  # of holes
    for limit in FILE_KINDS.values():
        if limit.most_bytes <= 16 * MIB:
            tracemalloc.start()
            with pytest.raises(limit.error, match="longer than"):
                limit.read_bytes(path)
            assert tracemalloc.get_traced_memory()[1] < 3 * limit.most_bytes
            tracemalloc.stop()


def test_only_regular_files_are_read(tmp_path):
    os.mkfifo(tmp_path / "a.mcap")
    for path in (tmp_path / "a.mcap", tmp_path, Path("/dev/zero"), Path("a\0b")):
        with pytest.raises(RecordingError, match="cannot be read"):
            load_recording(path)


# ---- archives and pen recordings


def zipped(path, files, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method, compresslevel=9) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def test_an_archive_that_bursts_is_unpacked_no_further_than_its_limit(tmp_path):
    """Both its heads say that the file is small; an honest one is in the corpus."""
    path = zipped(tmp_path / "a.zip", {"a.csv": bytes(64 * MIB), "b.csv": b"0,0,0\n1,1,1\n"})
    data = path.read_bytes()
    path.write_bytes(data.replace(struct.pack("<I", 64 * MIB), struct.pack("<I", 1000)))
    tracemalloc.start()
    outcomes = list(contents(pen_sources([path])))
    assert tracemalloc.get_traced_memory()[1] < 4 * FILE_KINDS["pen"].most_bytes
    tracemalloc.stop()
    assert isinstance(outcomes[0][1], RecordingError)
    assert outcomes[1][1] == b"0,0,0\n1,1,1\n"


def test_packing_methods_that_cannot_be_unpacked_piece_by_piece_are_refused(tmp_path):
    path = zipped(tmp_path / "a.zip", {"a.csv": bytes(MIB)}, zipfile.ZIP_BZIP2)
    ((_, content),) = contents(pen_sources([path]))
    assert "pack it by deflate" in str(content)


def test_an_archive_of_too_much_is_refused(tmp_path, monkeypatch):
    path = zipped(tmp_path / "a.zip", {f"{k}.csv": b"0,0,0" for k in range(4)})
    monkeypatch.setattr("pc_client.studies.extraction.pen.MOST_MEMBERS", 3)
    with pytest.raises(RecordingError, match=r"4 files of 0 MiB in all; allowed are 3"):
        pen_sources([path])


def test_samples_of_a_pen_recording_are_counted():
    with pytest.raises(RecordingError, match=f"more than {MOST_SAMPLES} samples"):
        parse_pen(b"0,0,0\n" * (MOST_SAMPLES + 1), "a.csv")


# ---- TOML

LIBRARY = (LIBRARY_FOLDER / "paper" / "lognorm_4_1.toml").read_text()
TOML_READERS = [name for name, target in TARGETS.items() if target.mutate is mutate_toml]


# As they stand in a TOML file.
NO_NAMES = [
    "../../evil", "/etc/evil", "a/b", "a\\\\b", "..", ".", ".x", "-rf", "", " ", "a ", " a", "a.", "x" * 300, "é" * 51,
    "a\\u0000", "a\\u001b[2J", "a\\nb", "C:evil", "a*", "CON", "nul", "Com1", "LPT9.txt", "aux.tar.gz", "a\\u202eb",
]  # fmt: skip


@pytest.mark.parametrize("name", NO_NAMES)
def test_a_name_never_leaves_the_folder_of_the_recordings(tmp_path, name):
    path = tmp_path / "m.toml"
    path.write_text(LIBRARY.replace('"lognorm_4_1"', f'"{name}"'))
    with pytest.raises(MovementError, match="name"):
        load_movement(path)


@given(name=st.text(max_size=120) | st.sampled_from(NO_NAMES))
def test_a_name_that_is_taken_is_a_file_of_the_folder(name):
    if is_file_name(name):
        assert PurePosixPath(name).parts == PureWindowsPath(name).parts == (name,)
        assert not PureWindowsPath(name).is_reserved()
        assert len(name.encode()) <= MOST_BYTES
    assert is_file_name(as_file_name(name, "drawing"))


def test_a_movement_of_years_is_refused_before_it_is_planned(tmp_path):
    path = tmp_path / "m.toml"
    lines = [("duration = 1e300" if line.startswith("duration") else line) for line in LIBRARY.splitlines()]
    path.write_text("\n".join(lines))
    with pytest.raises(MovementError, match="0 to 1200 s"):
        load_movement(path)


@pytest.mark.parametrize("reader", TOML_READERS)
@pytest.mark.parametrize("text", ["x = " + "[" * 5000, "x = " + "9" * 5000, "\0", "a" + ".a" * 5000 + " = 1"])
def test_toml_that_no_parser_likes(tmp_path, reader, text):
    with pytest.raises(ClientError):
        TARGETS[reader].read(text.encode(), tmp_path)


KEYS = {"movement": "name", "cell": "name", "controller": "gain_p", "sweep": "movements"}


@pytest.mark.parametrize("reader", TOML_READERS)
@pytest.mark.parametrize(
    ("value", "most"),
    [(".a" * 5000 + " = 1", 200 * MIB), (f" = 0x{'f' * 10_000}", 200 * MIB), (f" = [{'true, ' * 20_000}]", 40 * MIB)],
    ids=["nested", "long", "list"],
)  # fmt: skip
def test_a_key_with_a_monstrous_value(tmp_path, reader, value, most):
    tracemalloc.start()
    assert complaint(TARGETS[reader].read, f"{KEYS[reader]}{value}".encode(), tmp_path).isprintable()
    assert tracemalloc.get_traced_memory()[1] < most
    tracemalloc.stop()
