"""As slow as the arm needs it, and no slower: the factor is the least, and only pen-up moves become longer for pen-up moves."""

from __future__ import annotations

import numpy as np
import pytest
from drawing_samples import one_part, two_parts_and_a_dot

from pc_client.errors import PlanningError
from pc_client.kinematics.robot_model import robot_model
from pc_client.movements.files import load_movement, save_movement
from pc_client.movements.geometry import Box
from pc_client.planning.plan import plan_movement
from pc_client.studies.drawing.drawing import make_drawing
from pc_client.studies.drawing.joining import ACCURACY, factor_needed, join, least_factor, least_gaps, paced
from pc_client.studies.drawing.placement import PlacementOptions

ARM = robot_model("ur3")


@pytest.fixture(scope="module")
def large():
    return make_drawing(two_parts_and_a_dot(), "large", ARM, PlacementOptions(size=None))


def test_the_factor_is_the_least_that_planning_accepts(large):
    assert large.factor > 1.0
    plan_movement(large.movement, model=ARM)
    with pytest.raises(PlanningError):
        plan_movement(large.movement.stretched(1.0 - 3.0 * ACCURACY), model=ARM)


def test_slowing_down_is_the_theorys_own_scaling(large):
    for fast, slow in zip(large.joined.trajectory.strokes, large.trajectory.strokes, strict=True):
        a, b = fast.timing.lognormal, slow.timing.lognormal
        assert b.t0 == pytest.approx(large.factor * a.t0)
        assert b.mu == pytest.approx(a.mu + np.log(large.factor))
        assert (b.sigma, slow.arc_angle, slow.tilt) == (pytest.approx(a.sigma), fast.arc_angle, fast.tilt)
    np.testing.assert_array_equal(large.trajectory.target_points, large.joined.trajectory.target_points)


def test_a_small_drawing_is_as_fast_as_the_hand():
    drawing = make_drawing(one_part(), "small", ARM, PlacementOptions(size=0.01, lift=0.01))
    assert drawing.factor == 1.0
    assert drawing.movement.duration == pytest.approx(drawing.joined.trajectory.duration)


def test_the_need_of_a_moment_is_what_planning_finds(large):
    _, need = factor_needed("need", large.joined, ARM)
    assert need.max() == pytest.approx(large.factor, rel=5e-3)


def test_a_pen_up_move_that_is_too_fast_gets_time_and_the_marks_keep_theirs():
    drawing = make_drawing(two_parts_and_a_dot(gap=0.05), "x", ARM, PlacementOptions(size=0.08, lift=0.08))
    marks = [mark.transformed(drawing.placement.similarity) for mark in drawing.marks]
    gaps = least_gaps(marks, 0.08)
    recorded = factor_needed("x", join(marks, gaps, drawing.placement.lift), ARM)[1].max()
    own = max(1.0, factor_needed("x", join(marks, gaps + 3.0, drawing.placement.lift), ARM)[1].max())
    assert recorded > 1.5 * own  # as recorded, the pen-up moves would slow the whole drawing down
    assert drawing.factor < 1.02 * own
    assert np.all(drawing.joined.gaps >= gaps)
    assert drawing.joined.gaps[1] > gaps[1]
    assert drawing.delays[1] > 0.1
    again = paced("x", marks, gaps, drawing.placement.lift, ARM)
    np.testing.assert_array_equal(again.gaps, drawing.joined.gaps)


def test_out_of_reach_is_planning_s_refusal_in_one_line():
    far = Box((0.60, -0.2, 0.15), (0.75, 0.2, 0.35))
    with pytest.raises(PlanningError) as caught:
        make_drawing(one_part(), "far", ARM, PlacementOptions(box=far))
    assert str(caught.value).startswith("far: ")
    assert "\n" not in str(caught.value)


def test_what_is_refused_at_any_speed_is_refused(large):
    far = large.movement.transformed(
        type(large.placement.similarity)(1.0, np.eye(3), np.array([0.4, 0.0, 0.0]))
    )
    with pytest.raises(PlanningError):
        least_factor(far.stretched, 1.0, ARM)


def test_the_movement_is_one_file_that_runs_again(large, tmp_path):
    path = tmp_path / "large.toml"
    save_movement(large.movement, path)
    loaded = load_movement(path)
    t = np.linspace(0.0, large.movement.duration, 300)
    np.testing.assert_allclose(loaded.sample(t).p, large.movement.sample(t).p, atol=1e-9)
    assert loaded.provenance["slower_than_the_hand"] == pytest.approx(large.factor)
    assert loaded.stroke_durations.sum() == pytest.approx(loaded.duration)
