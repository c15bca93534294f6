"""Forward kinematics of the nominal arm: TCP pose and Jacobian, in UR's base frame.

Thin, typed functions on Pinocchio: only this module sets frames, order and shapes.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pc_client.kinematics.robot_model import RobotModel

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
