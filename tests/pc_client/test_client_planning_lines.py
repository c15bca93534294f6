"""Straight joint lines over time: the postures, the speeds, rest where a line ends."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pc_client.planning.approach import JointLines

angle = st.floats(-6.0, 6.0)
posture = st.lists(angle, min_size=6, max_size=6).map(np.array)
distances = st.lists(posture, min_size=2, max_size=4)
limits = {"v": st.floats(0.05, 0.5), "a": st.floats(0.05, 0.8)}


@given(postures=distances, **limits)
def test_it_begins_and_ends_at_rest_in_the_first_and_the_last_posture(postures, v, a):
    lines = JointLines(postures, v, a)
    for t, wanted in (
        (-1.0, postures[0]),
        (0.0, postures[0]),
        (lines.duration, postures[-1]),
        (99.0, postures[-1]),
    ):
        if t > 0.0:
            t = max(t, lines.duration)
        q, qd = lines.at(t)
        np.testing.assert_allclose(q, wanted, atol=1e-12)
        assert not qd.any()


@given(distance=st.floats(1e-4, 6.0), **limits)
def test_the_leading_joint_has_the_trapezoid_of_v_and_a(distance, v, a):
    lines = JointLines([np.zeros(6), np.array((0, -distance, distance / 2, 0, 0, 0))], v, a)
    t = np.linspace(0.0, lines.duration, 401)
    expected = np.minimum(np.minimum(a * t, v), a * (lines.duration - t))
    q, qd = (np.array(x) for x in zip(*(lines.at(time) for time in t), strict=True))
    np.testing.assert_allclose(-qd[:, 1], expected, atol=1e-6)
    np.testing.assert_allclose(qd[:, 2], -qd[:, 1] / 2, atol=1e-12)
    np.testing.assert_allclose(np.trapezoid(qd[:, 1], t), -distance, rtol=5e-3)
    np.testing.assert_allclose(q[:, 2], -q[:, 1] / 2, atol=1e-12)


@given(postures=distances, **limits)
def test_it_stays_on_the_lines_and_rests_at_each_posture(postures, v, a):
    lines = JointLines(postures, v, a)
    step = 0.05
    times = np.arange(0.0, lines.duration, step)
    q = np.array([lines.at(t)[0] for t in times])
    assert (np.abs(np.diff(q, axis=0)) <= v * step + 1e-9).all()
    end = 0.0
    for begin, goal in pairwise(postures):
        end += JointLines([begin, goal], v, a).duration
        at_posture, qd = lines.at(end)
        np.testing.assert_allclose(at_posture, goal, atol=1e-6)
        assert np.abs(qd).max() <= 1e-6
        middle = lines.at(end - JointLines([begin, goal], v, a).duration / 2)[0]
        np.testing.assert_allclose(middle, (begin + goal) / 2, atol=1e-6)


def test_no_distance_takes_no_time():
    here = np.full(6, 0.3)
    lines = JointLines([here, here, here], 0.5, 0.8)
    assert lines.duration == 0.0
    assert lines.at(0.0)[0] == pytest.approx(here)
