"""Marks and lifts in one movement: continuous, marks unchanged up to the stated tail, lifts as high as asked."""

from __future__ import annotations

import numpy as np
import pytest
from drawing_samples import one_part, two_parts_and_a_dot

from pc_client.errors import MovementError
from pc_client.studies.drawing.joining import TAIL, join, least_gaps
from pc_client.studies.drawing.placement import marks_of
from pc_client.studies.extraction.extract import Extraction
from pc_client.studies.extraction.pen import PenPart

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


def test_a_drawing_of_dots_alone_is_refused():
    dot = PenPart(np.array([0.0]), np.array([[1.0, 2.0]]))
    with pytest.raises(MovementError, match="only dots"):
        marks_of(Extraction("dots.txt", (), None, None, 0, 0, None, (), (dot,)))


@pytest.mark.parametrize("mark", [0, 1])
@pytest.mark.parametrize("tolerance", [1.0, 0.1, 0.01])
def test_tails_end_where_no_more_than_the_tolerance_is_left(mark, tolerance):
    one = marks_of(two_parts_and_a_dot())[mark]
    assert one.length_before(0.0) > tolerance  # it begins in motion, so there is a tail to speak of
    assert one.length_after(0.0) > tolerance
    assert one.length_before(one.lead(tolerance)) == pytest.approx(tolerance, rel=1e-3)
    assert one.length_after(one.lag(tolerance)) == pytest.approx(tolerance, rel=1e-3)


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


def test_the_movement_is_continuous_from_rest_to_rest():
    _, size, joined = joined_of(two_parts_and_a_dot())
    t = np.linspace(0.0, joined.trajectory.duration, 40001)
    motion = joined.trajectory.evaluate(t)
    steps = np.linalg.norm(np.diff(motion.p, axis=0), axis=1)
    speed = np.linalg.norm(motion.v, axis=1)
    np.testing.assert_allclose(steps / np.diff(t), speed[:-1], atol=0.02 * speed.max())
    assert max(speed[0], speed[-1]) < 0.01 * speed.max()
    np.testing.assert_allclose(motion.p[0], joined.trajectory.target_points[0], atol=1e-3 * size)
    np.testing.assert_allclose(motion.p[-1], joined.trajectory.target_points[-1], atol=1e-3 * size)


def test_every_lift_is_as_high_as_asked_and_no_higher():
    _, _, joined = joined_of(two_parts_and_a_dot())
    for begin, end in joined.gap_intervals():
        height = joined.trajectory.evaluate(np.linspace(begin, end, 4001)).p @ LIFT / np.linalg.norm(LIFT)
        assert height.max() == pytest.approx(12.0, rel=2 * TAIL)


def test_recorded_gaps_are_kept_where_they_are_long_enough_and_lengthened_where_tails_need_it():
    wide, tight = two_parts_and_a_dot(gap=0.9), two_parts_and_a_dot(gap=0.05)
    _, _, joined = joined_of(wide)
    assert joined.gaps[1] == pytest.approx(0.9, abs=1e-12)
    np.testing.assert_allclose(joined.shifts, joined.shifts[0], atol=1e-12)
    marks, size, joined = joined_of(tight)
    needed = max(marks[0].lag(TAIL * size), marks[1].lead(TAIL * size))
    assert joined.gaps[1] == needed > 0.1
    late = joined.gaps[1] - 0.05
    assert late > 0.05
    np.testing.assert_allclose(joined.shifts - joined.shifts[0], [0.0, late, late], atol=1e-9)


def test_one_part_has_a_lowering_and_a_lift_and_nothing_else():
    extraction = one_part()
    _, _, joined = joined_of(extraction)
    assert len(joined.trajectory.strokes) == len(extraction.parts[0].trajectory.strokes) + 2
    assert joined.gaps.shape == (2,)
    assert joined.pen_down.shape == (1, 2)
    assert joined.pen_down[0, 1] - joined.pen_down[0, 0] == pytest.approx(0.3)
