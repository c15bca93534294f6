"""A conveyor under the tool: an overlay that carries the path along as far as the belt has gone.

Where the belt is comes in ticks of an encoder, whole numbers once a cycle. An estimate of position and speed
smooths them without lag at constant speed; the tool follows the estimate with bounded acceleration, so that
an arm at rest catches up with a belt that runs already.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, exp, hypot, pi, sqrt

from protocol.pose import Pose, pose_inv, pose_trans
from ur_emulator.models.robot_model import Vector3
from ur_emulator.motion.target import JointTarget
from ur_emulator.motion.tool import Tool

# Nothing of this is published; all chosen.
# How quickly the estimate forgets old counts [1/s]: a quarter of a second smooths encoders of 1000 ticks/m.
_BANDWIDTH = 10.0
# Acceleration of the tool relative to its path [m/s^2], and its speed above the belt's [m/s] in catching up.
CATCH_UP_ACCELERATION, CATCH_UP_SPEED = 1.2, 0.25
# Share of the acceleration that the approach of the belt's position counts on, and its stiffness [1/s].
_APPROACH, _STIFFNESS = 0.5, 8.0
# A tool nearer to the axis of a turning conveyor than this turns as if it were so far away [m].
_LEAST_RADIUS = 0.1


class BeltEstimate:
    """Position and speed of a belt from counts: a critically damped alpha-beta filter."""

    def __init__(self, count: float, time: float) -> None:
        """Begin with the first count [ticks] at a time [s], at rest: the speed shows soon enough."""
        self.position = count
        self.speed = 0.0
        self._time = time

    def update(self, count: float, time: float) -> None:
        """Take the count at a later time; the gaps of a pause are bridged at the last speed."""
        dt = time - self._time
        if dt <= 0.0:
            return
        self._time = time
        memory = exp(-_BANDWIDTH * dt)
        self.position += self.speed * dt
        surprise = count - self.position
        self.position += (1.0 - memory * memory) * surprise
        self.speed += (1.0 - memory) ** 2 / dt * surprise


class Conveyor:
    """What linear and turning conveyors share: how far the tool has been carried, in ticks.

    Attributes:
        tool: the one that held when tracking began.
    """

    def __init__(self, tool: Tool, count: Callable[[], float], clock: Callable[[], float]) -> None:
        """Begin to track.

        Args:
            tool: that is carried.
            count: gives the ticks that the belt has gone so far, without wraps.
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
        """Draw what the tool has been carried to where the belt is."""
        belt = self._estimate
        a = CATCH_UP_ACCELERATION * ticks_per_metre
        gentle = _APPROACH * a
        behind = belt.position - self._carried
        # The speed that can still be taken off on the way left; linear close to the goal.
        corner = gentle / _STIFFNESS
        closing = min(
            sqrt(2.0 * gentle * abs(behind) + corner * corner) - corner, CATCH_UP_SPEED * ticks_per_metre
        )
        wanted = belt.speed + copysign(closing, behind)
        before = self._speed
        self._speed += min(max(wanted - before, -a * dt), a * dt)
        self._carried += 0.5 * dt * (before + self._speed)

    def _ticks_per_metre(self, tool_pose: Pose) -> float:
        """Return the ticks in which the tool is carried by a metre, above 0."""
        raise NotImplementedError

    def _carry(self, tool_pose: Pose, ticks: float) -> Pose:
        """Return the tool's pose carried along."""
        raise NotImplementedError


class LinearConveyor(Conveyor):
    """A belt that moves the tool straight on."""

    def __init__(
        self,
        direction: Vector3,
        ticks_per_metre: float,
        tool: Tool,
        count: Callable[[], float],
        clock: Callable[[], float],
    ) -> None:
        """Take the direction in the base frame, of any length above 0; and the ticks, below 0 to go back."""
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
        """Take the frame in the base frame; the ticks, below 0 to go back; whether the tool turns too."""
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
