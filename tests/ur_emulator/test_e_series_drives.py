"""Drives of e-Series arms: the controller's own model, friction, and how far an arm is from its target."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from box_support import Bench
from plant_support import target

from ur_emulator.models.calibration import NOMINAL
from ur_emulator.models.e_series_arms import UR5E, UR10E
from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.mjcf import arm_spec
from ur_emulator.models.robots import ROBOTS
from ur_emulator.plant.arm_physics import build_physics
from ur_emulator.plant.drives import ServoGains
from ur_emulator.plant.friction import Friction
from ur_emulator.plant.inverse_dynamics import InverseDynamics
from ur_emulator.plant.plant import Plant

ARMS = [pytest.param(robot, id=name) for name, robot in ROBOTS.items() if robot.generation is E_SERIES]
STILL = np.zeros(6)
TYPICAL, IDEAL = E_SERIES.fidelity("typical"), E_SERIES.fidelity("ideal")


def other_model(robot, tensors=True):
    """The arm in Pinocchio, by its DH table: joints and links in the frames of the table."""
    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    for i, (row, link) in enumerate(zip(robot.dh, robot.links, strict=True)):
        joint = model.addJoint(parent, pin.JointModelRZ(), place, f"joint_{i}")
        frame = pin.SE3(pin.utils.rotate("x", row.alpha), np.array([row.a, 0.0, row.d]))
        tensor = np.array(link.tensor) * tensors
        model.appendBodyToJoint(joint, pin.Inertia(link.mass, np.array(link.com), tensor), frame)
        parent, place = joint, frame
    model.gravity.linear = np.array([0.0, 0.0, -9.82])
    model.armature[:] = robot.armature
    return model


@pytest.mark.parametrize("robot", ARMS)
def test_target_moment_is_that_of_another_library(robot):
    """At rest and in motion; UR3e and UR5e take their links for points, the larger arms do not."""
    ours, other = InverseDynamics(robot, NOMINAL), other_model(robot, tensors=not robot.has_point_masses)
    data, rng = other.createData(), np.random.default_rng(3)
    for _ in range(20):
        q, qd, qdd = rng.uniform(-3, 3, (3, 6))
        assert ours.evaluate(q, STILL, STILL) == pytest.approx(
            pin.rnea(other, data, q, STILL, STILL), abs=1e-9
        )
        expected = pin.rnea(other, data, q, qd, qdd)
        assert ours.evaluate(q, qd, qdd) == pytest.approx(expected, abs=1e-9 * hypot(*expected))


@pytest.mark.parametrize("robot", ARMS)
def test_mass_matrix_of_the_physics_is_that_of_another_library(robot):
    model = arm_spec(robot, robot.dh, (1.0,) * 6).compile()
    data, other = mujoco.MjData(model), other_model(robot)
    other_data, ours = other.createData(), np.zeros((6, 6))
    for q in np.random.default_rng(4).uniform(-3, 3, (10, 6)):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, ours)
        theirs = pin.crba(other, other_data, q) - np.diag(robot.armature)
        np.testing.assert_allclose(ours, theirs, atol=1e-6 * np.trace(theirs))


def test_gravity_of_a_declared_payload_is_in_the_target_moment():
    ours, other = InverseDynamics(UR10E, NOMINAL), other_model(UR10E)
    ours.set_payload(1.07, (0.0, 0.0, 0.058))
    row = UR10E.dh[5]
    other.appendBodyToJoint(
        6,
        pin.Inertia(1.07, np.array([0.0, 0.0, 0.058]), np.zeros((3, 3))),
        pin.SE3(pin.utils.rotate("x", row.alpha), np.array([row.a, 0.0, row.d])),
    )
    q = np.array(UR10E.home_q)
    expected = pin.rnea(other, other.createData(), q, STILL, STILL)
    assert ours.evaluate(q, STILL, STILL) == pytest.approx(expected, abs=1e-9)


def test_no_payload_of_an_arm_of_point_masses_needs_no_warning_of_the_library():
    warnings = []
    mujoco.set_mju_user_warning(warnings.append)
    try:
        InverseDynamics(ROBOTS["ur3e"], NOMINAL).set_payload(0.0, (0.0, 0.0, 0.0))
    finally:
        mujoco.set_mju_user_warning(None)
    assert warnings == []


def friction_law(robot, qd):
    c, v1, v2 = (np.array(row) for row in (robot.coulomb, robot.viscous, robot.viscous_fast))
    return np.sign(qd) * (c + v1 * np.minimum(np.abs(qd), 0.5) + v2 * np.maximum(np.abs(qd) - 0.5, 0.0))


@pytest.mark.parametrize("robot", ARMS)
@pytest.mark.parametrize("speed", [-2.0, -0.51, -0.3, 0.05, 0.49, 0.8, 3.0])
def test_friction_grows_less_beyond_the_kink(robot, speed):
    """Source of the law: fits of target current against target moment of a real UR3e and a real UR10e."""
    friction, qd = Friction(robot, IDEAL, 0), np.full(6, speed)
    friction.evaluate(np.array([qd, qd, qd]))
    expected = friction_law(robot, qd)
    assert friction.expected == pytest.approx(expected, rel=1e-6)
    assert friction.compensation == pytest.approx(expected, rel=1e-6)
    # The true friction in the physics: dry part by the sign of the speed, and a damping.
    true = np.sign(qd) * friction.coulomb + np.array(robot.viscous_beyond_kink) * qd
    assert true == pytest.approx(expected, rel=1e-9)


def test_friction_has_changed_its_sign_within_a_few_hundredths_of_a_radian_a_second():
    friction = Friction(UR5E, IDEAL, 0)
    speeds = [np.full(6, speed) for speed in (0.0, 0.003, 0.012)]
    shares = []
    for qd in speeds:
        friction.evaluate(np.array([qd, qd, qd]))
        shares.append((friction.expected / UR5E.coulomb).max())
    assert shares[0] == 0.0
    assert 0.4 < shares[1] < 0.6
    assert shares[2] > 0.95


@pytest.mark.parametrize("name", ["ur3e", "ur10e"])
def test_current_of_a_package_is_moment_and_friction_by_the_torque_constant(name):
    bench, robot = Bench(robot=name, generation=E_SERIES, fidelity="ideal"), ROBOTS[name]
    bench.run("def p():\n  movej([0.2, -1.5, -1.8, 0.2, 1.2, 1.5], a=2, v=1)\n  sleep(0.1)\nend\n")
    moving = [s for s in bench.snapshots if min(map(abs, s.target_qd)) > 0.04]
    assert len(moving) > 50
    for s in moving:
        torque = np.array(s.target_moment) + friction_law(robot, np.array(s.target_qd))
        assert s.target_current == pytest.approx(torque / robot.torque_constant, rel=1e-3, abs=1e-6)
    at_rest = bench.snapshots[-1]
    assert at_rest.target_current == pytest.approx(np.divide(at_rest.target_moment, robot.torque_constant))
    assert all(s.joint_control_output == s.target_current for s in bench.snapshots)


def follow(robot, fidelity, speed, n=1200, amplitude=0.4):
    """Swing all joints; what packages show: target, its speed, and the angles of the same moment."""
    plant, period = Plant(robot, fidelity, 1), robot.generation.period_s
    t = np.arange(n) * period
    grown = np.clip(t / 0.5, 0.0, 1.0)
    size, rate = grown**2 * (3 - 2 * grown), np.where(grown < 1.0, 12 * grown * (1 - grown), 0.0)
    w = speed / amplitude
    swing, swing_rate = amplitude * np.sin(w * t), speed * np.cos(w * t)
    share = np.array([1.0, 0.5, 0.5, 1.0, 1.0, 1.0])
    q = np.array(robot.home_q) + np.outer(size * swing, share)
    qd = np.outer(size * swing_rate + rate * swing, share)
    qdd = np.gradient(qd, period, axis=0)
    actual = []
    for row in zip(q, qd, qdd, strict=True):
        plant.step(target(*row))
        actual.append(plant.sense().actual_q)
    return q[:-1], qd[:-1], np.array(actual)[1:]


@pytest.mark.parametrize("robot", [ROBOTS["ur3e"], UR5E, UR10E], ids=lambda robot: robot.name)
@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_typical_arm_is_half_a_millisecond_behind_its_target(robot, speed):
    """Source: rows of a real UR3e: .50 ms times the joint's speed, the rest .06 to .12 mrad rms."""
    q, qd, actual = (part[400:] for part in follow(robot, TYPICAL, speed))
    behind = q - actual
    lag = (behind * qd).sum(axis=0) / (qd * qd).sum(axis=0)
    rest = np.sqrt(((behind - lag * qd) ** 2).mean(axis=0))
    assert lag.mean() == pytest.approx(5e-4, abs=5e-5)
    assert (rest > 5e-5).all()
    assert (rest < 1.5e-4).all()


