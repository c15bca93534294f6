"""Minimum jerk: the polynomial, the movement through points, and that no other movement has less jerk."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

from pc_client.errors import MovementError
from pc_client.movements.minimum_jerk import MinimumJerk, stroke_shape
from pc_client.movements.trajectory import Similarity

POINTS = np.array([[0.30, 0.0, 0.2], [0.40, 0.1, 0.3], [0.30, 0.15, 0.2], [0.35, -0.05, 0.25]])
DURATIONS = np.array([1.7, 1.3, 2.2])
STOP, VIA = (MinimumJerk(POINTS, DURATIONS, passing) for passing in ("stop", "via"))


def test_unit_stroke_is_the_published_polynomial() -> None:
    u = np.linspace(0.0, 1.0, 101)
    shape = stroke_shape(u)
    np.testing.assert_allclose(shape.done, 10 * u**3 - 15 * u**4 + 6 * u**5, atol=1e-15)
    assert shape.rate.max() == 1.875
    assert u[shape.rate.argmax()] == 0.5
    np.testing.assert_allclose(shape.rate, shape.rate[::-1], atol=1e-14)
    ends = stroke_shape([-1.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(ends.done, [0.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal([*ends.rate, *ends.rate_change], 0.0)


@pytest.mark.parametrize("trajectory", [STOP, VIA])
def test_targets_are_reached_exactly_at_their_times(trajectory: MinimumJerk) -> None:
    edges = np.concatenate(([0.0], np.cumsum(DURATIONS)))
    at = trajectory.evaluate(edges)
    np.testing.assert_allclose(at.p, POINTS, atol=1e-14)
    for ends in (at.v[[0, -1]], at.a[[0, -1]]):
        np.testing.assert_allclose(ends, 0.0, atol=1e-13)
    if trajectory is STOP:
        np.testing.assert_allclose(at.v, 0.0, atol=1e-14)
    else:
        assert np.linalg.norm(at.v[1:-1], axis=1).min() > 0.05
    assert trajectory.duration == math.fsum(DURATIONS)


@pytest.mark.parametrize("trajectory", [STOP, VIA])
def test_derivatives(trajectory: MinimumJerk) -> None:
    t, h = np.linspace(0.01, trajectory.duration - 0.01, 401), 1e-6
    before, at, after = (trajectory.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.p - before.p) / (2 * h), at.v, atol=1e-8)
    np.testing.assert_allclose((after.v - before.v) / (2 * h), at.a, atol=1e-5)


def test_two_points_to_pass_are_one_stroke() -> None:
    t = np.linspace(0.0, 1.7, 50)
    one, other = (MinimumJerk(POINTS[:2], DURATIONS[:1], passing).evaluate(t) for passing in ("stop", "via"))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def jerk_cost(trajectory: MinimumJerk, bump: float = 0.0) -> float:
    """Integral of the squared jerk, of the movement plus a bump that is zero at all points and ends."""
    t = np.linspace(0.0, trajectory.duration, 40_001)
    edges = np.concatenate(([0.0], np.cumsum(DURATIONS)))
    zeros = np.polynomial.Polynomial.fromroots(
        [0.0, 0.0, 0.0, edges[1], edges[2], edges[3], edges[3], edges[3]]
    )
    a = trajectory.evaluate(t).a + bump * zeros.deriv(2)(t)[:, None] * [1.0, -0.5, 0.3]
    jerk = np.gradient(a, t, axis=0, edge_order=2)
    return float(simpson(np.einsum("ij,ij->i", jerk, jerk), x=t))


def test_no_movement_through_the_points_has_less_jerk() -> None:
    least = jerk_cost(VIA)
    for bump in (-1e-3, -1e-4, 1e-4, 1e-3):
        assert jerk_cost(VIA, bump) > least
    # to first order nothing changes: it is the minimum, not just lower than these
    assert (jerk_cost(VIA, 1e-4) - jerk_cost(VIA, -1e-4)) / 2e-4 == pytest.approx(0.0, abs=1e-3 * least)
    assert least < jerk_cost(STOP)


@settings(max_examples=25)
@given(
    scale=st.floats(0.1, 10.0),
    angles=st.tuples(*(st.floats(-3.0, 3.0) for _ in range(3))),
    stretch=st.floats(0.2, 5.0),
    passing=st.sampled_from(["stop", "via"]),
)
def test_similarities_and_time_stretch_commute_with_evaluation(
    scale: float, angles: tuple[float, float, float], stretch: float, passing: str
) -> None:
    trajectory = MinimumJerk(POINTS, DURATIONS, passing)
    similarity = Similarity(scale, Rotation.from_euler("xyz", angles).as_matrix(), np.array([1.0, -2.0, 0.3]))
    t = np.linspace(0.0, trajectory.duration, 101)
    at, moved = (
        trajectory.evaluate(t),
        trajectory.transformed(similarity).stretched(stretch).evaluate(stretch * t),
    )
    np.testing.assert_allclose(moved.p, similarity.points(at.p), atol=1e-12)
    np.testing.assert_allclose(moved.v, similarity.vectors(at.v) / stretch, atol=1e-10 * scale / stretch)
    np.testing.assert_allclose(moved.a, similarity.vectors(at.a) / stretch**2, atol=1e-9 * scale / stretch**2)


@pytest.mark.parametrize(
    "make",
    [
        lambda: MinimumJerk(POINTS, DURATIONS[:2]),
        lambda: MinimumJerk(POINTS, np.array([1.0, 0.0, 1.0])),
        lambda: MinimumJerk(POINTS[:1], np.array([])),
        lambda: MinimumJerk(POINTS[:, :2], DURATIONS),
        lambda: MinimumJerk(POINTS * np.nan, DURATIONS),
        lambda: MinimumJerk(POINTS, DURATIONS, "blend"),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
