"""How far the arm and its tool stay from themselves, from the surface under them and from what stands around.

Convex hulls of the links, moved by the nominal kinematics, against the bodies of a cell; distances by
Pinocchio's collision library (coal). The hulls are those of the published collision meshes. Of an arm without
meshes they enclose the housings of its joints, which are cylinders about the axes of the joints; two links
share the distance between their middle planes equally.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from math import cos, pi
from types import MappingProxyType
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pc_client.arrays import Array
from pc_client.kinematics.arms import DhArm, RobotDescription, find_robot_file, find_share_folder
from pc_client.kinematics.model import RobotModel, load_pinocchio_model
from ur_hil.cell import Solid, Three

# The joint that carries a body, as Pinocchio counts: 0 nothing, 3 the forearm's, 4 to 6 the wrists'.
_FIXED, _WRIST_3 = 0, 6

# The shoulder end of the upper arm cannot move up or down (on a UR5 it is 30 mm above the plane in every
# posture), and its elbow end lies beside the forearm's: from the forearm on, links are watched.
_FIRST_LINK_ABOVE_FLOOR = 3

# Neighbours touch at their common joint. Of the wrist's links those two joints apart pass each other closely
# but freely: the full meshes of a UR3 keep 6.7 mm in every posture, while the forearm's hull, which bridges
# its hollow side, would not.
_FREE_BY_DESIGN = {(3, 5), (4, 6)}

_COAL_SHAPES = MappingProxyType(
    {
        "box": pin.coal.Box,
        "cylinder": pin.coal.Cylinder,
        "sphere": pin.coal.Sphere,
        "capsule": pin.coal.Capsule,
    }
)


class Nearest(NamedTuple):
    """Two bodies that came near: their names for people, and the joint 0..5 that carries the outer one."""

    first: str
    second: str
    joint: int

    def says(self, distance: float, least: float) -> str:
        """Say that a distance [m] is below the least one that is allowed [m]."""
        return (
            f"{self.first} comes within {distance * 1e3:.0f} mm of {self.second},"
            f" at least {least * 1e3:.0f} mm is asked"
        )


class Distances(NamedTuple):
    """Smallest distances along a joint path.

    Attributes:
        least: (n,) smallest distance at each posture [m]; negative when bodies overlap, infinite without any.
        nearest: the two bodies that come closest at each posture; empty without any.
    """

    least: Array
    nearest: tuple[Nearest, ...]


_T = TypeVar("_T")


class Clearance(NamedTuple, Generic[_T]):
    """What is measured, or kept, of each kind of distance.

    Attributes:
        floor: of forearm, wrists and tool from the floor.
        own: of links that are not neighbours, and of the tool, from each other.
        cell: of moving links and tool from walls and solids of the cell.
    """

    floor: _T
    own: _T
    cell: _T


class _Pairs(NamedTuple):
    """Pairs of bodies whose distances are asked for together, with Pinocchio's model and scratch memory."""

    geometry: Any
    data: Any
    names: tuple[Nearest, ...]


@dataclass(frozen=True, slots=True)
class ClearanceModel:
    """The bodies of one arm in its cell, ready for distance queries. Like RobotModel: one per thread."""

    robot: RobotModel
    _floor: _Pairs = field(repr=False)
    _own: _Pairs = field(repr=False)
    _cell: _Pairs = field(repr=False)

    def along(self, q: ArrayLike) -> Clearance[Distances]:
        """Measure the clearance at each posture of a joint path (n, 6) [rad]."""
        path = np.atleast_2d(np.asarray(q, dtype=np.float64))
        return Clearance(*(self._distances(pairs, path) for pairs in (self._floor, self._own, self._cell)))

    def _distances(self, pairs: _Pairs, path: Array) -> Distances:
        least = np.full(len(path), np.inf)
        if not pairs.names:
            return Distances(least, ())
        nearest = []
        model, data = self.robot.pin_model, self.robot.pin_data
        for k, q_k in enumerate(path):
            index = pin.computeDistances(model, data, pairs.geometry, pairs.data, q_k)
            least[k] = pairs.data.distanceResults[index].min_distance
            nearest.append(pairs.names[index])
        return Distances(least, tuple(nearest))


