"""Shapes of bodies: their names and sizes as people give them, and as MuJoCo has them."""

from collections.abc import Sequence
from math import cos, hypot, sin
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from protocol.pose import rotvec_from_flat
from ur_emulator.machine.models.robot_model import Vector3, Vector6, six

_GEOM = mujoco.mjtGeom


class Shape(NamedTuple):
    """A kind of shape.

    Attributes:
        geom: MuJoCo's type.
        scale: MuJoCo's sizes over those of `things.SIZES`.
        rest: MuJoCo's sizes in place of those that people do not give [m].
    """

    geom: mujoco.mjtGeom
    scale: tuple[float, ...]
    rest: Vector3 = (0.0, 0.0, 0.0)

    def to_mujoco(self, size: Sequence[float]) -> list[float]:
        """Return MuJoCo's three sizes."""
        scaled = [scale * value for scale, value in zip(self.scale, size, strict=True)]
        return [*scaled, *self.rest[len(scaled) :]]

    def from_mujoco(self, size: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the sizes that people give."""
        return tuple(value / scale for scale, value in zip(self.scale, size.tolist(), strict=False))


SHAPES = {
    "box": Shape(_GEOM.mjGEOM_BOX, (0.5, 0.5, 0.5)),
    "sphere": Shape(_GEOM.mjGEOM_SPHERE, (1.0,)),
    "capsule": Shape(_GEOM.mjGEOM_CAPSULE, (1.0, 0.5)),
    # A wall without end, of which a part is drawn; what is on the side of negative z is inside it.
    "plane": Shape(_GEOM.mjGEOM_PLANE, (), (5.0, 5.0, 0.1)),
    "cylinder": Shape(_GEOM.mjGEOM_CYLINDER, (1.0, 0.5)),
}
# By MuJoCo's types; what people do not give is drawn as the box around it.
BY_GEOM = {int(shape.geom): name for name, shape in SHAPES.items()} | {
    int(geom): "box" for geom in (_GEOM.mjGEOM_ELLIPSOID, _GEOM.mjGEOM_MESH)
}


class DrawnBox(NamedTuple):
    """A shape in MuJoCo's frame of it: its middle (3,), its rotation (3, 3), MuJoCo's sizes (3,) [m]."""

    middle: NDArray[np.float64]
    rotation: NDArray[np.float64]
    size: NDArray[np.float64]

    @classmethod
    def of(cls, model: mujoco.MjModel, geom: int) -> "DrawnBox":
        """A mesh's is the box around it, along the axes of its file: MuJoCo's frame is its principal axes."""
        if model.geom_type[geom] != _GEOM.mjGEOM_MESH:
            return cls(np.zeros(3), np.eye(3), model.geom_size[geom])
        mesh, flat = int(model.geom_dataid[geom]), np.empty(9)
        mujoco.mju_quat2Mat(flat, model.mesh_quat[mesh])
        to_file = flat.reshape(3, 3)
        begin = model.mesh_vertadr[mesh]
        corners = model.mesh_vert[begin : begin + model.mesh_vertnum[mesh]] @ to_file.T
        low, high = corners.min(axis=0), corners.max(axis=0)
        return cls(to_file.T @ (low + high) / 2.0, to_file.T, (high - low) / 2.0)

    def place(self, data: mujoco.MjData, geom: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return its position (3,) [m] and rotation (3, 3) in the base frame."""
        rotation = data.geom_xmat[geom].reshape(3, 3)
        return data.geom_xpos[geom] + rotation @ self.middle, rotation @ self.rotation


def pose_of(position: NDArray[np.float64], rotation: NDArray[np.float64]) -> Vector6:
    """Return the pose of a position (3,) [m] and a rotation (3, 3)."""
    return six([*position.tolist(), *rotvec_from_flat(*rotation.ravel().tolist())])


def quaternion(vector: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of a rotation vector [rad]."""
    angle = hypot(*vector)
    x, y, z = vector
    share = sin(angle / 2) / angle if angle > 0.0 else 0.5
    return (cos(angle / 2), share * x, share * y, share * z)


def collide(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Find the contacts of the present pose."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
