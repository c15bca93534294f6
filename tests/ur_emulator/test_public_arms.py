"""The arms of the e-Series against the URDF and MJCF models that public packages hold.

`docs/fidelity.md` has the greatest differences and their reasons.
"""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from public_arms import MENAGERIE, ROS, Body, menagerie_model, ros_model

from ur_emulator.kinematics.arm_model import ArmModel
from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.mjcf import GRAVITY, arm_spec
from ur_emulator.models.robots import ROBOTS

POSTURES = np.random.default_rng(8).uniform(-np.pi, np.pi, (40, 6))

# Greatest difference of gravity torques, as a share of the greatest of the joint, and of mass matrices, as a
# share of their norm.
EXACT = (1e-9, 1e-5)
TOLERANCES = {
    "ur20": (0.06, 0.01),  # another wrist 3 there: .926 kg, where UR's article has .846
    "ur30": (1e-9, 0.45),  # the tensors there are a UR16e's
}
# Of shoulder and elbow: there are masses of CB3 arms, in the middle of the links.
MJCF_TOLERANCES = {"ur5e": (0.29, 0.32), "ur10e": (0.18, 0.24)}


def differences(robot, other):
    """Of gravity torques (6,) and of the mass matrix, as shares, over all postures."""
    model = arm_spec(robot, robot.dh, (1.0,) * 6).compile()
    data, other_data = mujoco.MjData(model), other.createData()
    other.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    gravity, others, matrix, worst = [], [], np.zeros((6, 6)), 0.0
    for q in POSTURES:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, matrix)
        theirs = pin.crba(other, other_data, q)
        theirs = np.triu(theirs) + np.triu(theirs, 1).T
        worst = max(worst, np.linalg.norm(matrix - theirs) / np.linalg.norm(theirs))
        gravity.append(data.qfrc_bias.copy())
        others.append(pin.computeGeneralizedGravity(other, other_data, q).copy())
    difference = np.abs(np.subtract(gravity, others)).max(axis=0)
    return difference / np.maximum(np.abs(others).max(axis=0), 1e-3 * np.abs(others).max()), worst


@pytest.mark.parametrize("name", ROS)
def test_masses_and_tensors_of_the_ros_description(name):
    gravity, matrix = differences(ROBOTS[name], ros_model(ROS[name]))
    of_gravity, of_matrix = TOLERANCES.get(name, EXACT)
    assert gravity.max() < of_gravity
    assert matrix < of_matrix


def test_the_ur20_differs_in_its_wrist_3_only():
    link, ros = ROBOTS["ur20"].links[5], ROS["ur20"]
    wrist_3 = Body(link.mass, link.com, (*link.inertia, *link.products))
    gravity, matrix = differences(ROBOTS["ur20"], ros_model(ros._replace(bodies=(*ros.bodies[:5], wrist_3))))
    assert gravity.max() < EXACT[0]
    assert matrix < EXACT[1]


@pytest.mark.parametrize("name", ROS)
def test_geometry_of_the_ros_description(name):
    arm, other = ArmModel(ROBOTS[name]), ros_model(ROS[name])
    data = other.createData()
    for q in POSTURES:
        pin.forwardKinematics(other, data, q)
        x, y, z, *rotation = arm.fk(q.tolist())
        assert [x, y, z] == pytest.approx(data.oMi[6].translation, abs=1e-9)
        assert pin.exp3(np.array(rotation)) == pytest.approx(data.oMi[6].rotation, abs=1e-8)


def test_every_arm_is_compared():
    assert ROS.keys() == {name for name, robot in ROBOTS.items() if robot.generation is E_SERIES}


@pytest.mark.parametrize("name", MENAGERIE)
def test_the_mjcf_models_are_near(name):
    gravity, matrix = differences(ROBOTS[name], menagerie_model(name))
    of_gravity, of_matrix = MJCF_TOLERANCES[name]
    assert gravity[1:3].max() < of_gravity
    assert matrix < of_matrix
