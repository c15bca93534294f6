"""Margins of the sampled loop: against the known bound, and against a loop that is run to its edge."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client.control.controller_config import CONTROLLERS
from pc_client.control.loop_model import LoopModel
from pc_client.control.pi_feedforward import PiState, step_pi
from pc_client.control.stability import gain_margin, loop_margins, sensitivity

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


@settings(max_examples=30, deadline=None)
@given(delay=st.floats(0.04, 0.1), gain=st.floats(1.0, 10.0))
def test_near_the_continuous_loop_for_long_delays(delay, gain):
    # the hold adds half a cycle, and the step in which a command shows another half
    ours = loop_margins(LoopModel(delay, 0.0, 0.0, 0.0), gain, 0.0, PERIOD)
    assert ours.gain == pytest.approx(gain_margin(gain, 0.0, delay + 0.5 * PERIOD), rel=0.05)


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
