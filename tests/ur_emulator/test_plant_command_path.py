"""The command path: its one matrix against the definition, its delay, its agreement with the targets."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from ur_emulator.motion.generators import JointTarget
from ur_emulator.plant.command_path import CommandPath, trace_cycle

N, DT = 4, 0.002
PERIOD = N * DT


LEAD, TRIM_GAIN = 0.03, 0.1


def advance(path, target, error=None):
    """A cycle of the path for a target (3, 6) of q, qd and deflection."""
    path.take(JointTarget(*map(tuple, target)))
    path.advance()
    path.keep(error)


def smooth(t):
    """Position, speed and no deflection of a smooth motion at time t, one row each, six joints."""
    phase = np.arange(6.0)
    return np.array([np.sin(2 * t + phase), 2 * np.cos(2 * t + phase), 0.0 * phase])


@pytest.mark.parametrize("damping", [None, 0.5])
@pytest.mark.parametrize("dead", [0, 1, 4, 5, 11, 6.3, [4.5, 9.25]])
def test_the_matrix_is_the_sub_step_definition(dead, damping):
    lag = 0.01
    path = CommandPath(N, DT, dead, lag, damping, LEAD, TRIM_GAIN)
    rng = np.random.default_rng(5)
    start = rng.standard_normal((3, 6))
    start[1] = 0.0
    turns = itertools.cycle(dead if isinstance(dead, list) else [dead])
    trim = rng.standard_normal(6)
    path.reset(start[0], start[2], start[0] + trim)
    knots = [start] * 6
    filtered = start if damping is None else np.vstack([start, np.zeros((3, 6))])
    for dead_substeps in itertools.islice(turns, 8):
        newest = rng.standard_normal((3, 6))
        knots = [newest, *knots[:5]]
        error = rng.standard_normal(6)
        advance(path, newest, error)
        assert path.trim == pytest.approx(trim, abs=1e-12)
        following = []
        for joint in range(6):
            old = np.array(knots)[:, :, joint]
            rows = trace_cycle(filtered[:, joint], old, N, DT, dead_substeps, lag, damping)
            control = rows[:-1, 0] + LEAD * rows[:-1, 1] + rows[:-1, 2] + trim[joint]
            assert path.control[:, joint] == pytest.approx(control, abs=1e-12)
            assert path.speeds[1:, joint] == pytest.approx([newest[1, joint], rows[-2, 1]], abs=1e-12)
            assert path.q_final[joint] == pytest.approx(rows[-1, 0], abs=1e-12)
            following.append(rows[-1])
        trim = trim + TRIM_GAIN * error
        filtered = np.array(following).T


@pytest.mark.parametrize(
    ("dead_substeps", "lag", "damping"),
    [(0, 0.0, None), (3, 0.0, None), (0, 0.01, None), (5, 0.014, None), (5, 0.014, 0.5), (2.5, 0.01, 1.2)],
)
def test_a_ramp_comes_late_by_dead_time_plus_lag(dead_substeps, lag, damping):
    path = CommandPath(N, DT, dead_substeps, lag, damping)
    speed = 0.7
    path.reset(np.zeros(6), np.zeros(6), np.zeros(6))
    for k in range(1, 60):
        advance(path, np.array([np.full(6, speed * k * PERIOD), np.full(6, speed), np.zeros(6)]))
    late = (speed * 59 * PERIOD - path.q_final[0]) / speed
    assert late == pytest.approx(dead_substeps * DT + lag, abs=1e-4)


def test_without_delay_the_set_point_follows_a_smooth_motion_between_targets():
    path = CommandPath(N, DT, 0, 0.0)
    path.reset(smooth(0.0)[0], smooth(0.0)[2], smooth(0.0)[0])
    advance(path, smooth(PERIOD))
    for k in range(2, 40):
        advance(path, smooth(k * PERIOD))
        for i in range(1, N):
            q, qd, _ = smooth((k - 1) * PERIOD + i * DT)
            assert path.control[i] == pytest.approx(q, abs=1e-9)
        assert path.speeds[2] == pytest.approx(qd, abs=1e-4)
        assert path.q_final == pytest.approx(smooth(k * PERIOD)[0], abs=1e-12)


def test_after_reset_it_stands_still():
    path = CommandPath(N, DT, 6, 0.01)
    q, deflection = np.arange(6.0), -np.arange(6.0)
    path.reset(np.ones(6), np.ones(6), np.ones(6))
    advance(path, smooth(1.0))
    path.reset(q, deflection, q)
    advance(path, np.array([q, np.zeros(6), deflection]))
    assert path.control == pytest.approx(np.tile(q + deflection, (N, 1)), abs=1e-12)
    assert path.speeds == pytest.approx(np.zeros((3, 6)), abs=1e-12)


@pytest.mark.parametrize(("dead_substeps", "later"), [(0, False), (3, False), (4, True), (8, True)])
def test_a_dead_time_of_a_cycle_keeps_a_target_out_of_its_own_cycle(dead_substeps, later):
    path = CommandPath(N, DT, dead_substeps, 0.01)
    assert path.newest_acts_later is later
    path.reset(np.zeros(6), np.zeros(6), np.zeros(6))
    advance(path, smooth(1.0))
    assert path.q_final.any() != later
