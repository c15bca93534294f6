"""estimate_payload: mass and centre of gravity from wrenches measured in several poses.

Source: URScript manual e-Series 5.15, estimate_payload: poses of the TCP, wrenches at the flange in base
axes; the least distance of the rotations. Chosen: least squares; gravity as it is set.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from math import hypot, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocol.pose import pose_inv, pose_sub, pose_trans, rotvec_to_matrix
from ur_emulator.controller.tool_settings import ToolSettings
from urscript.errors import ScriptRuntimeError
from urscript.values import Pose, Struct

_LEAST_POSES = 4
# A lighter payload has no centre of gravity that could be measured [kg].
_LEAST_MASS = 1e-3


def payload_functions(tool: ToolSettings) -> Mapping[str, Callable[..., Any]]:
    """Return the builtin.

    Args:
        tool: has TCP and gravity.
    """

    def estimate_payload(thread: object, poses: list[Any], wrenches: list[Any]) -> Struct:
        _require_poses(poses, wrenches)
        gravity = -np.array(tool.gravity)
        flange_of_tcp = pose_inv(tool.tcp_offset)
        turns = [rotvec_to_matrix(pose_trans(tuple(pose), flange_of_tcp)[3:]) for pose in poses]
        measured = np.array([tuple(map(float, wrench)) for wrench in wrenches])
        mass = float((measured[:, :3] @ gravity).sum() / (len(poses) * (gravity @ gravity)))
        if mass < _LEAST_MASS:
            return Struct({"mass": max(mass, 0.0), "cog": [0.0, 0.0, 0.0]})
        # The moment of the weight: centre x weight = -[weight] centre, centre = turn cog.
        weight = mass * gravity
        rows = np.concatenate([-_cross_matrix(weight) @ turn for turn in turns])
        cog, *_ = np.linalg.lstsq(rows, measured[:, 3:].ravel(), rcond=None)
        return Struct({"mass": mass, "cog": cog.tolist()})

    return {"estimate_payload": estimate_payload}


def _require_poses(poses: Sequence[Any], wrenches: Sequence[Any]) -> None:
    n = len(poses)
    if n < _LEAST_POSES or len(wrenches) != n:
        raise ScriptRuntimeError(
            f"estimate_payload: {n} poses and {len(wrenches)} wrenches given; "
            f"allowed: as many of both, at least {_LEAST_POSES}"
        )
    if not all(isinstance(item, Pose | list) and len(item) == 6 for item in (*poses, *wrenches)):
        raise ScriptRuntimeError("estimate_payload: poses and wrenches must have six numbers each")
    least = pi / (2 * n)
    for one, other in combinations(poses, 2):
        angle = hypot(*pose_sub(tuple(one), tuple(other))[3:])
        if angle < least:
            raise ScriptRuntimeError(
                f"estimate_payload: two poses differ by {angle:.3f} rad only; "
                f"allowed: at least {least:.3f} rad with {n} poses"
            )


def _cross_matrix(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
