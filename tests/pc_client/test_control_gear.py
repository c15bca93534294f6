"""Waves of the gears: found from runs whatever the movement, undone in advance, nonsense is left out."""

from __future__ import annotations

import numpy as np
import pytest
from control_loop import PERIOD

from pc_client.control.excitation import Excitation
from pc_client.control.gear import GEAR_RATIO, LARGEST_SLOPE, GearModel, GearObserver, MotorReference
from pc_client.control.loop_model import LoopModel, velocity_response

LOOP = LoopModel(0.022, 0.010, 0.0, 0.0)


def true_gear(seed=0, size=1.2e-4):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, 6))
    sizes = np.array([[size], [0.35 * size]])
    return GearModel(sizes * np.cos(phases), sizes * np.sin(phases))


def run(gear, seed, n=900, noise=1.5e-5):
    """Commands of some smooth movement and what six joints with these gears report."""
    random = np.random.default_rng(seed)
    t = np.arange(n) * PERIOD
    window = np.clip(np.minimum(t, t[-1] - t) / 0.5, 0, 1)
    rates = random.uniform(0.1, 0.35, 6)
    qd_cmd = window[:, None] * 0.5 * np.sin(2 * np.pi * rates * t[:, None] + random.uniform(0, 6, 6))
    response = velocity_response(LOOP, PERIOD) * PERIOD
    motor = np.stack([np.cumsum(np.convolve(qd_cmd[:, j], response)[:n]) for j in range(6)], axis=1)
    motor += random.uniform(-2, 2, 6)
    q = np.array([m + gear.error(m)[0] for m in motor])
    return qd_cmd, q + random.normal(0.0, noise, q.shape)


def test_slope_is_the_derivative():
    gear = true_gear()
    q = np.linspace(-1, 1, 6)
    above, below = (gear.error(q + h)[0] for h in (1e-6, -1e-6))
    np.testing.assert_allclose(gear.error(q)[1], (above - below) / 2e-6, rtol=1e-4, atol=1e-7)


def test_a_run_shows_the_waves_and_more_runs_show_them_better():
    gear, observer = true_gear(), GearObserver(LOOP, PERIOD)
    assert observer.model() is None
    left = []
    for seed in range(4):
        observer.take(*run(gear, seed))
        found = observer.model()
        assert found is not None
        assert found.n_waves == 12
        missing = np.hypot(found.sines - gear.sines, found.cosines - gear.cosines)
        left.append(float(np.sqrt(np.mean(missing**2))))
    assert left[0] < 0.1 * 1.2e-4
    assert left[3] < 0.7 * left[0]


def test_turns_do_not_matter():
    gear = true_gear()
    q = np.linspace(-1, 1, 6)
    np.testing.assert_allclose(gear.error(q + 2 * np.pi)[0], gear.error(q)[0], atol=1e-15)
    assert int(GEAR_RATIO) == GEAR_RATIO


def test_without_gears_hardly_any_wave_is_believed():
    observer = GearObserver(LOOP, PERIOD)
    for seed in range(3):
        observer.take(*run(true_gear(size=0.0), seed))
    found = observer.model()
    assert found is None or found.n_waves <= 1


def test_a_joint_that_stands_still_says_nothing():
    qd_cmd, q = run(true_gear(), 5)
    qd_cmd[:, 3] = 0.0
    q[:, 3] = q[0, 3]
    observer = GearObserver(LOOP, PERIOD)
    observer.take(qd_cmd, q)
    found = observer.model()
    assert found is not None
    assert not found.sines[:, 3].any()
    assert found.n_waves == 10


def test_a_wave_too_large_for_a_gear_is_left_out():
    size = 1.5 * LARGEST_SLOPE / GEAR_RATIO
    observer = GearObserver(LOOP, PERIOD)
    observer.take(*run(true_gear(size=size), 6))
    found = observer.model()
    assert found is None or not found.sines[0].any()


def test_motors_that_are_sent_against_the_waves_leave_the_joints_on_their_reference():
    gear, joints = true_gear(), Excitation((0.3, -1.0, 1.2, 0.1, 0.5, -0.7))
    motors = MotorReference(joints, gear)
    assert motors.duration == joints.duration
    for t in np.linspace(0.01, joints.duration - 0.01, 50):
        q, qd = (np.asarray(x) for x in joints.at(t))
        motor, motor_qd = motors.at(t)
        error, slope = gear.error(motor)
        # left is e of e, a hundredth of the wave
        np.testing.assert_allclose(motor + error, q, atol=3e-6)
        np.testing.assert_allclose(motor_qd * (1 + slope), qd, atol=1e-3)
        later = motors.at(t + 1e-6)[0]
        np.testing.assert_allclose((later - motor) / 1e-6, motor_qd, atol=1e-4)
    assert np.abs(np.asarray(motors.at(0.1)[0]) - np.asarray(joints.at(0.1)[0])).max() > 5e-5


@pytest.mark.parametrize("q", [np.zeros(6), np.linspace(-3, 3, 6)])
def test_size_of_the_waves(q):
    error, slope = true_gear().error(q)
    assert np.abs(error).max() <= 1.35 * 1.2e-4 + 1e-12
    assert np.abs(slope).max() <= LARGEST_SLOPE