def clearance_model(robot: RobotModel) -> ClearanceModel:
    """The bodies of an arm in its cell; PlanningError if example-robot-data is not installed."""
    cell = robot.cell
    hulls = load_hulls(robot.description)
    links = [_Body(str(hull.name).split("_link")[0].replace("_", " "), hull) for hull in hulls]
    tool = [_Body(f"tool {solid.title}", _geometry(solid, robot)) for solid in cell.tool.solids]
    around = [_Body(f"wall '{wall.name}'", _half_space(wall.normal, wall.offset)) for wall in cell.walls]
    around += [_Body(solid.title, _geometry(solid, None)) for solid in cell.solids]
    floor = _Body(f"the floor at z = {cell.floor_z:g} m", _half_space((0.0, 0.0, 1.0), cell.floor_z))

    above_floor = [body for body in (*links, *tool) if body.joint >= _FIRST_LINK_ABOVE_FLOOR]
    moving = [body for body in (*links, *tool) if body.joint > _FIXED]
    own = [
        (outer, inner)
        for inner in links
        for outer in links
        if outer.joint > inner.joint + 1 and (inner.joint, outer.joint) not in _FREE_BY_DESIGN
    ]
    # A tool begins where wrist 3 ends. Everything else it can reach, wrist 2 with a part that stands back.
    own += [(part, link) for part in tool for link in links if link.joint != _WRIST_3]
    return ClearanceModel(
        robot,
        _pairs((body, floor) for body in above_floor),
        _pairs(own),
        _pairs((body, other) for body in moving for other in around),
    )


class _Body(NamedTuple):
    """A body with its name for people."""

    name: str
    geometry: Any

    @property
    def joint(self) -> int:
        """The joint that carries it; 0 for what does not move."""
        return int(self.geometry.parentJoint)


def _pairs(bodies: Iterable[tuple[_Body, _Body]]) -> _Pairs:
    """Make a geometry model of pairs of bodies: what moves, and what it must not touch."""
    geometry, index, names = pin.GeometryModel(), {}, []
    for pair in bodies:
        for body in pair:
            if body.name not in index:
                index[body.name] = geometry.addGeometryObject(body.geometry)
        moving, other = pair
        geometry.addCollisionPair(pin.CollisionPair(index[other.name], index[moving.name]))
        names.append(Nearest(moving.name, other.name, moving.joint - 1))
    return _Pairs(geometry, geometry.createData(), tuple(names))


def _half_space(normal: Three, offset: float) -> Any:
    """Return what lies behind a plane in `base`."""
    shape = pin.coal.Halfspace(np.array(normal), offset)
    return pin.GeometryObject("half space", _FIXED, 0, pin.SE3.Identity(), shape)


def _geometry(solid: Solid, carrier: RobotModel | None) -> Any:
    """Return a solid that stands in `base`, or at the flange of the arm that carries it."""
    placement = pin.SE3(pin.rpy.rpyToMatrix(*solid.rpy), np.array(solid.centre))
    joint = _FIXED
    if carrier is not None:
        flange = carrier.pin_model.frames[carrier.flange_frame]
        joint, placement = flange.parentJoint, flange.placement * placement
    shape = _COAL_SHAPES[solid.shape](*solid.sizes)
    return pin.GeometryObject(solid.name, joint, 0, placement, shape)


@lru_cache(maxsize=4)
def load_hulls(description: RobotDescription) -> tuple[Any, ...]:
    """The convex hulls of the links, base to wrist 3 (shared, never changed)."""
    model = load_pinocchio_model(description)  # its frames place the links, so they are in `base` already
    geometry = description.geometry
    if isinstance(geometry, DhArm):
        return link_hulls(geometry, model)
    hulls = []
    for mesh in load_meshes(geometry, model):
        mesh.geometry.buildConvexHull(True, "Qt")  # Qt: triangles only, as coal needs
        hull = mesh.geometry.convex
        hulls.append(pin.GeometryObject(mesh.name, mesh.parentJoint, mesh.parentFrame, mesh.placement, hull))
    return tuple(hulls)


