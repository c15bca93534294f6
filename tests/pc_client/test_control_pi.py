"""The control law against arithmetic done by hand, its limits and its anti-windup."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pc_client.control.controller import CONTROLLERS
from pc_client.control.tracker import PiState, step_pi

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
