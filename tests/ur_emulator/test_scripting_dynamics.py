"""Dynamics that scripts and RTDE clients see, against Pinocchio, which has its own model of the arm."""

import numpy as np
import pinocchio as pin
import pytest
from e_series_support import ESeriesBench, program

from ur_emulator.controller.arm_in_space import ArmInSpace
from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.robots import robot_by_name

Q = (0.3, -1.2, 1.9, -0.7, 1.1, 0.4)
QD = (0.5, -0.8, 1.3, 0.9, -1.1, 2.0)
TCP = (0.02, -0.03, 0.15, 0.2, -0.4, 0.1)
NO_PAYLOAD = (0.0, (0.0, 0.0, 0.0), np.zeros((3, 3)))


def pinocchio_arm(robot, payload=NO_PAYLOAD):
    """The arm as the controller knows it: each joint turns about z, its link follows the rest of its DH row."""
    model = pin.Model()
    placement, parent = pin.SE3.Identity(), 0
    for i, (row, link) in enumerate(zip(robot.dh, robot.links, strict=True)):
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint {i}")
        c, s = np.cos(row.alpha), np.sin(row.alpha)
        placement = pin.SE3(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([row.a, 0.0, row.d]))
        xy, xz, yz = link.products
        xx, yy, zz = link.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) * (not robot.has_point_masses)
        model.appendBodyToJoint(parent, pin.Inertia(link.mass, np.array(link.com), inertia), placement)
    mass, cog, inertia = payload
    model.appendBodyToJoint(parent, pin.Inertia(mass, np.array(cog), inertia), placement)
    tcp = pin.SE3(pin.exp3(np.array(TCP[3:])), np.array(TCP[:3]))
    model.addFrame(pin.Frame("tcp", parent, 0, placement * tcp, pin.FrameType.OP_FRAME))
    return model, model.createData()


def asked(*lines, robot="ur5e"):
    """What a program computes on an arm with the nominal table."""
    bench = ESeriesBench(robot=robot, fidelity="exact")
    bench.run(program(f"set_tcp(p{list(TCP)})", *lines))
    assert not bench.errors
    return bench


def test_jacobian():
    model, data = pinocchio_arm(robot_by_name("ur5e"))
    expected = pin.computeFrameJacobian(
        model, data, np.array(Q), model.getFrameId("tcp"), pin.LOCAL_WORLD_ALIGNED
    )
    bench = asked(f"global a = get_jacobian({list(Q)})", f"global b = get_jacobian({list(Q)}, p{list(TCP)})")
    assert np.array(list(bench["a"])) == pytest.approx(expected, abs=1e-9)
    assert bench["b"] == bench["a"]


def test_jacobian_is_that_of_the_measured_arm_if_no_angles_are_given():
    bench = asked("global a = get_jacobian()", "global b = get_jacobian(get_actual_joint_positions())")
    assert bench["a"] == bench["b"]


def test_jacobian_time_derivative():
    h = 1e-6
    ahead, behind = ([q + sign * h * v for q, v in zip(Q, QD, strict=True)] for sign in (1, -1))
    bench = asked(
        f"global rate = get_jacobian_time_derivative({list(Q)}, {list(QD)})",
        f"global ahead = get_jacobian({ahead})",
        f"global behind = get_jacobian({behind})",
    )
    difference = (np.array(list(bench["ahead"])) - np.array(list(bench["behind"]))) / (2.0 * h)
    assert np.abs(difference).max() > 1.0
    assert np.array(list(bench["rate"])) == pytest.approx(difference, abs=1e-7)


