"""RTDE's table of variables: what it says of each, and what stands behind it."""

from __future__ import annotations

import pytest

from protocol.realtime.layout import COLUMNS
from protocol.rtde.fields import INPUTS, OUTPUTS, input_fields, output_fields
from protocol.rtde.types import RtdeType
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ValueOrigin

V3_15 = SoftwareVersion(3, 15, 8)


@pytest.mark.parametrize("table", [OUTPUTS, INPUTS])
def test_names_are_unique_ascii_and_free_of_commas(table):
    names = [field.name for field in table]
    assert len(set(names)) == len(names)
    assert all(name.isascii() and name.isidentifier() for name in names)


def test_sizes_of_types():
    sizes = {kind.name: kind.size for kind in RtdeType}
    assert sizes == {
        "BOOL": 1,
        "UINT8": 1,
        "UINT32": 4,
        "INT32": 4,
        "UINT64": 8,
        "DOUBLE": 8,
        "VECTOR3D": 24,
        "VECTOR6D": 48,
        "VECTOR6INT32": 24,
        "VECTOR6UINT32": 24,
    }


def test_registers_are_complete_in_both_directions():
    for table, sides in ((OUTPUTS, ("input", "output")), (INPUTS, ("input",))):
        names = {field.name: field.type for field in table}
        for side in sides:
            assert names[f"{side}_bit_registers0_to_31"] is RtdeType.UINT32
            assert names[f"{side}_bit_registers32_to_63"] is RtdeType.UINT32
            for i in range(64, 128):
                assert names[f"{side}_bit_register_{i}"] is RtdeType.BOOL
            for i in range(48):
                assert names[f"{side}_int_register_{i}"] is RtdeType.INT32
                assert names[f"{side}_double_register_{i}"] is RtdeType.DOUBLE
            assert f"{side}_bit_register_63" not in names
            assert f"{side}_int_register_48" not in names


def test_every_output_is_filled():
    for field in OUTPUTS:
        assert field.origin is not None
        assert field.comes_from or field.origin is ValueOrigin.CONSTANT, field.name
    assert set(output_fields(SoftwareVersion(5, 26))) == {field.name for field in OUTPUTS}


@pytest.mark.parametrize(
    ("name", "first", "before"),
    [
        ("timestamp", (3, 3), None),
        ("output_int_register_0", (3, 4), (3, 3)),
        ("elbow_position", (3, 5), (3, 4)),
        ("output_int_register_24", (3, 9), (3, 8)),
        ("safety_status", (3, 10), (3, 9)),
        ("payload", (3, 11), (3, 10)),
        ("tcp_offset", (3, 12, 3), (3, 12, 2)),
        ("script_control_line", (3, 14), (3, 13)),
        ("payload_inertia", (3, 15), (3, 14)),
        ("ft_raw_wrench", (5, 9), (3, 15)),
        ("elbow_position", (5, 0), None),
        ("output_int_register_24", (5, 3), (5, 2)),
        ("safety_status", (5, 4), (5, 3)),
        ("payload", (5, 5, 1), (5, 5, 0)),
        ("tcp_offset", (5, 5, 1), (5, 5, 0)),
        ("script_control_line", (5, 9), (5, 8)),
        ("ft_raw_wrench", (5, 9), (5, 8)),
        ("payload_inertia", (5, 11), (5, 10)),
        ("joint_position_deviation_ratio", (5, 11), (5, 10)),
        ("encoder1_raw", (5, 14), (3, 15)),
        ("time_scale_source", (5, 19), (5, 15)),
        ("collision_detection_ratio", (5, 19), (5, 15)),
        ("actual_robot_energy_consumed", (5, 23), (5, 22, 2)),
        ("actual_current_as_torque", (5, 23), (5, 22, 9)),
        ("target_gravity", (5, 26), (5, 25, 1)),
        ("control_step", (5, 26), (5, 25, 1)),
    ],
)
def test_first_version_of_a_variable(name, first, before):
    assert name in output_fields(SoftwareVersion(*first))
    if before:
        assert name not in output_fields(SoftwareVersion(*before))


def test_inputs_of_the_newest_cb3():
    fields = input_fields(V3_15)
    assert len(fields) == len(INPUTS) == 14 + 64 + 48 + 48 + 1
    assert "input_int_register_24" not in input_fields(SoftwareVersion(3, 8))


def test_variables_that_the_realtime_interface_has_too_come_from_the_same_attribute():
    rtde = {field.name: field for field in OUTPUTS}
    shared = [column for column in COLUMNS if column.name in rtde]
    assert len(shared) > 30
    for column in shared:
        field = rtde[column.name]
        assert field.comes_from == column.attribute
        assert field.origin is column.origin
        assert field.type.count == column.count
        assert field.unit == column.unit
