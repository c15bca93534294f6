"""Arms by UR's DH table and the sizes of their joints: the URDF of the frames, and the hulls of the links.

It is for the arms that example-robot-data lacks. Links and joints have the names and frames of the UR files
there: base and wrist 2 turn about z, all others about y; upper arm and forearm lie along z. The hull of a
link encloses the housings of its joints, which are cylinders about the axes of the joints. Two links share
the distance between their middle planes equally.

Source of the lengths: UR's article "DH parameters for calculations of kinematics and dynamics"; UR8 Long,
UR15 and UR18 by ros-industrial/universal_robot (ur_description/config/*/default_kinematics.yaml); offsets
from UR's ROS description (config/*/physical_parameters.yaml, "measured from model"; of UR8 Long, UR15 and
UR18 it has the faces between two links, in the middle between their planes). The foot is half of the
footprint in the data sheet. Radii go by joint size, from the meshes of the CB3 arms, whose housings are as
large: 32 mm for size 0, 38 for 1, 46 for 2, 60 for 3, 75 for 4. Those of UR20 and UR30 are assumed, in
proportion to the offsets; those of a UR15 are half of the widths of a UR8 Long's parts, by public notes on
their STL files.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]
Three = tuple[float, float, float]

_CORNERS = 24
"""Of the polygon around a circle."""

_CAP = 1.45
"""How far a wrist stands out on the side that carries nothing, in radii. Source: the meshes of UR3, UR5 and
UR10 (1.24 to 1.46)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DhArm:
    """Lengths of an arm [m].

    Attributes:
        d1: height of the shoulder.
        a2: upper arm, negative as in the DH table.
        a3: forearm, negative.
        d4: wrist 1.
        d5: wrist 2.
        d6: wrist 3, to the flange.
        shoulder_offset: from the base axis to the middle plane of the upper arm.
        elbow_offset: from the base axis to the middle plane of the forearm.
        foot: radius of the base where it is mounted.
        radii: of the housings of shoulder, elbow and wrists.
    """

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float
    shoulder_offset: float
    elbow_offset: float
    foot: float
    radii: Three

    @property
    def elbow_step(self) -> float:
        """From the middle plane of the forearm to that of the upper arm."""
        return self.shoulder_offset - self.elbow_offset

    @property
    def wrist_step(self) -> float:
        """From the middle plane of the forearm to the axis of wrist 2."""
        return self.d4 - self.elbow_offset


def urdf_text(arm: DhArm, name: str) -> str:
    """The frames of an arm as a URDF, without bodies and masses; the limits in it are none.

    Args:
        arm: its lengths.
        name: of the robot.
    """
    straight, turned, y, z = (0.0, 0.0, 0.0), (0.0, pi / 2, 0.0), (0, 1, 0), (0, 0, 1)
    out, inward, on = (0.0, arm.shoulder_offset, 0.0), -arm.elbow_step, (0.0, arm.wrist_step, 0.0)
    joints = (
        ("shoulder_pan_joint", "base_link", "shoulder_link", (0.0, 0.0, arm.d1), straight, z),
        ("shoulder_lift_joint", "shoulder_link", "upper_arm_link", out, turned, y),
        ("elbow_joint", "upper_arm_link", "forearm_link", (0.0, inward, -arm.a2), straight, y),
        ("wrist_1_joint", "forearm_link", "wrist_1_link", (0.0, 0.0, -arm.a3), turned, y),
        ("wrist_2_joint", "wrist_1_link", "wrist_2_link", on, straight, z),
        ("wrist_3_joint", "wrist_2_link", "wrist_3_link", (0.0, 0.0, arm.d5), straight, y),
        ("base_link-base_fixed_joint", "base_link", "base", straight, (0.0, 0.0, -pi), None),
        ("wrist_3_link-tool0_fixed_joint", "wrist_3_link", "tool0", (0, arm.d6, 0), (-pi / 2, 0, 0), None),
    )
    elements = ['<link name="base_link"/>']
    for joint, parent, child, xyz, rpy, axis in joints:
        # A joint that turns must have limits in a URDF; nothing reads them.
        turns = "" if axis is None else f'<axis xyz="{_text(axis)}"/><limit velocity="0" effort="0"/>'
        elements.append(
            f'<link name="{child}"/><joint name="{joint}" type="{"fixed" if axis is None else "revolute"}">'
            f'<parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/>{turns}</joint>'
        )
    return f'<robot name="{name}">{"".join(elements)}</robot>'


def link_hulls(arm: DhArm, model: Any) -> tuple[Any, ...]:
    """The hulls of the links.

    Args:
        arm: its lengths.
        model: the Pinocchio model of its URDF; its frames place the links.

    Returns:
        One convex pin.GeometryObject a link, base to wrist 3.
    """
    hulls = []
    for link, points in _housings(arm).items():
        index = model.getFrameId(link)
        frame = model.frames[index]
        hulls.append(pin.GeometryObject(link, frame.parentJoint, index, frame.placement, _hull(points)))
    return tuple(hulls)