@pytest.mark.parametrize("robot", ARMS)
@pytest.mark.parametrize("share", [-0.8, 0.3, 0.9])
def test_true_friction_rises_as_fast_as_the_compensation(robot, share):
    """Servos without gains press with a share of the dry friction: joints creep at that share of the speed."""
    no_gains = ServoGains(np.zeros(6), 0.0)
    model = build_physics(robot, robot.dh, (1.0,) * 6, no_gains, robot.generation.substep_us * 1e-6)
    model.opt.gravity[:] = 0.0
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home_q
    model.actuator_biasprm[:, 0] = share * np.array(robot.coulomb)
    for _ in range(50):
        mujoco.mj_step(model, data)
    assert data.qvel == pytest.approx(share * robot.reversal_speed, rel=0.05)


def follow_small(robot, fidelity, qd):
    """All joints from rest at speeds qd (n,): displacements of target and joints, (n,) and (n, 6)."""
    plant, period = Plant(robot, fidelity, 1), robot.generation.period_s
    q, qdd = np.cumsum(qd) * period, np.gradient(qd, period)
    actual = []
    for row in np.array([q, qd, qdd]).T:
        position, speed, acceleration = (np.full(6, value) for value in row)
        plant.step(target(robot.home_q + position, speed, acceleration))
        plant.sense()
        actual.append(plant.q_true - robot.home_q)
    return q, np.array(actual)


