"""Boundaries of the tool in space: safety planes, and a cone for its direction.

Sources: UR3 and UR10/CB3 user manuals 3.x, boundaries and safety modes: the normal of a plane points to its
allowed side, what is about to cross it ends the program, what has crossed it is a violation, on the way back
both modes are allowed within 20 mm of a plane that triggers reduced mode; PolyScope 5.20 user manual, safety
planes: the modes, the elbow. Codes and the first words of their texts: a public list of error codes. What a
boundary holds is the TCP; tool spheres are not modelled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from math import acos, fsum, inf, radians
from operator import mul
from typing import TYPE_CHECKING

from protocol.primary.messages import ReportLevel
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.models.robot_model import Vector3

if TYPE_CHECKING:
    from ur_emulator.machine.kinematics.arm_model import CartesianState

MOST_PLANES = 8
# A program is ended this far before a boundary [m, rad]; the manuals name such a tolerance without a number.
# Source of the numbers: UR5/CB3 manual 3.1, trueness of TCP position and orientation.
PLANE_TOLERANCE, DIRECTION_TOLERANCE = 0.020, radians(1.15)
# Reduced mode ends when the arm is this far back on the allowed side of the plane [m].
TRIGGER_BAND = 0.020
# An arm that comes nearer to a boundary by no more than this does not move towards it [m, rad].
_NO_MOTION = 1e-6


class BoundaryMode(Enum):
    """When a boundary is active; the values are those of the control API."""

    DISABLED = "disabled"
    NORMAL = "normal"
    REDUCED = "reduced"
    BOTH = "normal and reduced"
    TRIGGER = "trigger reduced mode"

    def limits(self, is_reduced: bool) -> bool:
        """True where the boundary is a strict limit, in reduced mode or in normal mode."""
        return self is self.BOTH or self is (self.REDUCED if is_reduced else self.NORMAL)


@dataclass(frozen=True, slots=True)
class SafetyPlane:
    """A safety plane in the base frame: a point [m], and the unit vector towards the allowed side."""

    name: str
    position: Vector3
    normal: Vector3
    mode: BoundaryMode
    restricts_elbow: bool = False

    def gaps(self, arm: CartesianState) -> Iterator[tuple[str, float]]:
        """Yield what it holds: name, distance on the allowed side [m]."""
        normal, offset = self.normal, _dot(self.normal, self.position)
        yield "TCP", _dot(normal, arm.tcp_pose[:3]) - offset
        if self.restricts_elbow:
            yield "elbow", _dot(normal, arm.elbow_position) - offset


@dataclass(frozen=True, slots=True)
class ToolDirection:
    """A cone around a unit vector in the base frame, which holds the z axis of the TCP; `deviation` in rad.

    Its mode never triggers reduced mode.
    """

    axis: Vector3
    deviation: float
    mode: BoundaryMode

    def gap(self, arm: CartesianState) -> float:
        """Return the angle that is left [rad]."""
        from protocol.pose import rotvec_to_flat  # loads numpy, which the command line does without

        rotation = rotvec_to_flat(*arm.tcp_pose[3:])
        cosine = _dot(self.axis, (rotation[2], rotation[5], rotation[8]))
        return self.deviation - acos(min(1.0, max(-1.0, cosine)))


@dataclass(frozen=True, slots=True)
class Boundaries:
    """The boundaries of a box, or those that are strict limits of a mode; without any it is false."""

    planes: tuple[SafetyPlane, ...] = ()
    tool_direction: ToolDirection | None = None

    def __bool__(self) -> bool:
        return bool(self.planes) or self.tool_direction is not None

    def limits(self, is_reduced: bool) -> Boundaries:
        """Return the strict limits of reduced mode, or of normal mode."""
        tool = self.tool_direction
        return Boundaries(
            tuple(plane for plane in self.planes if plane.mode.limits(is_reduced)),
            tool if tool is not None and tool.mode.limits(is_reduced) else None,
        )

    def trigger_gap(self, arm: CartesianState) -> float:
        """Return the distance to the nearest plane that triggers reduced mode [m]; negative beyond it."""
        planes = (plane for plane in self.planes if plane.mode is BoundaryMode.TRIGGER)
        return min((gap for plane in planes for _, gap in plane.gaps(arm)), default=inf)

    def find_near(self, arm: CartesianState, ahead: Sequence[CartesianState]) -> ErrorReported | None:
        """Return why a protective stop begins before a limit that the arm approaches, or None.

        `arm` is that at the set-point, `ahead` where it would go if it stopped now, until it rests.
        """
        for plane in self.planes:
            then = zip(*(plane.gaps(later) for later in ahead), strict=True)
            for (what, gap), gaps in zip(plane.gaps(arm), then, strict=True):
                least = min(later for _, later in gaps)
                if least < min(PLANE_TOLERANCE, gap - _NO_MOTION):
                    return _near(152, f"Position close to safety plane limits: {_place(plane, what, gap)}")
        if self.tool_direction is not None:
            left = self.tool_direction.gap(arm)
            least = min(map(self.tool_direction.gap, ahead))
            if least < min(DIRECTION_TOLERANCE, left - _NO_MOTION):
                return _near(151, f"Tool orientation close to limits: {left:.3f} rad left")
        return None

    def find_crossed(self, arm: CartesianState) -> ErrorReported | None:
        """Return the violation of a limit by the arm, or None."""
        for plane in self.planes:
            for what, gap in plane.gaps(arm):
                if gap < 0.0:
                    return _crossed(4, f"TCP position limit violated: {_place(plane, what, gap)}")
        if self.tool_direction is not None and (left := self.tool_direction.gap(arm)) < 0.0:
            return _crossed(5, f"TCP orientation limit violated: {-left:.3f} rad beyond")
        return None


NO_BOUNDARIES = Boundaries()


def _place(plane: SafetyPlane, what: str, gap: float) -> str:
    return f"{what} {abs(gap) * 1e3:.1f} mm {'beyond' if gap < 0.0 else 'from'} plane '{plane.name}'"


def _near(code: int, text: str) -> ErrorReported:
    return ErrorReported(code, 0, ReportLevel.WARNING, f"Protective Stop: {text}")


def _crossed(argument: int, text: str) -> ErrorReported:
    return ErrorReported(191, argument, ReportLevel.VIOLATION, f"Safety system violation: {text}")


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return fsum(map(mul, a, b))
