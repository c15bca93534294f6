"""Features of an installation: poses and planes in the base frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from protocol.pose import T_to_pose
from ur_emulator.errors import ProgramFileError
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.programs.installation import Feature
from ur_emulator.programs.installation_values import InstallationValues

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


def features(file: InstallationValues) -> Iterator[tuple[str, Feature]]:
    """Yield the features of an installation with their names."""
    container = file.first.get("Features", file.first.get("GeomFeatures"))
    if container is not None:
        yield from _features_in(file, container, "", is_variable=False)


def _features_in(
    file: InstallationValues, node: Element, name: str, *, is_variable: bool
) -> Iterator[tuple[str, Feature]]:
    """Yield the features in a node; a feature may stand in another node that has its name."""
    for given in node:
        child = file.tree.resolve(given)
        inner_name = child.get("name") or name
        variable = child.get("isVariable") == "true" or (is_variable and not child.get("isVariable"))
        pose = _pose_of(file, child)
        if pose is not None and inner_name:
            yield inner_name, Feature(pose, variable)
        elif pose is None and given is child:
            yield from _features_in(file, child, inner_name, is_variable=variable)


def _pose_of(file: InstallationValues, node: Element) -> Vector6 | None:
    """Return the pose of a feature; None for a node that is none."""
    if node.tag.endswith("GeomPlaneNode") and node.find("firstPoint") is not None:
        return _plane(file, node)
    if not node.tag.endswith("GeomPoseNode"):
        return None
    position = file.value(node, "toolPosition")
    if not position:
        return None
    return (
        *file.vector3(position, "position of a feature"),
        *file.vector3(file.value(node, "toolAxisAngle"), "rotation of a feature"),
    )


def _plane(file: InstallationValues, node: Element) -> Vector6:
    p1, p2, p3 = (_point(file, node, name) for name in ("firstPoint", "secondPoint", "thirdPoint"))
    y, normal = p2 - p1, np.cross(p2 - p1, p3 - p1)
    length, area = float(np.linalg.norm(y)), float(np.linalg.norm(normal))
    if not (length > 0.0 and area > 0.0):
        raise ProgramFileError(f"{file.tree.name}: the points of a plane lie on a line")
    y, z = y / length, normal / (-area if node.get("userHasPoints") == "true" else area)
    T_base_plane = np.eye(4)
    T_base_plane[:3, :4] = np.column_stack((np.cross(y, z), y, z, p1))
    return six(T_to_pose(T_base_plane))


def _point(file: InstallationValues, node: Element, name: str) -> np.ndarray:
    point = node.find(name)
    inner = None if point is None else file.tree.resolve(point)
    for element in () if inner is None else inner.iter():
        position = file.value(element, "toolPosition")
        if position:
            return np.array(file.vector3(position, "point of a plane"))
    raise ProgramFileError(f"{file.tree.name}: a plane has no <{name}>")