@pytest.mark.parametrize("robot", ["ur3e", "ur5e", "ur10e"])
def test_mass_matrix_and_coriolis_torques(robot):
    numbers = robot_by_name(robot)
    inertia = np.array([[0.02, 0.001, 0.002], [0.001, 0.03, 0.003], [0.002, 0.003, 0.04]])
    model, data = pinocchio_arm(numbers, (2.0, (0.01, -0.02, 0.08), inertia))
    expected = pin.crba(model, data, np.array(Q))
    expected = np.triu(expected) + np.triu(expected, 1).T
    coriolis = pin.nonLinearEffects(model, data, np.array(Q), np.array(QD))
    coriolis = coriolis - pin.computeGeneralizedGravity(model, data, np.array(Q))
    bench = asked(
        "set_target_payload(2, [0.01, -0.02, 0.08], [0.02, 0.03, 0.04, 0.001, 0.002, 0.003])",
        f"global m = get_mass_matrix({list(Q)})",
        f"global with_rotors = get_mass_matrix({list(Q)}, True)",
        f"global c = get_coriolis_and_centrifugal_torques({list(Q)}, {list(QD)})",
        "global still = get_coriolis_and_centrifugal_torques()",
        robot=robot,
    )
    mass = np.array(list(bench["m"]))
    assert mass == pytest.approx(expected, abs=1e-9)
    assert np.array(list(bench["with_rotors"])) - mass == pytest.approx(np.diag(numbers.armature), abs=1e-9)
    assert bench["c"] == pytest.approx(coriolis, abs=1e-9)
    assert bench["still"] == pytest.approx([0.0] * 6, abs=1e-12)


def test_measured_accelerations_are_those_of_the_motion():
    bench = ESeriesBench(fidelity="typical")
    bench.start(program("speedj([0.8, -0.8, 0.8, 0.8, 0.8, 0.8], 2, 0.4)", "sync()"))
    seen = []
    for _ in range(200):
        bench.tick()
        seen.append(bench.controller.state.past.joint_accelerations())
    wanted = np.array([2.0, -2.0, 2.0, 2.0, 2.0, 2.0])
    assert np.median(np.array(seen[60:180]), axis=0) == pytest.approx(wanted, rel=0.15)


def test_payload_transition_is_smooth_and_the_arm_carries_it():
    bench = ESeriesBench(fidelity="ideal")
    bench.start(program("set_target_payload(4, [0, 0, 0.1], transition_time=0.2)", "sleep(0.4)"))
    moments = [bench.tick().target_moment for _ in range(150)]
    masses = [snapshot.payload for snapshot in bench.snapshots]
    assert masses[:3] == pytest.approx([0.04, 0.08, 0.12])
    assert masses[-1] == 4.0
    steps = np.diff(np.array(moments), axis=0)
    assert np.abs(steps).max() < 0.01 * np.abs(np.array(moments[-1])).max()
    assert np.abs(np.array(bench.now.position_error)).max() < 1e-3


def space(robot, qdd):
    model, data = pinocchio_arm(robot, (2.0, (0.01, 0.02, 0.05), np.zeros((3, 3))))
    model.gravity.linear = np.array([0.0, 0.0, -9.82])
    arm = ArmInSpace(ArmModel(robot), (Q, QD), qdd, (Q, QD), (0.0,) * 6, TCP, force_at_flange=True)
    return model, data, arm


@pytest.mark.parametrize("qdd", [(0.0,) * 6, (1.0, -2.0, 3.0, -4.0, 5.0, -6.0)])
def test_acceleration_of_the_tcp(qdd):
    model, data, arm = space(robot_by_name("ur10e"), qdd)
    pin.forwardKinematics(model, data, np.array(Q), np.array(QD), np.array(qdd))
    expected = pin.getFrameClassicalAcceleration(
        model, data, model.getFrameId("tcp"), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    assert arm.target_acceleration == pytest.approx(expected.vector, abs=1e-4)
    assert arm.actual_acceleration == arm.target_acceleration


@pytest.mark.parametrize("qdd", [(0.0,) * 6, (1.0, -2.0, 3.0, -4.0, 5.0, -6.0)])
def test_wrench_that_holds_the_base(qdd):
    model, data, arm = space(robot_by_name("ur10e"), qdd)
    pin.rnea(model, data, np.array(Q), np.array(QD), np.array(qdd))
    expected = data.liMi[1].act(data.f[1]).vector
    wrench = arm.target_base_wrench((0.0, 0.0, 9.82), 2.0, (0.01, 0.02, 0.05))
    assert wrench == pytest.approx(expected, abs=1e-3)
