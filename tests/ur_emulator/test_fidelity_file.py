"""Arms that are built otherwise: the file of `--fidelity`, and what each of its options does to the motion."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from plant_support import HOME, PERIOD, SpeedRamp, column, hold

from ur_emulator.errors import ModelError
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.e_series_arms import UR5E
from ur_emulator.machine.models.fidelity import IDEAL, POOR, TYPICAL, Ripple, dead_cycles
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.plant.feedback import GearRipple, GearWithPlay
from ur_emulator.machine.plant.friction import Presliding
from ur_emulator.machine.plant.plant import Plant
from ur_emulator.machine.plant.sensors import Record

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "fidelity").glob("*.toml"))
OPTIONS = {
    "gears": {"ripples": (Ripple(cycles=80.0, rms=0.01, joints=(5,)),)},
    "backlash": {"backlash": 1e-3},
    "hysteresis": {"friction_presliding": 1e-3},
    "wander": {"dead_time_wander": 0.008, "dead_time_period": 0.4},
    "second order": {"drive_damping": 0.5},
}
OTHERWISE = [replace(TYPICAL, **changes) for changes in OPTIONS.values()]


def swing(plant, n=150, *, ahead=False):
    """States of an arm that turns to and fro."""
    ramp, states = SpeedRamp(HOME), []
    for k in range(n):
        plant.step(ramp.next(0.3 * np.sin(2 * np.pi * k / 75)))
        states.append(plant.sense())
        if ahead:
            plant.complete_cycle()
    return states


def read(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return CB3.fidelity(str(path))


def test_a_file_changes_what_it_names_and_keeps_the_rest_of_its_base(tmp_path):
    assert read(tmp_path, "") == replace(TYPICAL, name="mine")
    text = 'base = "poor"\ndead_time = 0\nencoder_sigma = [1e-6, 0, 0, 0, 0, 2e-6]\nripples = []'
    expected = replace(POOR, name="mine", dead_time=0.0, encoder_sigma=(1e-6, 0, 0, 0, 0, 2e-6), ripples=())
    assert read(tmp_path, text) == expected
    joint = read(tmp_path, "ripples = [{ cycles = 7, rms = 0.01, phase = 0, joints = [1] }]").ripples
    assert joint == (Ripple(cycles=7.0, rms=0.01, phase=0.0, joints=(1,)),)


def test_a_file_starts_from_the_fidelities_of_the_arms_own_generation(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("encoder_step = 1e-6")
    own = E_SERIES.fidelity("typical")
    assert E_SERIES.fidelity(str(path)) == replace(own, name="mine", encoder_step=1e-6)
    assert own.dead_time < TYPICAL.dead_time


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('base = "exact"', "base: 'exact'; give one of ideal, typical, poor"),
        ("has_physics = false", "has_physics: no such key"),
        ("dead_time = -1", "dead_time: -1; give a number from 0 to 0.2 s"),
        ("ripples = [{ rms = 0.01 }]", "ripples[0].cycles: missing; give a number from 1 to 2000"),
        ("ripples = [{ cycles = 9, rms = 0.01, joints = [6] }]", "ripples[0].joints[0]: 6; give a whole"),
        ("ripples = [{ cycles = 9, rms = 0.2 }, { cycles = 8, rms = 0.2 }]", "change its speed by up to 57%"),
        ("drive_lag = 0\ndrive_damping = 1", "drive_damping: a filter of second order has a lag"),
        ("dead_time = ", "not TOML"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(tmp_path, text, words):
    with pytest.raises(ModelError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'mine.toml'}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there():
    with pytest.raises(ModelError, match=r"nowhere\.toml: cannot be read"):
        CB3.fidelity("nowhere.toml")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_make_arms_that_rest_and_move(path):
    for robot, cycles in ((UR5E, 400), (UR3, 60)):
        plant = Plant(robot, robot.generation.fidelity(str(path)), 7)
        states = hold(plant, robot.home_q, cycles)
        assert plant.q_true == pytest.approx(robot.home_q, abs=5e-4)
        assert not column(states, "torque_saturated").any()
    q = column(swing(plant), "actual_q")
    assert np.ptp(q, axis=0) == pytest.approx(np.full(6, 0.0573), rel=0.05)


def test_the_page_names_every_field():
    page = (Path(__file__).parents[2] / "docs" / "fidelity.md").read_text()
    for field in fields(TYPICAL):
        assert f"`{field.name}`" in page or field.name in ("name", "has_physics"), field.name


@pytest.mark.parametrize("fidelity", OTHERWISE, ids=OPTIONS)
def test_the_same_seed_is_the_same_arm_also_where_it_runs_ahead(fidelity):
    plain, ahead = (swing(Plant(UR3, fidelity, 3), ahead=on) for on in (False, True))
    assert plain == ahead
    assert (plain == swing(Plant(UR3, TYPICAL, 3))) == bool(fidelity.dead_time_wander)  # not the plant's


def test_a_wave_has_the_joints_the_order_and_the_phase_of_its_row():
    ripple = Ripple(cycles=80.0, rms=0.01, phase=0.3, joints=(1, 5))
    gear = GearRipple(UR3, replace(TYPICAL, ripples=(ripple,)), 9)
    for angle in np.linspace(-3.0, 3.0, 50):
        gear.evaluate(np.full(6, angle))
        wave = np.sqrt(2) * 0.01 / 80 * np.sin(80 * angle + 0.3)
        assert gear.error == pytest.approx([0.0, wave, 0.0, 0.0, 0.0, wave], abs=1e-15)


def test_an_arm_without_waves():
    gear = GearRipple(UR3, replace(TYPICAL, ripples=()), 9)
    assert gear.motor_position(HOME) == pytest.approx(HOME, abs=0)


def test_play_lets_the_joint_trail_its_motor_by_half_of_it():
    half = 5e-4
    gear = GearWithPlay(UR3, replace(IDEAL, ripples=(), backlash=2 * half), 0)
    gear.motor_position(np.zeros(6))
    record, seen = Record(), []
    for motor in [*np.linspace(0, 0.01, 50), *np.linspace(0.01, 0, 50)]:
        record.q[:], record.qd[:] = motor, 1.0
        gear.apply(record)
        seen.append((motor, record.q[0], record.qd[0]))
    motor, joint, speed = np.array(seen).T
    assert joint[10:50] == pytest.approx(motor[10:50] - half)
    assert joint[60:] == pytest.approx(motor[60:] + half)
    assert joint[50:54] == pytest.approx(np.full(4, joint[49]))  # in the gap
    assert speed[51:54].tolist() == [0.0] * 3
    assert speed[60:].tolist() == [1.0] * 40


def test_friction_with_hysteresis_follows_the_path_not_the_speed():
    angle, size = 1e-3, np.full(6, 2.0)

    def loop(n):
        """Torque along a path out and back, in n steps each."""
        q, torque = np.zeros(6), np.zeros(6)
        friction = Presliding(angle)
        friction.bind(q, torque)
        seen = []
        for position in [*np.linspace(0, 0.01, n + 1)[1:], *np.linspace(0.01, 0.0, n + 1)[1:]]:
            q[:] = position
            friction.apply(size)
            seen.append(torque[0])
        return np.array(seen)

    fine, coarse = loop(1000), loop(100)
    assert fine[9::10] == pytest.approx(coarse, abs=1e-9)
    assert fine[999] == pytest.approx(-2.0, rel=1e-3)
    assert fine[1999] == pytest.approx(2.0, rel=1e-3)
    assert fine[1000 + 69] == pytest.approx(0.0, abs=0.02)  # ln 2 of the angle after the reversal
    assert np.all(np.abs(fine) <= 2.0)


def test_a_dead_time_wanders_between_its_bounds():
    fidelity = replace(IDEAL, dead_time=0.008, dead_time_wander=0.016, dead_time_period=0.8)
    cycles = dead_cycles(fidelity, 4, PERIOD)
    assert len(cycles) == round(0.8 / PERIOD)
    assert set(cycles) == {1, 2, 3}
    assert np.abs(np.diff([*cycles, cycles[0]])).max() == 1
    assert dead_cycles(TYPICAL, 4, PERIOD) == [2]
