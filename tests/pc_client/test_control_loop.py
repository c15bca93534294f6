"""The control law by hand, the tracker, the margins of the sampled loop, and what theory says a delayed loop can reach."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm, Ramp, recipe
from hypothesis import assume, given
from hypothesis import strategies as st

from pc_client.control.controller import CONTROLLERS
from pc_client.control.loop import LEAST_GAIN_MARGIN, LoopModel, loop_margins, sensitivity, velocity_response
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import PiState, Tracker, step_pi
from pc_client.errors import DriverError
from pc_client.kinematics.model import robot_model
from pc_client.movements.lognormal import TwoSidedTiming
from pc_client.recording.rows import Phase

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


UR3 = robot_model("ur3")
CONFIG = CONTROLLERS["paper"]


class Line:
    """TCP reference along x."""

    def sample(self, t):
        return np.stack([t, 0 * t, 0 * t], axis=1), np.ones((len(t), 1)) * [1.0, 0.0, 0.0]


def table(reference, tcp=None, **options):
    return ReferenceTable(reference, recipe(**options), tcp)


def test_table_agrees_with_its_source_on_and_off_the_grid():
    reference = Ramp([1, 2, 3, 4, 5, 6], 1.0)
    points = table(reference, tcp=Line())
    for t in (-0.2, 0.0, 0.4, 0.40051, 0.999, 1.0, 1.2):
        q, qd = reference.at(round(t, 6))
        point = points.at(t)
        np.testing.assert_allclose(point.q, q)
        np.testing.assert_allclose(point.qd_array, qd)
        assert point.qd_feedforward.tolist() == list(qd)
        assert point.p[0] == pytest.approx(t, abs=1e-6)


def test_lookahead_feedforward_is_the_mean_velocity_of_the_shifted_cycle():
    points = table(Ramp([1.0] * 6, 1.0), lookahead=0.03)
    assert not points.at(-0.1).qd_feedforward.any()
    assert points.at(0.5).qd_feedforward == pytest.approx([1.0] * 6)
    # the cycle [t + 0.03, t + 0.038] holds 2 ms of motion
    assert points.at(-0.036).qd_feedforward == pytest.approx([2 / 8] * 6)
    assert points.at(0.964).qd_feedforward == pytest.approx([6 / 8] * 6)


def test_phases_follow_the_stamps_and_the_run_ends():
    tracker = Tracker(table(Ramp([0.0] * 6, 1.0)), CONFIG, UR3)
    steps = [tracker.step(100.0 + k * PERIOD, (0.0,) * 6) for k in range(200)]
    assert steps[0].t == pytest.approx(-0.2)
    assert steps[0].phase is Phase.SETTLE_BEFORE
    assert [s.phase for s in steps].count(Phase.SETTLE_BEFORE) == 25
    first = next(k for k, s in enumerate(steps) if s.phase is Phase.MOVEMENT)
    assert steps[first].t == pytest.approx(0.0, abs=1e-9)
    assert next(s for s in steps if s.finished).t == pytest.approx(1.304, abs=0.005)
    assert next(s for s in steps if s.finished).phase is Phase.SETTLE_AFTER


def test_observe_changes_nothing():
    tracker = Tracker(table(Ramp([0.5] * 6, 1.0)), CONFIG, UR3)
    q = np.zeros(6)
    for k in range(40):
        step = tracker.step(k * PERIOD, q.tolist())
    seen = tracker.observe(40 * PERIOD)
    assert seen.qd_cmd == step.qd_cmd
    assert seen.t == pytest.approx(step.t + PERIOD)
    assert seen.point.q[0] > step.point.q[0]


@pytest.mark.parametrize("wrong", [0.05, -0.05, float("nan")])
def test_off_the_path_the_run_ends(wrong):
    tracker = Tracker(table(Ramp([0.0] * 6, 1.0)), CONTROLLERS["preview"], UR3)
    with pytest.raises(DriverError, match="off its path"):
        tracker.step(1.0, (0.0, 0.0, wrong, 0.0, 0.0, 0.0))


def test_a_gap_in_the_stamps_does_not_jump_the_integral():
    config = replace(CONFIG, gain_i=10.0, integral_limit=10.0)
    tracker = Tracker(table(Ramp([0.0] * 6, 3.0)), config, UR3)
    off = (0.002,) * 6
    tracker.step(1.0, off)
    tracker.step(1.2, off)
    command = tracker.step(1.208, off).qd_cmd
    # P part plus at most 1 + 3 cycles of integral
    assert command[0] == pytest.approx(-0.002 * config.gain_p - 0.002 * 10.0 * 4 * PERIOD)


class Strokes:
    """Four isolated lognormal strokes of one joint, in one direction."""

    def __init__(self, window):
        self.duration = 4 * window
        self._t = np.arange(0.0, self.duration + 1e-4, 1e-4)
        lognormals = [TwoSidedTiming(k * window, window, 0.1).lognormal for k in range(4)]
        self._qd = sum(self._lognormal(b) for b in lognormals)
        self._q = np.concatenate([[0.0], np.cumsum(0.5 * (self._qd[1:] + self._qd[:-1]) * 1e-4)])

    def _lognormal(self, lognormal):
        age = np.maximum(self._t - lognormal.t0, 1e-9)
        z = (np.log(age) - lognormal.mu) / lognormal.sigma
        return 0.1 * np.exp(-0.5 * z * z) / (lognormal.sigma * np.sqrt(2 * np.pi) * age)

    def at(self, t):
        q = np.interp(t, self._t, self._q)
        qd = np.interp(t, self._t, self._qd, left=0.0, right=0.0)
        return np.full(6, q), np.full(6, qd)


def run_loop(reference, config, *, cycles, lag, lookahead=None):
    """Closed loop; returns the SNR in dB of the arm's velocity against the reference."""
    points = table(reference, lookahead=lookahead)
    tracker = Tracker(points, config, UR3)
    arm = DelayedArm(reference.at(0.0)[0], cycles=cycles, lag=lag)
    signal = noise = 0.0
    stamp = 0.0
    while not (step := tracker.step(stamp, arm.q.tolist())).finished:
        wanted = step.point.qd_array[0]
        signal += wanted**2
        noise += (arm.qd[0] - wanted) ** 2
        arm.advance(step.qd_cmd)
        stamp += PERIOD
    return 10 * np.log10(signal / noise)


# From an independent simulation of PI + feed-forward with 16 ms dead time, 10 ms lag and a zero-order hold:
# velocity at the end of a cycle trails by 30 ms, which is two cycles of pipe here.
@pytest.mark.parametrize(("gain", "window", "snr"), [(0.0, 1.0, 14.7), (10.0, 1.0, 15.0), (10.0, 2.0, 25.1)])
def test_paper_controller_reaches_what_theory_says(gain, window, snr):
    config = replace(CONFIG, gain_p=gain, gain_i=0.0, slew_limit=1e3)
    assert run_loop(Strokes(window), config, cycles=2, lag=0.010) == pytest.approx(snr, abs=2.0)


def test_preview_makes_a_delay_that_it_knows_harmless():
    config = CONTROLLERS["preview"]
    unaware = run_loop(Strokes(1.0), config, cycles=3, lag=0.010)
    # three cycles of pipe and the lag; the integral's convention counts the held command from its frame
    aware = run_loop(Strokes(1.0), config, cycles=3, lag=0.010, lookahead=3 * PERIOD + 0.010)
    assert aware > unaware + 15.0
    assert aware > 25.0


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
