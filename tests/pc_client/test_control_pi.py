"""The control law against arithmetic done by hand, its limits and its anti-windup; gain margins."""

from __future__ import annotations

import math
from dataclasses import replace
from math import isclose, pi

import numpy as np
import pytest
from control_loop import DelayedArm

from pc_client.control.controller_config import CONTROLLERS
from pc_client.control.pi_feedforward import PiState, step_pi
from pc_client.control.stability import gain_margin, largest_gain

PLAIN = replace(
    CONTROLLERS["paper"], gain_p=10.0, gain_i=5.0, slew_limit=1e9, integral_limit=1.0, speed_share=1.0
)
WIDE = (100.0,) * 6
ZERO = (0.0,) * 6


def test_proportional_integral_and_feedforward_add_up_as_by_hand():
    state = PiState()
    q_ref = (0.1, -0.1, 0.0, 0.0, 0.0, 0.02)
    feedforward = (0.5, 0.0, 0.0, -0.2, 0.0, 0.0)
    first = step_pi(PLAIN, WIDE, state, q_ref, feedforward, ZERO, 0.008)
    assert first == pytest.approx([1.5, -1.0, 0.0, -0.2, 0.0, 0.2])
    # the integral acts from the next step on: gain_i * e * dt
    second = step_pi(PLAIN, WIDE, state, q_ref, feedforward, ZERO, 0.008)
    assert second == pytest.approx([1.504, -1.004, 0.0, -0.2, 0.0, 0.2008])
    assert state.qd_cmd is second


def test_commands_keep_the_speed_limit():
    limits = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    command = step_pi(PLAIN, limits, PiState(), (9.0, -9.0) * 3, ZERO, ZERO, 0.008)
    assert command == [1.0, -2.0, 3.0, -4.0, 5.0, -6.0]


def test_commands_keep_the_slew_limit():
    config = replace(PLAIN, slew_limit=15.0)
    state = PiState()
    command = step_pi(config, WIDE, state, (1.0,) * 6, ZERO, ZERO, 0.008)
    assert command == pytest.approx([0.12] * 6)
    command = step_pi(config, WIDE, state, (-1.0,) * 6, ZERO, ZERO, 0.008)
    assert command == pytest.approx([0.0] * 6)


def test_integral_does_not_wind_up_while_a_limit_cuts():
    state = PiState()
    for _ in range(500):
        step_pi(PLAIN, (0.1,) * 6, state, (1.0,) * 6, ZERO, ZERO, 0.008)
    assert state.integral == [0.0] * 6
    # and it may shrink while the limit cuts
    state.integral = [0.5] * 6
    step_pi(PLAIN, (0.1,) * 6, state, (-0.01,) * 6, ZERO, ZERO, 0.008)
    assert all(value < 0.5 for value in state.integral)


def test_integral_is_bounded():
    config = replace(PLAIN, integral_limit=0.02)
    state = PiState()
    for _ in range(500):
        step_pi(config, WIDE, state, (0.1, -0.1) * 3, ZERO, ZERO, 0.008)
    assert state.integral == pytest.approx([0.02, -0.02] * 3)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_controller_has_margin_for_the_slowest_loop_it_is_meant_for(name):
    config = CONTROLLERS[name]
    assert config.name == name
    # 45 ms is the bad end of what UR users report for a CB3.
    assert config.gain_p < largest_gain(0.045) / 2
    assert gain_margin(config.gain_p, config.gain_i, 0.045) > 2.0
    assert config.gain_i <= config.gain_p**2 / 8


def test_margin_without_integral_is_the_known_bound():
    assert isclose(gain_margin(10.0, 0.0, 0.03), pi / (2 * 0.03) / 10.0, rel_tol=1e-9)


def test_integral_part_costs_margin_and_can_cost_all():
    assert gain_margin(10.0, 20.0, 0.03) < gain_margin(10.0, 0.0, 0.03)
    assert gain_margin(1.0, 50.0, 0.03) == 0.0
    assert gain_margin(0.0, 1.0, 0.03) == 0.0
    assert gain_margin(0.0, 0.0, 0.03) == math.inf


def _last_error(factor):
    """Closed loop on 4 cycles of delay plus half a cycle of hold: error 12 s after a step of 1 mrad."""
    delay = 4 * 0.008 + 0.004
    config = replace(PLAIN, gain_p=factor * largest_gain(delay), gain_i=0.0)
    arm, state = DelayedArm([0.0] * 6, cycles=4), PiState()
    errors = []
    for _ in range(1500):
        arm.advance(step_pi(config, WIDE, state, (1e-3,) * 6, ZERO, arm.q.tolist(), 0.008))
        errors.append(abs(1e-3 - arm.q[0]))
    return max(errors[-100:])


def test_bound_tells_stable_from_unstable():
    assert _last_error(0.9) < 1e-4
    assert _last_error(1.1) > 1e-2
    assert not np.isnan(_last_error(1.1))
