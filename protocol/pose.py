"""Poses as the controller writes them: `[x y z rx ry rz]`, metres and a rotation vector in radians.

One meaning of the pose algebra for the box, the script language and the client. A pose `p_a_b` is the frame b
seen from the frame a, like `T_a_b`; `pose_trans(p_a_b, p_b_c)` is `p_a_c`. All in plain floats: a call
costs about as much as one or two numpy operations. Rotations go through unit quaternions because both
conversions are then exact near 0 and near pi, where formulas with acos lose half of the digits.

Rotation vectors that come out have length <= pi. At exactly pi both signs of the axis mean the same rotation;
which one comes out is not fixed. Vectors that come in may have any length.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, sin, sqrt

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Pose",
    "T_to_pose",
    "Vector3",
    "interpolate_pose",
    "pose_add",
    "pose_inv",
    "pose_sub",
    "pose_to_T",
    "pose_trans",
    "rotvec_from_flat",
    "rotvec_to_flat",
    "rotvec_to_matrix",
    "rotvec_to_rpy",
    "rpy_to_rotvec",
]

Vector3 = tuple[float, float, float]
Pose = tuple[float, float, float, float, float, float]
_Quaternion = tuple[float, float, float, float]  # w x y z, unit length
_Flat = tuple[float, float, float, float, float, float, float, float, float]  # row by row

_TINY = 1e-150
"""Below this length a square underflows; sin(x)/x is then exactly 1 in floats anyway."""


# --- quaternions: the inner form ---


def _quaternion(rx: float, ry: float, rz: float) -> _Quaternion:
    angle = sqrt(rx * rx + ry * ry + rz * rz)
    if angle < _TINY:
        return 1.0, 0.5 * rx, 0.5 * ry, 0.5 * rz
    scale = sin(0.5 * angle) / angle
    return cos(0.5 * angle), scale * rx, scale * ry, scale * rz


def _rotvec(w: float, x: float, y: float, z: float) -> Vector3:
    """Any non-zero length will do: only ratios enter."""
    if w < 0.0:  # the same rotation, by the smaller angle
        w, x, y, z = -w, -x, -y, -z
    sine = sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine < _TINY else 2.0 * atan2(sine, w) / sine
    return scale * x, scale * y, scale * z


def _multiply(a: _Quaternion, b: _Quaternion) -> _Quaternion:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _rotate(quaternion: _Quaternion, x: float, y: float, z: float) -> Vector3:
    w, qx, qy, qz = quaternion
    # v + 2 w (q x v) + 2 q x (q x v)
    cx, cy, cz = qy * z - qz * y, qz * x - qx * z, qx * y - qy * x
    return (
        x + 2.0 * (w * cx + qy * cz - qz * cy),
        y + 2.0 * (w * cy + qz * cx - qx * cz),
        z + 2.0 * (w * cz + qx * cy - qy * cx),
    )


# --- rotation vector and matrix ---


def rotvec_from_flat(
    r00: float, r01: float, r02: float, r10: float, r11: float, r12: float, r20: float, r21: float, r22: float
) -> Vector3:
    """Rotation vector [rad] of a rotation matrix given row by row.

    Takes the largest of the four quaternion components from the diagonal, so that no angle loses digits.

    Source: S. W. Shepperd, "Quaternion from rotation matrix", 1978.
    """
    trace = r00 + r11 + r22
    if trace >= r00 and trace >= r11 and trace >= r22:
        return _rotvec(1.0 + trace, r21 - r12, r02 - r20, r10 - r01)
    if r00 >= r11 and r00 >= r22:
        return _rotvec(r21 - r12, 1.0 + r00 - r11 - r22, r01 + r10, r02 + r20)
    if r11 >= r22:
        return _rotvec(r02 - r20, r01 + r10, 1.0 + r11 - r00 - r22, r12 + r21)
    return _rotvec(r10 - r01, r02 + r20, r12 + r21, 1.0 + r22 - r00 - r11)


def rotvec_to_flat(rx: float, ry: float, rz: float) -> _Flat:
    """Rotation matrix of a rotation vector [rad] as nine floats, row by row."""
    w, x, y, z = _quaternion(rx, ry, rz)
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def rotvec_to_matrix(rotvec: Sequence[float]) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) of a rotation vector (3,) [rad]."""
    rx, ry, rz = rotvec
    return np.array(rotvec_to_flat(rx, ry, rz)).reshape(3, 3)


# --- pose and homogeneous matrix ---


def pose_to_T(pose: Sequence[float]) -> NDArray[np.float64]:
    """Homogeneous matrix (4, 4) of a pose."""
    x, y, z, rx, ry, rz = pose
    r = rotvec_to_flat(rx, ry, rz)
    return np.array((*r[0:3], x, *r[3:6], y, *r[6:9], z, 0.0, 0.0, 0.0, 1.0)).reshape(4, 4)


