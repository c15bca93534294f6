"""Overlays: what displaces the tool from the path of the program while it moves on it.

A conveyor moves the tool along with a belt; force mode moves it until it meets a force. The program works in
terms of the path; the joints get the displaced target. Without overlays none of this runs.
"""

from dataclasses import dataclass
from typing import Protocol

from protocol.pose import Pose, pose_add, pose_inv, pose_sub, pose_trans
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.motion.tool import Tool, UnreachableError
from ur_emulator.machine.motion.tool_streams import twist_towards


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


# Deceleration of a last displacement [m/s^2, rad/s^2]. Chosen: smooth for the conveyor, short for contact.
_LINEAR, _ANGULAR = 1.0, 4.0


@dataclass(slots=True, eq=False)
class LastDisplacement:
    """Takes the place of an overlay that was removed during a move: keeps its last displacement.

    The displacement is in base axes: added to the position, turned onto the rotation [m, rad]. The velocity
    that it still has is ramped down [m/s, rad/s].
    """

    tool: Tool
    _shift: Pose
    _velocity: Vector6

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """Return where the tool is with the displacement, which slows down to rest."""
        if self._velocity is not ZERO6:
            after = twist_towards(self._velocity, ZERO6, _LINEAR, _ANGULAR, dt)
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
