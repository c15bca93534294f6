"""The orientation of the TCP during a movement without orientations of its own."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

_TCP_RPY = (0.0, 0.75 * pi, 0.0)
"""Roll, pitch, yaw of the TCP in `base` [rad]. Source: paper section III, "RPY(0, 3/4 pi, 0)"."""


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Return R = Rz(yaw) @ Ry(pitch) @ Rx(roll), the convention of UR and ROS.

    Args:
        roll: turn about the fixed x axis [rad], first.
        pitch: turn about the fixed y axis [rad], second.
        yaw: turn about the fixed z axis [rad], last.

    Returns:
        (3, 3) rotation matrix.
    """
    # Lower-case axes are scipy's fixed (extrinsic) axes.
    return np.asarray(Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix(), dtype=np.float64)


def fixed_tcp_rotation() -> NDArray[np.float64]:
    """Return R_base_tcp of the experiment: tool z = (.7071, 0, -.7071), forward and 45 deg down."""
    return rotation_from_rpy(*_TCP_RPY)
