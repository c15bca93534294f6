"""An arm that runs ahead while its target is unknown: the same bits as one that does not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_support import HOME, SpeedRamp

from protocol.ur_types import ControlMode
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.e_series_arms import UR5E
from ur_emulator.models.fidelity import EXACT, IDEAL, POOR, TYPICAL
from ur_emulator.models.generations import E_SERIES
from ur_emulator.plant.exact import ExactPlant
from ur_emulator.plant.plant import Plant

POSE = (0.0, 0.0, 1.5, 0.0, 0.0, 0.0)

# What may happen to an arm between two cycles.
EVENTS = {
    "nothing": lambda plant: None,
    "payload": lambda plant: plant.set_payload(1.0, (0.0, 0.0, 0.05)),
    "hang": lambda plant: plant.attach_load(0.5),
    "push": lambda plant: plant.push((5.0, 0.0, -3.0)),
    "end of push": lambda plant: plant.push((0.0, 0.0, 0.0)),
    "obstacle": lambda plant: plant.obstacles.put("ball", "sphere", (0.1,), POSE),
    "no obstacle": lambda plant: plant.obstacles.remove("ball"),
    "look": lambda plant: (plant.q_true, plant.qd_true, plant.flange_position, plant.contact_wrench),
    "trim rests": lambda plant: plant.hold_trim(),
    "reset": lambda plant: plant.reset(HOME),
}
MODES = {
    "brakes": None,
    "force": ControlMode.FORCE,
    "hand": ControlMode.TEACH,
    "position": ControlMode.POSITION,
}
CYCLES = st.lists(
    st.tuples(
        st.sampled_from([*EVENTS, *(["nothing"] * 10)]),
        st.sampled_from(["brakes", "force", "hand", *(["position"] * 10)]),
        st.floats(-0.5, 0.5),
    ),
    min_size=3,
    max_size=25,
)


def states(plant, cycles, *, ahead):
    """What a plant says after each cycle of a history, and where it is at its end."""
    ramp, said = SpeedRamp(HOME), []
    for event, mode, speed in cycles:
        EVENTS[event](plant)
        if event == "reset":
            ramp = SpeedRamp(HOME)
        target = ramp.next(speed)
        plant.step(None if mode == "brakes" else target, MODES[mode] or ControlMode.POSITION)
        said.append(plant.sense())
        if ahead:
            plant.run_ahead()
    return [*said, plant.q_true.tolist(), plant.qd_true.tolist(), plant.flange_position.tolist()]


ARMS = [
    *((UR3, fidelity) for fidelity in (TYPICAL, POOR, IDEAL)),
    *((UR5E, E_SERIES.fidelity(name)) for name in ("typical", "poor", "ideal")),
]


@given(CYCLES, st.sampled_from(ARMS))
@settings(max_examples=60)
def test_running_ahead_changes_no_bit(cycles, arm):
    plain, ahead = (states(Plant(*arm, 3), cycles, ahead=on) for on in (False, True))
    assert plain == ahead


@pytest.mark.parametrize(("fidelity", "moves"), [(TYPICAL, True), (POOR, True), (IDEAL, False)])
def test_it_runs_ahead_where_the_dead_time_is_a_cycle(fidelity, moves):
    plant = Plant(UR3, fidelity, 3)
    ramp = SpeedRamp(HOME)
    for _ in range(10):
        plant.step(ramp.next(0.3))
        plant.sense()
    before = plant._physics.q.copy()
    plant.run_ahead()
    assert np.any(plant._physics.q != before) == moves
    assert plant.q_true is not None
    assert np.all(plant._physics.q == before)


def test_an_arm_that_acts_at_once_moves_after_its_report():
    plant = Plant(UR5E, E_SERIES.fidelity("typical"), 3)
    ramp = SpeedRamp(UR5E.home_q)
    for _ in range(10):
        plant.step(ramp.next(0.3))
    reported, before = plant.sense(), plant._physics.q.copy()
    plant.run_ahead()
    moved = plant._physics.q.copy()
    assert np.all(moved != before)
    assert plant.sense() == reported
    assert plant.q_true is not None
    assert np.all(plant._physics.q == moved)


def test_an_arm_without_physics_does_not_run_ahead():
    plant = ExactPlant(UR3, EXACT, 3)
    plant.step(SpeedRamp(HOME).next(0.3))
    plant.sense()
    before = plant._physics.q.copy()
    plant.run_ahead()
    assert np.all(plant._physics.q == before)