@pytest.mark.parametrize("robot", ARMS)
@pytest.mark.parametrize("speed", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("hertz", [3.0, 8.0])
def test_small_motions_keep_their_size(robot, speed, hertz):
    """The compensation of friction, which knows only the target, does not push a slow joint ahead of it."""
    period = robot.generation.period_s
    t = np.arange(round(4.0 / hertz / period)) * period
    q, actual = follow_small(robot, IDEAL, speed * np.sin(2.0 * np.pi * hertz * t))
    wave = np.exp(-2j * np.pi * hertz * t) * (t >= 2.0 / hertz)
    gain = np.abs(wave @ actual) / np.abs(wave @ q)
    assert (gain > 0.85).all()
    assert (gain < 1.1).all()


@pytest.mark.parametrize("robot", ARMS)
def test_a_slow_reversal_leaves_no_more_than_the_ripple_of_the_gears(robot):
    """To and fro at 0.01 rad/s; a real UR3e in motion is within .06 to .12 mrad rms of its target."""
    still, on = np.zeros(25), np.full(150, 0.01)
    qd = np.convolve(np.concatenate([still, on, -on, on, still]), np.full(5, 0.2), "same")
    for fidelity, bound in ((IDEAL, 3e-5), (TYPICAL, 1e-4)):
        q, actual = follow_small(robot, fidelity, qd)
        behind = q[:, None] - actual
        assert (np.sqrt((behind**2).mean(axis=0)) < bound).all()


@pytest.mark.parametrize("robot", ARMS)
def test_a_small_step_ends_at_its_target(robot):
    step, period = 1e-3, robot.generation.period_s
    qd = np.concatenate([np.zeros(10), [step / period], np.zeros(389)])
    _, actual = follow_small(robot, IDEAL, qd)
    assert actual.max() < 1.5 * step
    assert actual[-50:] == pytest.approx(step, abs=1e-5)


def test_a_finer_physics_step_changes_next_to_nothing():
    finer = replace(UR5E, generation=replace(E_SERIES, substep_us=500))
    _, _, coarse = follow(UR5E, IDEAL, 1.0, n=600)
    _, _, fine = follow(finer, replace(IDEAL, feedback_age=0.002), 1.0, n=600)
    assert np.abs(coarse - fine)[50:].max() < 2e-4
