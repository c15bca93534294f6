"""Builtins on poses, rotations and wrenches; the algebra itself is `protocol.pose`.

Source: script manual CB3 3.15.4, module urmath.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from protocol import pose as algebra
from urscript.catalogue.calls import number, numbers, pose
from urscript.catalogue.types import ParamType
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose


def _computed(function: str, compute: Callable[..., Sequence[float]], *args: Any) -> Sequence[float]:
    """`compute(*args)`; infinite angles, which have no sine, become a run-time error."""
    try:
        return compute(*args)
    except (ValueError, OverflowError):
        raise ScriptRuntimeError(f"{function}: Parameters must be finite") from None


def _of_two(
    function: str, first: str, second: str, compute: Callable[[Pose, Pose], Sequence[float]]
) -> Callable[[Any, Any], Pose]:
    def call(a: Any, b: Any) -> Pose:
        return Pose.of(_computed(function, compute, pose(function, first, a), pose(function, second, b)))

    return call


pose_add = _of_two("pose_add", "p_1", "p_2", algebra.pose_add)
pose_sub = _of_two("pose_sub", "p_to", "p_from", algebra.pose_sub)
pose_trans = _of_two("pose_trans", "p_from", "p_from_to", algebra.pose_trans)


def pose_inv(p_from: Any, function: str = "pose_inv") -> Pose:
    """The inverse transformation; `function` is the builtin that errors name."""
    return Pose.of(_computed(function, algebra.pose_inv, pose(function, "p_from", p_from)))


def interpolate_pose(p_from: Any, p_to: Any, alpha: Any) -> Pose:
    """From p_from (alpha 0) to p_to (alpha 1) on a straight line with the shortest rotation, or beyond."""
    start, goal = pose("interpolate_pose", "p_from", p_from), pose("interpolate_pose", "p_to", p_to)
    fraction = number("interpolate_pose", "alpha", alpha)
    return Pose.of(_computed("interpolate_pose", algebra.interpolate_pose, start, goal, fraction))


def point_dist(p_from: Any, p_to: Any) -> float:
    """Distance of the two positions [m]."""
    start, goal = pose("point_dist", "p_from", p_from), pose("point_dist", "p_to", p_to)
    return math.dist(start[:3], goal[:3])


def pose_dist(p_from: Any, p_to: Any) -> float:
    """Distance including rotation: Euclidean length of pose_sub(p_to, p_from) over all six numbers.

    The manual gives no formula; this one is assumed, to be checked on a real arm.
    """
    start, goal = pose("pose_dist", "p_from", p_from), pose("pose_dist", "p_to", p_to)
    return math.hypot(*_computed("pose_dist", algebra.pose_sub, goal, start))


def rotvec2rpy(rotation_vector: Any) -> list[float]:
    """Roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll) of a rotation vector [rad]."""
    vector = numbers("rotvec2rpy", "rotation_vector", rotation_vector, ParamType.VECTOR3)
    return list(_computed("rotvec2rpy", algebra.rotvec_to_rpy, vector))


def rpy2rotvec(rpy_vector: Any) -> list[float]:
    """Rotation vector [rad] of roll, pitch, yaw [rad] with R = Rz(yaw) Ry(pitch) Rx(roll)."""
    vector = numbers("rpy2rotvec", "rpy_vector", rpy_vector, ParamType.VECTOR3)
    return list(_computed("rpy2rotvec", algebra.rpy_to_rotvec, vector))


def wrench_trans(T_from_to: Any, w_from: Any) -> list[float]:
    """A wrench [F, M] seen from another frame, whose pose in the present frame is T_from_to.

    F_to = R^T F and M_to = R^T (M - p x F): the torque about the new point, in the new axes. Assumed: some
    scripts in the field read the rotation in the opposite direction; to be checked on a real arm.

    Source: e-Series script directory, get_tcp_force: its example takes the wrench at the TCP from
    `wrench_trans(get_tcp_offset(), get_wrench_at_tool_flange())`.
    """
    x, y, z, rx, ry, rz = pose("wrench_trans", "T_from_to", T_from_to)
    fx, fy, fz, mx, my, mz = numbers("wrench_trans", "w_from", w_from, ParamType.VECTOR6)
    mx, my, mz = mx - (y * fz - z * fy), my - (z * fx - x * fz), mz - (x * fy - y * fx)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _computed(
        "wrench_trans", algebra.rotvec_to_flat, rx, ry, rz
    )
    return [
        r00 * fx + r10 * fy + r20 * fz,
        r01 * fx + r11 * fy + r21 * fz,
        r02 * fx + r12 * fy + r22 * fz,
        r00 * mx + r10 * my + r20 * mz,
        r01 * mx + r11 * my + r21 * mz,
        r02 * mx + r12 * my + r22 * mz,
    ]


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "pose_add": pose_add,
    "pose_sub": pose_sub,
    "pose_trans": pose_trans,
    "pose_inv": pose_inv,
    "interpolate_pose": interpolate_pose,
    "point_dist": point_dist,
    "pose_dist": pose_dist,
    "rotvec2rpy": rotvec2rpy,
    "rpy2rotvec": rpy2rotvec,
    "wrench_trans": wrench_trans,
}
