"""Where a drawing is done: right-handed sheets, nothing mirrored, inside the box, and an exact way back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawing_samples import one_part, two_parts_and_a_dot
from hypothesis import given
from hypothesis import strategies as st

from pc_client.errors import MovementError
from pc_client.kinematics.arms import UR3_BOX
from pc_client.studies.drawing.drawing import spatial
from pc_client.studies.drawing.placement import (
    PLANES,
    PlacementOptions,
    inverse,
    marks_of,
    place,
    sheet_frame,
)


def drawn(extraction):
    return np.vstack([spatial(part.p) for part in extraction.parts])


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("y_up", [False, True])
def test_sheets_are_right_handed_frames(plane, y_up):
    frame = sheet_frame(plane, y_up=y_up)
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    np.testing.assert_allclose(frame[:, 0], [0.0, -1.0, 0.0])  # right, for one who looks as the robot does
    into = frame[:, 2] * (-1.0 if y_up else 1.0)
    np.testing.assert_allclose(into, PLANES[plane], atol=1e-12)


@pytest.mark.parametrize(
    ("plane", "down", "out"),
    [
        ("vertical", (0, 0, -1), (-1, 0, 0)),
        ("horizontal", (-1, 0, 0), (0, 0, 1)),
        ("inclined", (-math.sqrt(0.5), 0, -math.sqrt(0.5)), (-math.sqrt(0.5), 0, math.sqrt(0.5))),
    ],
)
def test_screens_point_down_and_pens_come_out_towards_the_robot(plane, down, out):
    np.testing.assert_allclose(sheet_frame(plane, y_up=False)[:, 1], down, atol=1e-12)
    extraction = one_part()
    placement = place(marks_of(extraction), drawn(extraction), PlacementOptions(plane=plane))
    np.testing.assert_allclose(placement.lift, 0.03 * np.array(out), atol=1e-12)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("rotation", [0.0, 0.7, None])
@pytest.mark.parametrize("size", [0.05, None])
def test_all_of_the_path_and_the_lifts_lie_in_the_box(plane, rotation, size):
    extraction = two_parts_and_a_dot()
    marks = marks_of(extraction)
    options = PlacementOptions(plane=plane, rotation=rotation, size=size)
    placement = place(marks, drawn(extraction), options)
    paths = [placement.similarity.points(mark.path(1e-3)) for mark in marks]
    for path in paths:
        assert UR3_BOX.contains(path, 3e-5)  # tails below 1e-4 of the size are not looked at
        assert UR3_BOX.contains(path + placement.lift, 3e-5)
    if size is not None:
        extent = np.ptp(drawn(extraction), axis=0).max()
        assert placement.similarity.scale * extent == pytest.approx(size)
    else:  # it touches the box on two sides
        low = np.min([np.minimum(path, path + placement.lift).min(axis=0) for path in paths], axis=0)
        high = np.max([np.maximum(path, path + placement.lift).max(axis=0) for path in paths], axis=0)
        assert np.any(np.isclose(high - low, UR3_BOX.size, rtol=1e-3))


def test_y_points_down_as_pixels_are_counted_unless_one_is_below_0():
    extraction = one_part()
    marks, ink = marks_of(extraction), drawn(extraction)
    assert not place(marks, ink, PlacementOptions()).y_up
    assert place(marks, ink - [0.0, 90.0, 0.0], PlacementOptions()).y_up
    assert not place(marks, ink - [0.0, 90.0, 0.0], PlacementOptions(y_up=False)).y_up
    assert place(marks, ink, PlacementOptions(y_up=True)).y_up


def test_auto_rotation_is_never_smaller_than_any_other():
    extraction = two_parts_and_a_dot()
    marks, ink = marks_of(extraction), drawn(extraction)
    best = place(marks, ink, PlacementOptions(rotation=None, size=None)).similarity.scale
    others = [
        place(marks, ink, PlacementOptions(rotation=math.radians(angle), size=None)).similarity.scale
        for angle in (0.0, 30.0, 77.5, 120.0)
    ]
    assert best >= max(others) - 1e-12


@pytest.mark.parametrize("y_up", [False, True])
def test_rotation_is_positive_to_the_left_as_it_is_looked_at(y_up):
    extraction = one_part()
    marks, ink = marks_of(extraction), drawn(extraction)
    straight = place(marks, ink, PlacementOptions(y_up=y_up)).similarity.R
    turned = place(marks, ink, PlacementOptions(y_up=y_up, rotation=math.radians(90.0))).similarity.R
    right = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(straight @ right, [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned @ right, [0.0, 0.0, 1.0], atol=1e-12)  # right has become up


def test_recordings_in_space_keep_their_axes_and_lift_upwards():
    extraction = one_part()
    placement = place(marks_of(extraction), drawn(extraction), PlacementOptions(), flat=False)
    assert placement.plane == "space"
    np.testing.assert_allclose(placement.similarity.R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(placement.lift, [0.0, 0.0, 0.03])


@given(
    angle=st.floats(-3.0, 3.0),
    size=st.floats(0.01, 0.12),
    plane=st.sampled_from(sorted(PLANES)),
    y_up=st.booleans(),
)
def test_the_inverse_is_exact(angle, size, plane, y_up):
    extraction = one_part()
    options = PlacementOptions(plane=plane, y_up=y_up, rotation=angle, size=size)
    similarity = place(marks_of(extraction), drawn(extraction), options).similarity
    p = np.array([[0.0, 0.0, 0.0], [100.0, -3.0, 0.0], [7.0, 50.0, 20.0]])
    back = inverse(similarity)
    np.testing.assert_allclose(back.points(similarity.points(p)), p, atol=1e-9)
    np.testing.assert_allclose(back.vectors(similarity.vectors(p)), p, atol=1e-9)


@pytest.mark.parametrize(
    "wrong", [{"plane": "ceiling"}, {"lift": 0.0}, {"lift": 0.2}, {"size": -1.0}, {"rotation": math.inf}]
)
def test_what_makes_no_sense_is_refused(wrong):
    with pytest.raises(MovementError):
        PlacementOptions(**wrong)


def test_a_point_has_no_size():
    with pytest.raises(MovementError, match="one point"):
        place(marks_of(one_part()), np.ones((3, 3)), PlacementOptions())
