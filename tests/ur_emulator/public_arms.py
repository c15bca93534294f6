"""The e-Series arms of public URDF models, by the numbers of `public_arms.toml`."""

import tomllib
from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin


class Body(NamedTuple):
    """One link: mass [kg], centre of mass [m], inertia xx yy zz xy xz yz about it [kg m²]."""

    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, ...]


class RosArm(NamedTuple):
    """A ROS description: offsets of the joints as they stand in default_kinematics.yaml [m]; six links."""

    shoulder_z: float
    forearm_x: float
    wrist_1_x: float
    wrist_1_z: float
    wrist_2_y: float
    wrist_3_y: float
    bodies: tuple[Body, ...]


def _arm(row):
    return RosArm(**{**row, "bodies": tuple(Body(**body) for body in row["bodies"])})


ROS = {
    name: _arm(row) for name, row in tomllib.loads(Path(__file__).with_suffix(".toml").read_text()).items()
}
ROS["ur7e"], ROS["ur12e"] = ROS["ur5e"], ROS["ur10e"]


def ros_model(arm):
    """A Pinocchio model as a ROS description has it: link frames at the joints, tensors turned by an rpy."""
    quarter = pi / 2
    places = (
        ((0.0, 0.0, arm.shoulder_z), 0.0),
        ((0.0, 0.0, 0.0), quarter),
        ((arm.forearm_x, 0.0, 0.0), 0.0),
        ((arm.wrist_1_x, 0.0, arm.wrist_1_z), 0.0),
        ((0.0, arm.wrist_2_y, 0.0), quarter),
        ((0.0, arm.wrist_3_y, 0.0), -quarter),
    )
    turns = (quarter, 0.0, 0.0, quarter, -quarter, 0.0)
    model, parent = pin.Model(), 0
    for (place, roll), body, turn in zip(places, arm.bodies, turns, strict=True):
        frame = pin.SE3(pin.utils.rotate("x", roll), np.array(place))
        parent = model.addJoint(parent, pin.JointModelRZ(), frame, f"joint {parent}")
        R = pin.utils.rotate("x", turn)
        tensor = R @ _tensor(body.inertia) @ R.T
        model.appendBodyToJoint(
            parent, pin.Inertia(body.mass, np.array(body.com), tensor), pin.SE3.Identity()
        )
    return model


def _tensor(inertia):
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
