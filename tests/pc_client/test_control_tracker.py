"""The tracker: phases, commands, aborts; and what the theory says a delayed loop can reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_loop import PERIOD, DelayedArm, Ramp

from pc_client.control.controller import CONTROLLERS
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import Tracker
from pc_client.errors import DriverError
from pc_client.kinematics.model import robot_model
from pc_client.movements.lognormal import TwoSidedTiming
from pc_client.recording.rows import Phase

UR3 = robot_model("ur3")
CONFIG = CONTROLLERS["paper"]


class Line:
    """TCP reference along x."""

    def sample(self, t):
        return np.stack([t, 0 * t, 0 * t], axis=1), np.ones((len(t), 1)) * [1.0, 0.0, 0.0]


def table(reference, **options):
    return ReferenceTable(reference, period=PERIOD, lead=0.2, settle=0.3, **options)


def test_table_agrees_with_its_source_on_and_off_the_grid():
    reference = Ramp([1, 2, 3, 4, 5, 6], 1.0)
    points = table(reference, tcp=Line())
    for t in (-0.2, 0.0, 0.4, 0.40051, 0.999, 1.0, 1.2):
        q, qd = reference.at(round(t, 6))
        point = points.at(t)
        np.testing.assert_allclose(point.q, q)
        np.testing.assert_allclose(point.qd_array, qd)
        assert point.qd_feedforward == tuple(qd)
        assert point.p[0] == pytest.approx(t, abs=1e-6)


def test_lookahead_feedforward_is_the_mean_velocity_of_the_shifted_cycle():
    points = table(Ramp([1.0] * 6, 1.0), lookahead=0.03)
    assert points.at(-0.1).qd_feedforward == (0.0,) * 6
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
