"""The arm of the plant: at rest, in motion, at its limits, and ahead of its targets.

At rest: sensor noise, exact standstill, brakes, payload, pushes. In motion: delay, tracking, ripple, settling. At
its limits: torque, contacts, targets that are not finite, divergence. Where it runs ahead it has the same bits as
one that does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_support import HOME, PERIOD, SpeedRamp, column, hold, target

from protocol.ur_types import ControlMode
from ur_emulator.errors import EmulatorError, ModelError, PlantError
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.calibration import draw_dh
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.e_series_arms import UR3E, UR5E
from ur_emulator.machine.models.fidelity import EXACT, IDEAL, POOR, TYPICAL
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.models.things import Thing
from ur_emulator.machine.plant.exact import ExactPlant
from ur_emulator.machine.plant.plant import Plant
from ur_emulator.machine.plant.sensors import Record, Sensors

IN_ARM_PLANE = np.cos(HOME[0])  # share of a lever along x that the shoulder feels


@pytest.fixture(scope="module")
def resting():
    """States of an arm that has held its pose for a while."""
    plant = Plant(UR3, TYPICAL, 11)
    hold(plant, HOME, 150)
    return plant, hold(plant, HOME, 1500)


def test_at_rest_the_arm_stands_within_the_dead_band_of_its_servos(resting):
    plant, states = resting
    assert np.abs(plant.q_true - HOME).max() < TYPICAL.servo_dead_band
    standing = column(states, "actual_q").mean(axis=0) - HOME
    assert standing == pytest.approx(plant.q_true - HOME, abs=5e-6)


def test_encoder_noise_is_white_and_of_the_measured_size(resting):
    _, states = resting
    noise = column(states, "actual_q") - HOME
    # Source: a real UR3.
    assert np.all((noise.std(axis=0) > 2.0e-5) & (noise.std(axis=0) < 2.4e-5))
    for joint in noise.T:
        assert abs(np.corrcoef(joint[1:], joint[:-1])[0, 1]) < 0.13


def test_encoder_reads_whole_steps(resting):
    _, states = resting
    steps = column(states, "actual_q") / TYPICAL.encoder_step
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
    for joint in steps.T:
        assert 10 <= len(np.unique(np.rint(joint))) <= 18


def test_currents_carry_the_gravity_torque(resting):
    _, states = resting
    current = column(states, "actual_current")
    moment = np.array(states[0].target_moment)
    assert moment[1] > 5.0
    beyond = current.mean(axis=0) * UR3.torque_constant - moment
    assert np.all(np.abs(beyond) < np.array(UR3.coulomb) + np.multiply(UR3.torque_constant, 0.1))
    assert column(states, "target_current")[0] * UR3.torque_constant == pytest.approx(moment, abs=1e-9)
    # Friction that holds the joints fades slowly.
    assert np.diff(current, axis=0).std(axis=0) / np.sqrt(2) == pytest.approx(TYPICAL.current_sigma, rel=0.1)
    steps = current / TYPICAL.current_step
    assert np.abs(steps - np.rint(steps)).max() < 1e-6


def test_accelerometer_shows_gravity_along_the_tool(resting):
    _, states = resting
    measured = column(states, "actual_tool_accelerometer").mean(axis=0)
    # The tool axis points forward and 45 degrees down, so both show .707 g upwards.
    assert np.linalg.norm(measured) == pytest.approx(9.81, abs=0.05)
    assert measured[2] == pytest.approx(-6.94, abs=0.1)


def test_slow_signals_are_in_their_range(resting):
    _, states = resting
    voltages = column(states, "joint_voltage")
    assert np.abs(voltages.mean(axis=0) - 47.92).max() <= 0.105  # real joints: 47.81 to 48.02 V, sd .02
    assert voltages.std(axis=0) == pytest.approx([0.02] * 6, rel=0.1)
    temperatures = column(states, "joint_temperatures")
    assert temperatures.min() >= 28.0
    assert temperatures.max() <= 45.0
    assert np.all(np.abs(np.diff(temperatures, axis=0)) <= 1 / 16)


def test_the_force_is_what_the_motors_give_beyond_the_target_current():
    """In each package, as on a real UR3 (correlation 1.000); so its noise at rest is that of the currents."""
    fidelity = TYPICAL
    plant, arm = Plant(UR3, fidelity, 4), ArmModel(UR3, draw_dh(UR3, fidelity, 4))
    hold(plant, HOME, 100)
    for state in SpeedRamp(HOME, 2.0).run(plant, (0.5, 0.3, -0.4, 0.2, 0.0, 0.1), 120)[1]:
        beyond = np.subtract(state.actual_current, state.target_current) * UR3.torque_constant
        wrench = -np.linalg.solve(arm.jacobian(state.actual_q).T, beyond)
        assert state.estimated_force == pytest.approx(wrench, rel=0.02, abs=0.05)


def test_near_a_singularity_the_error_of_the_force_grows_and_stays_finite():
    plant = Plant(UR3, TYPICAL, 4)
    sizes = []
    for wrist in (-1.57, -0.05, 0.0):
        q = (*HOME[:4], wrist, HOME[5])
        plant.reset(q)
        forces = column(hold(plant, q, 300)[100:], "estimated_force")[:, :3]
        sizes.append(np.linalg.norm(forces, axis=1).max())
    assert 2.0 * sizes[0] < sizes[1] < 200.0
    assert sizes[2] < 200.0


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
    assert np.linalg.norm(column(states, "actual_tool_accelerometer").mean(axis=0)) == pytest.approx(
        9.81, abs=0.05
    )


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
    arm = ArmModel(UR3, plant.dh)
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (10, 6)):
        plant.reset(q)
        # The gear's error of .3 mrad is in the encoders, not in the links.
        assert plant.physics.flange_position == pytest.approx(arm.fk(q)[:3], abs=4e-4)
        assert np.abs(plant.physics.flange_position - ArmModel(UR3).fk(q)[:3]).max() > 1e-5


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
    assert pushed.estimated_force[:3] == pytest.approx((0.0, 0.0, -30.0), abs=0.5)
    extra = (pushed.actual_current[1] - quiet.actual_current[1]) * UR3.torque_constant[1]
    assert extra == pytest.approx(30 * 0.35 * IN_ARM_PLANE, rel=0.02)
    assert not any(state.torque_saturated for state in first)
    plant.push((0.0, 0.0, 0.0))
    assert hold(plant, HOME, 200)[-1].estimated_force[:3] == pytest.approx((0.0, 0.0, 0.0), abs=0.5)
    assert np.abs(plant.q_true - HOME).max() < 2e-5


def test_a_push_beside_the_flange_has_a_moment():
    plant = Plant(UR3, IDEAL, 3)
    plant.push((0.0, 0.0, -10.0), point=(0.0, 0.1, 0.0))
    wrench = hold(plant, HOME, 100)[-1].estimated_force
    # The flange's y axis is the base's y axis at home: (0, .1, 0) x (0, 0, -10).
    assert wrench[3:] == pytest.approx((-1.0, 0.0, 0.0), abs=0.05)


RAISED = HOME - np.array((1.0, 0.3, 0.3, 1.0, 1.0, 1.0))


def measured_lag(fidelity, seed):
    """Time by which a reported position trails its target at constant speed [s]."""
    plant = Plant(UR3, fidelity, seed)
    speed = 0.4
    targets, states = SpeedRamp(HOME).run(plant, speed, 110)
    return float(((targets - column(states, "actual_q"))[-50:] / speed).mean())


@pytest.mark.parametrize(
    "fidelity",
    [IDEAL, TYPICAL, POOR],
    ids=lambda it: it.name,
)
def test_the_arm_lags_by_drive_and_feedback(fidelity):
    for seed in range(3):
        expected = fidelity.drive_lag + fidelity.feedback_age
        assert measured_lag(fidelity, seed) == pytest.approx(expected, abs=4e-4)  # waves of the gears


@pytest.mark.parametrize("speed", [0.4, 1.0])
def test_speed_ripple_is_that_of_a_real_arm(speed):
    plant = Plant(UR3, TYPICAL, 1)
    plant.reset(RAISED)
    n = int(1.0 / speed / PERIOD)
    ramp = SpeedRamp(RAISED)
    ramp.run(plant, speed, 70)
    _, states = ramp.run(plant, speed, n)
    assert plant.physics.data.ncon == 0
    ripple = (column(states, "actual_qd") - speed) / speed
    assert np.all(np.abs(ripple.mean(axis=0)) < 0.004)
    # Source: a real UR3.
    least, most = (0.003, 0.005, *(0.008,) * 4), (0.005, 0.007, *(0.012,) * 4)
    assert np.all((ripple.std(axis=0) > least) & (ripple.std(axis=0) < most))


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
    waves = [ripple for ripple in TYPICAL.ripples if 5 in ripple.joints]
    assert sorted(np.argsort(lines[5:400])[-3:] + 5) == [ripple.cycles for ripple in waves]
    # Amplitude of the angle error from the rms share of speed; the outer loop takes a little off.
    for ripple in waves:
        size = np.sqrt(2) * ripple.rms / ripple.cycles
        assert lines[round(ripple.cycles)] == pytest.approx(size, rel=0.3)


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
    # Source: a real UR3, up to .2 mrad for .9 s.
    _, states = ramp.run(plant, 0.0, 150)
    assert np.abs(plant.q_true - ramp.q).max() < 1.5e-4
    assert np.all(column(states, "actual_qd")[-50:] == 0.0)


@pytest.mark.parametrize(("robot", "least"), [(UR3, 1e-5), (UR3E, 1.4e-45)])
def test_reported_speed_decays_to_exactly_zero(robot, least):
    """Source: a real UR3 has no speeds below its step at rest, a real UR3e goes through the float32 denormals."""
    sensors = Sensors(robot, robot.generation.fidelity("typical"), 1, robot.generation.period_s)
    record, speeds = Record(), []
    for k in range(150):
        record.qd[:] = 0.5 if k < 10 else 0.0
        speeds.append(sensors.read(record).actual_qd)
    decaying = np.abs(speeds[10:])
    assert np.all(decaying[-20:] == 0.0)
    assert least <= decaying[decaying > 0].min() < 100 * least


def test_hard_reversals_stay_in_hand():
    plant = Plant(UR3, TYPICAL, 3)
    ramp = SpeedRamp(HOME, acceleration=40.0)
    largest = 0.0
    for k in range(240):
        sign = 1.0 if (k // 40) % 2 == 0 else -1.0
        plant.step(ramp.next(sign * np.array([1.5, 0.5, 0.5, 1.5, 1.5, 1.5])))
        largest = max(largest, *map(abs, plant.sense().position_error))
    assert largest < 5e-3


def test_currents_never_exceed_the_torque_limits():
    plant = Plant(UR3, IDEAL, 0)
    hold(plant, HOME, 5)
    states = hold(plant, HOME + np.array([1.0, 0, 0, 1.0, 1.0, 1.0]), 30)
    torque = np.abs(column(states, "joint_control_output")) * UR3.torque_constant
    assert np.all(torque <= np.array(UR3.tau_max) * (1 + 1e-9))
    assert torque.max(axis=0)[[0, 3, 4, 5]] == pytest.approx([56, 12, 12, 12])
    assert any(state.torque_saturated for state in states)


def test_the_arm_accelerates_as_its_torque_allows():
    # 56 Nm less friction on .28 kg m² of links and .61 of the rotor.
    plant = Plant(UR3, IDEAL, 0)
    hold(plant, HOME, 5)
    before = plant.qd_true[0]
    hold(plant, HOME + np.array([1.0, 0, 0, 0, 0, 0]), 2)
    faster = (plant.qd_true[0] - before) / (2 * PERIOD)
    assert 50 < faster < 65


def test_the_arm_cannot_fold_into_itself():
    plant = Plant(UR3, IDEAL, 0)
    ramp = SpeedRamp(HOME)
    ramp.run(plant, (0, 0, -0.6, 0, 0, 0), 180)
    assert plant.physics.data.ncon > 0
    assert plant.q_true[2] > ramp.q[2] + 0.1


def test_home_and_the_work_box_are_clear():
    plant = Plant(UR3, TYPICAL, 0)
    for q1 in (-0.3, 1.1):
        for q3 in (-2.6, -1.1):
            plant.reset((q1, -1.8, q3, -0.1, 1.3, 1.8))
            hold(plant, (q1, -1.8, q3, -0.1, 1.3, 1.8), 2)
            assert plant.physics.data.ncon == 0


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf"), 1e308])
@pytest.mark.parametrize("part", [0, 1, 2])
def test_a_target_that_is_no_target_is_refused_and_changes_nothing(bad, part):
    plant, twin = Plant(UR3, TYPICAL, 1), Plant(UR3, TYPICAL, 1)
    hold(plant, HOME, 3)
    hold(twin, HOME, 3)
    parts = [list(HOME), [0.0] * 6, [0.0] * 6]
    parts[part][2] = bad
    plant.step(target(*parts))
    with pytest.raises(PlantError, match="finite numbers") as caught:
        plant.complete_cycle()
    assert caught.value.cycle == 4
    assert np.array_equal(plant.q_true, twin.q_true)
    assert hold(plant, HOME, 1) == hold(twin, HOME, 1)


def test_divergence_is_an_error_in_its_cycle_and_a_reset_heals():
    plant = Plant(UR3, TYPICAL, 1)
    hold(plant, HOME, 5)
    plant.push((0.0, 0.0, 1e7))
    hold(plant, HOME, 1)
    with pytest.raises(EmulatorError, match="diverged in cycle 6") as caught:
        plant.complete_cycle()
    assert "\n" not in str(caught.value)
    plant.push((0.0, 0.0, 0.0))
    plant.reset(HOME)
    hold(plant, HOME, 100)
    assert np.abs(plant.q_true - HOME).max() < 1e-4


FILLED, WHOLE = "whole multiple of the physics step of 2000", "whole number of cycles a second"


@pytest.mark.parametrize(
    ("period", "words"), [(0, FILLED), (3_000, FILLED), (-8_000, FILLED), (6_000, WHOLE)]
)
def test_a_cycle_that_the_physics_or_a_second_cannot_fill_is_refused(period, words):
    with pytest.raises(ModelError, match=words):
        replace(CB3, period_us=period)


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


BALL = Thing("ball", "sphere", (0.1,), 0.0, 0.3, (0.0, 0.0, 1.5, 0.0, 0.0, 0.0))

# What may happen to an arm between two cycles.
EVENTS = {
    "nothing": lambda plant: None,
    "payload": lambda plant: plant.set_payload(1.0, (0.0, 0.0, 0.05)),
    "hang": lambda plant: plant.attach_load(0.5),
    "push": lambda plant: plant.push((5.0, 0.0, -3.0)),
    "end of push": lambda plant: plant.push((0.0, 0.0, 0.0)),
    "obstacle": lambda plant: plant.put(BALL),
    "no obstacle": lambda plant: (
        plant.physics.scene.obstacles and plant.physics.scene.remove("obstacle", "ball")
    ),
    "look": lambda plant: (
        plant.q_true,
        plant.qd_true,
        plant.physics.flange_position,
        plant.physics.contact_wrench,
    ),
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
            plant.complete_cycle()
    return [*said, plant.q_true.tolist(), plant.qd_true.tolist(), plant.physics.flange_position.tolist()]


ARMS = [
    *((UR3, fidelity) for fidelity in (TYPICAL, POOR, IDEAL)),
    *((UR5E, E_SERIES.fidelity(name)) for name in ("typical", "poor", "ideal")),
]


@given(CYCLES, st.sampled_from(ARMS))
@settings(max_examples=30)
def test_running_ahead_changes_no_bit(cycles, arm):
    plain, ahead = (states(Plant(*arm, 3), cycles, ahead=on) for on in (False, True))
    assert plain == ahead


@pytest.mark.parametrize("robot", [UR3, UR5E], ids=lambda it: it.name)
def test_an_arm_moves_after_its_report(robot):
    plant = Plant(robot, robot.generation.fidelity("typical"), 3)
    ramp = SpeedRamp(robot.home_q)
    for _ in range(10):
        plant.step(ramp.next(0.3))
    reported, before = plant.sense(), plant._physics.q.copy()
    plant.complete_cycle()
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
    plant.complete_cycle()
    assert np.all(plant._physics.q == before)
