"""Forward kinematics of the nominal arm in UR's base frame, and what is measured by it.

Thin, typed functions on Pinocchio set frames, order and shapes. `measure_singularity` says how far a posture
is from a singularity, in the mixed units (m and rad) of the Jacobian. `flange_difference` compares the flange
pose that a robot reports with that of the nominal arm, `check_flange` refuses what is beyond the tolerances:
before anything moves and in each frame of a stream, angles that drift away from the pose, or a pose that
drifts away from the angles, mean that one of them is not what the robot measures.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pc_client.errors import DriverError
from pc_client.kinematics.robot_model import RobotModel
from protocol.pose import T_to_pose, pose_inv, pose_trans

Array = NDArray[np.float64]


def tcp_pose(model: RobotModel, q: ArrayLike) -> Array:
    """Return T_base_tcp at joint angles q.

    Args:
        model: nominal arm.
        q: (6,) joint angles [rad].

    Returns:
        (4, 4) homogeneous matrix; translation in m.
    """
    pin.framesForwardKinematics(model.pin_model, model.pin_data, np.asarray(q, dtype=np.float64))
    return np.array(model.pin_data.oMf[model.tcp_frame].homogeneous)


def tcp_jacobian(model: RobotModel, q: ArrayLike) -> Array:
    """Return J_base_tcp: twist of the TCP (linear first, axes of `base`, at the TCP) = J @ qd.

    Args:
        model: nominal arm.
        q: (6,) joint angles [rad].

    Returns:
        (6, 6); rows 0-2 in m, rows 3-5 dimensionless.
    """
    jacobian = pin.computeFrameJacobian(
        model.pin_model,
        model.pin_data,
        np.asarray(q, dtype=np.float64),
        model.tcp_frame,
        pin.LOCAL_WORLD_ALIGNED,
    )
    return np.array(jacobian)


def tcp_positions(model: RobotModel, q: ArrayLike) -> Array:
    """Return the TCP positions along a joint path.

    Args:
        model: nominal arm.
        q: (n, 6) joint angles [rad].

    Returns:
        (n, 3) positions in `base` [m].
    """
    path = np.asarray(q, dtype=np.float64)
    positions = np.empty((len(path), 3))
    data, frame = model.pin_data, model.tcp_frame
    for k, q_k in enumerate(path):
        pin.framesForwardKinematics(model.pin_model, data, q_k)
        positions[k] = data.oMf[frame].translation
    return positions


SINGULARITIES = MappingProxyType(
    {
        0: "the wrist comes above the base axis and the base would race",
        2: "the elbow is stretched or folded",
        4: "wrist 1 and wrist 3 are aligned and would race",
    }
)
"""What happens at the singularity that a joint names.

