"""Overlays: what displaces the tool from the path of the program while it moves on it.

A conveyor moves the tool along with a belt; force mode moves it until it meets a force. The program works in
terms of the path; the joints get the displaced target. Without overlays none of this runs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from math import copysign, exp, hypot, pi, sqrt
from typing import Protocol

import numpy as np

from protocol.pose import Pose, pose_add, pose_inv, pose_sub, pose_trans, rotvec_from_flat, rotvec_to_matrix
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6, six
from ur_emulator.machine.motion.generators import JointTarget, twist_towards
from ur_emulator.machine.motion.tool import Tool, UnreachableError


class Overlay(Protocol):
    """Displaces the tool, cycle by cycle; which tool may change while it is active."""

    tool: Tool

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """Return where the tool shall be at the end of the cycle, in the base frame [m, rad].

        The first displacement must be close to zero: a step here is a step of the arm.

        Args:
            tool_pose: tool along the path at the end of the cycle, displaced by the overlays before this one.
            dt: time to advance by [s]; shorter than a cycle, never 0, while a pause ramps down or up.
        """
        ...


class LastDisplacement:
    """Takes the place of an overlay that was removed during a move: keeps its last displacement.

    The velocity that the displacement still has is ramped down.
    """

    # Deceleration of the displacement [m/s^2, rad/s^2]. Chosen: smooth for the conveyor, short for contact.
    LINEAR, ANGULAR = 1.0, 4.0

    def __init__(self, tool: Tool, shift: Pose, velocity: Vector6) -> None:
        """Keep a displacement of a tool, and its rate of change [m/s, rad/s].

        `shift` is in base axes: added to the position, turned onto the rotation [m, rad].
        """
        self.tool = tool
        self._shift = shift
        self._velocity = velocity

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """See Overlay."""
        if self._velocity is not ZERO6:
            after = twist_towards(self._velocity, ZERO6, self.LINEAR, self.ANGULAR, dt)
            displacement = [0.5 * dt * (a + b) for a, b in zip(self._velocity, after, strict=True)]
            self._shift = pose_add(six(displacement), self._shift)
            self._velocity = after if any(after) else ZERO6
        return pose_add(self._shift, tool_pose)


_NO_SHIFT: tuple[Pose, Pose, float] = (ZERO6, ZERO6, 1.0)


class OverlayChain:
    """The active overlays in order, and how the last cycle displaced the tool."""

    def __init__(self) -> None:
        self.overlays: list[Overlay] = []
        # By overlay the displacements of the last two cycles, and the time between them.
        self._shifts: dict[int, tuple[Pose, Pose, float]] = {}
        self._step_speed: Vector6 = ZERO6

    def add(self, overlay: Overlay, target: JointTarget) -> None:
        """Append an overlay; it begins without displacement."""
        if not self.overlays:
            self._step_speed = target.qd
        self.overlays.append(overlay)

    def keep_last(self, overlay: Overlay) -> None:
        """Replace an overlay by its last displacement."""
        last, before, dt = self._shifts.pop(id(overlay), _NO_SHIFT)
        velocity = six([x / dt for x in pose_sub(last, before)])
        self.overlays[self.overlays.index(overlay)] = LastDisplacement(overlay.tool, last, velocity)

    @property
    def all_ended(self) -> bool:
        """True when no overlay acts any more."""
        return all(isinstance(overlay, LastDisplacement) for overlay in self.overlays)

    def clear(self) -> None:
        """Forget all overlays."""
        self.overlays.clear()
        self._shifts.clear()

    def displace(self, path: JointTarget, before: JointTarget, dt: float, share: float) -> JointTarget:
        """Return the displaced target, from that along the path and the displaced one `before`.

        The overlays advance by a share of the cycle `dt` [s]; 0 while they stand still. UnreachableError if
        the arm cannot be where they want it.
        """
        arm = self.overlays[0].tool.arm
        flange = arm.fk(path.q)
        still = not any(path.qd)
        for overlay in self.overlays:
            tcp = overlay.tool.tcp
            pose = pose_trans(flange, tcp)
            previous = self._shifts.get(id(overlay), _NO_SHIFT)[0]
            if share > 0.0:
                moved = overlay.displace(pose, share * dt)
                shift = pose_sub(moved, pose)
                self._shifts[id(overlay)] = (shift, previous, share * dt)
            else:
                moved, shift = pose_add(previous, pose), previous
            still = still and shift == previous
            flange = pose_trans(moved, pose_inv(tcp))
        near = [q + dt * v for q, v in zip(before.q, before.qd, strict=True)]
        q = arm.inverse(flange, near)
        if q is None:
            raise UnreachableError
        if still:
            self._step_speed = ZERO6
            return JointTarget(q)
        if not any(before.qd):
            self._step_speed = ZERO6  # after a pause
        # Speed at the end of the cycle from those of this one and the last: exact for a constant
        # acceleration.
        speed = six([(b - a) / dt for a, b in zip(before.q, q, strict=True)])
        qd = six([1.5 * new - 0.5 * old for new, old in zip(speed, self._step_speed, strict=True)])
        self._step_speed = speed
        return JointTarget(q, qd, six([(b - a) / dt for a, b in zip(before.qd, qd, strict=True)]))


# --- Conveyor tracking: an overlay that displaces the tool by the displacement of the belt
#
# The belt's position comes as counts of an encoder, whole numbers once a cycle. An estimate of position and
# speed smooths them, without lag at constant speed. The tool follows the estimate with bounded
# acceleration, so an arm at rest catches up with a running belt.


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


class Conveyor:
    """The overlay."""

    def __init__(
        self,
        belt: LinearBelt | CircularBelt,
        tool: Tool,
        count: Callable[[], float],
        clock: Callable[[], float],
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
        """See Overlay."""
        self._estimate.update(self._count() - self._origin, self._clock())
        self._follow(self._belt.ticks_per_metre(tool_pose), dt)
        return self._belt.carry(tool_pose, self._carried)

    def _follow(self, ticks_per_metre: float, dt: float) -> None:
        """Move the tool's displacement towards the belt's."""
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


# --- Path offset: displaces the tool from the path of the program, by what a program sets cycle by cycle
#
# Source: URScript manual e-Series 5.2x, path_offset_*: frames, filter, limits. Chosen: the rotation of the
# motion frame acts about its axes; an arm that stands keeps the last motion frame, at first it is that of the
# tool.


# The path moves by more than this in a cycle [m]: there its direction is that of the motion frame.
_MOTION = 1e-9
# Limits of the offset where a program sets none [m, rad]. Source: manual, path_offset_set_max_offset.
MAX_OFFSET = (0.1, 0.52)


class OffsetType(IntEnum):
    """What an offset refers to."""

    BASE = 1
    TCP = 2
    MOTION = 3  # x along the path, y perpendicular to it and to z of the tool
    WORLD = 4  # the offset is the pose of the base in the world, which the path refers to


class PathOffset:
    """The overlay; offset, filter and limits stay when it is taken away and added again.

    Attributes:
        alpha: share of the offset that a cycle takes over; 1 without a filter.
        limits: greatest displacement and rotation along an axis [m, rad].
    """

    def __init__(self, tool: Tool) -> None:
        self.alpha = 1.0
        self.limits = MAX_OFFSET
        self._wanted: Vector6 = ZERO6
        self._kind = OffsetType.BASE
        self.begin(tool)

    def begin(self, tool: Tool) -> None:
        """Begin to displace a tool, without an offset in the first cycle if there is a filter."""
        self.tool = tool
        self._filtered = np.zeros(6)
        self._path: Pose | None = None
        self._displaced: Pose | None = None
        self._motion_axes: Pose | None = None

    def set(self, offset: Vector6, kind: OffsetType) -> None:
        """Set the offset [m, rad]."""
        self._wanted, self._kind = offset, kind

    def applied(self, kind: OffsetType) -> Pose:
        """Return the offset of the last cycle in one of the frames."""
        path, displaced = self._path, self._displaced
        if path is None or displaced is None:
            return ZERO6
        match kind:
            case OffsetType.BASE:
                return pose_sub(displaced, path)
            case OffsetType.TCP:
                return pose_trans(pose_inv(path), displaced)
            case OffsetType.WORLD:
                return pose_trans(path, pose_inv(displaced))
        axes = self._motion_axes or (*ZERO6[:3], *path[3:])
        return _in_axes(pose_inv(axes), pose_sub(displaced, path))

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """See Overlay."""
        self._follow(tool_pose)
        most = np.repeat(self.limits, 3)
        self._filtered += self.alpha * (np.clip(self._wanted, -most, most) - self._filtered)
        offset = six(self._filtered.tolist())
        match self._kind:
            case OffsetType.BASE:
                displaced = pose_add(offset, tool_pose)
            case OffsetType.TCP:
                displaced = pose_trans(tool_pose, offset)
            case OffsetType.WORLD:
                displaced = pose_trans(pose_inv(offset), tool_pose)
            case _:
                axes = self._motion_axes or (*ZERO6[:3], *tool_pose[3:])
                displaced = pose_add(_in_axes(axes, offset), tool_pose)
        self._path, self._displaced = tool_pose, displaced
        return displaced

    def _follow(self, tool_pose: Pose) -> None:
        """Turn the motion frame to the path."""
        if self._path is None:
            return
        x = np.subtract(tool_pose[:3], self._path[:3])
        y = np.cross(x, rotvec_to_matrix(tool_pose[3:])[:, 2])
        if np.linalg.norm(x) > _MOTION < np.linalg.norm(y):
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
            turn = rotvec_from_flat(*np.column_stack([x, y, np.cross(x, y)]).ravel().tolist())
            self._motion_axes = (0.0, 0.0, 0.0, *turn)


def _in_axes(axes: Pose, offset: Pose) -> Pose:
    """Return an offset along turned axes as one along the axes that these are turned from."""
    return pose_trans(pose_trans(axes, offset), pose_inv(axes))
