"""The robot-like trajectory: exact lengths and times, smoothness, paths by arc length."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from pc_client.errors import MovementError
from pc_client.movements.trajectory import Similarity
from pc_client.movements.uniform import CornerPath, SmoothedSquareWave, Uniform

POINTS = np.array([[0.30, 0.0, 0.2], [0.40, 0.1, 0.3], [0.30, 0.15, 0.2], [0.35, -0.05, 0.25]])
DURATIONS = np.array([1.7, 1.3, 2.2])
TRAJECTORIES = [
    Uniform(POINTS, DURATIONS, (0.2,)),
    Uniform(POINTS, DURATIONS, (0.2, 0.1)),
    Uniform(POINTS, DURATIONS, (0.1, 0.2), "blend", 0.03),
    Uniform(POINTS, DURATIONS, (0.25,), "blend", 0.02),
]


@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_length_and_time_are_kept(trajectory: Uniform) -> None:
    assert trajectory.duration == math.fsum(DURATIONS)
    along = trajectory.wave.evaluate([0.0, trajectory.duration, trajectory.duration + 100.0])
    np.testing.assert_allclose(along.s, [0.0, trajectory.path.length, trajectory.path.length], atol=1e-12)
    np.testing.assert_allclose(along.v, 0.0, atol=1e-12)
    np.testing.assert_allclose(trajectory.evaluate(trajectory.duration).p[0], POINTS[-1], atol=1e-12)


@pytest.mark.parametrize("trajectory", TRAJECTORIES[:2])
def test_stops_are_at_the_targets_at_the_twins_times(trajectory: Uniform) -> None:
    edges = np.concatenate(([0.0], np.cumsum(DURATIONS)))
    at = trajectory.evaluate(edges)
    np.testing.assert_allclose(at.p, POINTS, atol=1e-12)
    np.testing.assert_allclose(at.v, 0.0, atol=1e-12)
    assert trajectory.path.length == pytest.approx(
        np.linalg.norm(np.diff(POINTS, axis=0), axis=1).sum(), abs=1e-15
    )


@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_length_speed_and_acceleration_belong_together(trajectory: Uniform) -> None:
    t = np.linspace(0.0, trajectory.duration, 52_001)
    along = trajectory.wave.evaluate(t)
    assert along.v.min() > -1e-12
    np.testing.assert_allclose(cumulative_simpson(along.v, x=t, initial=0.0), along.s, atol=1e-8)
    np.testing.assert_allclose(cumulative_simpson(along.a, x=t, initial=0.0), along.v, atol=2e-4)


@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_velocity_is_the_derivative_of_position(trajectory: Uniform) -> None:
    t, h = np.linspace(0.0011, trajectory.duration - 0.0011, 2000), 1e-6
    before, at, after = (trajectory.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.v, atol=2e-6)
    smooth = np.linalg.norm(after.a - before.a, axis=1) < 1e-3  # away from the corners of single ramps
    assert smooth.mean() > 0.98
    np.testing.assert_allclose(((after.v - before.v) / (2 * h))[smooth], at.a[smooth], atol=2e-4)


def test_levels_and_ramps_of_a_trapezoid() -> None:
    wave = SmoothedSquareWave(np.array([[1.0, 3.0]]), np.array([0.5]), (0.4,))
    along = wave.evaluate([0.7, 0.8, 0.9, 1.0, 1.2, 2.0, 2.8, 3.0, 3.2, 4.0])
    np.testing.assert_allclose(along.v, [0.0, 0.0, 0.125, 0.25, 0.5, 0.5, 0.5, 0.25, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(along.s[-1], 1.0, atol=1e-15)
    assert np.abs(along.a).max() == pytest.approx(0.5 / 0.4)


def test_two_boxcars_bound_acceleration_and_jerk() -> None:
    wave = SmoothedSquareWave(np.array([[1.0, 3.0]]), np.array([0.5]), (0.4, 0.1))
    t = np.linspace(0.0, 4.0, 400_001)
    along = wave.evaluate(t)
    assert np.abs(along.a).max() == pytest.approx(0.5 / 0.4, rel=1e-9)
    assert np.abs(np.diff(along.a)).max() / (t[1] - t[0]) == pytest.approx(0.5 / (0.4 * 0.1), rel=1e-3)
    # the order of the two boxcars does not matter
    other = SmoothedSquareWave(np.array([[1.0, 3.0]]), np.array([0.5]), (0.1, 0.4)).evaluate(t)
    np.testing.assert_allclose(other.s, along.s, atol=1e-14)


def test_smoothing_is_the_convolution_with_boxcars() -> None:
    """By brute force on a grid."""
    trajectory = TRAJECTORIES[2]
    dt = 1e-4
    t = np.arange(-1.0, trajectory.duration + 1.0, dt)
    square = np.zeros_like(t)
    for (begin, end), level in zip(trajectory.wave.windows, trajectory.wave.levels, strict=True):
        square[(t >= begin) & (t < end)] = level
    for width in trajectory.ramps:
        n = round(width / dt)
        square = np.convolve(square, np.ones(n) / n, mode="same")
    np.testing.assert_allclose(trajectory.wave.evaluate(t).v, square, atol=2e-4)


point = st.tuples(*(st.floats(-0.5, 0.5) for _ in range(3)))


@settings(max_examples=60)
@given(middle=point, end=point, blend=st.floats(0.0, 0.3))
def test_paths_have_unit_tangents_and_join(
    middle: tuple[float, float, float], end: tuple[float, float, float], blend: float
) -> None:
    points = np.array([[1.0, 1.0, 1.0], middle, np.subtract(end, 2.0)])
    path = CornerPath(points, blend)
    s = np.linspace(0.0, path.length, 400)
    at = path.at(s)
    np.testing.assert_allclose(np.linalg.norm(at.tangent, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(at.p[[0, -1]], points[[0, -1]], atol=1e-12)
    steps = np.linalg.norm(np.diff(at.p, axis=0), axis=1)
    assert steps.max() <= s[1] * (1.0 + 1e-9)
    straight = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert np.linalg.norm(points[2] - points[0]) - 1e-12 <= path.length <= straight + 1e-12


def test_blends_by_differentiation() -> None:
    path = CornerPath(POINTS, 0.03)
    h = 1e-6
    s = np.linspace(2 * h, path.length - 2 * h, 3001)
    before, at, after = (path.at(s + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.tangent, atol=1e-8)
    np.testing.assert_allclose((after.tangent - before.tangent) / (2 * h), at.curvature, atol=0.02)
    # no jump of curvature: the finest steps of the curvature vector are proportional to the step of s
    fine = np.linspace(0.0, path.length, 200_001)
    curvature = path.at(fine).curvature
    assert np.abs(np.diff(curvature, axis=0)).max() < 0.05 * np.abs(curvature).max()
    assert np.abs(curvature).max() > 10.0


def test_blend_passes_its_middle_at_the_target() -> None:
    path = CornerPath(POINTS, 0.03)
    for s, target, before, after in zip(
        path.targets_at[1:-1], POINTS[1:-1], POINTS, POINTS[2:], strict=False
    ):
        inwards = (before - target) / np.linalg.norm(before - target) + (after - target) / np.linalg.norm(
            after - target
        )
        miss = path.at(s).p[0] - target
        assert 1e-3 < np.linalg.norm(miss) < 0.03
        np.testing.assert_allclose(np.cross(miss, inwards), 0.0, atol=1e-12)


def test_sharp_path_passes_exactly_through_its_targets() -> None:
    path = CornerPath(POINTS)
    np.testing.assert_allclose(path.at(path.targets_at).p, POINTS, atol=1e-15)


def test_straight_corner_needs_no_blend() -> None:
    path = CornerPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.3, 0.0, 0.0]]), 0.02)
    assert path.length == pytest.approx(0.3, abs=1e-15)
    np.testing.assert_allclose(path.targets_at, [0.0, 0.1, 0.3], atol=1e-15)


@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_similarities_and_time_stretch_commute_with_evaluation(trajectory: Uniform) -> None:
    similarity = Similarity(
        0.4, Rotation.from_euler("xyz", [0.3, -1.0, 2.0]).as_matrix(), np.array([1.0, 2.0, 3.0])
    )
    t = np.linspace(0.0, trajectory.duration, 501)
    at, moved = trajectory.evaluate(t), trajectory.transformed(similarity).stretched(1.7).evaluate(1.7 * t)
    np.testing.assert_allclose(moved.p, similarity.points(at.p), atol=1e-12)
    np.testing.assert_allclose(moved.v, similarity.vectors(at.v) / 1.7, atol=1e-10)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Uniform(POINTS, DURATIONS[:2], (0.2,)),
        lambda: Uniform(POINTS, DURATIONS, ()),
        lambda: Uniform(POINTS, DURATIONS, (0.2, 0.0)),
        lambda: Uniform(POINTS, DURATIONS, (1.0, 0.4)),
        lambda: Uniform(POINTS, DURATIONS, (0.2,), "stop", 0.01),
        lambda: Uniform(POINTS, DURATIONS, (0.2,), "blend"),
        lambda: Uniform(POINTS, DURATIONS, (0.2,), "round", 0.01),
        lambda: Uniform(POINTS, np.array([1.7, math.nan, 2.2]), (0.2,)),
        lambda: CornerPath(POINTS, -0.1),
        lambda: CornerPath(POINTS[:1]),
        lambda: CornerPath(POINTS[[0, 0, 1]]),
        lambda: CornerPath(POINTS[[0, 1, 0]], 0.01),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
