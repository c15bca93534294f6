"""The arm in motion: delay, tracking, ripple, settling, and the same bits for the same seed.

Then where the plant ends: torque limits, contacts, targets that are not finite, divergence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plant_support import HOME, PERIOD, SpeedRamp, column, hold, target

from ur_emulator.errors import EmulatorError, ModelError, PlantError
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.fidelity import IDEAL, POOR, TYPICAL
from ur_emulator.models.generations import CB3
from ur_emulator.plant.plant import Plant

RAISED = HOME - np.array((1.0, 0.3, 0.3, 1.0, 1.0, 1.0))


def measured_lag(fidelity, seed):
    """Time by which a reported position trails its target at constant speed [s]."""
    plant = Plant(UR3, fidelity, seed)
    speed = 0.4
    targets, states = SpeedRamp(HOME).run(plant, speed, 110)
    return float(((targets - column(states, "actual_q"))[-50:] / speed).mean())


@pytest.mark.parametrize(
    ("fidelity", "loop_ms", "spread_ms"),
    [(IDEAL, 12, 0.3), (TYPICAL, 33, 4), (POOR, 45, 4)],
    ids=lambda x: str(x)[:8],
)
def test_the_loop_delay_is_that_of_the_fidelity(fidelity, loop_ms, spread_ms):
    # A streamed speed is held for a cycle, which adds half a cycle to the lag of the positions.
    delays = [1e3 * (measured_lag(fidelity, seed) + PERIOD / 2) for seed in range(8)]
    assert np.mean(delays) == pytest.approx(loop_ms, abs=2)
    assert max(abs(delay - loop_ms) for delay in delays) <= spread_ms + 0.3
    for seed, delay in enumerate(delays):
        parts = Plant(UR3, fidelity, seed).dead_time + fidelity.drive_lag + fidelity.feedback_age
        assert delay == pytest.approx(1e3 * (parts + PERIOD / 2), abs=0.3)


def test_reported_positions_follow_a_smooth_move_after_that_delay():
    plant = Plant(UR3, TYPICAL, 3)
    lag = plant.dead_time + TYPICAL.drive_lag + TYPICAL.feedback_age
    omega, amplitude = 2.5, 0.3

    def wave(t):
        return HOME + amplitude * (1 - np.cos(omega * t))

    reported = []
    for k in range(1, 300):
        t = k * PERIOD
        speed = np.full(6, amplitude * omega * np.sin(omega * t))
        acceleration = np.full(6, amplitude * omega**2 * np.cos(omega * t))
        plant.step(target(wave(t), speed, acceleration))
        reported.append(plant.sense().actual_q)
        assert np.abs(plant.sense().position_error).max() < 1e-3
    times = PERIOD * np.arange(1, 300)
    expected = np.array([wave(t - lag) for t in times])
    error = np.array(reported)[50:] - expected[50:]
    assert np.sqrt((error**2).mean()) < 0.4e-3


@pytest.mark.parametrize("speed", [0.4, 1.0])
def test_speed_ripple_is_about_one_percent(speed):
    plant = Plant(UR3, TYPICAL, 1)
    plant.reset(RAISED)
    n = int(1.0 / speed / PERIOD)
    ramp = SpeedRamp(RAISED)
    ramp.run(plant, speed, 70)
    _, states = ramp.run(plant, speed, n)
    assert plant.n_contacts == 0
    ripple = (column(states, "actual_qd") - speed) / speed
    assert np.all(np.abs(ripple.mean(axis=0)) < 0.004)
    assert np.all((ripple.std(axis=0) > 0.005) & (ripple.std(axis=0) < 0.015))


def test_ripple_has_the_periods_of_the_gear():
    # Reported minus commanded angle over one joint turn of wrist 3, as a function of the angle.
    plant = Plant(UR3, TYPICAL, 5)
    speed = np.array([0, 0, 0, 0, 0, 0.4])
    ramp = SpeedRamp(HOME)
    ramp.run(plant, speed, 70)
    q, errors = [], []
    while not q or q[-1] - q[0] < 2 * np.pi:
        plant.step(ramp.next(speed))
        q.append(plant.q_true[5])
        errors.append(plant.sense().position_error[5])
    grid = np.linspace(q[0], q[0] + 2 * np.pi, 2048, endpoint=False)
    lines = np.abs(np.fft.rfft(np.interp(grid, q, errors))) / 1024
    assert sorted(np.argsort(lines[5:400])[-2:] + 5) == [101, 202]
    # Amplitude of the angle error from the rms share of speed; the outer loop takes a little off.
    for ripple in TYPICAL.ripples:
        size = np.sqrt(2) * ripple.rms / ripple.cycles
        assert lines[round(ripple.cycles)] == pytest.approx(size, rel=0.2)


def test_reported_speed_is_the_derivative_of_reported_position():
    plant = Plant(UR3, TYPICAL, 2)
    rates, differences = [], []
    q_before = plant.sense().actual_q
    qd_before = plant.sense().actual_qd
    for k in range(1, 400):
        t = k * PERIOD
        plant.step(
            target(
                HOME + 0.2 * (1 - np.cos(3 * t)),
                np.full(6, 0.6 * np.sin(3 * t)),
                np.full(6, 1.8 * np.cos(3 * t)),
            )
        )
        state = plant.sense()
        differences.append((np.array(state.actual_q) - q_before) / PERIOD)
        rates.append((np.array(state.actual_qd) + qd_before) / 2)
        q_before, qd_before = state.actual_q, state.actual_qd
    difference = np.array(differences) - np.array(rates)
    assert np.abs(difference.mean(axis=0)).max() < 2e-4
    assert difference.std(axis=0).max() < 6e-3


def test_after_a_stop_the_arm_settles_on_its_target():
    plant = Plant(UR3, TYPICAL, 1)
    ramp = SpeedRamp(HOME)
    ramp.run(plant, 1.0, 100)
    ramp.run(plant, 0.0, 26)
    _, states = ramp.run(plant, 0.0, 25)
    # 0.2 s after the target stopped: within the arm's repeatability of 0.1 mm at 0.4 m.
    assert np.abs(plant.q_true - ramp.q).max() < 3e-4
    _, states = ramp.run(plant, 0.0, 100)
    assert np.abs(plant.q_true - ramp.q).max() < 5e-6
    speeds = column(states, "actual_qd")
    assert np.all(speeds[-60:] == 0.0)


def test_reported_speed_decays_through_the_float32_denormals_to_exactly_zero():
    plant = Plant(UR3, TYPICAL, 1)
    ramp = SpeedRamp(HOME)
    ramp.run(plant, 0.5, 60)
    _, states = ramp.run(plant, 0.0, 120)
    speeds = np.abs(column(states, "actual_qd"))
    tiny = (speeds > 0) & (speeds < 1e-6)
    # Wrists (size 0) have the slowest pole and show the longest tail, base and shoulder the shortest.
    assert tiny[:, 5].sum() > tiny[:, 2].sum() > 0
    assert np.all(speeds[-20:] == 0.0)
    assert speeds[speeds > 0].min() >= 1.4e-45


def test_hard_reversals_stay_in_hand():
    plant = Plant(UR3, TYPICAL, 3)
    ramp = SpeedRamp(HOME, acceleration=40.0)
    largest = 0.0
    for k in range(240):
        sign = 1.0 if (k // 40) % 2 == 0 else -1.0
        plant.step(ramp.next(sign * np.array([1.5, 0.5, 0.5, 1.5, 1.5, 1.5])))
        largest = max(largest, *map(abs, plant.sense().position_error))
    assert largest < 5e-3


def run(seed, n=300):
    plant = Plant(UR3, TYPICAL, seed)
    states = hold(plant, HOME, 10)
    states += SpeedRamp(HOME).run(plant, 0.3, n)[1]
    return plant, states


def test_same_seed_and_same_targets_give_the_same_bits():
    assert run(7)[1] == run(7)[1]


def test_another_seed_is_another_arm_of_the_same_kind():
    (first, one), (second, other) = run(1), run(2)
    assert first.calibration != second.calibration
    assert one != other
    lag = (first.dead_time - second.dead_time) * 0.3
    gap = column(one, "actual_q")[-100:] - column(other, "actual_q")[-100:]
    assert np.abs(gap.mean(axis=0) + lag).max() < 1e-4


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
