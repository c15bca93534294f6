"""Conveyor tracking: an overlay that displaces the tool by the way of the belt.

The belt's position comes as counts of an encoder, whole numbers once a cycle. An estimate of position and
speed smooths them, without lag at constant speed. The tool follows the estimate with bounded acceleration, so
an arm at rest catches up with a running belt.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, exp, hypot, pi, sqrt

from protocol.pose import Pose, pose_inv, pose_trans
from ur_emulator.models.robot_model import Vector3
from ur_emulator.motion.target import JointTarget
from ur_emulator.motion.tool import Tool

# Nothing of this is published; all chosen.
# Bandwidth of the estimate [1/s]: smooths encoders of 1000 ticks/m within a quarter of a second.
_BANDWIDTH = 10.0
# Acceleration of the tool relative to its path [m/s^2], and its speed relative to the belt, while it catches
# up [m/s].
CATCH_UP_ACCELERATION, CATCH_UP_SPEED = 1.2, 0.25
# Share of the acceleration that is planned for the approach to the belt's position; its gain close by [1/s].
_APPROACH, _STIFFNESS = 0.5, 8.0
# Least radius that counts for the speed of a tool on a circular conveyor [m].
_LEAST_RADIUS = 0.1


class BeltEstimate:
    """Position and speed of a belt from counts: a critically damped alpha-beta filter."""

    def __init__(self, count: float, time: float) -> None:
        """Begin at rest with the first count [ticks] at a time [s]."""
        self.position = count
        self.speed = 0.0
        self._time = time

    def update(self, count: float, time: float) -> None:
        """Update with the count at a later time; over a pause the last speed is extrapolated."""
        dt = time - self._time
        if dt <= 0.0:
            return
        self._time = time
        decay = exp(-_BANDWIDTH * dt)
        self.position += self.speed * dt
        innovation = count - self.position
        self.position += (1.0 - decay * decay) * innovation
        self.speed += (1.0 - decay) ** 2 / dt * innovation


class Conveyor:
    """What linear and circular conveyors share: the way of the tool with the belt, in ticks.

    Attributes:
        tool: in force when tracking began.
    """

    def __init__(self, tool: Tool, count: Callable[[], float], clock: Callable[[], float]) -> None:
        """Begin to track.

        Args:
            tool: that moves with the belt.
            count: gives the ticks of the belt so far, without overflows.
            clock: gives the time [s].
        """
        self.tool = tool
        self._count = count
        self._clock = clock
        self._origin = count()
        self._estimate = BeltEstimate(0.0, clock())
        self._carried = 0.0
        self._speed = 0.0

    def displace(self, tool_pose: Pose, path: JointTarget, dt: float) -> Pose:
        """See Overlay."""
        self._estimate.update(self._count() - self._origin, self._clock())
        self._follow(self._ticks_per_metre(tool_pose), dt)
        return self._carry(tool_pose, self._carried)

    def _follow(self, ticks_per_metre: float, dt: float) -> None:
        """Move the tool's way towards the belt's."""
        belt = self._estimate
        a = CATCH_UP_ACCELERATION * ticks_per_metre
        deceleration = _APPROACH * a
        error = belt.position - self._carried
        # The speed from which the tool can still stop at the belt's position; linear close to it.
        corner = deceleration / _STIFFNESS
        approach = min(
            sqrt(2.0 * deceleration * abs(error) + corner * corner) - corner, CATCH_UP_SPEED * ticks_per_metre
        )
        wanted = belt.speed + copysign(approach, error)
        before = self._speed
        self._speed += min(max(wanted - before, -a * dt), a * dt)
        self._carried += 0.5 * dt * (before + self._speed)

    def _ticks_per_metre(self, tool_pose: Pose) -> float:
        """Return the ticks that move the tool by a metre, above 0."""
        raise NotImplementedError

    def _carry(self, tool_pose: Pose, ticks: float) -> Pose:
        """Return the tool's pose after so many ticks of the belt."""
        raise NotImplementedError


class LinearConveyor(Conveyor):
    """A belt that moves in a straight line."""

    def __init__(
        self,
        direction: Vector3,
        ticks_per_metre: float,
        tool: Tool,
        count: Callable[[], float],
        clock: Callable[[], float],
    ) -> None:
        """Take the direction in the base frame, of any length above 0; ticks below 0 reverse it."""
        super().__init__(tool, count, clock)
        size = hypot(*direction)
        x, y, z = direction
        self._per_tick = (x / size / ticks_per_metre, y / size / ticks_per_metre, z / size / ticks_per_metre)
        self._density = abs(ticks_per_metre)

    def _ticks_per_metre(self, tool_pose: Pose) -> float:
        return self._density

    def _carry(self, tool_pose: Pose, ticks: float) -> Pose:
        dx, dy, dz = self._per_tick
        x, y, z, rx, ry, rz = tool_pose
        return (x + ticks * dx, y + ticks * dy, z + ticks * dz, rx, ry, rz)


class CircularConveyor(Conveyor):
    """A table that turns about the z axis of a frame."""

    def __init__(
        self,
        centre: Pose,
        ticks_per_turn: float,
        tool: Tool,
        count: Callable[[], float],
        clock: Callable[[], float],
        *,
        rotate_tool: bool,
    ) -> None:
        """Take the frame in the base frame; ticks, below 0 to turn backwards; whether the tool turns."""
        super().__init__(tool, count, clock)
        self._centre = centre
        self._from_centre = pose_inv(centre)
        self._per_tick = 2.0 * pi / ticks_per_turn
        self._rotate_tool = rotate_tool

    def _ticks_per_metre(self, tool_pose: Pose) -> float:
        x, y, *_ = pose_trans(self._from_centre, tool_pose)
        return 1.0 / (abs(self._per_tick) * max(hypot(x, y), _LEAST_RADIUS))

    def _carry(self, tool_pose: Pose, ticks: float) -> Pose:
        turn = (0.0, 0.0, 0.0, 0.0, 0.0, ticks * self._per_tick)
        x, y, z, *turned = pose_trans(
            pose_trans(self._centre, turn), pose_trans(self._from_centre, tool_pose)
        )
        rx, ry, rz = turned if self._rotate_tool else tool_pose[3:]
        return (x, y, z, rx, ry, rz)
