"""Measures of human-likeness against signals whose answer is known; test_docs_figures.py has those of the page's table."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pc_client.errors import ClientError
from pc_client.movements.minimum_jerk import stroke_shape
from pc_client.studies.likeness import (
    between_peaks,
    fit_power_law,
    log_dimensionless_jerk,
    peaks_of,
    sparc,
    speed_peaks,
)

RATE = 1000.0
T = np.arange(1001) / RATE


@pytest.mark.parametrize(("rate", "error"), [(1e3, 3e-3), (1e4, 3e-4), (1e5, 3e-5)])
def test_jerk_of_minimum_jerk_tends_to_its_exact_value(rate: float, error: float) -> None:
    t = np.arange(round(rate) + 1) / rate
    found = log_dimensionless_jerk(stroke_shape(t).rate, rate)
    assert found == pytest.approx(-math.log(204.8), abs=error)


def test_jerk_of_corners_falls_with_the_rate() -> None:
    """Ten times the rate, ten times the squared jerk of a corner: ln 10 less."""
    figures = []
    for rate in (1e3, 1e4):
        t = np.arange(round(rate) + 1) / rate
        figures.append(log_dimensionless_jerk(np.clip(np.minimum(t, 1 - t) / 0.2, 0, 1), rate))
    assert figures[0] - figures[1] == pytest.approx(math.log(10.0), abs=0.01)


@given(size=st.floats(1e-3, 1e3), stretch=st.floats(0.5, 2.0))
def test_smoothness_knows_no_unit_of_speed_and_jerk_none_of_time(size: float, stretch: float) -> None:
    speed = stroke_shape(T).rate
    assert sparc(size * speed, RATE) == pytest.approx(sparc(speed, RATE), abs=1e-9)
    found = log_dimensionless_jerk(size * speed, RATE * stretch)
    assert found == pytest.approx(log_dimensionless_jerk(speed, RATE), abs=1e-9)


def test_spectrum_ends_at_the_cutoff() -> None:
    """What is faster than 10 Hz is not movement: it changes nothing but the scale."""
    speed = stroke_shape(T).rate
    shaken = speed + 0.3 * np.sin(2 * math.pi * 40.0 * T) * speed
    assert sparc(shaken, RATE) == pytest.approx(sparc(speed, RATE), abs=0.01)
    assert sparc(shaken, RATE, cutoff=60.0) < sparc(speed, RATE) - 0.1
    slower = speed + 0.3 * np.sin(2 * math.pi * 10.0 * T) * speed
    assert sparc(slower, RATE) < sparc(slower, RATE, cutoff=9.0) - 0.05


@pytest.mark.parametrize("count", [1, 2, 5])
def test_peaks_are_counted(count: int) -> None:
    speed = np.concatenate([stroke_shape(T).rate] * count)
    assert speed_peaks(speed) == count
    assert peaks_of(speed) == [500 + 1001 * k for k in range(count)]
    noisy = speed + 0.01 * np.random.default_rng(1).standard_normal(len(speed))
    assert speed_peaks(noisy) == count


def test_ripples_plateaus_and_cut_ends() -> None:
    wave = np.sin(np.linspace(0.0, 4 * math.pi, 400))
    assert speed_peaks(1.0 + 0.02 * wave) == 1  # ripples of 4 % on a plateau
    assert speed_peaks(1.0 + 0.04 * wave) == 2
    assert (
        speed_peaks(
            np.clip(np.minimum(T, 1.0 - T) / 0.2, 0.0, 1.0)
            + 1e-15 * np.random.default_rng(2).standard_normal(1001)
        )
        == 1
    )
    assert peaks_of(np.linspace(0.0, 1.0, 50)) == [49]
    assert peaks_of(np.linspace(1.0, 0.0, 50)) == [0]
    assert speed_peaks(np.zeros(50)) == 0
    assert between_peaks(np.zeros(50)) == slice(0, 0)
    speed = np.concatenate([stroke_shape(T).rate] * 3)
    assert between_peaks(speed) == slice(500, 2503)


def ellipse(beta: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity and acceleration on an ellipse run with speed = curvature^-beta, by differences in the parameter."""
    u = np.linspace(0.0, 2 * math.pi, 4001)
    p = np.column_stack((0.2 * np.cos(u), 0.1 * np.sin(u), 0.05 * np.cos(u)))
    first = np.column_stack((-0.2 * np.sin(u), 0.1 * np.cos(u), -0.05 * np.sin(u)))
    pace = np.linalg.norm(first, axis=1)
    curvature = np.linalg.norm(np.cross(first, -p), axis=1) / pace**3
    u_dot = curvature**-beta / pace
    v = first * u_dot[:, None]
    return v, np.gradient(v, u, axis=0, edge_order=2) * u_dot[:, None]