def _housings(arm: DhArm) -> dict[str, Array]:
    """Points (n, 3) on the ends of the housings of each link, in the frame of the link [m]."""
    shoulder, elbow, wrist = arm.radii
    upper, half = arm.shoulder_offset / 2, arm.elbow_step / 2
    end, side, cap = arm.wrist_step / 2, arm.d5 / 2, _CAP * wrist
    rings: dict[str, tuple[Array, ...]] = {
        "base_link": (_about_z(0.0, 0.0, arm.foot), _about_z(0.0, arm.d1 - upper, shoulder)),
        "shoulder_link": (
            _about_z(0.0, -upper, shoulder),
            _about_z(0.0, upper, shoulder),
            _about_y(upper, 0.0, shoulder),
        ),
        "upper_arm_link": (
            _about_y(-upper, 0.0, shoulder),
            _about_y(upper, 0.0, shoulder),
            _about_y(-half, -arm.a2, elbow),
            _about_y(half, -arm.a2, elbow),
        ),
        "forearm_link": (
            _about_y(-half, 0.0, elbow),
            _about_y(half, 0.0, elbow),
            _about_y(-end, -arm.a3, wrist),
            _about_y(end, -arm.a3, wrist),
        ),
        "wrist_1_link": (
            _about_y(end, 0.0, wrist),
            _about_y(arm.wrist_step + wrist, 0.0, wrist),
            _about_z(arm.wrist_step, -cap, wrist),
            _about_z(arm.wrist_step, side, wrist),
        ),
        "wrist_2_link": (
            _about_z(0.0, side, wrist),
            _about_z(0.0, arm.d5 + wrist, wrist),
            _about_y(-cap, arm.d5, wrist),
            _about_y(side, arm.d5, wrist),
        ),
        "wrist_3_link": (_about_y(side, 0.0, wrist), _about_y(arm.d6, 0.0, wrist)),
    }
    return {link: np.vstack(parts) for link, parts in rings.items()}


def _about_y(y: float, z: float, radius: float) -> Array:
    """Polygon (n, 3) around a circle about an axis along y."""
    c, s = _polygon(radius)
    return np.column_stack((c, np.full_like(c, y), s + z))


def _about_z(y: float, z: float, radius: float) -> Array:
    """Polygon (n, 3) around a circle about an axis along z."""
    c, s = _polygon(radius)
    return np.column_stack((c, s + y, np.full_like(c, z)))


def _polygon(radius: float) -> tuple[Array, Array]:
    angles = 2.0 * pi / _CORNERS * np.arange(_CORNERS)
    outer = radius / cos(pi / _CORNERS)
    return outer * np.cos(angles), outer * np.sin(angles)


def _hull(points: Array) -> Any:
    """The convex hull of points (n, 3), as Pinocchio's collision library has it."""
    cloud = pin.coal.BVHModelOBBRSS()
    cloud.beginModel(0, len(points))
    cloud.addVertices(points)
    cloud.endModel()
    cloud.buildConvexHull(True, "Qt")  # Qt: triangles only, as coal needs
    return cloud.convex


def _text(numbers: tuple[float, ...]) -> str:
    return " ".join(map(repr, numbers))


UR3E = DhArm(
    d1=0.15185,
    a2=-0.24355,
    a3=-0.2132,
    d4=0.13105,
    d5=0.08535,
    d6=0.0921,
    shoulder_offset=0.12,
    elbow_offset=0.027,
    foot=0.064,
    radii=(0.046, 0.038, 0.032),
)
UR5E = DhArm(
    d1=0.1625,
    a2=-0.425,
    a3=-0.3922,
    d4=0.1333,
    d5=0.0997,
    d6=0.0996,
    shoulder_offset=0.138,
    elbow_offset=0.007,
    foot=0.075,
    radii=(0.06, 0.06, 0.038),
)
UR10E = DhArm(
    d1=0.1807,
    a2=-0.6127,
    a3=-0.57155,
    d4=0.17415,
    d5=0.11985,
    d6=0.11655,
    shoulder_offset=0.1762,
    elbow_offset=0.0393,
    foot=0.095,
    radii=(0.075, 0.06, 0.046),
)
UR16E = replace(UR10E, a2=-0.4784, a3=-0.36, shoulder_offset=0.176, elbow_offset=0.04)
UR20 = DhArm(
    d1=0.2363,
    a2=-0.862,
    a3=-0.7287,
    d4=0.201,
    d5=0.1593,
    d6=0.1543,
    shoulder_offset=0.26,
    elbow_offset=0.043,
    foot=0.1225,
    radii=(0.11, 0.095, 0.064),
)
UR30 = replace(UR20, a2=-0.637, a3=-0.5037)
UR15 = DhArm(
    d1=0.2186,
    a2=-0.6475,
    a3=-0.5164,
    d4=0.1824,
    d5=0.1361,
    d6=0.1434,
    shoulder_offset=0.218,
    elbow_offset=0.0505,
    foot=0.102,
    radii=(0.075, 0.062, 0.045),
)
UR18 = replace(UR15, a2=-0.475, a3=-0.3389)
UR8LONG = replace(UR15, a2=-0.8989, a3=-0.7149)
