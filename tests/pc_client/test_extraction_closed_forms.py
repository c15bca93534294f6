"""The closed forms give back the lognormal that they are asked about (docs/theory.md, sections 1 and 8)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pc_client.errors import MovementError
from pc_client.movements.lognormal import Lognormal
from pc_client.studies.extraction.initial import (
    CharacteristicPoints,
    lognormal_from_points,
    sigma_from_peak_ratio,
    sigma_from_slope_ratio,
    turn_rate,
)


def points_of(lognormal, length):
    times = (lognormal.inflections.before, lognormal.mode, lognormal.inflections.after)
    return CharacteristicPoints(times, tuple((length * lognormal.evaluate(list(times)).rate).tolist()))


def test_all_three_formulas_give_back_the_notes_sigma():
    assert sigma_from_peak_ratio(0.526450600870) == pytest.approx(0.25, abs=1e-10)
    assert sigma_from_peak_ratio(0.677292380471) == pytest.approx(0.25, abs=1e-10)
    assert sigma_from_slope_ratio(0.677292380471 / 0.526450600870) == pytest.approx(0.25, abs=1e-10)


def test_case_a_comes_back_from_its_printed_points():
    points = CharacteristicPoints(
        (0.142887802493, 0.189664226341, 0.236500620975), (4.293095569063, 8.154792799106, 5.523179027154)
    )
    for i, k in ((0, 1), (1, 2), (0, 2), (2, 0)):
        lognormal, length = lognormal_from_points(points, 0.25, i, k)
        assert (lognormal.t0, lognormal.mu) == (pytest.approx(0.0, abs=1e-10), pytest.approx(-1.6, abs=1e-9))
        assert length == pytest.approx(1.0, abs=1e-9)


@given(st.floats(-2.0, 2.0), st.floats(-3.0, 1.0), st.floats(0.08, 0.6), st.floats(0.01, 300.0))
def test_any_lognormal_comes_back(t0, mu, sigma, length):
    points = points_of(Lognormal(t0, mu, sigma), length)
    v2, v3, v4 = points.speeds
    for found in (
        sigma_from_peak_ratio(v2 / v3),
        sigma_from_peak_ratio(v4 / v3),
        sigma_from_slope_ratio(v4 / v2),
    ):
        assert found == pytest.approx(sigma, rel=1e-5)
    for i, k in ((0, 1), (1, 2), (2, 0)):
        lognormal, area = lognormal_from_points(points, sigma, i, k)
        assert lognormal.mu == pytest.approx(mu, abs=1e-6)
        assert lognormal.t0 == pytest.approx(t0, abs=1e-6)
        assert area == pytest.approx(length, rel=1e-6)


@pytest.mark.parametrize("ratio", [0.0, 1.0, -0.3, 1.7, math.nan])
def test_heights_that_no_lognormal_has_are_refused(ratio):
    with pytest.raises(MovementError, match=r"\(0, 1\)"):
        sigma_from_peak_ratio(ratio)


def test_a_gaussian_has_sigma_zero_and_no_less():
    assert sigma_from_peak_ratio(math.exp(-0.5)) == pytest.approx(0.0, abs=1e-7)
    with pytest.raises(MovementError, match="greater than 0"):
        sigma_from_slope_ratio(0.0)


def test_turn_rate_of_an_arc():
    assert turn_rate((0.2, 0.8), (0.1, 0.4)) == pytest.approx(2.0)
