"""Margins of the sampled loop: against its poles, the known bound, and a loop that is run to its edge."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq

from pc_client.control.controller import CONTROLLERS
from pc_client.control.loop import LEAST_GAIN_MARGIN, LoopModel, loop_margins, sensitivity, velocity_response
from pc_client.control.tracker import PiState, step_pi

BEST = CONTROLLERS["best"]


def last_error(config, cycles, lag, t_end=12.0):
    """Closed loop after a step of 1 mrad: the largest error of the last second."""
    arm, state = DelayedArm([0.0] * 6, cycles=cycles, lag=lag), PiState()
    errors = []
    for _ in range(round(t_end / PERIOD)):
        arm.advance(step_pi(config, (1e9,) * 6, state, (1e-3,) * 6, (0.0,) * 6, arm.q.tolist(), PERIOD))
        errors.append(abs(1e-3 - arm.q[0]))
    return max(errors[-125:])


@pytest.mark.parametrize(("cycles", "lag"), [(3, 0.0), (3, 0.010), (1, 0.03), (5, 0.015)])
@pytest.mark.parametrize(("gain_p", "gain_i"), [(5.0, 3.0), (8.0, 0.0)])
def test_gain_margin_is_where_the_loop_begins_to_oscillate(cycles, lag, gain_p, gain_i):
    margins = loop_margins(LoopModel(cycles * PERIOD, lag, 0.0, 0.0), gain_p, gain_i, PERIOD)
    config = replace(BEST, slew_limit=1e9, integral_limit=1e9)
    inside, outside = (
        replace(config, gain_p=f * margins.gain * gain_p, gain_i=f * margins.gain * gain_i)
        for f in (0.93, 1.07)
    )
    assert last_error(inside, cycles, lag) < 1e-4
    assert last_error(outside, cycles, lag) > 1e-2


def test_delay_margin_is_the_delay_that_the_loop_still_bears():
    loop = LoopModel(3 * PERIOD, 0.01, 0.0, 0.0)
    margins = loop_margins(loop, 12.0, 5.0, PERIOD)
    config = replace(BEST, gain_p=12.0, gain_i=5.0, slew_limit=1e9, integral_limit=1e9)
    more = margins.delay / PERIOD
    assert last_error(config, 3 + math.floor(0.9 * more), 0.01) < 1e-4
    assert last_error(config, 3 + math.ceil(1.1 * more), 0.01) > 1e-2


def continuous_gain_margin(gain_p, gain_i, delay):
    """Of L(s) = (gain_p + gain_i / s) / s exp(-s delay), by its phase: atan(w gain_p / gain_i) = w delay."""
    w = brentq(
        lambda w: math.atan2(w * gain_p, gain_i) - w * delay, 1e-3 / delay, 0.5 * math.pi / delay + 1e-9
    )
    return w * w / math.hypot(gain_p * w, gain_i)


@given(delay=st.floats(0.04, 0.1), gain_p=st.floats(1.0, 10.0), gain_i=st.floats(0.0, 10.0))
def test_near_the_continuous_loop_for_long_delays(delay, gain_p, gain_i):
    assume(gain_i * delay < 0.5 * gain_p)
    # the hold adds half a cycle, and the step in which a command shows another half
    ours = loop_margins(LoopModel.of_delay(delay, 0.0), gain_p, gain_i, PERIOD)
    theirs = continuous_gain_margin(gain_p, gain_i, delay + 0.5 * PERIOD)
    assert ours.gain == pytest.approx(theirs, rel=0.05)


def largest_pole(loop, gain_p, gain_i):
    """Of 1 + L = 0, as a polynomial in 1 / z; below 1 the loop is stable."""
    response = velocity_response(loop, PERIOD)
    if gain_i == 0.0:  # a single integrator
        open_loop, integrators = gain_p * PERIOD * response, [1.0, -1.0]
    else:
        controller = [gain_p, gain_i * PERIOD - gain_p]
        open_loop, integrators = PERIOD * np.convolve(controller, response), [1.0, -2.0, 1.0]
    open_loop[: len(integrators)] += integrators
    return np.abs(np.roots(open_loop)).max()


loops = st.builds(
    LoopModel,
    st.floats(0.0, 0.2) | st.integers(0, 20).map(lambda cycles: cycles * PERIOD),
    st.just(0.0) | st.floats(0.001, 0.06),
    st.just(0.0),
    st.just(0.0),
)
gains_p = st.just(0.0) | st.floats(-2.0, 2.5).map(lambda x: 10.0**x)
gains_i = st.just(0.0) | st.floats(-2.0, 4.0).map(lambda x: 10.0**x)


@given(loop=loops, gain_p=gains_p, gain_i=gains_i)
def test_the_gain_margin_is_above_one_exactly_when_all_poles_are_inside(loop, gain_p, gain_i):
    assume(gain_p > 0.0 or gain_i > 0.0)
    margins = loop_margins(loop, gain_p, gain_i, PERIOD)
    assert 0.0 <= margins.gain < math.inf
    if abs(margins.gain - 1.0) > 1e-3:
        assert (margins.gain > 1.0) == (largest_pole(loop, gain_p, gain_i) < 1.0)
        assert (margins.gain > 1.0) == (margins.phase_deg > 0.0) == (margins.delay > 0.0)
    assert (margins.gain > 1.0) == (margins.peak < math.inf)


@given(loop=loops, gain_p=gains_p, gain_i=gains_i)
def test_gains_that_grow_by_the_margin_put_a_pole_on_the_unit_circle(loop, gain_p, gain_i):
    assume(gain_p > 0.0 or gain_i > 0.0)
    margin = loop_margins(loop, gain_p, gain_i, PERIOD).gain
    if margin == 0.0:  # too much integral part: no pair of this ratio is stable
        assert largest_pole(loop, 0.01 * gain_p, 0.01 * gain_i) > 1.0
    else:
        assert largest_pole(loop, 0.99 * margin * gain_p, 0.99 * margin * gain_i) < 1.0
        assert largest_pole(loop, 1.01 * margin * gain_p, 1.01 * margin * gain_i) > 1.0


def test_peak_is_the_largest_amplification():
    loop = LoopModel(0.03, 0.01, 0.0, 0.0)
    margins = loop_margins(loop, 10.0, 5.0, PERIOD)
    hertz = np.geomspace(0.01, 62.0, 3000)
    assert np.abs(sensitivity(loop, 10.0, 5.0, PERIOD, hertz)).max() == pytest.approx(margins.peak, rel=1e-3)
    assert 1.0 < margins.peak < 3.0
    assert margins.peak >= 1.0 / (1.0 - 1.0 / margins.gain) - 1e-3


def test_without_feedback_there_is_no_bound():
    margins = loop_margins(LoopModel(0.03, 0.01, 0.0, 0.0), 0.0, 0.0, PERIOD)
    assert margins == type(margins)(math.inf, math.inf, math.inf, 1.0)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_has_room_on_a_slow_loop(name):
    config = CONTROLLERS[name]
    margins = loop_margins(LoopModel(0.035, 0.015, 0.0, 0.0), config.gain_p, config.gain_i, PERIOD)
    assert margins.gain > 4.0
    assert margins.phase_deg > 55.0
    assert margins.delay > 0.1


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_is_accepted_on_the_slowest_loop_it_is_meant_for(name):
    config = CONTROLLERS[name]
    # 45 ms is the bad end of what UR users report for a CB3.
    margins = loop_margins(LoopModel.of_delay(0.045, 0.0), config.gain_p, config.gain_i, PERIOD)
    assert margins.gain > 2.0 * LEAST_GAIN_MARGIN
    assert config.gain_i <= config.gain_p**2 / 8  # the integral does not overshoot
