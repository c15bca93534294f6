"""Dead time and lag apart: the sampled response, the identification, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.identification import BRISK_PULSE, Excitation, identify_loop
from pc_client.control.loop import LoopModel, frequency_response, lagged_displacement, velocity_response
from pc_client.control.reference import ReferenceTable
from pc_client.errors import DriverError

Q0 = np.array((0.4, -1.7, -2.1, -0.1, 1.3, 1.9))


def excitation():
    """Stamps and commands of the brisk excitation, one row a cycle."""
    points = ReferenceTable(
        Excitation(Q0, BRISK_PULSE), period=PERIOD, lead=0.1, settle=0.3, lookahead=0.0
    ).commands()
    return np.arange(len(points)) * PERIOD, points


def reported(t, qd_cmd, dead_time, lag):
    """Positions of an arm of any real dead time and lag: the continuous solution, sampled finely."""
    fine = 40
    knots = np.arange(len(t) * fine + 1) * PERIOD / fine
    displacement, _ = lagged_displacement(knots, np.repeat(qd_cmd, fine, axis=0), lag)
    return Q0 + np.stack([np.interp(t - dead_time, knots, displacement[:, j]) for j in range(6)], axis=1)


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
    t, qd_cmd = excitation()
    random = np.random.default_rng(seed)
    q = reported(t, qd_cmd, dead_time, lag)
    q = q + 1e-4 * np.sin(101 * q + random.uniform(0, 6, 6)) + random.normal(0.0, 1.5e-5, q.shape)
    loop = identify_loop(t, qd_cmd, q, PERIOD)
    assert loop.dead_time == pytest.approx(dead_time, abs=2e-3)
    assert loop.lag == pytest.approx(lag, abs=2e-3)
    assert loop.delay == pytest.approx(dead_time + lag, abs=0.5e-3)
    assert loop.spread < 1e-3


def test_a_joint_that_is_later_shows_in_the_spread():
    t, qd_cmd = excitation()
    q = reported(t, qd_cmd, 0.02, 0.01)
    q[:, 2] = reported(t, qd_cmd, 0.026, 0.01)[:, 2]
    loop = identify_loop(t, qd_cmd, q, PERIOD)
    assert loop.spread == pytest.approx(0.005, abs=0.001)  # 6 ms, one of which is the common mean's
    assert max(corner.delay for corner in loop.corners()) == pytest.approx(loop.delay + loop.spread)
    assert min(corner.delay for corner in loop.corners()) == pytest.approx(loop.delay - loop.spread)


def test_an_arm_that_does_something_else_is_refused():
    t, qd_cmd = excitation()
    random = np.random.default_rng(0)
    q = reported(t, qd_cmd, 0.02, 0.01) + np.cumsum(random.normal(0.0, 2e-4, (len(t), 6)), axis=0)
    with pytest.raises(DriverError, match="cannot be separated"):
        identify_loop(t, qd_cmd, q, PERIOD)


def test_feedforward_with_lag_is_what_the_lag_undoes():
    """Sent through the lag, qd + lag qdd comes out as qd: the joint is where it should be."""
    lag, excite = 0.02, Excitation(np.zeros(6), 0.4)
    table = ReferenceTable(excite, period=PERIOD, lead=0.1, settle=0.4, lookahead=0.0, lag=lag)
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
