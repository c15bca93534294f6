"""Port 30003: the table against the documents' offsets, the codec against plain struct."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.realtime.layout import COLUMNS, SNAPSHOT_FIELDS, layout_for_size, layout_for_version
from protocol.ur_types import SoftwareVersion

SIZES = [1044, 1060, 1108, 1116, 1140, 1220]


def numbered_snapshot():
    """Every float of every column is another number, so that any mix-up shows."""
    values, number = {}, 1.0
    for column in COLUMNS:
        if column.count == 1:
            values[column.attribute] = number
        else:
            values[column.attribute] = tuple(number + 0.01 * k for k in range(column.count))
        number += 1.0
    return SimpleNamespace(**{name: values[name] for name in SNAPSHOT_FIELDS})


@pytest.mark.parametrize(
    ("version", "size"),
    [
        ("3.0", 1044), ("3.1.18024", 1044), ("3.2", 1060),
        ("3.4.5", 1060), ("3.5", 1108), ("3.9.1", 1108), ("3.10", 1116), ("3.13", 1116), ("3.14.3", 1140),
        ("3.15.8", 1140), ("5.0.5", 1108), ("5.3", 1108), ("5.4", 1116), ("5.8", 1116), ("5.9", 1140),
        ("5.10", 1220), ("5.24", 1220), ("10.7", 1220),
    ],
)  # fmt: skip
def test_frame_size_of_each_version(version, size):
    layout = layout_for_version(SoftwareVersion.parse(version))
    assert layout.size == size
    assert layout is layout_for_size(size)


@pytest.mark.parametrize("version", ["0.9", "1.8", "2.0", "4.1"])
def test_versions_that_never_were(version):
    with pytest.raises(LocalProtocolError, match=version):
        layout_for_version(SoftwareVersion.parse(version))


# Offset of each field and its first gnuplot column, as in the vendor's sheet.
SHEET = [
    ("timestamp", 4, 1), ("target_q", 12, 2), ("target_qd", 60, 8), ("target_qdd", 108, 14),
    ("target_current", 156, 20), ("target_moment", 204, 26), ("actual_q", 252, 32), ("actual_qd", 300, 38),
    ("actual_current", 348, 44), ("joint_control_output", 396, 50), ("actual_TCP_pose", 444, 56),
    ("actual_TCP_speed", 492, 62), ("actual_TCP_force", 540, 68), ("target_TCP_pose", 588, 74),
    ("target_TCP_speed", 636, 80), ("actual_digital_input_bits", 684, 86), ("joint_temperatures", 692, 87),
    ("actual_execution_time", 740, 93), ("test_value", 748, 94), ("robot_mode", 756, 95),
    ("joint_mode", 764, 96), ("safety_mode", 812, 102), ("internal_103", 820, 103),
    ("actual_tool_accelerometer", 868, 109), ("internal_112", 892, 112), ("speed_scaling", 940, 118),
    ("actual_momentum", 948, 119), ("internal_120", 956, 120), ("internal_121", 964, 121),
    ("actual_main_voltage", 972, 122), ("actual_robot_voltage", 980, 123), ("actual_robot_current", 988, 124),
    ("actual_joint_voltage", 996, 125), ("actual_digital_output_bits", 1044, 131),
    ("runtime_state", 1052, 132),
    ("elbow_position", 1060, 133), ("elbow_velocity", 1084, 136), ("safety_status", 1108, 139),
    ("internal_140", 1116, 140), ("internal_141", 1124, 141), ("internal_142", 1132, 142),
    ("payload", 1140, 143), ("payload_cog", 1148, 144), ("payload_inertia", 1172, 147),
]  # fmt: skip


def test_offsets_are_those_of_the_sheet():
    layout = layout_for_size(1220)
    assert [(c.name, layout.offset(c), (layout.offset(c) - 4) // 8 + 1) for c in layout.columns] == SHEET


@pytest.mark.parametrize("size", SIZES)
def test_what_is_written_is_read(size):
    snapshot = numbered_snapshot()
    layout = layout_for_size(size)
    data = layout.encoder()(snapshot)
    assert len(data) == size
    frame = layout.decode(data)
    assert frame.names == tuple(column.attribute for column in layout.columns)
    for column in layout.columns:
        value = getattr(frame, column.attribute)
        expected = getattr(snapshot, column.attribute, 0.0 if column.count == 1 else (0.0,) * column.count)
        assert np.shape(value) == (() if column.count == 1 else (column.count,))
        assert np.array_equal(value, expected)


def test_bytes_are_big_endian_doubles_after_the_length_bits_and_modes_too():
    snapshot = numbered_snapshot()
    snapshot.actual_digital_input_bits, snapshot.robot_mode = 0b101, 7
    data = layout_for_size(1140).encoder()(snapshot)
    assert data[684:692].hex() == "4014000000000000"  # 5.0: bits 0 and 2
    assert data[756:764].hex() == "401c000000000000"
    assert struct.unpack_from(">i", data) == (1140,)
    assert struct.unpack_from(">7d", data, 4) == (1.0, 2.0, 2.01, 2.02, 2.03, 2.04, 2.05)
    assert data[820:868] == bytes(48)  # internal


def test_a_frame_is_read_only_and_its_vectors_are_views():
    layout = layout_for_size(1140)
    frame = layout.decode(layout.encoder()(numbered_snapshot()))
    assert isinstance(frame.timestamp, float)
    assert frame.actual_q.base is not None
    with pytest.raises(ValueError, match="read-only"):
        frame.actual_q[0] = 1.0
    assert "timestamp 1.000 s" in repr(frame)


def test_a_column_that_the_version_lacks_is_named_in_the_error():
    layout = layout_for_size(1060)
    frame = layout.decode(layout.encoder()(numbered_snapshot()))
    with pytest.raises(AttributeError, match=r"1060 bytes has no 'elbow_position'; it has timestamp"):
        _ = frame.elbow_position


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("actual_q", (1.0,) * 5, r"actual_q is .*give 6 numbers"),
        ("actual_q", 1.0, r"actual_q is 1.0: give 6 numbers"),
        ("robot_mode", None, r"robot_mode is None: give 1 number"),
        ("elbow_position", ("x", 0.0, 0.0), r"elbow_position is .*give 3 numbers"),
    ],
)
def test_a_wrong_snapshot_is_named(field, value, message):
    snapshot = numbered_snapshot()
    setattr(snapshot, field, value)
    with pytest.raises(LocalProtocolError, match=message):
        layout_for_size(1140).encoder()(snapshot)


def test_a_snapshot_without_a_column_is_an_attribute_error():
    snapshot = numbered_snapshot()
    del snapshot.elbow_position
    assert len(layout_for_size(1060).encoder()(snapshot)) == 1060  # this version does not send it
    with pytest.raises(AttributeError, match="elbow_position"):
        layout_for_size(1140).encoder()(snapshot)


@pytest.mark.parametrize(
    "data", [b"", b"\x00\x00\x04\x74", bytes(1140), (1140).to_bytes(4, "big") + bytes(1137), b"\xff" * 1140]
)
def test_frames_of_another_size_are_refused(data):
    with pytest.raises(RemoteProtocolError, match="1140 bytes"):
        layout_for_size(1140).decode(data)


def test_unknown_sizes_are_refused():
    with pytest.raises(RemoteProtocolError, match=r"1141 bytes: known sizes are 1044, 1060"):
        layout_for_size(1141)
