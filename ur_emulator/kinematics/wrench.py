"""Wrenches at other points."""

from __future__ import annotations

from collections.abc import Sequence

from ur_emulator.models.robot_model import Vector6


def moved_wrench(wrench: Vector6, of: Sequence[float], to: Sequence[float]) -> Vector6:
    """Return a wrench at another point, in the same axes: the moment loses lever times force.

    Args:
        wrench: [N, Nm].
        of: point that its moment refers to, (3,) or the pose of it [m].
        to: the other point.
    """
    rx, ry, rz = (b - a for a, b in zip(of[:3], to[:3], strict=True))
    fx, fy, fz, mx, my, mz = wrench
    return (fx, fy, fz, mx - ry * fz + rz * fy, my - rz * fx + rx * fz, mz - rx * fy + ry * fx)
