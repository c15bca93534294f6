"""The Kalman estimate: aligned with the loop, less noisy than the encoders, and no slower."""

from __future__ import annotations

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.excitation import BRISK_PULSE, Excitation
from pc_client.control.loop_model import LoopModel, lagged_way
from pc_client.control.reference import ReferenceTable
from pc_client.control.state_estimate import EstimatorGains, StateEstimator, identify_estimator, kalman_gains

SIGMA = 1.5e-5


def stream(dead_time, lag, disturbance=0.0, seed=0):
    """Commands and true positions for the excitation; the velocity may have a disturbance a cycle [rad/s]."""
    qd_cmd = ReferenceTable(
        Excitation((0.0,) * 6, BRISK_PULSE), period=PERIOD, lead=0.1, settle=0.5, lookahead=0.0
    ).commands()
    fine = 40
    knots = np.arange(len(qd_cmd) * fine + 1) * PERIOD / fine
    way, _ = lagged_way(knots, np.repeat(qd_cmd, fine, axis=0), lag)
    t = np.arange(len(qd_cmd)) * PERIOD
    q = np.stack([np.interp(t - dead_time, knots, way[:, j]) for j in range(6)], axis=1)
    moving = (t > 0.1) & (t < 0.6)
    pushes = np.random.default_rng(seed).normal(0.0, disturbance, q.shape) * moving[:, None]
    return qd_cmd, q + np.cumsum(pushes, axis=0) * PERIOD


@settings(max_examples=20)
@given(dead_time=st.floats(0.0, 0.05), lag=st.floats(0.0, 0.03))
def test_of_a_loop_that_it_knows_it_predicts_every_frame(dead_time, lag):
    qd_cmd, q = stream(dead_time, lag)
    estimator = StateEstimator(LoopModel(dead_time, lag, 0.0, 0.0), EstimatorGains(0.0, 0.0, SIGMA), PERIOD)
    estimator.update(q[0].tolist())
    for command, reported in zip(qd_cmd[:-1], q[1:], strict=True):
        estimator.sent(command.tolist())
        # gains of zero: prediction alone, from the first frame to the last
        assert estimator.update(reported.tolist()) == pytest.approx(reported.tolist(), abs=2e-5)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_gains_are_those_of_the_steady_filter(ratio):
    """The innovations of a filter that fits are white with the variance that it says."""
    keep, lag = np.exp(-PERIOD / 0.01), 0.01
    k_q, k_qd, variance = kalman_gains(ratio, keep, lag, PERIOD)
    assert 0.0 < k_q < 1.0
    assert k_qd > 0.0
    random = np.random.default_rng(3)
    true, estimate, surprises = np.zeros(2), np.zeros(2), []
    model = np.array([[1.0, lag * (1 - keep) / PERIOD], [0.0, keep]])
    for _ in range(20_000):
        push = ratio * random.normal()
        true = model @ true + np.array([0.5, 1.0]) * push
        estimate = model @ estimate
        surprises.append(true[0] + random.normal() - estimate[0])
        estimate += np.array([k_q, k_qd * PERIOD]) * surprises[-1]
    surprises = np.array(surprises[100:])
    assert np.var(surprises) == pytest.approx(variance, rel=0.05)
    assert abs(np.corrcoef(surprises[1:], surprises[:-1])[0, 1]) < 0.05


def test_stream_gives_the_encoders_noise_and_the_filter_lowers_it():
    loop = LoopModel(0.02, 0.01, 0.0, 0.0)
    qd_cmd, true = stream(0.02, 0.01, disturbance=1e-3)
    reported = true + np.random.default_rng(4).normal(0.0, SIGMA, true.shape)
    gains = identify_estimator(qd_cmd, reported, loop, PERIOD, 30)
    assert gains.encoder_sigma == pytest.approx(SIGMA, rel=0.2)
    estimator = StateEstimator(loop, gains, PERIOD)
    errors = []
    estimator.update(reported[0].tolist())
    for command, seen, real in zip(qd_cmd[:-1], reported[1:], true[1:], strict=True):
        estimator.sent(command.tolist())
        errors.append(np.array(estimator.update(seen.tolist())) - real)
    assert np.std(errors) < 0.8 * SIGMA


def test_lost_frames_are_bridged_with_the_command_in_force():
    loop = LoopModel(2 * PERIOD, 0.0, 0.0, 0.0)
    arm = DelayedArm(np.zeros(6), cycles=2)
    estimator = StateEstimator(loop, EstimatorGains(0.0, 0.0, SIGMA), PERIOD)
    estimator.update(arm.q.tolist())
    for k in range(40):
        command = [0.1 * np.sin(0.3 * k)] * 6
        estimator.sent(command)
        cycles = 3 if k == 20 else 1
        for _ in range(cycles):
            arm.advance(command)
        assert estimator.update(arm.q.tolist(), cycles) == pytest.approx(arm.q.tolist(), abs=1e-9)
