"""Fit a movement into the robot's workspace: move, scale and rotate it, and, only when asked, slow it down.

The similarity of space changes no shape: neither of the path nor of the speed over time. Slowing down is the
theory's own scaling of time. Planning checks the joint limits.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import MovementError
from pc_client.movements.geometry import UR3_BOX, Box, Similarity
from pc_client.movements.movement import Movement

__all__ = ["Fit", "fit_movement"]

#: Which rotations may be used: none, about the vertical, or any.
_Rotate = Literal["none", "yaw", "any"]

_N_SAMPLES = 2001


class Fit(NamedTuple):
    """A fitted movement and its changes; `stretch` is the factor by which it became slower (1: none)."""

    movement: Movement
    similarity: Similarity
    stretch: float


def fit_movement(
    movement: Movement,
    box: Box = UR3_BOX,
    *,
    rotate: _Rotate = "yaw",
    max_scale: float = math.inf,
    max_speed: float | None = None,
    may_slow_down: bool = False,
) -> Fit:
    """The movement as large as it fits into the box, in its middle.

    Args:
        movement: where and as large as it may be.
        box: where its path must lie, base frame, m.
        rotate: "none"; "yaw": the angle about the vertical, of 360 half degrees, that allows the largest
            scale; "any": the principal axes of the path are laid along the box's axes, the longest along the
            longest.
        max_scale: largest scale, so that a small movement need not be blown up; 1 for "only shrink".
        max_speed: largest TCP speed, m/s, or None.
        may_slow_down: whether the movement may be stretched in time to keep `max_speed`.

    Raises:
        MovementError: when the movement is a single point, or too fast and may not be slowed down.
    """
    if not max_scale > 0.0:
        raise MovementError(f"largest scale {max_scale}: give a number greater than 0")
    t = np.linspace(0.0, movement.duration, _N_SAMPLES)
    path = movement.sample(t).p
    rotation, scale = max(
        ((R, _largest_scale(path @ R.T, box)) for R in _candidates(path, box, rotate)),
        key=lambda found: found[1],
    )
    if not math.isfinite(scale):
        raise MovementError(
            f"movement {movement.name} stays at one point: there is nothing to fit into a box"
        )
    scale = min(scale, max_scale)
    turned = scale * path @ rotation.T
    similarity = Similarity(scale, rotation, box.centre - 0.5 * (turned.min(axis=0) + turned.max(axis=0)))
    fitted = movement.transformed(similarity)
    stretch = _needed_stretch(fitted, t, max_speed)
    if stretch > 1.0:
        if not may_slow_down:
            raise MovementError(
                f"movement {movement.name} reaches {stretch * (max_speed or 0.0):.3f} m/s in the box, "
                f"{max_speed} are allowed: allow it to be slowed down, or give a smaller scale"
            )
        fitted = fitted.stretched(stretch)
    return Fit(fitted, similarity, stretch)


def _candidates(path: NDArray[np.float64], box: Box, rotate: _Rotate) -> list[NDArray[np.float64]]:
    if rotate == "none":
        return [np.eye(3)]
    if rotate == "yaw":
        return [_yaw(math.radians(0.5 * step)) for step in range(360)]
    if rotate == "any":
        _, axes = np.linalg.eigh(np.cov(path.T))
        R = np.empty((3, 3))
        R[np.argsort(box.size, kind="stable")] = axes.T
        if np.linalg.det(R) < 0.0:
            R[int(np.argmin(box.size))] *= -1.0
        return [R]
    raise MovementError(f'rotation "{rotate}": give "none", "yaw" or "any"')


def _yaw(angle: float) -> NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _largest_scale(path: NDArray[np.float64], box: Box) -> float:
    extent = np.ptp(path.T.copy(), axis=1)  # six times as quick as along the columns
    return float(
        min(
            (room / need for room, need in zip(box.size, extent, strict=True) if need > 1e-12),
            default=math.inf,
        )
    )


def _needed_stretch(movement: Movement, t: NDArray[np.float64], max_speed: float | None) -> float:
    if max_speed is None:
        return 1.0
    if not max_speed > 0.0:
        raise MovementError(f"largest speed {max_speed} m/s: give a number greater than 0")
    return max(1.0, float(movement.speed(t).max()) / max_speed)
