"""Fitting movements into the workspace changes neither the shape of the path nor of the speed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pc_client.errors import MovementError
from pc_client.kinematics.arms import UR3_BOX, Box
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.recipes import fit_movement
from pc_client.movements.samples import SampledTrajectory
from pc_client.movements.trajectory import Similarity

T = np.linspace(0.0, 1.0, 1501)


def drawing() -> Movement:
    """A flat figure such as a pen makes, 40 units wide."""
    t = np.linspace(0.0, 2.0, 60)
    points = np.column_stack((20.0 * np.cos(3.0 * t), 8.0 * np.sin(5.0 * t), np.zeros_like(t)))
    return Movement("drawing", SampledTrajectory(t, points), np.array([2.0]))


@pytest.mark.parametrize("rotate", ["none", "yaw", "any"])
@pytest.mark.parametrize("name", ["drawing", "lognorm_5_1", "uniform_4_2"])
def test_fills_the_box_with_the_same_speed_shape(name: str, rotate: str) -> None:
    movement = drawing() if name == "drawing" else load_movement(name)
    fit = fit_movement(movement, rotate=rotate)
    t = T * movement.duration
    p = fit.movement.sample(t).p
    assert UR3_BOX.contains(p, 1e-5)
    assert (np.ptp(p, axis=0) / UR3_BOX.size).max() == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(0.5 * (p.min(axis=0) + p.max(axis=0)), UR3_BOX.centre, atol=1e-4)
    assert fit.stretch == 1.0
    assert fit.movement.duration == movement.duration
    np.testing.assert_allclose(
        fit.movement.speed(t), fit.similarity.scale * movement.speed(t), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(p, fit.similarity.points(movement.sample(t).p), atol=1e-12)


def test_turning_makes_more_room() -> None:
    scales = {
        rotate: fit_movement(drawing(), rotate=rotate).similarity.scale for rotate in ("none", "yaw", "any")
    }
    assert scales["none"] < scales["yaw"]
    assert scales["none"] < scales["any"]


def test_small_movements_need_not_grow() -> None:
    movement = load_movement("lognorm_4_1").transformed(Similarity(0.1, np.eye(3), np.zeros(3)))
    assert fit_movement(movement, max_scale=1.0).similarity.scale == 1.0


def test_slows_down_only_when_asked() -> None:
    movement = drawing()
    with pytest.raises(MovementError, match="allow it to be slowed down"):
        fit_movement(movement, max_speed=0.25)
    fit = fit_movement(movement, max_speed=0.25, may_slow_down=True)
    t = T * fit.movement.duration
    assert fit.stretch > 1.0
    assert fit.movement.duration == pytest.approx(fit.stretch * movement.duration)
    assert fit.movement.speed(t).max() == pytest.approx(0.25, rel=1e-3)
    np.testing.assert_allclose(fit.movement.stroke_durations, fit.stretch * movement.stroke_durations)
    assert fit_movement(movement, max_speed=100.0, may_slow_down=True).stretch == 1.0


@settings(max_examples=15)
@given(
    angle=st.floats(-math.pi, math.pi),
    scale=st.floats(1e-3, 1e3),
    shift=st.tuples(*(st.floats(-10.0, 10.0) for _ in range(3))),
)
def test_where_a_movement_came_from_does_not_matter(
    angle: float, scale: float, shift: tuple[float, float, float]
) -> None:
    movement = load_movement("lognorm_5_3")
    elsewhere = Similarity(scale, Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix(), np.array(shift))
    t = T * movement.duration
    fitted = fit_movement(movement, rotate="yaw").movement
    again = fit_movement(movement.transformed(elsewhere), rotate="yaw").movement
    # the angle is searched in half degrees, so the size is the same within one per cent
    ratio = again.speed(t).max() / fitted.speed(t).max()
    assert ratio == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(again.speed(t), ratio * fitted.speed(t), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "make",
    [
        lambda: fit_movement(drawing(), rotate="upside down"),
        lambda: fit_movement(drawing(), max_scale=0.0),
        lambda: fit_movement(drawing(), max_speed=-1.0),
        lambda: fit_movement(
            Movement("dot", SampledTrajectory(np.arange(4.0), np.ones((4, 3))), np.array([3.0]))
        ),
        lambda: fit_movement(drawing(), Box((0.0, 0.0, 0.0), (0.0, 1.0, 1.0))),
        lambda: drawing().stretched(0.0),
        lambda: Movement("", drawing().trajectory, np.array([2.0])),
        lambda: Movement("x", drawing().trajectory, np.array([1.0])),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
