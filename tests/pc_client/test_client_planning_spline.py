from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pc_client.errors import PlanningError
from pc_client.planning.joint_spline import JointSpline

KNOTS = st.integers(2, 30).flatmap(lambda n: arrays(np.float64, (n, 6), elements=st.floats(-6, 6, width=32)))
DURATIONS = st.floats(0.01, 60.0)


@given(KNOTS, DURATIONS)
def test_it_passes_through_its_knots_and_rests_at_both_ends(knots, duration):
    spline = JointSpline(duration, knots)
    q, qd = spline.sample(spline.t_knots)
    np.testing.assert_allclose(q, knots, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(qd[[0, -1]], 0.0)


@given(KNOTS, DURATIONS)
def test_position_velocity_and_acceleration_are_continuous_at_knots(knots, duration):
    spline = JointSpline(duration, knots)
    h = duration / (len(knots) - 1)
    t = spline.t_knots[1:-1]
    eps = 1e-7 * h
    scale = max(1.0, float(np.abs(knots).max())) * 30
    (q_a, qd_a), (q_b, qd_b) = spline.sample(t - eps), spline.sample(t + eps)
    np.testing.assert_allclose(q_a, q_b, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(qd_a, qd_b, rtol=0, atol=1e-5 * scale / h)
    np.testing.assert_allclose(spline.qdd(t - eps), spline.qdd(t + eps), rtol=0, atol=1e-5 * scale / h**2)


@given(KNOTS, DURATIONS, st.lists(st.floats(-0.2, 1.2), min_size=1, max_size=20))
def test_one_time_and_many_times_give_the_same(knots, duration, fractions):
    spline = JointSpline(duration, knots)
    t = np.array(fractions) * duration
    q, qd = spline.sample(t)
    for k, t_k in enumerate(t.tolist()):
        q_at, qd_at = spline.at(t_k)
        np.testing.assert_allclose(q_at, q[k], rtol=1e-13, atol=1e-12)
        np.testing.assert_allclose(qd_at, qd[k], rtol=1e-12, atol=1e-11 / duration * len(knots))


def test_velocity_and_acceleration_are_the_derivatives():
    rng = np.random.default_rng(6)
    spline = JointSpline(4.0, np.cumsum(rng.normal(0, 0.1, (101, 6)), axis=0))
    t, h = rng.uniform(0.1, 3.9, 200), 1e-6
    np.testing.assert_allclose(
        spline.sample(t)[1], (spline.sample(t + h)[0] - spline.sample(t - h)[0]) / (2 * h), atol=1e-6
    )
    np.testing.assert_allclose(
        spline.qdd(t), (spline.sample(t + h)[1] - spline.sample(t - h)[1]) / (2 * h), atol=1e-2
    )


def test_it_is_exact_for_a_cubic_that_rests_at_both_ends():
    t = np.linspace(0.0, 2.0, 21)
    cubic = t**2 * (3.0 - t)  # derivative 3 t (2 - t) vanishes at 0 and 2
    spline = JointSpline(2.0, np.outer(cubic, np.arange(1.0, 7.0)))
    q, qd = spline.at(0.7331)
    np.testing.assert_allclose(q, 0.7331**2 * (3 - 0.7331) * np.arange(1.0, 7.0), rtol=1e-12)
    np.testing.assert_allclose(qd, 3 * 0.7331 * (2 - 0.7331) * np.arange(1.0, 7.0), rtol=1e-12)


@pytest.mark.parametrize("t", [-np.inf, -1.0, -0.0, 0.0])
def test_before_the_begin_it_rests_at_the_first_knot(t):
    knots = np.random.default_rng(7).normal(size=(5, 6))
    spline = JointSpline(1.0, knots)
    q, qd = spline.at(t)
    np.testing.assert_array_equal(q, knots[0])
    np.testing.assert_array_equal(qd, 0.0)


@pytest.mark.parametrize("t", [1.0, 1.0 + 1e-15, 7.0, np.inf])
def test_after_the_end_it_rests_at_the_last_knot(t):
    knots = np.random.default_rng(7).normal(size=(5, 6))
    q, qd = JointSpline(1.0, knots).at(t)
    np.testing.assert_array_equal(q, knots[-1])
    np.testing.assert_array_equal(qd, 0.0)


@given(DURATIONS, st.integers(2, 3000))
def test_the_last_moment_before_the_end_is_inside(duration, n):
    knots = np.linspace(0.0, 1.0, n)[:, None] * np.ones(6)
    q, qd = JointSpline(duration, knots).at(float(np.nextafter(duration, 0.0)))
    np.testing.assert_allclose(q, 1.0, atol=1e-9)
    np.testing.assert_allclose(qd, 0.0, atol=1e-5 / duration)


def test_acceleration_outside_is_zero():
    spline = JointSpline(1.0, np.random.default_rng(8).normal(size=(9, 6)))
    np.testing.assert_array_equal(spline.qdd([-0.1, 1.1]), 0.0)
    assert np.abs(spline.qdd([0.0, 1.0])).min() > 0.0


def test_what_is_handed_out_at_the_ends_cannot_be_spoiled():
    spline = JointSpline(1.0, np.zeros((3, 6)))
    for values in (*spline.at(-1.0), *spline.at(2.0)):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_a_shift_moves_positions_and_nothing_else():
    spline = JointSpline(1.0, np.random.default_rng(9).normal(size=(9, 6)))
    offset = 2 * np.pi * np.array((1, 0, -1, 0, 0, 1))
    t = np.linspace(0, 1, 50)
    (q, qd), (q_shifted, qd_shifted) = spline.sample(t), spline.shifted(offset).sample(t)
    np.testing.assert_allclose(q_shifted, q + offset, atol=1e-12)
    np.testing.assert_allclose(qd_shifted, qd, atol=1e-10)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_a_duration_that_is_none_is_refused(duration):
    with pytest.raises(PlanningError, match="positive duration"):
        JointSpline(duration, np.zeros((3, 6)))


@pytest.mark.parametrize("shape", [(1, 6), (6,), (0, 6)])
def test_too_few_knots_are_refused(shape):
    with pytest.raises(PlanningError, match="knots of shape"):
        JointSpline(1.0, np.zeros(shape))


def test_a_knot_that_is_no_number_is_named_with_its_joint():
    knots = np.zeros((5, 6))
    knots[3, 2] = np.nan
    with pytest.raises(PlanningError) as caught:
        JointSpline(1.0, knots)
    assert (caught.value.sample, caught.value.joint) == (3, 2)
