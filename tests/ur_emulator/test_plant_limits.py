"""Where the plant ends: torque limits, contacts, targets that are none, divergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plant_support import HOME, PERIOD, SpeedRamp, column, hold, target

from ur_emulator.errors import EmulatorError, ModelError, PlantError
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.fidelity import IDEAL, TYPICAL
from ur_emulator.models.generations import CB3
from ur_emulator.plant.plant import Plant

TABLE = -0.02


def test_currents_never_exceed_the_torque_limits():
    plant = Plant(UR3, IDEAL, 0)
    hold(plant, HOME, 5)
    states = hold(plant, HOME + np.array([1.0, 0, 0, 1.0, 1.0, 1.0]), 30)
    torque = np.abs(column(states, "joint_control_output")) * UR3.torque_constant
    assert np.all(torque <= np.array(UR3.tau_max) * (1 + 1e-9))
    assert torque.max(axis=0)[[0, 3, 4, 5]] == pytest.approx([56, 12, 12, 12])
    assert any(state.torque_saturated for state in states)


def test_the_arm_accelerates_as_its_torque_allows():
    # 56 Nm less friction on .28 kg m² of links and .45 of the rotor.
    plant = Plant(UR3, IDEAL, 0)
    hold(plant, HOME, 5)
    before = plant.qd_true[0]
    hold(plant, HOME + np.array([1.0, 0, 0, 0, 0, 0]), 2)
    faster = (plant.qd_true[0] - before) / (1.5 * PERIOD)
    assert 60 < faster < 85


def press_down(plant, n):
    """Turn the shoulder so that the stretched arm comes down on the table."""
    ramp = SpeedRamp((0.0, -0.3, 0.0, -1.57, 0.0, 0.0))
    plant.reset(ramp.q)
    return ramp.run(plant, (0.0, 0.4, 0.0, 0.0, 0.0, 0.0), n)[1]


def test_the_table_stops_the_arm_and_is_felt():
    plant = Plant(UR3, IDEAL, 0)
    states = press_down(plant, 260)
    assert plant.n_contacts > 0
    assert plant.q_true[1] < 0.7
    last = states[-1]
    assert last.torque_saturated
    assert last.position_error[1] > 0.05
    assert last.tcp_force[2] > 50.0
    assert not states[20].torque_saturated
    # The wrist yields, the table does not.
    assert np.all(plant._physics.data.contact.dist > -5e-4)


def test_the_arm_cannot_fold_into_itself():
    plant = Plant(UR3, IDEAL, 0)
    ramp = SpeedRamp(HOME)
    ramp.run(plant, (0, 0, -0.6, 0, 0, 0), 180)
    assert plant.n_contacts > 0
    assert plant.q_true[2] > ramp.q[2] + 0.1


def test_home_and_the_work_box_are_clear():
    plant = Plant(UR3, TYPICAL, 0)
    for q1 in (-0.3, 1.1):
        for q3 in (-2.6, -1.1):
            plant.reset((q1, -1.8, q3, -0.1, 1.3, 1.8))
            hold(plant, (q1, -1.8, q3, -0.1, 1.3, 1.8), 2)
            assert plant.n_contacts == 0


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf"), 1e308])
@pytest.mark.parametrize("part", [0, 1, 2])
def test_a_target_that_is_no_target_is_refused_and_changes_nothing(bad, part):
    plant, twin = Plant(UR3, TYPICAL, 1), Plant(UR3, TYPICAL, 1)
    hold(plant, HOME, 3)
    hold(twin, HOME, 3)
    parts = [list(HOME), [0.0] * 6, [0.0] * 6]
    parts[part][2] = bad
    with pytest.raises(PlantError, match="finite numbers") as caught:
        plant.step(target(*parts))
    assert caught.value.cycle == 4
    assert np.array_equal(plant.q_true, twin.q_true)
    assert hold(plant, HOME, 1) == hold(twin, HOME, 1)


def test_divergence_is_an_error_in_its_cycle_and_a_reset_heals():
    plant = Plant(UR3, TYPICAL, 1)
    hold(plant, HOME, 5)
    plant.push((0.0, 0.0, 1e7))
    with pytest.raises(EmulatorError, match="diverged in cycle 6") as caught:
        hold(plant, HOME, 1)
    assert "\n" not in str(caught.value)
    plant.push((0.0, 0.0, 0.0))
    plant.reset(HOME)
    hold(plant, HOME, 100)
    assert np.abs(plant.q_true - HOME).max() < 1e-4


@pytest.mark.parametrize("period", [0, 3_000, -8_000])
def test_a_cycle_that_the_physics_cannot_fill_is_refused(period):
    with pytest.raises(ModelError, match="whole multiple of the physics step of 2000"):
        replace(CB3, period_us=period)


def test_a_cycle_that_does_not_divide_a_second_is_refused():
    with pytest.raises(ModelError, match="whole number of cycles a second"):
        replace(CB3, period_us=6_000)


def test_a_two_millisecond_cycle_works_too():
    plant = Plant(replace(UR3, generation=replace(CB3, period_us=2_000)), TYPICAL, 0)
    for _ in range(400):
        plant.step(target(HOME))
        plant.sense()
    assert np.abs(plant.q_true - HOME).max() < 5e-5


@pytest.mark.parametrize("q", [(0.0,) * 5, (float("nan"),) * 6])
def test_reset_wants_six_numbers(q):
    with pytest.raises(PlantError, match="six finite numbers"):
        Plant(UR3, IDEAL, 0).reset(q)


@pytest.mark.parametrize(
    ("mass", "cog"), [(-1.0, (0, 0, 0)), (float("nan"), (0, 0, 0)), (1.0, (0, float("inf"), 0))]
)
def test_payload_wants_sense(mass, cog):
    with pytest.raises(PlantError, match="mass >= 0"):
        Plant(UR3, IDEAL, 0).set_payload(mass, cog)


@pytest.mark.parametrize("force", [(0.0, 0.0), (float("nan"), 0.0, 0.0)])
def test_push_wants_three_numbers(force):
    with pytest.raises(PlantError, match="three finite numbers"):
        Plant(UR3, IDEAL, 0).push(force)
