"""Safety planes and the limit of the tool's direction, as the pendant sets them up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, pi, radians
from typing import Literal

from ur_emulator.commands.operation import CommandOperation
from ur_emulator.commands.parameters import parameter
from ur_emulator.controller.command import Box
from ur_emulator.controller.safety.boundaries import (
    MOST_PLANES,
    Boundaries,
    BoundaryMode,
    SafetyPlane,
    ToolDirection,
)
from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.models.robot_model import Vector3

_LEAST_LENGTH = 1e-6


class SetSafetyPlane(CommandOperation):
    """Set up a safety plane; one of the same name is replaced, and all when an installation is loaded."""

    name: str = parameter("of the plane")
    position: Sequence[float] = parameter("of a point of the plane in the base frame", "m")
    normal: Sequence[float] = parameter("towards the allowed side, in the base frame, of any length")
    mode: Literal["disabled", "normal", "reduced", "normal and reduced", "trigger reduced mode"] = parameter(
        "where it is a strict limit, or that it triggers reduced mode", default="normal"
    )
    restrict_elbow: bool = parameter("it holds the elbow, too", default=False)

    def check_together(self) -> None:
        if not self.name:
            raise ArgumentError("safety plane without a name given: it needs one, to be replaced by")
        _unit(self.normal)

    def apply(self, box: Box) -> None:
        x, y, z = self.position
        plane = SafetyPlane(
            self.name, (x, y, z), _unit(self.normal), BoundaryMode(self.mode), self.restrict_elbow
        )
        boundaries = box.state.safety.limits.boundaries
        planes = (*(other for other in boundaries.planes if other.name != self.name), plane)
        if len(planes) > MOST_PLANES:
            raise RefusedError(
                f"safety plane {self.name!r}: there are {MOST_PLANES} planes, no more are possible: "
                f"give the name of one of them, {', '.join(other.name for other in boundaries.planes)}"
            )
        _set(box, replace(boundaries, planes=planes))


class LimitToolDirection(CommandOperation):
    """Limit the direction of the tool, the z axis of the TCP, to a cone."""

    axis: Sequence[float] = parameter("of the cone in the base frame, of any length")
    deviation: float = parameter("largest angle from the axis", "rad", low=radians(3.0), high=pi)
    mode: Literal["disabled", "normal", "reduced", "normal and reduced"] = parameter(
        "where it is a strict limit", default="normal"
    )

    def check_together(self) -> None:
        _unit(self.axis)

    def apply(self, box: Box) -> None:
        cone = ToolDirection(_unit(self.axis), self.deviation, BoundaryMode(self.mode))
        _set(box, replace(box.state.safety.limits.boundaries, tool_direction=cone))


def _set(box: Box, boundaries: Boundaries) -> None:
    box.safety.set_limits(replace(box.state.safety.limits, boundaries=boundaries))


def _unit(vector: Sequence[float]) -> Vector3:
    x, y, z = vector
    length = hypot(x, y, z)
    if length < _LEAST_LENGTH:
        raise ArgumentError(f"direction {list(vector)} given: its length must be at least {_LEAST_LENGTH:g}")
    return x / length, y / length, z / length
