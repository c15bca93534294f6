"""The plant's parts by themselves: inverse dynamics, friction, gear, force drift, temperatures.

The command path is held against its definition: its one matrix, its delay, its agreement with the targets.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plant_support import dh_frames

from ur_emulator.machine.models.calibration import draw_dh
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.fidelity import IDEAL, TYPICAL
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.command_path import CommandPath, trace_cycle
from ur_emulator.machine.plant.drives import ServoGains
from ur_emulator.machine.plant.feedback import GearRipple
from ur_emulator.machine.plant.friction import Friction
from ur_emulator.machine.plant.inverse_dynamics import InverseDynamics
from ur_emulator.machine.plant.sensors import ForceDrift
from ur_emulator.machine.plant.thermometers import Thermometers

Q = np.array([0.4, -1.3, 1.1, -0.6, 0.9, 2.0])
STILL = np.zeros(6)


def potential_energy(rows, q):
    frames = dh_frames(rows, q)
    heights = [(frame @ (*link.com, 1.0))[2] for frame, link in zip(frames, UR3.links, strict=True)]
    return CB3.gravity * sum(link.mass * z for link, z in zip(UR3.links, heights, strict=True))


def kinetic_energy(rows, q, qd, h=1e-5):
    """From differences of the frames: masses, tensors and rotors."""
    before, after = dh_frames(rows, q - h * qd), dh_frames(rows, q + h * qd)
    energy = 0.5 * np.dot(UR3.armature, qd**2)
    for one, two, link in zip(before, after, UR3.links, strict=True):
        com = np.array([*link.com, 1.0])
        velocity = ((two - one) @ com)[:3] / (2 * h)
        spin = two[:3, :3].T @ (two - one)[:3, :3] / (2 * h)  # skew matrix of the spin in link axes
        omega = np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2
        energy += 0.5 * link.mass * velocity @ velocity + 0.5 * np.dot(link.inertia, omega**2)
    return energy


@pytest.mark.parametrize("rows", [UR3.dh, draw_dh(UR3, TYPICAL, 3)], ids=["nominal", "calibrated"])
def test_gravity_torque_is_the_slope_of_potential_energy(rows):
    torque = InverseDynamics(UR3, rows).evaluate(Q, STILL, STILL)
    h = 1e-6
    slope = [
        (potential_energy(rows, Q + h * e) - potential_energy(rows, Q - h * e)) / (2 * h) for e in np.eye(6)
    ]
    assert torque == pytest.approx(slope, abs=1e-6)


def test_power_of_the_torque_is_the_change_of_energy():
    dynamics = InverseDynamics(replace(UR3, has_point_masses=False), UR3.dh)
    rng = np.random.default_rng(0)
    h = 1e-5
    for _ in range(10):
        q, qd, qdd = rng.uniform(-2, 2, (3, 6))

        def energy(t, q=q, qd=qd, qdd=qdd):
            where, speed = q + qd * t + 0.5 * qdd * t * t, qd + qdd * t
            return kinetic_energy(UR3.dh, where, speed) + potential_energy(UR3.dh, where)

        power = np.dot(dynamics.evaluate(q, qd, qdd), qd)
        assert power == pytest.approx((energy(h) - energy(-h)) / (2 * h), abs=2e-4)


def test_a_declared_payload_is_in_the_model():
    dynamics = InverseDynamics(UR3, UR3.dh)
    alone = dynamics.evaluate(Q, STILL, STILL).copy()
    dynamics.set_payload(2.0, (0.0, 0.0, 0.1))
    loaded = dynamics.evaluate(Q, STILL, STILL).copy()
    h = 1e-6

    def height(q):
        return (dh_frames(UR3.dh, q)[5] @ (0.0, 0.0, 0.1, 1.0))[2]

    slope = [2.0 * CB3.gravity * (height(Q + h * e) - height(Q - h * e)) / (2 * h) for e in np.eye(6)]
    assert loaded - alone == pytest.approx(slope, abs=1e-6)
    dynamics.set_payload(0.0, (0.0, 0.0, 0.0))
    assert dynamics.evaluate(Q, STILL, STILL) == pytest.approx(alone, abs=1e-12)


def test_an_ideal_controller_knows_its_friction():
    friction = Friction(UR3, IDEAL, 0)
    friction.evaluate(np.array([STILL, STILL, STILL]))
    assert friction.coulomb == pytest.approx(UR3.coulomb)
    assert friction.compensation == pytest.approx(STILL)
    friction.evaluate(np.array([np.ones(6), np.ones(6), -np.ones(6)]))
    # Half of the speed is below the kink.
    full = np.array(UR3.coulomb) + np.add(UR3.viscous, UR3.viscous_fast) / 2
    assert friction.coulomb == pytest.approx(full - UR3.viscous_fast)
    assert friction.expected == pytest.approx(full, rel=1e-4)
    assert friction.compensation == pytest.approx(-full, rel=1e-4)


def test_a_typical_controller_is_wrong_about_friction_as_much_as_stated():
    errors = []
    for seed in range(60):
        friction = Friction(UR3, TYPICAL, seed)
        friction.evaluate(np.array([STILL, np.full(6, 0.4), STILL]))
        errors.append(friction.expected / (np.array(UR3.coulomb) + 0.4 * np.array(UR3.viscous)) - 1)
    assert abs(np.mean(errors)) < 0.03
    assert 0.09 < np.std(errors) < 0.17


def test_gear_slope_is_the_derivative_of_its_error():
    gear = GearRipple(UR3, TYPICAL, 9)
    h = 1e-7
    gear.evaluate(Q)
    slope = gear.slope.copy()
    gear.evaluate(Q + h)
    after = gear.error.copy()
    gear.evaluate(Q - h)
    assert slope == pytest.approx((after - gear.error) / (2 * h), abs=1e-6)


def test_gear_inverts_exactly():
    gear = GearRipple(UR3, TYPICAL, 9)
    motor = gear.motor_position(Q)
    gear.evaluate(motor)
    assert motor + gear.error == pytest.approx(Q, abs=1e-15)
    assert np.abs(motor - Q).max() > 1e-6


def test_gear_phases_come_from_the_seed_and_sizes_do_not():
    q = np.linspace(0, 2 * np.pi, 5000)
    tables = []
    for seed in (1, 2):
        gear = GearRipple(UR3, TYPICAL, seed)
        rows = []
        for angle in q:
            gear.evaluate(np.full(6, angle))
            rows.append(gear.slope.copy())
        tables.append(np.array(rows))
    expected = [
        math.hypot(*(ripple.rms for ripple in TYPICAL.ripples if joint in ripple.joints))
        for joint in range(6)
    ]
    for table in tables:
        assert table.std(axis=0) == pytest.approx(expected, rel=0.01)
    assert np.abs(tables[0] - tables[1]).max() > max(expected)


def test_force_drift_is_a_line_without_a_bound():
    """A real UR10e: -10 N in 1,800 s, along a line."""
    (typical,) = (it for it in E_SERIES.fidelities if it.name == "typical")
    ends = []
    for seed in range(100):
        drift = ForceDrift(typical, seed, 15.0)
        blocks = np.concatenate([drift.next_block(4) for _ in range(30)])
        times = np.arange(len(blocks))[:, None]
        assert blocks - blocks[0] == pytest.approx((blocks[1] - blocks[0]) * times, abs=1e-9)
        ends.append(blocks[-1, :3] - blocks[0, :3])
        assert np.abs(blocks[0, :3]).max() <= typical.force_offset
    assert np.std(ends) == pytest.approx(10.8, rel=0.15)


def test_motors_warm_up_with_work_and_slowly():
    idle, working = Thermometers(CB3), Thermometers(CB3)
    start = np.array(idle.reading)
    for _ in range(125 * 600):
        idle.step((0.0,) * 6)
        working.step((4.0, 4.0, 4.0, 3.0, 3.0, 3.0))
    assert np.array_equal(idle.reading, start)
    rise = np.array(working.reading) - start
    assert np.all((rise > 1.0) & (rise < 20.0))
    assert max(working.reading) < 46.0


def test_servo_gains_have_the_stated_frequency_and_damping():
    gains = ServoGains.of(UR3)
    inertia = np.array(UR3.servo_inertia)
    assert np.sqrt(gains.kp / inertia) / (2 * np.pi) == pytest.approx([25.0] * 6)
    assert gains.kv / (2 * np.sqrt(gains.kp * inertia)) == pytest.approx([0.9] * 6)


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
@pytest.mark.parametrize("lag", [0.0005, 0.01])
def test_the_matrix_is_the_sub_step_definition(lag, damping):
    path = CommandPath(N, DT, lag, damping, LEAD, TRIM_GAIN)
    rng = np.random.default_rng(5)
    start = rng.standard_normal((3, 6))
    start[1] = 0.0
    trim = rng.standard_normal(6)
    path.reset(start[0], start[2], start[0] + trim)
    knots = [start] * 2
    filtered = start if damping is None else np.vstack([start, np.zeros((3, 6))])
    for _ in range(8):
        newest = rng.standard_normal((3, 6))
        knots = [newest, knots[0]]
        error = rng.standard_normal(6)
        advance(path, newest, error)
        assert path.trim == pytest.approx(trim, abs=1e-12)
        following = []
        for joint in range(6):
            old = np.array(knots)[:, :, joint]
            rows = trace_cycle(filtered[:, joint], old, N, DT, lag, damping)
            control = rows[:-1, 0] + LEAD * rows[:-1, 1] + rows[:-1, 2] + trim[joint]
            assert path.control[:, joint] == pytest.approx(control, abs=1e-12)
            assert path.speeds[1:, joint] == pytest.approx([newest[1, joint], rows[-2, 1]], abs=1e-12)
            assert path.q_final[joint] == pytest.approx(rows[-1, 0], abs=1e-12)
            following.append(rows[-1])
        trim = trim + TRIM_GAIN * error
        filtered = np.array(following).T


@pytest.mark.parametrize(
    ("lag", "damping"),
    [(0.0, None), (0.0005, None), (0.01, None), (0.014, 0.5), (0.01, 1.2)],
)
def test_a_ramp_comes_late_by_the_lag(lag, damping):
    path = CommandPath(N, DT, lag, damping)
    speed = 0.7
    path.reset(np.zeros(6), np.zeros(6), np.zeros(6))
    for k in range(1, 60):
        advance(path, np.array([np.full(6, speed * k * PERIOD), np.full(6, speed), np.zeros(6)]))
    late = (speed * 59 * PERIOD - path.q_final[0]) / speed
    assert late == pytest.approx(lag, abs=1e-4)


def test_without_delay_the_set_point_follows_a_smooth_motion_between_targets():
    path = CommandPath(N, DT, 0.0)
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