def T_to_pose(T: NDArray[np.float64]) -> Pose:
    """Pose of a homogeneous matrix (4, 4)."""
    (r00, r01, r02, x), (r10, r11, r12, y), (r20, r21, r22, z), _ = T.tolist()
    return (x, y, z, *rotvec_from_flat(r00, r01, r02, r10, r11, r12, r20, r21, r22))


# --- the script language's pose algebra ---


def pose_trans(p_from: Sequence[float], p_from_to: Sequence[float]) -> Pose:
    """`T(p_from) T(p_from_to)`: the second pose, given in the frame of the first, seen from outside.

    Source: URScript manual CB3, `pose_trans`.
    """
    ax, ay, az, arx, ary, arz = p_from
    bx, by, bz, brx, bry, brz = p_from_to
    rotation = _quaternion(arx, ary, arz)
    x, y, z = _rotate(rotation, bx, by, bz)
    return (ax + x, ay + y, az + z, *_rotvec(*_multiply(rotation, _quaternion(brx, bry, brz))))


def pose_inv(p_from: Sequence[float]) -> Pose:
    """Inverse of a pose; the product of both is the zero pose. Source: URScript manual CB3, `pose_inv`."""
    x, y, z, rx, ry, rz = p_from
    w, qx, qy, qz = _quaternion(rx, ry, rz)
    inverse = (w, -qx, -qy, -qz)
    return (*_rotate(inverse, -x, -y, -z), *_rotvec(*inverse))


def pose_add(p_1: Sequence[float], p_2: Sequence[float]) -> Pose:
    """Positions added, rotations multiplied `R1 R2`. Not `pose_trans`. Source: URScript manual CB3."""
    ax, ay, az, arx, ary, arz = p_1
    bx, by, bz, brx, bry, brz = p_2
    rotation = _multiply(_quaternion(arx, ary, arz), _quaternion(brx, bry, brz))
    return (ax + bx, ay + by, az + bz, *_rotvec(*rotation))


def pose_sub(p_to: Sequence[float], p_from: Sequence[float]) -> Pose:
    """Positions subtracted, rotations `R_to R_from^-1`, so that `pose_add(pose_sub(a, b), b)` is `a`.

    The manual does not state the order of the rotations; this one is inferred from programs in the field.

    Source: URScript manual CB3, `pose_sub`.
    """
    ax, ay, az, arx, ary, arz = p_to
    bx, by, bz, brx, bry, brz = p_from
    rotation = _multiply(_quaternion(arx, ary, arz), _quaternion(-brx, -bry, -brz))
    return (ax - bx, ay - by, az - bz, *_rotvec(*rotation))


def interpolate_pose(p_from: Sequence[float], p_to: Sequence[float], alpha: float) -> Pose:
    """Straight line in position and shortest turn at constant rate in rotation.

    `alpha` is 0 at `p_from` and 1 at `p_to`; outside of [0, 1] the movement continues beyond its ends.

    Source: URScript manual CB3, `interpolate_pose`.
    """
    ax, ay, az, arx, ary, arz = p_from
    bx, by, bz, brx, bry, brz = p_to
    start = _quaternion(arx, ary, arz)
    w, x, y, z = start
    tx, ty, tz = _rotvec(*_multiply((w, -x, -y, -z), _quaternion(brx, bry, brz)))
    rotation = _multiply(start, _quaternion(alpha * tx, alpha * ty, alpha * tz))
    return (ax + alpha * (bx - ax), ay + alpha * (by - ay), az + alpha * (bz - az), *_rotvec(*rotation))


# --- roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll) ---


def _rpy_quaternion(roll: float, pitch: float, yaw: float) -> _Quaternion:
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


def rpy_to_rotvec(rpy: Sequence[float]) -> Vector3:
    """Rotation vector [rad] of (roll, pitch, yaw) [rad]. Source: URScript manual CB3, `rpy2rotvec`."""
    roll, pitch, yaw = rpy
    return _rotvec(*_rpy_quaternion(roll, pitch, yaw))


def rotvec_to_rpy(rotvec: Sequence[float]) -> Vector3:
    """(roll, pitch, yaw) [rad], pitch within +-pi/2, of a rotation vector [rad].

    At pitch = +-pi/2 only a sum of roll and yaw is defined. Yaw is read first and roll from what is left
    after turning yaw back, so the three angles always give the rotation again, whatever rounding made of yaw.

    Source: URScript manual CB3, `rotvec2rpy`.
    """
    r00, r01, r02, r10, r11, r12, r20, _, _ = rotvec_to_flat(*rotvec)
    yaw = atan2(r10, r00)
    pitch = atan2(-r20, hypot(r00, r10))
    c, s = cos(yaw), sin(yaw)
    return atan2(s * r02 - c * r12, c * r11 - s * r01), pitch, yaw