@pytest.mark.parametrize("beta", [0.0, 0.2, 1 / 3, 0.5])
def test_exponent_of_an_ellipse(beta: float) -> None:
    """Harmonic motion on an ellipse obeys the two-thirds law exactly; any other exponent can be imposed."""
    fit = fit_power_law(*ellipse(beta))
    assert fit.exponent == pytest.approx(beta, abs=2e-5)
    if beta:
        assert fit.r_squared == pytest.approx(1.0, abs=1e-6)


def test_harmonic_motion_obeys_the_law() -> None:
    u = np.linspace(0.0, 6.0, 500)
    v = np.column_stack((-0.2 * np.sin(u), 0.1 * np.cos(u), 0 * u))
    a = np.column_stack((-0.2 * np.cos(u), -0.1 * np.sin(u), 0 * u))
    assert fit_power_law(v, a).exponent == pytest.approx(1 / 3, abs=1e-12)


def test_straight_and_circular_paths_have_no_exponent() -> None:
    shape = stroke_shape(T)
    v, a = (np.outer(values, [1.0, 2.0, 0.0]) for values in (shape.rate, shape.rate_change))
    assert math.isnan(fit_power_law(v, a).exponent)
    u = np.linspace(0.0, 6.0, 500)
    v = np.column_stack((-np.sin(u), np.cos(u), 0 * u)) * 0.1
    a = np.column_stack((-np.cos(u), -np.sin(u), 0 * u)) * 0.1
    assert math.isnan(fit_power_law(v, a).exponent)


def test_slow_and_nearly_straight_samples_are_left_out() -> None:
    v, a = ellipse(1 / 3)
    # The same path slowly, by no law, and a line that is hardly bent.
    slow = np.concatenate((v, 1e-3 * v)), np.concatenate((a, 3e-6 * a))
    assert fit_power_law(*slow) == pytest.approx(fit_power_law(v, a), abs=1e-9)
    straight = np.tile([0.5, 0.0, 0.0], (500, 1)), np.tile([0.0, 0.1, 0.0], (500, 1))
    with_line = (np.concatenate(both) for both in zip((v, a), straight, strict=True))
    assert fit_power_law(*with_line) == pytest.approx(fit_power_law(v, a), abs=1e-9)


@pytest.mark.parametrize(
    "measure",
    [
        lambda: sparc(np.ones(5), RATE),
        lambda: sparc(np.zeros(100), RATE),
        lambda: sparc(np.ones((10, 3)), RATE),
        lambda: sparc(T, 0.0),
        lambda: sparc(T, RATE, cutoff=0.01),
        lambda: log_dimensionless_jerk([1.0] * 9 + [math.nan], RATE),
        lambda: log_dimensionless_jerk(T, math.inf),
    ],
)
def test_nonsense_is_refused(measure: object) -> None:
    with pytest.raises(ClientError):
        measure()


def test_too_few_samples_have_no_exponent() -> None:
    v, a = ellipse(1 / 3)
    for n in (0, 5):
        assert math.isnan(fit_power_law(v[:n], a[:n]).exponent)
