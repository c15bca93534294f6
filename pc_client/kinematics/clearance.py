"""How far the arm stays from itself and from the surface it stands on.

Convex hulls of the published collision meshes, moved by the nominal kinematics; distances by Pinocchio's
collision library (coal). Tools and the surroundings are not known here: the bare arm on a plane z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pc_client.kinematics.robot_data import find_robot_file, find_share_folder
from pc_client.kinematics.robot_model import RobotModel, load_pinocchio_model

Array = NDArray[np.float64]

# The shoulder end of the upper arm cannot move up or down (on a UR5 it is 30 mm above the plane in every
# posture), and its elbow end lies beside the forearm's: from the forearm on, links are watched.
_FIRST_LINK_ABOVE_FLOOR = 3

# Neighbours touch at their common joint. Of the wrist's links those two joints apart pass each other closely
# but freely: the full meshes of a UR3 keep 6.7 mm in every posture, while the forearm's hull, which bridges
# its hollow side, would not. Numbers are the joints that carry the links (forearm 3, wrist 3 is 6).
_FREE_BY_DESIGN = {(3, 5), (4, 6)}


class Nearest(NamedTuple):
    """What came near: its name for people, and the joint 0..5 that carries it (the outer of two links)."""

    name: str
    joint: int


class Clearance(NamedTuple):
    """Distances along a joint path; negative when bodies overlap.

    Attributes:
        floor: (n,) lowest point of forearm and wrists above the base plane [m].
        floor_nearest: (n,) the link that comes lowest.
        own: (n,) smallest distance between links that are not neighbours [m].
        own_nearest: (n,) the two links that come closest.
    """

    floor: Array
    floor_nearest: tuple[Nearest, ...]
    own: Array
    own_nearest: tuple[Nearest, ...]


@dataclass(frozen=True, slots=True)
class ClearanceModel:
    """The hulls of one arm, ready for distance queries. Like RobotModel: one per thread."""

    robot: RobotModel
    _own_pairs: Any = field(repr=False)
    _own_data: Any = field(repr=False)
    _floor_pairs: Any = field(repr=False)
    _floor_data: Any = field(repr=False)
    _own_names: tuple[Nearest, ...] = field(repr=False)
    _floor_names: tuple[Nearest, ...] = field(repr=False)

    def along(self, q: ArrayLike) -> Clearance:
        """Measure the clearance at each posture of a joint path.

        Args:
            q: (n, 6) joint angles [rad].

        Returns:
            The distances, one per posture.
        """
        path = np.atleast_2d(np.asarray(q, dtype=np.float64))
        own, floor = np.empty(len(path)), np.empty(len(path))
        own_nearest, floor_nearest = [], []
        model, data = self.robot.pin_model, self.robot.pin_data
        for k, q_k in enumerate(path):
            nearest = pin.computeDistances(model, data, self._own_pairs, self._own_data, q_k)
            own[k] = self._own_data.distanceResults[nearest].min_distance
            own_nearest.append(self._own_names[nearest])
            lowest = pin.computeDistances(model, data, self._floor_pairs, self._floor_data, q_k)
            floor[k] = self._floor_data.distanceResults[lowest].min_distance
            floor_nearest.append(self._floor_names[lowest])
        return Clearance(floor, tuple(floor_nearest), own, tuple(own_nearest))


def clearance_model(robot: RobotModel) -> ClearanceModel:
    """Return the hulls of `robot`.

    Raises:
        PlanningError: example-robot-data is not installed.
    """
    own_pairs, floor_pairs = _load_hulls(robot.description.urdf)
    return ClearanceModel(
        robot,
        own_pairs,
        own_pairs.createData(),
        floor_pairs,
        floor_pairs.createData(),
        tuple(_nearest(own_pairs, pair.first, pair.second) for pair in own_pairs.collisionPairs),
        tuple(_nearest(floor_pairs, pair.second) for pair in floor_pairs.collisionPairs),
    )


@lru_cache(maxsize=4)
def _load_hulls(urdf: str) -> tuple[Any, Any]:
    """Read the meshes of a URDF: link-against-link and floor-against-link pairs (shared, never changed)."""
    model = load_pinocchio_model(urdf)  # its frames place the meshes, so they are in `base` already
    meshes = pin.buildGeomFromUrdf(
        model, str(find_robot_file(urdf)), pin.GeometryType.COLLISION, package_dirs=[str(find_share_folder())]
    )
    own_pairs, floor_pairs = pin.GeometryModel(), pin.GeometryModel()
    floor_pairs.addGeometryObject(
        pin.GeometryObject(
            "floor", 0, 0, pin.SE3.Identity(), pin.coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        )
    )
    for mesh in meshes.geometryObjects:
        if not isinstance(mesh.geometry, pin.coal.BVHModelBase):
            continue  # ee_link carries a token box, not a part of the arm
        mesh.geometry.buildConvexHull(True, "Qt")  # Qt: triangles only, as coal needs
        hull = pin.GeometryObject(
            mesh.name, mesh.parentJoint, mesh.parentFrame, mesh.placement, mesh.geometry.convex
        )
        own_pairs.addGeometryObject(hull)
        if mesh.parentJoint >= _FIRST_LINK_ABOVE_FLOOR:
            index = floor_pairs.addGeometryObject(hull)
            floor_pairs.addCollisionPair(pin.CollisionPair(0, index))
    joints = [hull.parentJoint for hull in own_pairs.geometryObjects]
    for i, joint_i in enumerate(joints):
        for j, joint_j in enumerate(joints):
            if joint_j > joint_i + 1 and (joint_i, joint_j) not in _FREE_BY_DESIGN:
                own_pairs.addCollisionPair(pin.CollisionPair(i, j))
    return own_pairs, floor_pairs


def _nearest(geometry: Any, *indices: int) -> Nearest:
    """Name one link or two of a geometry model: `wrist_1_link_0` becomes `wrist 1`."""
    links = [geometry.geometryObjects[index] for index in indices]
    names = [str(link.name).split("_link")[0].replace("_", " ") for link in links]
    return Nearest(" and ".join(names), max(int(link.parentJoint) for link in links) - 1)
