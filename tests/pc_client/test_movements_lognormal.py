"""The lognormal and its two constructions against the acceptance figures of the theory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import erf, ndtr

from pc_client.errors import MovementError
from pc_client.movements.lognormal import (
    FULL_COVERAGE,
    LiteralTiming,
    Lognormal,
    TwoSidedTiming,
    lead_from_k,
    sigma_for_k,
)

CASE_A = Lognormal(0.0, -1.6, 0.25)
DIGITS_12 = {"rel": 0.0, "abs": 5.1e-13}


def figures(lognormal: Lognormal, length: float = 1.0) -> dict[str, float]:
    before, after = lognormal.inflections
    at_before, at_after = lognormal.evaluate(before), lognormal.evaluate(after)
    return {
        "t1": lognormal.time_at_deviation(-3.0),
        "t2": before,
        "t3": lognormal.mode,
        "t4": after,
        "t5": lognormal.time_at_deviation(3.0),
        "v3": length * lognormal.peak,
        "v2": length * float(at_before.rate),
        "v4": length * float(at_after.rate),
        "s2": float(at_before.done),
        "s3": lognormal.done_at_mode,
        "s4": float(at_after.done),
        "mean": lognormal.mean,
        "median": lognormal.median,
        "std": lognormal.std,
        "skew": lognormal.skewness,
        "kurt": lognormal.kurtosis,
        "power": length**2 * lognormal.power,
    }


def test_case_a() -> None:
    assert figures(CASE_A) == pytest.approx(
        {
            "t1": 0.095369162216,
            "t2": 0.142887802493,
            "t3": 0.189664226341,
            "t4": 0.236500620975,
            "t5": 0.427414931949,
            "v3": 8.154792799106,
            "v2": 4.293095569063,
            "v4": 5.523179027154,
            "s2": 0.083365826392,
            "s3": 0.401293674317,
            "s4": 0.736562064951,
            "mean": 0.208305401438,
            "median": 0.201896517995,
            "std": 0.052900738307,
            "skew": 0.778251635797,
            "kurt": 4.095931274730,
            "power": 5.676910948135,
        },
        **DIGITS_12,
    )


def test_case_a_length_is_one() -> None:
    assert float(CASE_A.evaluate(50.0).done) == pytest.approx(1.0, abs=1e-12)


def test_case_b_shift_and_length() -> None:
    found = figures(Lognormal(0.1, -1.6, 0.25), 0.2)
    assert found["t3"] == pytest.approx(0.289664226341, **DIGITS_12)
    assert found["v3"] == pytest.approx(1.630958559821, **DIGITS_12)
    assert found["power"] == pytest.approx(0.227076437925, **DIGITS_12)


def test_case_c_the_papers_isolated_stroke() -> None:
    timing = LiteralTiming(start=0.0, duration=0.1, lead=0.0)
    lognormal = timing.lognormal
    assert timing.k == 2.0
    assert lognormal.sigma == pytest.approx(0.157527431, abs=5e-10)
    assert lognormal.mu == pytest.approx(-2.970917382, abs=5e-10)
    assert lognormal.mode == pytest.approx(0.05, abs=2e-12)
    # The notes' further digits come from sigma and mu rounded to nine decimals.
    rounded = Lognormal(0.0, -2.970917382, 0.157527431)
    for figures_of, tolerance in ((rounded, 5e-10), (lognormal, 8e-9)):
        assert 0.1 * figures_of.peak == pytest.approx(5.002595473, abs=tolerance)
        assert figures_of.done_at_mode == pytest.approx(0.437414595, abs=tolerance)
        assert figures_of.skewness == pytest.approx(0.479511888, abs=tolerance)
        assert figures_of.kurtosis == pytest.approx(3.411570306, abs=tolerance)
        assert float(figures_of.evaluate(0.1).done) == pytest.approx(0.99998895, abs=5e-9)


def test_case_d() -> None:
    found = figures(Lognormal(0.5, -0.5, 0.3), 0.3)
    assert found["t3"] == pytest.approx(1.054327284735, **DIGITS_12)
    assert found["v3"] == pytest.approx(0.688019200865, **DIGITS_12)
    assert found["s3"] == pytest.approx(0.382088577811, **DIGITS_12)
    assert found["std"] == pytest.approx(0.194698306290, **DIGITS_12)
    assert found["power"] == pytest.approx(0.142703685516, **DIGITS_12)


@pytest.mark.parametrize(
    ("k", "sigma"),
    [(2, 0.157527431), (1.5, 0.093508117), (4 / 3, 0.066756911), (1.2, 0.042546925), (12 / 11, 0.020410587)],
)
def test_case_f_the_quadratic(k: float, sigma: float) -> None:
    found = sigma_for_k(k)
    assert found == pytest.approx(sigma, abs=5e-10)
    assert abs(found**2 + 3.0 * math.sqrt(2.0) * found - math.log(k)) < 1e-15


@given(a=st.floats(0.05, 50.0), b=st.floats(0.01, 10.0), sigma=st.floats(0.03, 0.6), mu=st.floats(-3.0, 1.5))
def test_case_g_scaling_of_time_and_space(a: float, b: float, sigma: float, mu: float) -> None:
    lognormal = Lognormal(0.3, mu, sigma)
    slow = lognormal.stretched(a)
    assert slow.t0 == pytest.approx(a * lognormal.t0)
    assert slow.mode - slow.t0 == pytest.approx(a * (lognormal.mode - lognormal.t0), rel=1e-9)
    assert slow.std == pytest.approx(a * lognormal.std, rel=1e-9)
    assert b * slow.peak == pytest.approx(b * lognormal.peak / a, rel=1e-9)
    assert (slow.skewness, slow.kurtosis) == (lognormal.skewness, lognormal.kurtosis)
    t = np.linspace(0.0, 5.0, 50)
    np.testing.assert_allclose(slow.evaluate(a * t).done, lognormal.evaluate(t).done, atol=1e-9)


def test_case_h_tails() -> None:
    assert 1.0 - erf(3.0) == pytest.approx(2.2090e-5, abs=5e-10)
    assert ndtr(3.0) - ndtr(-3.0) == pytest.approx(0.99730020, abs=5e-9)
    covered = TwoSidedTiming(0.0, 1.0, 0.1).lognormal.evaluate([0.0, 1.0]).done
    assert covered[1] - covered[0] == pytest.approx(0.99997791, abs=5e-9)
    covered = TwoSidedTiming(0.0, 1.0, 0.1, coverage=3.0).lognormal.evaluate([0.0, 1.0]).done
    assert covered[1] - covered[0] == pytest.approx(0.99730020, abs=5e-9)


# lead / T -> k, sigma, mu for T = 1 s, share of the length in the window, visible start, mode in the visible
# part, skewness, kurtosis, peak speed.
LITERAL_TABLE = [
    (0.0, 2.0, 0.157527431, -0.668332289, 0.99998895, 0.263, 0.322, 0.480, 3.412, 5.003),
    (0.5, 1.5, 0.093508117, 0.008743768, 0.99998895, 0.178, 0.391, 0.282, 3.142, 4.248),
    (1.0, 4 / 3, 0.066756911, 0.409921593, 0.99998895, 0.135, 0.422, 0.201, 3.072, 3.975),
    (2.0, 1.2, 0.042546925, 0.918100973, 0.99998889, 0.091, 0.450, 0.128, 3.029, 3.747),
    (5.0, 12 / 11, 0.020410587, 1.705164684, 0.99998759, 0.046, 0.476, 0.061, 3.007, 3.553),
]


@pytest.mark.parametrize("row", LITERAL_TABLE)
def test_table_of_the_literal_construction(row: tuple[float, ...]) -> None:
    lead, k, sigma, mu, covered, start, mode, skew, kurt, peak = row
    timing = LiteralTiming(0.0, 1.0, lead)
    lognormal = timing.lognormal
    assert timing.k == pytest.approx(k, rel=1e-14)
    assert lead_from_k(k, 1.0) == pytest.approx(lead, abs=1e-13)
    assert lognormal.sigma == pytest.approx(sigma, abs=6e-10)
    assert lognormal.mu == pytest.approx(mu, abs=6e-10)
    assert lognormal.mode == pytest.approx(0.5, abs=1e-12)
    done = lognormal.evaluate([0.0, 1.0]).done
    assert done[1] - done[0] == pytest.approx(covered, abs=6e-9)
    visible = lognormal.time_at_deviation(-FULL_COVERAGE)
    assert visible == pytest.approx(start, abs=6e-4)
    assert (0.5 - visible) / (1.0 - visible) == pytest.approx(mode, abs=6e-4)
    assert lognormal.skewness == pytest.approx(skew, abs=6e-4)
    assert lognormal.kurtosis == pytest.approx(kurt, abs=6e-4)
    assert lognormal.peak == pytest.approx(peak, abs=6e-4)


# sigma -> mode fraction and peak for c = 3 sqrt 2 and for c = 3, skewness, kurtosis.
TWO_SIDED_TABLE = [
    (0.05, 0.441, 3.415, 0.454, 2.406, 0.150, None),
    (0.10, 0.384, 3.505, 0.409, 2.442, 0.302, 3.162),
    (0.15, 0.330, 3.659, 0.366, 2.503, 0.456, 3.372),
    (0.20, 0.279, 3.883, 0.324, 2.591, 0.614, 3.678),
    (0.25, 0.233, 4.185, 0.284, 2.708, 0.778, 4.096),
    (0.30, 0.193, 4.577, 0.247, 2.856, 0.950, 4.645),
]


@pytest.mark.parametrize("row", TWO_SIDED_TABLE)
def test_table_of_the_two_sided_construction(row: tuple[float, ...]) -> None:
    sigma, full_mode, full_peak, mode, peak, skew, kurt = row
    full, three = TwoSidedTiming(0.7, 2.0, sigma), TwoSidedTiming(0.7, 2.0, sigma, 3.0)
    assert full.mode_fraction == pytest.approx(full_mode, abs=6e-4)
    assert three.mode_fraction == pytest.approx(mode, abs=6e-4)
    assert (full.lognormal.mode - 0.7) / 2.0 == pytest.approx(full.mode_fraction, abs=1e-12)
    assert 2.0 * full.lognormal.peak == pytest.approx(full_peak, abs=6e-4)
    assert 2.0 * three.lognormal.peak == pytest.approx(peak, abs=6e-4)
    assert full.lognormal.skewness == pytest.approx(skew, abs=6e-4)
    if kurt is not None:
        assert full.lognormal.kurtosis == pytest.approx(kurt, abs=6e-4)


@pytest.mark.parametrize(
    ("fraction", "sigma"),
    [
        (0.49, 0.008486),
        (0.475, 0.021229),
        (0.45, 0.042557),
        (0.425, 0.064084),
        (0.40, 0.085916),
        (0.375, 0.108171),
        (0.35, 0.130979),
    ],
)
def test_the_peak_of_a_two_sided_window(fraction: float, sigma: float) -> None:
    assert TwoSidedTiming(0.0, 1.0, sigma).mode_fraction == pytest.approx(fraction, abs=6e-7)


def test_window_ends_carry_the_tails_asked_for() -> None:
    done = TwoSidedTiming(1.5, 0.8, 0.2, 2.5).lognormal.evaluate([1.5, 2.3]).done
    assert done == pytest.approx([ndtr(-2.5), ndtr(2.5)], abs=1e-14)


@pytest.mark.parametrize("lognormal", [CASE_A, Lognormal(-0.4, 0.3, 0.08), Lognormal(0.0, -0.5, 0.5)])
def test_closed_forms_agree_with_quadrature(lognormal: Lognormal) -> None:
    """Moments and power straight from Lambda, which uses none of their closed forms."""
    low, high = lognormal.time_at_deviation(-9.0), lognormal.time_at_deviation(9.0)

    def integral(weight: object) -> float:
        def weighted(t: float) -> float:
            return weight(t) * float(lognormal.evaluate(t).rate)

        return float(quad(weighted, low, high, points=[lognormal.mode], limit=400)[0])

    mean = integral(lambda t: t)
    std = math.sqrt(integral(lambda t: (t - mean) ** 2))
    assert integral(lambda t: 1.0) == pytest.approx(1.0, abs=1e-10)
    assert mean == pytest.approx(lognormal.mean, rel=1e-9)
    assert std == pytest.approx(lognormal.std, rel=1e-8)
    assert integral(lambda t: ((t - mean) / std) ** 3) == pytest.approx(lognormal.skewness, rel=1e-6)
    assert integral(lambda t: ((t - mean) / std) ** 4) == pytest.approx(lognormal.kurtosis, rel=1e-6)
    assert integral(lambda t: float(lognormal.evaluate(t).rate)) == pytest.approx(lognormal.power, rel=1e-9)


def test_rates_are_the_derivatives_of_the_values() -> None:
    t, h = np.linspace(0.05, 0.6, 200), 1e-6
    before, at, after = (CASE_A.evaluate(t + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((after.done - before.done) / (2 * h), at.rate, atol=1e-7)
    np.testing.assert_allclose((after.rate - before.rate) / (2 * h), at.rate_change, atol=1e-5)


def test_inflections_are_where_the_slope_is_steepest() -> None:
    t = np.linspace(0.02, 0.6, 200_001)
    slope = CASE_A.evaluate(t).rate_change
    assert t[np.argmax(slope)] == pytest.approx(CASE_A.inflections.before, abs=1e-5)
    assert t[np.argmin(slope)] == pytest.approx(CASE_A.inflections.after, abs=1e-5)


def test_nothing_moves_before_the_command() -> None:
    values = Lognormal(1.0, -1.0, 0.2).evaluate([-1e9, 0.0, 1.0, np.nextafter(1.0, 2.0)])
    assert not np.any(values)


def test_power_as_a_signal_of_known_frequency() -> None:
    """The isolated stroke with sigma = .1 has w = 6.26 / T."""
    lognormal = TwoSidedTiming(0.0, 1.0, 0.1).lognormal
    t = np.linspace(0.0, 1.0, 20_001)
    values = lognormal.evaluate(t)
    w = math.sqrt(float(values.rate_change @ values.rate_change) / float(values.rate @ values.rate))
    assert w == pytest.approx(6.26, abs=0.005)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Lognormal(0.0, 0.0, 0.0),
        lambda: Lognormal(math.nan, 0.0, 0.1),
        lambda: sigma_for_k(1.0),
        lambda: lead_from_k(2.5, 1.0),
        lambda: LiteralTiming(0.0, 1.0, -0.1),
        lambda: LiteralTiming(0.0, 0.0, 1.0),
        lambda: TwoSidedTiming(0.0, -1.0, 0.1),
        lambda: TwoSidedTiming(0.0, 1.0, math.inf),
        lambda: TwoSidedTiming(0.0, 1.0, 0.1, 0.0),
    ],
)
def test_nonsense_is_refused(make: object) -> None:
    with pytest.raises(MovementError):
        make()
