"""Identification of the loop: harmless excitation, the delay and its two parts, nonsense is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm, recipe
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.identification import (
    BRISK_PULSE,
    DISPLACEMENT,
    PULSE,
    Excitation,
    estimate_delay,
    identify_loop,
)
from pc_client.control.loop import LoopModel, frequency_response, lagged_displacement, velocity_response
from pc_client.control.reference import ReferenceTable
from pc_client.errors import DriverError

Q0 = np.array((0.4, -1.7, -2.1, -0.1, 1.3, 1.9))


def commands(pulse):
    """Stamps and what the driver sends for the excitation, one row a cycle."""
    table = ReferenceTable(Excitation(Q0, pulse), recipe(0.0), lead=0.1, settle=0.3)
    sent = table.commands()
    return np.arange(len(sent)) * PERIOD, sent


def reported(t, qd_cmd, dead_time, lag=0.0):
    """Positions of an arm of any real dead time and lag: the continuous solution, sampled finely."""
    fine = 40
    knots = np.arange(len(t) * fine + 1) * PERIOD / fine
    displacement, _ = lagged_displacement(knots, np.repeat(qd_cmd, fine, axis=0), lag)
    return Q0 + np.stack([np.interp(t - dead_time, knots, displacement[:, j]) for j in range(6)], axis=1)


@pytest.mark.parametrize(("pulse", "fastest"), [(PULSE, 0.12), (BRISK_PULSE, 0.28)])
def test_excitation_is_small_smooth_and_ends_where_it_began(pulse, fastest):
    excitation = Excitation(Q0, pulse)
    t = np.linspace(-0.1, excitation.duration + 0.1, 3001)
    q = np.array([excitation.at(x)[0] for x in t])
    qd = np.array([excitation.at(x)[1] for x in t])
    assert np.abs(qd).max() == pytest.approx(fastest, rel=1e-3)
    assert np.abs(q - Q0).max() == pytest.approx(DISPLACEMENT, rel=1e-3)
    assert np.degrees(np.abs(q - Q0).max()) <= 1.0
    assert np.degrees(np.abs(q - Q0).max()) > 0.8
    np.testing.assert_allclose(q[-1], Q0)
    np.testing.assert_allclose(np.gradient(q, t, axis=0)[2:-2], qd[2:-2], atol=5e-3)
    _, qd_cmd = commands(PULSE)
    np.testing.assert_allclose(qd_cmd.sum(axis=0) * PERIOD, 0.0, atol=1e-12)


@settings(max_examples=20)
@given(delay=st.floats(0.003, 0.15), seed=st.integers(0, 99))
def test_estimate_is_sub_sample_under_encoder_noise_and_ripple(delay, seed):
    t, qd_cmd = commands(PULSE)
    random = np.random.default_rng(seed)
    q = reported(t, qd_cmd, delay)
    q = q + random.normal(0.0, 2e-5, q.shape) + 1e-4 * np.sin(101 * q * 2)
    estimate = estimate_delay(t, qd_cmd, q, PERIOD)
    assert abs(estimate.delay - delay) < 1e-3
    assert estimate.residual < 0.05 * np.sqrt(np.mean(np.var(q, axis=0)))


@pytest.mark.parametrize(("cycles", "lag"), [(0, 0.0), (2, 0.0), (2, 0.010), (3, 0.020)])
def test_dead_time_and_lag_add_up(cycles, lag):
    t, qd_cmd = commands(PULSE)
    arm = DelayedArm(Q0, cycles=cycles, lag=lag)
    q = []
    for row in qd_cmd:
        q.append(arm.q)
        arm.advance(row)
    estimate = estimate_delay(t, qd_cmd, np.array(q), PERIOD)
    assert estimate.delay == pytest.approx(cycles * PERIOD + lag, abs=1e-3)


def test_lost_frames_do_not_disturb():
    t, qd_cmd = commands(PULSE)
    keep = np.ones(len(t), bool)
    # the command before a lost frame stays in force for two cycles
    for k in (40, 71, 90):
        keep[k] = False
        qd_cmd[k] = qd_cmd[k - 1]
    q = reported(t, qd_cmd, 0.031)
    assert estimate_delay(t[keep], qd_cmd[keep], q[keep], PERIOD).delay == pytest.approx(0.031, abs=1e-3)


@pytest.mark.parametrize(("share", "words"), [(1.0, "blocked"), (0.0, "no motion")])
def test_an_arm_that_stands_still_is_refused_whatever_it_was_told(share, words):
    t, qd_cmd = commands(PULSE)
    with pytest.raises(DriverError, match=words):
        estimate_delay(t, share * qd_cmd, np.tile(Q0, (len(t), 1)), PERIOD)


@pytest.mark.parametrize(("cycles", "lag"), [(0, 0.0), (3, 0.0), (2, 0.010), (0, 0.030)])
def test_response_is_what_an_arm_does(cycles, lag):
    arm = DelayedArm(np.zeros(6), cycles=cycles, lag=lag)
    q = [arm.q[0]]
    for k in range(60):
        arm.advance(np.full(6, float(k == 0)))
        q.append(arm.q[0])
    response = velocity_response(LoopModel(cycles * PERIOD, lag, 0.0, 0.0), PERIOD)
    steps = np.concatenate([[0.0], np.diff(q) / PERIOD])
    np.testing.assert_allclose(steps[: len(response)], response[: len(steps)], atol=1e-5)
    assert response.sum() == pytest.approx(1.0, abs=1e-5)


@given(dead_time=st.floats(0.0, 0.1), lag=st.floats(0.0, 0.05))
def test_slow_motion_trails_by_dead_time_and_lag(dead_time, lag):
    # A command acts half a cycle before the end of the step in which it shows, on the mean.
    hertz = np.array([0.05])
    phase = -np.angle(frequency_response(LoopModel(dead_time, lag, 0.0, 0.0), PERIOD, hertz))[0]
    assert phase / (2 * np.pi * hertz[0]) == pytest.approx(dead_time + lag + PERIOD, abs=1e-4)


@settings(max_examples=12)
@given(dead_time=st.floats(0.005, 0.06), lag=st.floats(0.003, 0.03), seed=st.integers(0, 99))
def test_both_are_found_under_noise_and_gear_waves(dead_time, lag, seed):
    t, qd_cmd = commands(BRISK_PULSE)
    random = np.random.default_rng(seed)
    q = reported(t, qd_cmd, dead_time, lag)
    q = q + 1e-4 * np.sin(101 * q + random.uniform(0, 6, 6)) + random.normal(0.0, 1.5e-5, q.shape)
    loop = identify_loop(t, qd_cmd, q, PERIOD)
    assert loop.dead_time == pytest.approx(dead_time, abs=2e-3)
    assert loop.lag == pytest.approx(lag, abs=2e-3)
    assert loop.delay == pytest.approx(dead_time + lag, abs=0.5e-3)
    assert loop.spread < 1e-3


def test_a_joint_that_is_later_shows_in_the_spread():
    t, qd_cmd = commands(BRISK_PULSE)
    q = reported(t, qd_cmd, 0.02, 0.01)
    q[:, 2] = reported(t, qd_cmd, 0.026, 0.01)[:, 2]
    loop = identify_loop(t, qd_cmd, q, PERIOD)
    assert loop.spread == pytest.approx(0.005, abs=0.001)  # 6 ms, one of which is the common mean's
    assert max(corner.delay for corner in loop.corners()) == pytest.approx(loop.delay + loop.spread)
    assert min(corner.delay for corner in loop.corners()) == pytest.approx(loop.delay - loop.spread)


def test_an_arm_that_does_something_else_cannot_be_separated():
    t, qd_cmd = commands(BRISK_PULSE)
    random = np.random.default_rng(0)
    q = reported(t, qd_cmd, 0.02, 0.01) + np.cumsum(random.normal(0.0, 2e-4, (len(t), 6)), axis=0)
    with pytest.raises(DriverError, match="cannot be separated"):
        identify_loop(t, qd_cmd, q, PERIOD)


def test_feedforward_with_lag_is_what_the_lag_undoes():
    """Sent through the lag, qd + lag qdd comes out as qd: the joint is where it should be."""
    lag, excite = 0.02, Excitation(np.zeros(6), 0.4)
    table = ReferenceTable(excite, recipe(0.0, lag), lead=0.1, settle=0.4)
    arm = DelayedArm(np.zeros(6), lag=lag)
    plain = DelayedArm(np.zeros(6), lag=lag)
    errors = []
    for k in range(260):
        t = k * PERIOD - 0.1
        wanted = excite.at(t)[0][0]
        errors.append((abs(arm.q[0] - wanted), abs(plain.q[0] - wanted)))
        arm.advance(table.at(t).qd_feedforward)
        plain.advance(excite.at(t + 0.5 * PERIOD)[1])
    ours, without = np.max(errors, axis=0)
    assert ours < 2e-5
    assert without > 20 * ours


def test_a_controller_that_makes_up_for_no_lag_is_ahead_by_the_whole_delay():
    """Also where dead time and lag are known apart, as learning needs them."""
    learns = recipe(0.03, lag=0.01)
    assert learns.ahead == (0.03, 0.01)
    plain = replace(learns, controller=replace(learns.controller, compensates_lag=False, uses_ilc=True))
    assert plain.ahead == pytest.approx((0.04, 0.0))