def load_meshes(file: str, model: Any) -> list[Any]:
    """The published meshes of the links, one pin.GeometryObject a link, base to wrist 3.

    The links are placed by the frames of the Pinocchio model of the arm's URDF.
    """
    meshes = pin.buildGeomFromUrdf(
        model, str(find_robot_file(file)), pin.GeometryType.COLLISION, package_dirs=[str(find_share_folder())]
    )
    # ee_link carries a token box, not a part of the arm.
    return [mesh for mesh in meshes.geometryObjects if isinstance(mesh.geometry, pin.coal.BVHModelBase)]


_CORNERS = 24
"""Of the polygon around a circle."""

_CAP = 1.45
"""How far a wrist stands out on the side that carries nothing, in radii. Source: the meshes of UR3, UR5 and
UR10 (1.24 to 1.46)."""


def link_hulls(arm: DhArm, model: Any) -> tuple[Any, ...]:
    """The hulls of the links, one convex pin.GeometryObject a link, base to wrist 3.

    The links are placed by the frames of the Pinocchio model of the arm's URDF.
    """
    hulls = []
    for link, rings in housings(arm).items():
        frame = model.frames[index := model.getFrameId(link)]
        hull = _hull(np.vstack(rings))
        hulls.append(pin.GeometryObject(link, frame.parentJoint, index, frame.placement, hull))
    return tuple(hulls)


def housings(arm: DhArm) -> dict[str, tuple[Array, ...]]:
    """Both ends (n, 3) of one or two round housings of each link, in the frame of the link [m]."""
    shoulder, elbow, wrist = arm.radii
    upper, half = arm.shoulder_offset / 2, arm.elbow_step / 2
    end, side, cap = arm.wrist_step / 2, arm.d5 / 2, _CAP * wrist
    return {
        "base_link": (*_about_z(arm.foot, (0.0, 0.0)), *_about_z(shoulder, (0.0, arm.d1 - upper))),
        "shoulder_link": (
            *_about_z(shoulder, (0.0, -upper), (0.0, upper)),
            *_about_y(shoulder, (0.0, 0.0), (upper, 0.0)),
        ),
        "upper_arm_link": (
            *_about_y(shoulder, (-upper, 0.0), (upper, 0.0)),
            *_about_y(elbow, (-half, -arm.a2), (half, -arm.a2)),
        ),
        "forearm_link": (
            *_about_y(elbow, (-half, 0.0), (half, 0.0)),
            *_about_y(wrist, (-end, -arm.a3), (end, -arm.a3)),
        ),
        "wrist_1_link": (
            *_about_y(wrist, (end, 0.0), (arm.wrist_step + wrist, 0.0)),
            *_about_z(wrist, (arm.wrist_step, -cap), (arm.wrist_step, side)),
        ),
        "wrist_2_link": (
            *_about_z(wrist, (0.0, side), (0.0, arm.d5 + wrist)),
            *_about_y(wrist, (-cap, arm.d5), (side, arm.d5)),
        ),
        "wrist_3_link": tuple(_about_y(wrist, (side, 0.0), (arm.d6, 0.0))),
    }


def _about_y(radius: float, *places: tuple[float, float]) -> list[Array]:
    """Polygons (n, 3) around circles about axes along y, centred at y, z."""
    c, s = _polygon(radius)
    return [np.column_stack((c, np.full_like(c, y), s + z)) for y, z in places]


def _about_z(radius: float, *places: tuple[float, float]) -> list[Array]:
    """Polygons (n, 3) around circles about axes along z, centred at y, z."""
    c, s = _polygon(radius)
    return [np.column_stack((c, s + y, np.full_like(c, z))) for y, z in places]


def _polygon(radius: float) -> tuple[Array, Array]:
    angles = 2.0 * pi / _CORNERS * np.arange(_CORNERS)
    outer = radius / cos(pi / _CORNERS)
    return outer * np.cos(angles), outer * np.sin(angles)


def _hull(points: Array) -> Any:
    """The convex hull of points (n, 3)."""
    cloud = pin.coal.BVHModelOBBRSS()
    cloud.beginModel(0, len(points))
    cloud.addVertices(points)
    cloud.endModel()
    cloud.buildConvexHull(True, "Qt")  # Qt: triangles only, as coal needs
    return cloud.convex
