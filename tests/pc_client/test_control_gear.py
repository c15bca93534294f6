"""Waves of the gears: found from runs whatever the movement, undone in advance, nonsense is left out."""

from __future__ import annotations

import numpy as np
import pytest
from control_loop import PERIOD

from pc_client.control.gear import LARGEST_SLOPE, ORDERS, GearModel, GearObserver, MotorReference, find_waves
from pc_client.control.identification import Excitation
from pc_client.control.loop import LoopModel, velocity_response

LOOP = LoopModel(0.022, 0.010, 0.0, 0.0)
TURNS = np.array([101.0, 80.0, 120.0, 50.0, 101.0, 160.0])  # of each motor in a turn of its joint


def true_gear(seed=0, size=1.2e-4):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, 6))
    sizes = np.array([[size], [0.35 * size]]) * 101.0 / TURNS
    return GearModel(np.array([TURNS, 2 * TURNS]), sizes * np.cos(phases), sizes * np.sin(phases))


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


def test_runs_show_the_orders_and_the_waves_and_more_runs_show_them_better():
    gear, observer = true_gear(), GearObserver(LOOP, PERIOD)
    assert observer.model() is None
    left = []
    for seed in range(6):
        observer.take(*run(gear, seed))
        found = observer.model()
        q = np.random.default_rng(0).uniform(-1, 1, (500, 6))
        left.append(np.std([found.error(x)[0] - gear.error(x)[0] for x in q]))
    assert {tuple(sorted(joint)) for joint in found.orders.T} == {(turns, 2 * turns) for turns in TURNS}
    assert found.n_waves == 12
    assert left[-1] < 0.1 * np.std([gear.error(x)[0] for x in q])
    assert left[-1] < left[0]


def test_an_order_is_the_same_in_every_turn():
    assert ORDERS.dtype.kind == "i"
    gear, q = true_gear(), np.linspace(-1, 1, 6)
    np.testing.assert_allclose(gear.error(q + 2 * np.pi)[0], gear.error(q)[0], atol=1e-15)


@pytest.mark.parametrize("noise", [0.0, 1.5e-5])
def test_without_gears_no_wave_is_believed(noise):
    observer = GearObserver(LOOP, PERIOD)
    for seed in range(5):
        observer.take(*run(true_gear(size=0.0), seed, noise=noise))
        assert observer.model() is None


def test_an_order_that_a_short_range_leaves_open_is_not_believed():
    # One wave of order 80 passes: it is seen, but a gear of order 75 would fit as well.
    t = np.linspace(0, 1, 400)
    motor = 0.04 * (1 - np.cos(2 * np.pi * t))
    noise = np.random.default_rng(1).normal(0.0, 1.5e-5, len(t))
    q = motor + 1.2e-4 * np.sin(80 * motor) + noise
    assert find_waves(q[:-1], q[1:], np.diff(q - motor)) == []
    far = 1.2 * (1 - np.cos(2 * np.pi * t))
    q = far + 1.2e-4 * np.sin(80 * far) + noise
    (wave,) = find_waves(q[:-1], q[1:], np.diff(q - far))
    assert wave.order == 80
    assert wave.sine == pytest.approx(1.2e-4, rel=0.1)


def test_a_joint_that_stands_still_says_nothing():
    observer = GearObserver(LOOP, PERIOD)
    for seed in range(3):
        qd_cmd, q = run(true_gear(), seed)
        qd_cmd[:, 3] = 0.0
        q[:, 3] = 0.5
        observer.take(qd_cmd, q)
    found = observer.model()
    assert found is not None
    assert not found.orders[:, 3].any()
    assert found.orders[0].astype(bool).tolist() == [True, True, True, False, True, True]


def test_a_wave_too_large_for_a_gear_is_left_out():
    observer = GearObserver(LOOP, PERIOD)
    gear = true_gear(size=1.5 * LARGEST_SLOPE / 101.0)
    for seed in range(4):
        observer.take(*run(gear, seed))
    found = observer.model()
    assert found is not None  # the second waves are smaller
    assert not (found.orders == TURNS).any()


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
