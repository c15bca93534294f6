"""Learning between runs: it converges as promised, stays within bounds, and takes up little noise."""

from __future__ import annotations

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.learning import (
    LearningBounds,
    LearningFilter,
    RunSignals,
    bounded,
    design_filter,
    learn,
    noise_share_below,
)
from pc_client.control.loop import LoopModel, frequency_response, sensitivity

LOOP = LoopModel(0.022, 0.010, 0.002, 0.0)
GAINS = {"learning_gain": 0.8, "gain_p": 5.0, "gain_i": 3.0}
BOUNDS = LearningBounds(0.2, 20.0)
QUIET = (0.1, 0.15)
N = 400


def disturbance(n=N):
    """What the arm does beside what it is told: the same in every run, at rest at both ends (n,) [rad]."""
    t = np.arange(n) * PERIOD
    inside = np.clip((t - 0.3) / 0.3, 0, 1) * np.clip((t[-1] - 0.5 - t) / 0.3, 0, 1)
    return inside * (3e-4 * np.sin(2 * np.pi * 1.1 * t) + 1e-4 * np.sin(2 * np.pi * 7 * t))


def run_once(learned, real, random=None, gain_p=5.0):
    """One run of a joint at a constant reference; returns what it teaches."""
    arm = DelayedArm(np.zeros(6), cycles=real[0], lag=real[1])
    pushed = disturbance()
    error, added = np.zeros((N, 6)), np.zeros((N, 6))
    for k in range(N):
        q = arm.q + pushed[k]
        if random is not None:
            q = q + random.normal(0.0, 1.5e-5, 6)
        error[k] = -q
        added[k] = (0.0 if learned is None else learned[k]) - gain_p * q
        arm.advance(added[k])
    return RunSignals(error, added)


def rms(error):
    return float(np.sqrt(np.mean(np.square(error))))


@pytest.mark.parametrize("real", [(3, 0.010), (2, 0.014), (3, 0.006)])
def test_what_repeats_is_gone_after_a_few_runs(real):
    loop = LoopModel(0.023, 0.010, 0.004, 0.0)  # not quite any of them
    weight = design_filter(loop, PERIOD, **GAINS)
    assert weight.contraction < 1.0
    learned, errors = None, []
    for _ in range(4):
        run = run_once(learned, real)
        errors.append(rms(run.error))
        learned = learn(run, loop, weight, 0.8, BOUNDS, QUIET, PERIOD)
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.2 * errors[0]
    assert errors[3] < 1.05 * errors[2]


def test_nothing_is_added_where_the_arm_rests():
    weight = design_filter(LOOP, PERIOD, **GAINS)
    random = np.random.default_rng(0)
    learned = learn(run_once(None, (3, 0.008), random), LOOP, weight, 0.8, BOUNDS, QUIET, PERIOD)
    assert not learned[: int(QUIET[0] / PERIOD)].any()
    assert not learned[N - int(QUIET[1] / PERIOD) :].any()
    assert learned[60:300].any()


def test_noise_that_is_learned_costs_what_the_filter_says():
    weight = design_filter(LOOP, PERIOD, **GAINS)
    assert weight.limited_by == "noise"
    random = np.random.default_rng(1)
    noise = random.normal(0.0, 1.5e-5, (N, 6))
    # A run without disturbance, of which only noise is learned, seen again by the same loop without noise.
    learned = learn(RunSignals(noise, 0 * noise), LOOP, weight, 1.0, BOUNDS, (0.0, 0.0), PERIOD)
    arm = DelayedArm(np.zeros(6), cycles=0, lag=LOOP.lag)
    q = []
    for row in learned:
        q.append(arm.q)
        arm.advance(row)
    added = np.mean(np.square(np.diff(q, axis=0))) / np.mean(np.square(np.diff(noise, axis=0)))
    assert added == pytest.approx(weight.noise_share, rel=0.25)
    assert weight.noise_share < 0.12


@given(
    dead_time=st.floats(0.005, 0.06),
    lag=st.floats(0.0, 0.03),
    spread=st.floats(0.0, 0.006),
    share=st.floats(0.0, 1.0),
    late=st.floats(-1.0, 1.0),
)
@settings(max_examples=40)
def test_contraction_holds_for_every_loop_within_the_spread(dead_time, lag, spread, share, late):
    loop = LoopModel(dead_time, lag, spread, 0.0)
    promised = design_filter(loop, PERIOD, **GAINS)
    shift = late * spread
    inside = LoopModel(max(dead_time + (1 - share) * shift, 0.0), max(lag + share * shift, 0.0), 0.0, 0.0)
    hertz = np.linspace(0.5, 60, 100)
    ratio = frequency_response(inside, PERIOD, hertz) / frequency_response(loop, PERIOD, hertz)
    factor = promised.weight(hertz) * (1 - 0.8 * ratio) * sensitivity(inside, 5.0, 3.0, PERIOD, hertz)
    assert np.abs(factor).max() <= promised.contraction * 1.02 + 1e-6


def test_a_loop_that_is_known_badly_is_learned_at_low_frequencies_only():
    good = design_filter(LoopModel(0.02, 0.01, 0.0005, 0.0), PERIOD, **GAINS)
    bad = design_filter(LoopModel(0.02, 0.01, 0.01, 0.0), PERIOD, **GAINS)
    assert (good.limited_by, bad.limited_by) == ("noise", "loop")
    assert bad.cut_off < 0.5 * good.cut_off
    # |1 - exp(-j w 10 ms)| = 0.5 at w = 2 asin(0.25) / 10 ms
    assert bad.cut_off == pytest.approx(2 * np.arcsin(0.25) / 0.01 / (2 * np.pi), rel=0.1)
    assert bad.contraction < 1.0


def test_weight_is_one_below_zero_above_and_never_shifts():
    weight = LearningFilter(20.0, "noise", 0.3, 0.1)
    hertz = np.array([0.0, 10.0, 15.0, 20.0, 25.0, 60.0])
    np.testing.assert_allclose(weight.weight(hertz), [1.0, 1.0, 1.0, 0.5, 0.0, 0.0], atol=1e-12)


def test_share_of_differenced_noise():
    assert noise_share_below(0.5 / PERIOD, PERIOD) == pytest.approx(1.0)
    random = np.random.default_rng(2)
    steps = np.diff(random.normal(size=200_001))
    power = np.abs(np.fft.rfft(steps)) ** 2
    low = np.fft.rfftfreq(len(steps), PERIOD) < 25.0
    assert power[low].sum() / power.sum() == pytest.approx(noise_share_below(25.0, PERIOD), rel=0.05)


@given(seed=st.integers(0, 99), size=st.floats(0.01, 100.0))
def test_bounds_hold_whatever_was_measured(seed, size):
    wild = size * np.random.default_rng(seed).normal(size=(200, 6))
    kept = bounded(wild, BOUNDS, PERIOD)
    assert np.abs(kept).max() <= BOUNDS.speed
    assert np.abs(np.diff(kept, axis=0, prepend=0 * kept[:1])).max() <= BOUNDS.acceleration * PERIOD + 1e-12


def test_what_keeps_the_bounds_is_not_changed():
    t = np.arange(300) * PERIOD
    gentle = 0.1 * np.sin(2 * np.pi * 3 * t)[:, None] * np.ones(6)
    np.testing.assert_allclose(bounded(gentle, BOUNDS, PERIOD), gentle)
