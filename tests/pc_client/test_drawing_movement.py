"""A drawing becomes one movement: placed in the box without a mirror, marks as they were, lifts, as slow as the arm needs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawing_samples import one_part, two_parts_and_a_dot

from pc_client.errors import MovementError, PlanningError
from pc_client.kinematics.arms import UR3_BOX, Box
from pc_client.kinematics.model import robot_model
from pc_client.movements.movement import load_movement
from pc_client.planning.plan import plan_movement
from pc_client.studies.drawing.drawing import (
    ACCURACY,
    TAIL,
    factor_needed,
    join,
    least_gaps,
    make_drawing,
    spatial,
)
from pc_client.studies.drawing.placement import (
    PLANES,
    PlacementOptions,
    inverse,
    marks_of,
    place,
    sheet_frame,
)
from pc_client.studies.extraction.extract import Extraction
from pc_client.studies.extraction.pen import PenPart


def placed(extraction, options=None, shift=(0.0, 0.0, 0.0), *, flat=True):
    """The placement of what a recording shows, moved in its own frame."""
    drawn = np.vstack([spatial(part.p) for part in extraction.parts])
    return place(marks_of(extraction), drawn + np.array(shift), options or PlacementOptions(), flat=flat)


RIGHT, HALF = np.array([0.0, -1.0, 0.0]), math.sqrt(0.5)


@pytest.mark.parametrize("y_up", [False, True])
@pytest.mark.parametrize(
    ("plane", "down", "out"),
    [
        ("vertical", (0, 0, -1), (-1, 0, 0)),
        ("horizontal", (-1, 0, 0), (0, 0, 1)),
        ("inclined", (-HALF, 0, -HALF), (-HALF, 0, HALF)),
    ],
)
def test_sheets_are_right_handed_and_pens_come_out_towards_the_robot(plane, down, out, y_up):
    frame = sheet_frame(plane, y_up=y_up)
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    sense = -1.0 if y_up else 1.0
    np.testing.assert_allclose(frame * [1.0, sense, -sense], np.column_stack((RIGHT, down, out)), atol=1e-12)
    placement = placed(one_part(), PlacementOptions(plane=plane, y_up=y_up))
    np.testing.assert_allclose(placement.lift, 0.03 * np.array(out), atol=1e-12)


@pytest.mark.parametrize(
    ("plane", "rotation", "size"),
    [("vertical", 0.0, 0.05), ("horizontal", 0.7, None), ("inclined", None, None)],
)
def test_all_of_the_path_and_the_lifts_lie_in_the_box(plane, rotation, size):
    extraction = two_parts_and_a_dot()
    placement = placed(extraction, PlacementOptions(plane=plane, rotation=rotation, size=size))
    path = np.vstack([placement.similarity.points(mark.path(1e-3)) for mark in marks_of(extraction)])
    path = np.vstack((path, path + placement.lift))
    assert UR3_BOX.contains(path, 3e-5)  # tails below 1e-4 of the size are not looked at
    if size is not None:
        extent = np.ptp(np.vstack([part.p for part in extraction.parts]), axis=0).max()
        assert placement.similarity.scale * extent == pytest.approx(size)
    else:  # it touches the box on two sides
        assert np.any(np.isclose(np.ptp(path, axis=0), UR3_BOX.size, rtol=1e-3))


def test_y_points_down_as_pixels_are_counted_unless_one_is_below_0():
    below = (0.0, -90.0, 0.0)
    assert not placed(one_part()).y_up
    assert placed(one_part(), shift=below).y_up
    assert not placed(one_part(), PlacementOptions(y_up=False), below).y_up
    assert placed(one_part(), PlacementOptions(y_up=True)).y_up


def test_auto_rotation_is_never_smaller_than_any_other():
    best, *others = (
        placed(two_parts_and_a_dot(), PlacementOptions(rotation=rotation, size=None)).similarity.scale
        for rotation in (None, 0.0, math.radians(77.5), math.radians(120.0))
    )
    assert best >= max(others) - 1e-12


@pytest.mark.parametrize("y_up", [False, True])
def test_rotation_is_positive_to_the_left_as_it_is_looked_at(y_up):
    turned = placed(one_part(), PlacementOptions(y_up=y_up, rotation=math.radians(90.0))).similarity.R
    np.testing.assert_allclose(turned @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)  # right has become up


def test_recordings_in_space_keep_their_axes_and_lift_upwards():
    placement = placed(one_part(), flat=False)
    assert placement.plane == "space"
    np.testing.assert_allclose(placement.similarity.R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(placement.lift, [0.0, 0.0, 0.03])


@pytest.mark.parametrize("plane", PLANES)
def test_the_inverse_is_exact(plane):
    similarity = placed(one_part(), PlacementOptions(plane=plane, rotation=1.1, size=0.07)).similarity
    p = np.array([[0.0, 0.0, 0.0], [100.0, -3.0, 0.0], [7.0, 50.0, 20.0]])
    back = inverse(similarity)
    np.testing.assert_allclose(back.points(similarity.points(p)), p, atol=1e-9)
    np.testing.assert_allclose(back.vectors(similarity.vectors(p)), p, atol=1e-9)


@pytest.mark.parametrize(
    "wrong", [{"plane": "ceiling"}, {"lift": 0.0}, {"lift": 0.2}, {"size": -1.0}, {"rotation": math.inf}]
)
def test_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(MovementError):
        PlacementOptions(**wrong)


def test_drawings_without_a_size_are_refused():
    with pytest.raises(MovementError, match="one point"):
        place(marks_of(one_part()), np.ones((3, 3)), PlacementOptions())
    dot = PenPart(np.array([0.0]), np.array([[1.0, 2.0]]))
    with pytest.raises(MovementError, match="only dots"):
        marks_of(Extraction("dots.txt", still=(dot,)))


LIFT = np.array([0.0, 0.0, -12.0])


def joined_of(extraction, longer=1.0):
    marks = marks_of(extraction)
    size = np.ptp(np.vstack([part.p for part in extraction.parts]), axis=0).max()
    return marks, size, join(marks, longer * least_gaps(marks, size), LIFT)


def test_marks_come_in_order_of_time_and_dots_have_no_strokes():
    marks = marks_of(two_parts_and_a_dot())
    assert [mark.trajectory is None for mark in marks] == [False, False, True]
    np.testing.assert_array_equal(marks[2].first, [50.0, 95.0, 0.0])
    assert marks[2].begin == marks[2].end
    assert marks[2].lead(1e-9) == marks[2].lag(1e-9) == 0.0


@pytest.mark.parametrize(("mark", "tolerance"), [(0, 1.0), (1, 0.01)])
def test_tails_end_where_no_more_than_the_tolerance_is_left(mark, tolerance):
    one = marks_of(two_parts_and_a_dot())[mark]
    for before, tail in ((True, one.lead(tolerance)), (False, one.lag(tolerance))):
        assert one.length_outside(0.0, before=before) > tolerance  # it begins and ends in motion
        assert one.length_outside(tail, before=before) == pytest.approx(tolerance, rel=1e-3)


@pytest.mark.parametrize("longer", [1.0, 1.5])
def test_marks_are_unchanged_up_to_the_stated_tail(longer):
    extraction = two_parts_and_a_dot()
    marks, size, joined = joined_of(extraction, longer)
    # Its own way outside the gap is left of each of two lifts, and each neighbour's tail.
    chord = max(np.linalg.norm(stroke) for stroke in np.diff(joined.trajectory.target_points, axis=0))
    allowed = 2 * TAIL * size + 2 * TAIL * chord
    for index, part in enumerate(extraction.parts):
        p = joined.trajectory.evaluate(part.t + joined.shifts[index]).p
        assert np.abs(p - part.trajectory.evaluate(part.t).p).max() < allowed
        assert np.abs(p[:, 2]).max() < 2 * TAIL * chord
    dot = joined.trajectory.evaluate(joined.pen_down[2]).p
    np.testing.assert_allclose(dot, [marks[2].first] * 2, atol=allowed)


def test_the_movement_is_continuous_from_rest_to_rest_and_every_lift_is_as_high_as_asked():
    _, size, joined = joined_of(two_parts_and_a_dot())
    t = np.linspace(0.0, joined.trajectory.duration, 20001)
    motion = joined.trajectory.evaluate(t)
    steps = np.linalg.norm(np.diff(motion.p, axis=0), axis=1)
    speed = np.linalg.norm(motion.v, axis=1)
    np.testing.assert_allclose(steps / np.diff(t), speed[:-1], atol=0.02 * speed.max())
    assert max(speed[0], speed[-1]) < 0.01 * speed.max()
    np.testing.assert_allclose(motion.p[0], joined.trajectory.target_points[0], atol=1e-3 * size)
    np.testing.assert_allclose(motion.p[-1], joined.trajectory.target_points[-1], atol=1e-3 * size)
    for begin, end in joined.gaps:
        height = motion.p[(t >= begin) & (t <= end)] @ LIFT / np.linalg.norm(LIFT)
        assert height.max() == pytest.approx(12.0, rel=2 * TAIL)


def test_recorded_gaps_are_kept_where_they_are_long_enough_and_lengthened_where_tails_need_it():
    wide, tight = two_parts_and_a_dot(gap=0.9), two_parts_and_a_dot(gap=0.05)
    _, _, joined = joined_of(wide)
    assert np.diff(joined.gaps)[1] == pytest.approx(0.9, abs=1e-12)
    np.testing.assert_allclose(joined.shifts, joined.shifts[0], atol=1e-12)
    marks, size, joined = joined_of(tight)
    needed = max(marks[0].lag(TAIL * size), marks[1].lead(TAIL * size))
    assert np.diff(joined.gaps)[1] == pytest.approx(needed, abs=1e-12)
    late = needed - 0.05
    assert late > 0.05
    np.testing.assert_allclose(joined.shifts - joined.shifts[0], [0.0, late, late], atol=1e-9)


def test_one_part_has_a_lowering_and_a_lift_and_nothing_else():
    extraction = one_part()
    _, _, joined = joined_of(extraction)
    assert len(joined.trajectory.strokes) == len(extraction.parts[0].trajectory.strokes) + 2
    assert joined.gaps.shape == (2, 2)
    assert np.diff(joined.pen_down) == pytest.approx(np.array([[0.3]]))


ARM = robot_model("ur3")


@pytest.fixture(scope="module")
def large():
    return make_drawing(two_parts_and_a_dot(dot=False), "large", ARM, PlacementOptions(size=None))


def test_the_factor_is_the_least_that_planning_accepts(large):
    assert large.factor > 1.0
    plan_movement(large.movement, model=ARM)
    with pytest.raises(PlanningError):
        plan_movement(large.movement.stretched(1.0 - 3.0 * ACCURACY), model=ARM)
    _, need = factor_needed("need", large.joined, ARM)
    assert need.max() == pytest.approx(large.factor, rel=5e-3)


def test_slowing_down_is_the_theorys_own_scaling(large):
    slowed = large.movement.trajectory
    for fast, slow in zip(large.joined.trajectory.strokes, slowed.strokes, strict=True):
        a, b = fast.timing.lognormal, slow.timing.lognormal
        assert b.t0 == pytest.approx(large.factor * a.t0)
        assert b.mu == pytest.approx(a.mu + np.log(large.factor))
        assert (b.sigma, slow.arc_angle, slow.tilt) == (pytest.approx(a.sigma), fast.arc_angle, fast.tilt)
    np.testing.assert_array_equal(slowed.target_points, large.joined.trajectory.target_points)


def test_a_small_drawing_is_as_fast_as_the_hand_times_what_is_asked():
    options = PlacementOptions(size=0.01, lift=0.01)
    drawing = make_drawing(one_part(), "small", ARM, options, slower=1.5)
    assert drawing.factor == 1.5
    assert drawing.movement.duration == pytest.approx(1.5 * drawing.joined.trajectory.duration)
    with pytest.raises(MovementError, match=r"0\.9 times slower"):
        make_drawing(one_part(), "small", ARM, options, slower=0.9)


def test_a_pen_up_move_that_is_too_fast_gets_time_and_the_marks_keep_theirs():
    extraction = two_parts_and_a_dot(gap=0.05, dot=False)
    drawing = make_drawing(extraction, "x", ARM, PlacementOptions(size=0.06, lift=0.06))
    marks = [mark.transformed(drawing.placement.similarity) for mark in drawing.marks]
    gaps = least_gaps(marks, 0.06)
    recorded, slow = (
        factor_needed("x", join(marks, each, drawing.placement.lift), ARM)[1].max()
        for each in (gaps, gaps + 1.5)
    )
    own = max(1.0, slow)
    assert recorded > 1.5 * own  # as recorded, the pen-up moves would slow the whole drawing down
    assert drawing.factor < 1.02 * own
    given = np.diff(drawing.joined.gaps)[:, 0]
    assert np.all(given >= gaps - 1e-12)
    assert given[1] > gaps[1]
    assert drawing.delays[1] > 0.1


def test_out_of_reach_is_planning_s_refusal_in_one_line():
    far = Box((0.60, -0.2, 0.15), (0.75, 0.2, 0.35))
    with pytest.raises(PlanningError) as caught:
        make_drawing(one_part(), "far", ARM, PlacementOptions(box=far))
    assert str(caught.value).startswith("far: ")
    assert "\n" not in str(caught.value)


def test_the_movement_is_one_file_that_runs_again(large, tmp_path):
    path = tmp_path / "large.toml"
    large.movement.save(path)
    loaded = load_movement(path)
    t = np.linspace(0.0, large.movement.duration, 300)
    np.testing.assert_allclose(loaded.sample(t).p, large.movement.sample(t).p, atol=1e-9)
    assert loaded.provenance["slower_than_the_hand"] == pytest.approx(large.factor)
