"""What the tables say of where values come from is true: what is measured or modelled changes, constants do not."""

import pytest
from wire_story import ESeriesStory, Story

from protocol.primary.layout import SUB_PACKAGES
from protocol.primary.packages import decode_package, state_types
from protocol.realtime.layout import COLUMNS, layout_for_version
from protocol.rtde.fields import OUTPUTS, output_fields
from protocol.rtde.recipe import Recipe, snapshot_encoder
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ValueOrigin, wire_fields
from ur_emulator.models.generations import CB3
from ur_emulator.ports.primary.robot_state import StateEncoder

V3_15 = SoftwareVersion(3, 15, 8)
ALIVE = (ValueOrigin.MEASURED, ValueOrigin.MODELLED)
# Vectors are looked at element by element, but for these: the last of them is a radius; and a motor that does
# little stays as warm as it is.
ANY_ELEMENT = {"target_base_acceleration", "elbow_sphere", "joint_temperatures", "temperature_motor"}
# Modelled on an e-Series only; the stories run with the control cycle of CB3.
ZERO_ON_CB3 = {"actual_execution_time"}


@pytest.fixture(scope="module")
def story():
    return Story()


@pytest.fixture(scope="module")
def e_series_story():
    return ESeriesStory()


def check(name, origin, values):
    """Check one mark against all values that were sent."""
    columns = list(zip(*(value if isinstance(value, tuple) else (value,) for value in values), strict=True))
    changes = [len(set(column)) > 1 for column in columns]
    if name in ZERO_ON_CB3:
        assert not any(map(any, columns)), name
    elif origin in ALIVE:
        assert any(changes) if name in ANY_ELEMENT else all(changes), f"{name} is {origin.value}: {changes}"
    else:
        assert not any(changes), f"{name} is {origin.value}, but changes: {changes}"
        if origin is ValueOrigin.INTERNAL_ZERO:
            assert not any(map(any, columns)), name


def check_outputs(story, version):
    fields = tuple(output_fields(version).values())
    recipe = Recipe((f.name for f in fields), (f.type for f in fields))
    encode = snapshot_encoder(fields, b"")
    packages = [recipe.decode(encode(snapshot)) for snapshot, _ in story.moments]
    for field, *values in zip(fields, *packages, strict=True):
        check(field.name, field.origin, values)


def test_every_output_of_rtde_is_what_the_table_says(story):
    check_outputs(story, V3_15)


@pytest.mark.parametrize("version", [SoftwareVersion(5, 12), SoftwareVersion(5, 26)])
def test_every_output_of_an_e_series_is_what_the_table_says(e_series_story, version):
    check_outputs(e_series_story, version)


def test_every_column_of_a_frame_is_what_the_table_says(story):
    layout = layout_for_version(SoftwareVersion(5, 12))  # the longest frame
    encode = layout.encoder()
    frames = [layout.decode(encode(snapshot)) for snapshot, _ in story.moments]
    for column in layout.columns:
        values = [getattr(frame, column.attribute) for frame in frames]
        check(column.name, column.origin, [tuple(v) if column.count > 1 else v for v in values])


def check_states(story, version):
    encoder = StateEncoder(CB3.software(version), story.controller.state.arm, story.controller.state.safety)
    states = [decode_package(encoder.encode_first(s), version).sub_packages for s, _ in story.moments]
    for record, *sent in zip(state_types(version, first=True), *states, strict=True):
        for field in wire_fields(record):
            if field.since.covers(version) and not field.only_if:
                check(f"{field.name}", field.origin, [getattr(one, field.name) for one in sent])


@pytest.mark.parametrize("version", [V3_15, SoftwareVersion(3, 2)])
def test_every_field_of_a_state_is_what_the_table_says(story, version):
    check_states(story, version)


@pytest.mark.parametrize("version", [SoftwareVersion(5, 12), SoftwareVersion(5, 26)])
def test_every_field_of_an_e_series_state_is_what_the_table_says(e_series_story, version):
    check_states(e_series_story, version)


def test_every_field_of_the_tables_has_a_mark():
    assert all(field.origin for record in SUB_PACKAGES for field in wire_fields(record))
    assert all(column.origin for column in COLUMNS)
    assert all(field.origin for field in OUTPUTS)


def test_what_is_constant_is_little():
    constants = {f.name for f in output_fields(V3_15).values() if f.origin is ValueOrigin.CONSTANT}
    assert constants == {
        "actual_main_voltage", "euromap67_24V_voltage", "euromap67_24V_current"
    }  # fmt: skip
