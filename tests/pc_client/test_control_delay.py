"""Identification of the loop delay: harmless excitation, sub-sample estimate, nonsense is refused."""

from __future__ import annotations

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.identification import BRISK_PULSE, DISPLACEMENT, PULSE, Excitation, estimate_delay
from pc_client.control.reference import ReferenceTable
from pc_client.errors import DriverError

Q0 = (0.4, -1.7, -2.1, -0.1, 1.3, 1.9)


def commands():
    """What the driver sends for the excitation, one row a cycle."""
    points = ReferenceTable(Excitation(Q0), period=PERIOD, lead=0.1, settle=0.3, lookahead=0.0)
    t = np.arange(190) * PERIOD
    return t, np.array([points.at(stamp - 0.1).qd_feedforward for stamp in t])


def reported(t, qd_cmd, delay):
    """Positions of an arm with any real delay: the integral of the held commands, shifted."""
    knots = np.append(t, t[-1] + PERIOD)
    displacement = np.vstack([np.zeros(6), np.cumsum(qd_cmd * PERIOD, axis=0)])
    return np.array(Q0) + np.stack(
        [np.interp(t - delay, knots, displacement[:, j]) for j in range(6)], axis=1
    )


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
    _, qd_cmd = commands()
    np.testing.assert_allclose(qd_cmd.sum(axis=0) * PERIOD, 0.0, atol=1e-12)


@settings(max_examples=20)
@given(delay=st.floats(0.003, 0.15), seed=st.integers(0, 99))
def test_estimate_is_sub_sample_under_encoder_noise_and_ripple(delay, seed):
    t, qd_cmd = commands()
    random = np.random.default_rng(seed)
    q = reported(t, qd_cmd, delay)
    q = q + random.normal(0.0, 2e-5, q.shape) + 1e-4 * np.sin(101 * q * 2)
    estimate = estimate_delay(t, qd_cmd, q, PERIOD)
    assert abs(estimate.delay - delay) < 1e-3
    assert estimate.residual < 0.05 * estimate.motion


@pytest.mark.parametrize(("cycles", "lag"), [(0, 0.0), (2, 0.0), (2, 0.010), (3, 0.020)])
def test_dead_time_and_lag_add_up(cycles, lag):
    t, qd_cmd = commands()
    arm = DelayedArm(Q0, cycles=cycles, lag=lag)
    q = []
    for row in qd_cmd:
        q.append(arm.q)
        arm.advance(row)
    estimate = estimate_delay(t, qd_cmd, np.array(q), PERIOD)
    assert estimate.delay == pytest.approx(cycles * PERIOD + lag, abs=1e-3)


def test_lost_frames_do_not_disturb():
    t, qd_cmd = commands()
    q = reported(t, qd_cmd, 0.031)
    keep = np.ones(len(t), bool)
    # the command before a lost frame stays in force for two cycles
    for k in (40, 71, 90):
        keep[k] = False
        qd_cmd[k] = qd_cmd[k - 1]
    q = reported(t, qd_cmd, 0.031)
    assert estimate_delay(t[keep], qd_cmd[keep], q[keep], PERIOD).delay == pytest.approx(0.031, abs=1e-3)


def test_an_arm_that_does_something_else_is_refused():
    t, qd_cmd = commands()
    with pytest.raises(DriverError, match="blocked"):
        estimate_delay(t, qd_cmd, np.tile(Q0, (len(t), 1)), PERIOD)


def test_a_stream_without_motion_is_refused():
    t, qd_cmd = commands()
    with pytest.raises(DriverError, match="no motion"):
        estimate_delay(t, 0 * qd_cmd, np.tile(Q0, (len(t), 1)), PERIOD)
