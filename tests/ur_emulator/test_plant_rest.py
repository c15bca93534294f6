"""The arm at rest: sensor noise, exact standstill, brakes, payload, pushes."""

from __future__ import annotations

import numpy as np
import pytest
from plant_support import HOME, SpeedRamp, column, hold

from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.fidelity import IDEAL, TYPICAL
from ur_emulator.plant.plant import Plant

IN_ARM_PLANE = np.cos(HOME[0])  # share of a lever along x that the shoulder feels


@pytest.fixture(scope="module")
def resting():
    """States of an arm that has held its pose for a while."""
    plant = Plant(UR3, TYPICAL, 11)
    hold(plant, HOME, 150)
    return plant, hold(plant, HOME, 1500)


def test_at_rest_actual_equals_target_to_encoder_noise(resting):
    plant, states = resting
    assert np.abs(plant.q_true - HOME).max() < 2e-6
    assert np.abs(column(states, "actual_q").mean(axis=0) - HOME).max() < 2e-6


def test_encoder_noise_is_white_and_of_the_measured_size(resting):
    _, states = resting
    noise = column(states, "actual_q") - HOME
    assert noise.std(axis=0) == pytest.approx(TYPICAL.encoder_sigma, rel=0.1)
    for joint in noise.T:
        assert abs(np.corrcoef(joint[1:], joint[:-1])[0, 1]) < 0.13


def test_encoder_reads_whole_steps(resting):
    _, states = resting
    steps = column(states, "actual_q") / TYPICAL.encoder_step
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
    for joint in steps.T:
        assert 15 <= len(np.unique(np.rint(joint))) <= 45


def test_reported_speed_is_exactly_zero(resting):
    _, states = resting
    assert np.all(column(states, "actual_qd") == 0.0)


def test_currents_carry_the_gravity_torque(resting):
    _, states = resting
    current = column(states, "actual_current")
    moment = np.array(states[0].target_moment)
    assert moment[1] > 5.0
    assert current.mean(axis=0) * UR3.torque_constant == pytest.approx(moment, abs=0.05 * moment[1])
    assert column(states, "target_current")[0] * UR3.torque_constant == pytest.approx(moment, abs=1e-9)
    assert current.std(axis=0) == pytest.approx(TYPICAL.current_sigma, rel=0.1)


def test_accelerometer_shows_gravity_along_the_tool(resting):
    _, states = resting
    measured = column(states, "tool_accelerometer").mean(axis=0)
    # The tool axis points forward and 45 degrees down, so both show .707 g upwards.
    assert np.linalg.norm(measured) == pytest.approx(9.81, abs=0.05)
    assert measured[2] == pytest.approx(-6.94, abs=0.1)


def test_slow_signals_are_in_their_range(resting):
    _, states = resting
    assert column(states, "joint_voltage").mean() == pytest.approx(48.0, abs=0.1)
    temperatures = column(states, "joint_temperatures")
    assert temperatures.min() >= 28.0
    assert temperatures.max() <= 45.0
    assert np.all(np.abs(np.diff(temperatures, axis=0)) <= 1 / 16)
    force = column(states, "tcp_force")
    assert np.all(np.abs(force[:, :3].mean(axis=0)) <= TYPICAL.force_bias)
    assert force[:, :3].std(axis=0) == pytest.approx([3.0] * 3, rel=0.25)


def test_everything_is_plain_python(resting):
    _, states = resting
    for name, value in states[-1]._asdict().items():
        values = value if isinstance(value, tuple) else (value,)
        assert all(type(x) in (float, bool) for x in values), name


def test_sensing_twice_is_sensing_once():
    plant, twin = Plant(UR3, TYPICAL, 4), Plant(UR3, TYPICAL, 4)
    for _ in range(3):
        hold(plant, HOME, 1)
        assert plant.sense() is plant.sense()
        assert hold(twin, HOME, 1)[0] == plant.sense()


# --- brakes ---


