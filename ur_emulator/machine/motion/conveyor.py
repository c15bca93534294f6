"""Conveyor tracking: an overlay that displaces the tool by the displacement of the belt.

The belt's position comes as counts of an encoder, whole numbers once a cycle. An estimate of position and
speed smooths them, without lag at constant speed. The tool follows the estimate with bounded acceleration, so
an arm at rest catches up with a running belt.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import copysign, exp, hypot, pi, sqrt

from protocol.pose import Pose, pose_inv, pose_trans
from ur_emulator.machine.models.robot_model import Vector3
from ur_emulator.machine.motion.tool import Tool

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


@dataclass(frozen=True, slots=True)
class LinearBelt:
    """A belt that moves in a straight line, at `density` ticks per metre; below 0: against the direction."""

    direction: Vector3
    density: float

    def ticks_per_metre(self, tool_pose: Pose) -> float:
        """Return the ticks that move a tool by a metre, above 0."""
        return abs(self.density)

    def carry(self, tool_pose: Pose, ticks: float) -> Pose:
        """Return the pose of a tool after so many ticks."""
        size = hypot(*self.direction)
        dx, dy, dz = (ticks * (k / size / self.density) for k in self.direction)
        x, y, z, rx, ry, rz = tool_pose
        return (x + dx, y + dy, z + dz, rx, ry, rz)


@dataclass(frozen=True, slots=True)
class CircularBelt:
    """A table that turns about the z axis of a frame.

    Attributes:
        centre: the frame, in the base frame.
        ticks_per_turn: below 0 it turns backwards.
        rotate_tool: the tool turns with the table.
    """

    centre: Pose
    ticks_per_turn: float
    rotate_tool: bool

    def ticks_per_metre(self, tool_pose: Pose) -> float:
        """Return the ticks that move a tool there by a metre, above 0."""
        x, y, *_ = pose_trans(pose_inv(self.centre), tool_pose)
        return 1.0 / (abs(2.0 * pi / self.ticks_per_turn) * max(hypot(x, y), _LEAST_RADIUS))

    def carry(self, tool_pose: Pose, ticks: float) -> Pose:
        """Return the pose of a tool after so many ticks."""
        turn = (0.0, 0.0, 0.0, 0.0, 0.0, ticks * (2.0 * pi / self.ticks_per_turn))
        x, y, z, *turned = pose_trans(
            pose_trans(self.centre, turn), pose_trans(pose_inv(self.centre), tool_pose)
        )
        rx, ry, rz = turned if self.rotate_tool else tool_pose[3:]
        return (x, y, z, rx, ry, rz)


Belt = LinearBelt | CircularBelt


class Conveyor:
    """The overlay that carries a tool with a belt."""

    def __init__(
        self, belt: Belt, tool: Tool, count: Callable[[], float], clock: Callable[[], float]
    ) -> None:
        """Begin to track: `count` gives the ticks of the belt, without overflows, `clock` the time [s]."""
        self.tool = tool
        self._belt = belt
        self._count = count
        self._clock = clock
        self._origin = count()
        self._estimate = BeltEstimate(0.0, clock())
        self._carried = 0.0  # displacement of the tool [ticks]
        self._speed = 0.0

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """Return where a tool on its path is with the displacement that follows the belt."""
        self._estimate.update(self._count() - self._origin, self._clock())
        self._follow(self._belt.ticks_per_metre(tool_pose), dt)
        return self._belt.carry(tool_pose, self._carried)

    def _follow(self, ticks_per_metre: float, dt: float) -> None:
        a = CATCH_UP_ACCELERATION * ticks_per_metre
        deceleration = _APPROACH * a
        error = self._estimate.position - self._carried
        # The speed from which the tool can still stop at the belt's position; linear close to it.
        corner = deceleration / _STIFFNESS
        approach = min(
            sqrt(2.0 * deceleration * abs(error) + corner * corner) - corner, CATCH_UP_SPEED * ticks_per_metre
        )
        wanted = self._estimate.speed + copysign(approach, error)
        before = self._speed
        self._speed += min(max(wanted - before, -a * dt), a * dt)
        self._carried += 0.5 * dt * (before + self._speed)
