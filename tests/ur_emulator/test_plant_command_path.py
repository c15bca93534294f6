"""The command path: its one matrix against the definition, its delay, its agreement with the targets."""

from __future__ import annotations

import numpy as np
import pytest

from ur_emulator.motion.target import JointTarget
from ur_emulator.plant.command_path import CommandPath, trace_cycle

N, DT = 4, 0.002
PERIOD = N * DT


LEAD = 0.03


def advance(path, target):
    """A cycle of the path for a target (3, 6) of q, qd and tau."""
    path.take(JointTarget(*map(tuple, target)))
    path.advance()


def smooth(t):
    """Position, speed and a torque stand-in of a smooth motion at time t, one row each, six joints."""
    phase = np.arange(6.0)
    return np.array([np.sin(2 * t + phase), 2 * np.cos(2 * t + phase), np.sin(t + phase)])


@pytest.mark.parametrize("dead_substeps", [0, 1, 4, 5, 11])
def test_the_matrix_is_the_sub_step_definition(dead_substeps):
    lag = 0.01
    path = CommandPath(N, DT, dead_substeps, lag, LEAD)
    rng = np.random.default_rng(dead_substeps)
    start = rng.standard_normal((3, 6))
    start[1] = 0.0
    path.reset(start[0], start[2])
    path.trim[:] = trim = rng.standard_normal(6)
    knots = [start] * 6
    filtered = start
    for _ in range(8):
        newest = rng.standard_normal((3, 6))
        knots = [newest, *knots[:5]]
        advance(path, newest)
        for joint in range(6):
            rows = trace_cycle(filtered[:, joint], np.array(knots)[:, :, joint], N, DT, dead_substeps, lag)
            position = rows[:-1, 0] + LEAD * rows[:-1, 1] + trim[joint]
            assert path.position[:, joint] == pytest.approx(position, abs=1e-12)
            assert path.speeds[1:, joint] == pytest.approx([newest[1, joint], rows[-2, 1]], abs=1e-12)
            assert path.tau[:, joint] == pytest.approx(rows[:-1, 2], abs=1e-12)
            assert path.q_final[joint] == pytest.approx(rows[-1, 0], abs=1e-12)
        filtered = np.array(
            [
                [
                    trace_cycle(filtered[:, j], np.array(knots)[:, :, j], N, DT, dead_substeps, lag)[-1, s]
                    for j in range(6)
                ]
                for s in range(3)
            ]
        )


@pytest.mark.parametrize(("dead_substeps", "lag"), [(0, 0.0), (3, 0.0), (0, 0.01), (5, 0.014)])
def test_a_ramp_comes_late_by_dead_time_plus_lag(dead_substeps, lag):
    path = CommandPath(N, DT, dead_substeps, lag)
    speed = 0.7
    path.reset(np.zeros(6), np.zeros(6))
    for k in range(1, 60):
        advance(path, np.array([np.full(6, speed * k * PERIOD), np.full(6, speed), np.zeros(6)]))
    late = (speed * 59 * PERIOD - path.q_final[0]) / speed
    assert late == pytest.approx(dead_substeps * DT + lag, abs=1e-4)


def test_without_delay_the_set_point_follows_a_smooth_motion_between_targets():
    path = CommandPath(N, DT, 0, 0.0)
    path.reset(smooth(0.0)[0], smooth(0.0)[2])
    advance(path, smooth(PERIOD))
    for k in range(2, 40):
        advance(path, smooth(k * PERIOD))
        for i in range(1, N):
            q, qd, _ = smooth((k - 1) * PERIOD + i * DT)
            assert path.position[i] == pytest.approx(q, abs=1e-9)
        assert path.speeds[2] == pytest.approx(qd, abs=1e-4)
        assert path.q_final == pytest.approx(smooth(k * PERIOD)[0], abs=1e-12)


def test_after_reset_it_stands_still():
    path = CommandPath(N, DT, 6, 0.01)
    q, tau = np.arange(6.0), -np.arange(6.0)
    path.reset(np.ones(6), np.ones(6))
    advance(path, smooth(1.0))
    path.reset(q, tau)
    advance(path, np.array([q, np.zeros(6), tau]))
    assert path.position == pytest.approx(np.tile(q, (N, 1)), abs=1e-12)
    assert path.speeds == pytest.approx(np.zeros((3, 6)), abs=1e-12)
    assert path.tau == pytest.approx(np.tile(tau, (N, 1)), abs=1e-12)