def test_brakes_hold_without_any_sag():
    plant = Plant(UR3, TYPICAL, 6)
    q = np.array([0.5, -1.2, -0.8, 0.3, 1.0, -2.0])
    plant.reset(q)
    before = plant.q_true
    assert before == pytest.approx(q, abs=1e-12)
    states = []
    for _ in range(200):
        plant.step(None)
        states.append(plant.sense())
    assert np.array_equal(plant.q_true, before)
    assert np.array_equal(plant.qd_true, np.zeros(6))
    assert np.abs(column(states, "actual_q").mean(axis=0) - q).max() < 5e-6
    assert np.all(column(states, "actual_qd") == 0.0)
    assert np.all(column(states, "target_moment") == 0.0)
    assert np.abs(column(states, "actual_current").mean(axis=0)).max() < 0.01
    assert np.linalg.norm(column(states, "tool_accelerometer").mean(axis=0)) == pytest.approx(9.81, abs=0.05)


def test_releasing_the_brakes_does_not_shake_the_arm():
    plant = Plant(UR3, TYPICAL, 6)
    states = hold(plant, HOME, 100)
    assert np.abs(column(states, "actual_q") - HOME).max() < 2e-4
    assert np.all(column(states, "actual_qd") == 0.0)


def test_brakes_stop_a_moving_arm_where_it_is():
    plant = Plant(UR3, TYPICAL, 6)
    SpeedRamp(HOME).run(plant, 0.5, 50)
    stopped = plant.q_true
    for _ in range(30):
        plant.step(None)
        plant.sense()
    assert np.array_equal(plant.q_true, stopped)
    assert np.abs(np.array(plant.sense().actual_q) - stopped).max() < 1e-4
    # And the drives take over there, even when the target has not moved on.
    hold(plant, stopped, 60)
    assert np.abs(plant.q_true - stopped).max() < 5e-5


def test_the_physical_flange_is_where_the_controller_computes_it():
    plant = Plant(UR3, TYPICAL, 9)
    arm = ArmModel(UR3, plant.calibration)
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (10, 6)):
        plant.reset(q)
        # The gear's error of .1 mrad is in the encoders, not in the links.
        assert plant.flange_position == pytest.approx(arm.fk(q)[:3], abs=2e-4)
        assert np.abs(plant.flange_position - ArmModel(UR3).fk(q)[:3]).max() > 1e-5


# --- loads ---


def test_a_payload_adds_its_torque_and_does_not_move_the_arm():
    plant = Plant(UR3, IDEAL, 0)
    alone = np.array(hold(plant, HOME, 100)[-1].target_moment)
    plant.set_payload(3.0, (0.0, 0.0, 0.03))
    state = hold(plant, HOME, 200)[-1]
    added = np.array(state.target_moment) - alone
    # The load hangs .35 m out along x, and .03 m further along a tool axis that points 45 degrees down.
    lever = (0.35 + 0.03 * 0.7071) * IN_ARM_PLANE
    assert added[1] == pytest.approx(3 * 9.81 * lever, rel=0.01)
    assert np.abs(plant.q_true - HOME).max() < 5e-6
    assert state.actual_current == pytest.approx(state.target_current, abs=0.02)


def test_a_push_is_resisted_and_seen_in_force_and_current():
    plant = Plant(UR3, IDEAL, 3)
    quiet = hold(plant, HOME, 100)[-1]
    plant.push((0.0, 0.0, -30.0))
    first = hold(plant, HOME, 8)
    assert 1e-4 < np.abs(plant.q_true - HOME).max() < 2e-2
    pushed = hold(plant, HOME, 200)[-1]
    assert np.abs(plant.q_true - HOME).max() < 2e-5
    assert pushed.tcp_force[:3] == pytest.approx((0.0, 0.0, -30.0), abs=0.5)
    extra = (pushed.actual_current[1] - quiet.actual_current[1]) * UR3.torque_constant[1]
    assert extra == pytest.approx(30 * 0.35 * IN_ARM_PLANE, rel=0.02)
    assert not any(state.torque_saturated for state in first)
    plant.push((0.0, 0.0, 0.0))
    assert hold(plant, HOME, 200)[-1].tcp_force[:3] == pytest.approx((0.0, 0.0, 0.0), abs=0.5)
    assert np.abs(plant.q_true - HOME).max() < 2e-5


def test_a_push_beside_the_flange_has_a_moment():
    plant = Plant(UR3, IDEAL, 3)
    plant.push((0.0, 0.0, -10.0), point=(0.0, 0.1, 0.0))
    wrench = hold(plant, HOME, 100)[-1].tcp_force
    # The flange's y axis is the base's y axis at home: (0, .1, 0) x (0, 0, -10).
    assert wrench[3:] == pytest.approx((-1.0, 0.0, 0.0), abs=0.05)
