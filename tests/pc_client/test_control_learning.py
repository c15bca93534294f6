"""What runs teach: commands for the next run, within bounds and with little noise, and the waves of the gears."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.controller import CONTROLLERS
from pc_client.control.gear import LARGEST_SLOPE, ORDERS, GearModel, GearObserver, find_waves
from pc_client.control.identification import Excitation
from pc_client.control.learning import (
    LearningFilter,
    RunSignals,
    bounded,
    design_filter,
    learn,
    noise_share_below,
)
from pc_client.control.loop import LoopModel, frequency_response, sensitivity, velocity_response
from pc_client.control.reference import RunRecipe

LOOP = LoopModel(0.022, 0.010, 0.002, 0.0)
BEST = CONTROLLERS["best"]
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
    weight = design_filter(RunRecipe(BEST, loop, PERIOD))
    assert weight.contraction < 1.0
    learned, errors = None, []
    for _ in range(4):
        run = run_once(learned, real)
        errors.append(rms(run.error))
        learned = learn(run, RunRecipe(BEST, loop, PERIOD), weight)
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.2 * errors[0]
    assert errors[3] < 1.05 * errors[2]


def test_nothing_is_added_where_the_arm_rests():
    weight = design_filter(RunRecipe(BEST, LOOP, PERIOD))
    random = np.random.default_rng(0)
    learned = learn(run_once(None, (3, 0.008), random), RunRecipe(BEST, LOOP, PERIOD), weight)
    assert not learned[: int(QUIET[0] / PERIOD)].any()
    assert not learned[N - int(QUIET[1] / PERIOD) :].any()
    assert learned[60:300].any()


def test_noise_that_is_learned_costs_what_the_filter_says():
    weight = design_filter(RunRecipe(BEST, LOOP, PERIOD))
    assert weight.limited_by == "noise"
    random = np.random.default_rng(1)
    noise = random.normal(0.0, 1.5e-5, (N, 6))
    # A run without disturbance, of which only noise is learned, seen again by the same loop without noise.
    learned = learn(
        RunSignals(noise, 0 * noise),
        RunRecipe(replace(BEST, learning_gain=1.0), LOOP, PERIOD),
        weight,
        (0.0, 0.0),
    )
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
    promised = design_filter(RunRecipe(BEST, loop, PERIOD))
    shift = late * spread
    inside = LoopModel(max(dead_time + (1 - share) * shift, 0.0), max(lag + share * shift, 0.0), 0.0, 0.0)
    hertz = np.linspace(0.5, 60, 100)
    ratio = frequency_response(inside, PERIOD, hertz) / frequency_response(loop, PERIOD, hertz)
    factor = promised.weight(hertz) * (1 - 0.8 * ratio) * sensitivity(inside, 5.0, 3.0, PERIOD, hertz)
    assert np.abs(factor).max() <= promised.contraction * 1.02 + 1e-6


def test_a_loop_that_is_known_badly_is_learned_at_low_frequencies_only():
    good = design_filter(RunRecipe(BEST, LoopModel(0.02, 0.01, 0.0005, 0.0), PERIOD))
    bad = design_filter(RunRecipe(BEST, LoopModel(0.02, 0.01, 0.01, 0.0), PERIOD))
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
    kept = bounded(wild, BEST, PERIOD)
    assert np.abs(kept).max() <= BEST.learning_speed
    assert (
        np.abs(np.diff(kept, axis=0, prepend=0 * kept[:1])).max()
        <= BEST.learning_acceleration * PERIOD + 1e-12
    )


def test_what_keeps_the_bounds_is_not_changed():
    t = np.arange(300) * PERIOD
    gentle = 0.1 * np.sin(2 * np.pi * 3 * t)[:, None] * np.ones(6)
    np.testing.assert_allclose(bounded(gentle, BEST, PERIOD), gentle)


TURNS = np.array([101.0, 80.0, 120.0, 50.0, 101.0, 160.0])  # of each motor in a turn of its joint


def true_gear(seed=0, size=1.2e-4):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, 6))
    sizes = np.array([[size], [0.35 * size]]) * 101.0 / TURNS
    return GearModel(np.array([TURNS, 2 * TURNS]), sizes * np.cos(phases), sizes * np.sin(phases))


def joints_with(gear, seed, n=900, noise=1.5e-5):
    """Commands of some smooth movement and what six joints with these gears report."""
    random = np.random.default_rng(seed)
    t = np.arange(n) * PERIOD
    window = np.clip(np.minimum(t, t[-1] - t) / 0.5, 0, 1)
    rates = random.uniform(0.1, 0.35, 6)
    qd_cmd = window[:, None] * 0.5 * np.sin(2 * np.pi * rates * t[:, None] + random.uniform(0, 6, 6))
    response = velocity_response(LOOP, PERIOD) * PERIOD
    motor = np.stack([np.cumsum(np.convolve(qd_cmd[:, j], response)[:n]) for j in range(6)], axis=1)
    motor += random.uniform(-2, 2, 6)
    q = np.array([m + gear.error(m)[0] for m in motor])
    return qd_cmd, q + random.normal(0.0, noise, q.shape)


def test_slope_is_the_derivative():
    gear = true_gear()
    q = np.linspace(-1, 1, 6)
    above, below = (gear.error(q + h)[0] for h in (1e-6, -1e-6))
    np.testing.assert_allclose(gear.error(q)[1], (above - below) / 2e-6, rtol=1e-4, atol=1e-7)


def test_runs_show_the_orders_and_the_waves_and_more_runs_show_them_better():
    gear, observer = true_gear(), GearObserver(LOOP, PERIOD)
    assert observer.model() is None
    left = []
    for seed in range(6):
        observer.take(*joints_with(gear, seed))
        found = observer.model()
        q = np.random.default_rng(0).uniform(-1, 1, (500, 6))
        left.append(np.std([found.error(x)[0] - gear.error(x)[0] for x in q]))
    assert {tuple(sorted(joint)) for joint in found.orders.T} == {(turns, 2 * turns) for turns in TURNS}
    assert found.n_waves == 12
    assert left[-1] < 0.1 * np.std([gear.error(x)[0] for x in q])
    assert left[-1] < left[0]


def test_an_order_is_the_same_in_every_turn():
    assert ORDERS.dtype.kind == "i"
    gear, q = true_gear(), np.linspace(-1, 1, 6)
    np.testing.assert_allclose(gear.error(q + 2 * np.pi)[0], gear.error(q)[0], atol=1e-15)


@pytest.mark.parametrize("noise", [0.0, 1.5e-5])
def test_without_gears_no_wave_is_believed(noise):
    observer = GearObserver(LOOP, PERIOD)
    for seed in range(5):
        observer.take(*joints_with(true_gear(size=0.0), seed, noise=noise))
        assert observer.model() is None


def test_an_order_that_a_short_range_leaves_open_is_not_believed():
    # One wave of order 80 passes: it is seen, but a gear of order 75 would fit as well.
    t = np.linspace(0, 1, 400)
    motor = 0.04 * (1 - np.cos(2 * np.pi * t))
    noise = np.random.default_rng(1).normal(0.0, 1.5e-5, len(t))
    q = motor + 1.2e-4 * np.sin(80 * motor) + noise
    assert find_waves(q[:-1], q[1:], np.diff(q - motor)) == []
    far = 1.2 * (1 - np.cos(2 * np.pi * t))
    q = far + 1.2e-4 * np.sin(80 * far) + noise
    (wave,) = find_waves(q[:-1], q[1:], np.diff(q - far))
    assert wave.order == 80
    assert wave.sine == pytest.approx(1.2e-4, rel=0.1)


def test_a_joint_that_stands_still_says_nothing():
    observer = GearObserver(LOOP, PERIOD)
    for seed in range(3):
        qd_cmd, q = joints_with(true_gear(), seed)
        qd_cmd[:, 3] = 0.0
        q[:, 3] = 0.5
        observer.take(qd_cmd, q)
    found = observer.model()
    assert found is not None
    assert not found.orders[:, 3].any()
    assert found.orders[0].astype(bool).tolist() == [True, True, True, False, True, True]


def test_a_wave_too_large_for_a_gear_is_left_out():
    observer = GearObserver(LOOP, PERIOD)
    gear = true_gear(size=1.5 * LARGEST_SLOPE / 101.0)
    for seed in range(4):
        observer.take(*joints_with(gear, seed))
    found = observer.model()
    assert found is not None  # the second waves are smaller
    assert not (found.orders == TURNS).any()


def test_motors_that_are_sent_against_the_waves_leave_the_joints_on_their_reference():
    gear, joints = true_gear(), Excitation((0.3, -1.0, 1.2, 0.1, 0.5, -0.7))

    def motors_at(t):
        return gear.motors(*map(np.asarray, joints.at(t)))

    for t in np.linspace(0.01, joints.duration - 0.01, 50):
        q, qd = (np.asarray(x) for x in joints.at(t))
        motor, motor_qd = motors_at(t)
        error, slope = gear.error(motor)
        # left is e of e, a hundredth of the wave
        np.testing.assert_allclose(motor + error, q, atol=3e-6)
        np.testing.assert_allclose(motor_qd * (1 + slope), qd, atol=1e-3)
        later = motors_at(t + 1e-6)[0]
        np.testing.assert_allclose((later - motor) / 1e-6, motor_qd, atol=1e-4)
    assert np.abs(np.asarray(motors_at(0.1)[0]) - np.asarray(joints.at(0.1)[0])).max() > 5e-5