Source: the factors of det J of a UR arm, a2 a3 sin(q3) sin(q5) r, r being the distance of the wrist centre
from the base axis in the plane of the arm (Hawkins 2013)."""


class SingularityMeasure(NamedTuple):
    """Measures of a stack of Jacobians (n, 6, 6).

    Attributes:
        sigma_min: (n,) smallest singular value: the twist that joint speed 1 gives in the worst direction.
        condition: (n,) largest over smallest singular value; inf when singular.
        manipulability: (n,) product of all singular values, |det J|.
            Source: Yoshikawa, "Manipulability of robotic mechanisms", 1985.
        critical_joint: (n,) joint that names the nearest singularity, a key of SINGULARITIES.
    """

    sigma_min: Array
    condition: Array
    manipulability: Array
    critical_joint: NDArray[np.intp]


def measure_singularity(jacobians: ArrayLike) -> SingularityMeasure:
    """Measure a stack of Jacobians.

    Args:
        jacobians: (n, 6, 6) of a UR arm with the TCP on the axis of wrist 3; linear rows first, in `base`.

    Returns:
        One value per Jacobian of each measure.
    """
    J = np.asarray(jacobians, dtype=np.float64)
    sigma = np.asarray(np.linalg.svd(J, compute_uv=False), dtype=np.float64)
    sigma_min = sigma[:, -1]
    with np.errstate(divide="ignore"):
        condition = sigma[:, 0] / sigma_min
    nearest = np.argmin(_determinant_factors(J), axis=1)
    return SingularityMeasure(
        sigma_min,
        condition,
        np.multiply.reduce(sigma, axis=1),
        np.array(tuple(SINGULARITIES), dtype=np.intp)[nearest],
    )


def _determinant_factors(J: Array) -> Array:
    """Return (n, 3): r / |a2|, |sin q3| and |sin q5|, read off the columns axis x (tcp - origin) and axis."""
    linear, axis = J[:, :3, :], J[:, 3:, :]
    # Columns of parallel axes differ by axis x (link between them), so by the links turned a quarter.
    upper, fore = linear[:, :, 1] - linear[:, :, 2], linear[:, :, 2] - linear[:, :, 3]
    a2, a3 = np.linalg.norm(upper, axis=1), np.linalg.norm(fore, axis=1)
    elbow = np.linalg.norm(np.cross(upper, fore), axis=1) / (a2 * a3)
    wrist = np.linalg.norm(np.cross(axis[:, :, 3], axis[:, :, 5]), axis=1)
    # The base's column is (-y, x, 0) of the TCP; the wrist centre lies d6 behind it on the last axis.
    d6 = np.sum(np.cross(axis[:, :, 4], axis[:, :, 5]) * linear[:, :, 4], axis=1)
    centre_x, centre_y = linear[:, 1, 0] - d6 * axis[:, 0, 5], -linear[:, 0, 0] - d6 * axis[:, 1, 5]
    shoulder = np.abs(centre_y * axis[:, 0, 1] - centre_x * axis[:, 1, 1]) / a2
    return np.stack((shoulder, elbow, wrist), axis=1)


ROTATION_TOLERANCE = 0.02
"""Between the reported flange and the model's [rad]: twice what three real UR3e calibrations come to, 8 mrad.
That of the position stands in the arm's row. A choice: docs/fidelity.md."""

_FARTHEST = 1e3
"""No angle [rad] and no coordinate [m, rad] of a pose is larger."""

_NO_OFFSET = (0.0,) * 6


def flange_difference(
    model: RobotModel, q: Sequence[float], pose: Sequence[float], tcp_offset: Sequence[float] = _NO_OFFSET
) -> tuple[float, float]:
    """How far the reported flange is from the model's.

    Args:
        model: nominal arm.
        q: (6,) reported joint angles [rad].
        pose: (6,) reported pose of the TCP in the base frame [m, rad].
        tcp_offset: (6,) pose of the TCP in the flange frame [m, rad].

    Returns:
        Distance [m] and angle [rad]; endless where a value is no number.
    """
    if not all(-_FARTHEST < value < _FARTHEST for value in (*q, *pose, *tcp_offset)):  # NaN is not
        return inf, inf
    x, y, z, rx, ry, rz = pose
    computed = T_to_pose(tcp_pose(model, q))
    flange = pose_trans((x, y, z, rx, ry, rz), pose_inv(tuple(tcp_offset)))
    difference = pose_trans(pose_inv(computed), flange)
    return float(np.linalg.norm(difference[:3])), float(np.linalg.norm(difference[3:]))


def check_flange(model: RobotModel, q: Sequence[float], pose: Sequence[float]) -> None:
    """Refuse a robot whose angles and pose do not belong together; the TCP is the flange.

    Args:
        model: nominal arm.
        q: (6,) reported joint angles [rad].
        pose: (6,) reported pose of the TCP in the base frame [m, rad].

    Raises:
        DriverError: they are further apart than the tolerances.
    """
    distance, angle = flange_difference(model, q, pose)
    most = model.description.position_tolerance
    if not (distance <= most and angle <= ROTATION_TOLERANCE):
        raise DriverError(
            f"the robot reports its flange {1e3 * distance:.1f} mm and {1e3 * angle:.1f} mrad from where its "
            f"joint angles put it, allowed is {1e3 * most:g} mm and {1e3 * ROTATION_TOLERANCE:g} mrad: "
            "its angles or its pose are not what it measures; the run was ended"
        )
