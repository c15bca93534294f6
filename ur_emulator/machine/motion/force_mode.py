"""Force mode: along its compliant axes the tool moves until the wrench there is the one asked for.

An overlay of the tool path. Each compliant axis gets the sum of two speeds, within its limit:

    pressing = gain * missing,   missing = wrench demanded + wrench measured
    free:    d(free)/dt = missing / inertia + free * log(1 - damping) / 2 ms

In contact only the first is left, because `free` is limited by the measured speed, and the force approaches
the demanded one as a first-order lag. `gain` is the rate of that lag times the compliance that the joint
servos give the tool at its present pose, so contact is equally fast and stable at all poses. In free space
the tool moves as a mass. The law is one in seconds: the control period does not change it. Along stiff axes
the tool follows the program.

An arm that knows forces by its currents takes accelerations of its own mass for forces, and that mass, at the
tool, grows without bound towards a singularity. So `inertia` is at least the mass of the arm, and `gain` is
limited by it.

Source: URScript manual CB3 3.15, force_mode: compliant axes, limits; force_mode_set_damping: 1 "decelerates
quickly if no force is present", 0 "maintains the speed"; force_mode_set_gain_scaling. What the program moves
along compliant axes is not executed (documentation of the maker's ROS 2 driver, ForceModeController). The law
in contact is ours. Inertia and damping are those of a UR5e in the maker's simulator, by two files of ur_rtde
1.6.5: with 10 N, damping 0.025 and scaling 0.5 it moves at 20 mm/s (doc/_static/force_mode_example.gif), and
after two seconds down and two up it is 1.3 mm below its start (test/main.cpp).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf, log, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, pose_add, pose_sub, rotvec_to_matrix
from ur_emulator.machine.models.robot_generation import ForceSensing
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion.tool import Tool
from ur_hil.arithmetic import add_up

Axes = NDArray[np.float64]

MIN_DISTANCE = 0.01  # m, of the tool from the origin of a frame of type 1
# The path's speed in the x-y plane that counts as motion [m/s].
_MOTION = 1e-6


class FrameType(IntEnum):
    """How the task frame is oriented."""

    POINT = 1  # y towards its origin
    FIXED = 2
    MOTION = 3  # x along the projected motion of the tool


class TaskFrame:
    """A task frame in the base: the pose as given to force_mode [m, rad], and how it turns cycle by cycle.

    Source: URScript manual CB3 3.15, force_mode, `type`; UR3/CB3 manual, program node "Force": a point must
    be at least 10 mm away; with the motion type no axis is compliant before the tool moves, and when it
    stands again the frame stays as it was last. Chosen, where the manuals leave it open: the frame gives
    directions only, the wrench acts at the tool centre point; the other axes of type 1; the motion of type 3
    is that along the program's path.

    Attributes:
        axes: directions of the axes in the base as columns (3, 3); None as long as there are none.
    """

    def __init__(self, pose: Pose, kind: FrameType) -> None:
        self.kind = kind
        self._origin = np.array(pose[:3])
        self._given: Axes = np.array(rotvec_to_matrix(pose[3:]))
        self.axes = self._given if kind is FrameType.FIXED else None

    def follow(self, before: TaskFrame) -> None:
        """Begin with the directions of the frame whose place this one takes, if they are of its kind."""
        if self.kind is before.kind is not FrameType.FIXED:
            self.axes = before.axes

    def distance(self, tool: Sequence[float]) -> float:
        """Return how far a tool position is from the origin [m]."""
        return float(np.linalg.norm(self._origin - np.array(tool[:3])))

    def turn(self, tool: Sequence[float], velocity: Sequence[float]) -> Axes | None:
        """Turn the frame to a tool position (3,) [m] and its velocity along the path (3,) [m/s], in base."""
        if self.kind is FrameType.POINT:
            self._turn_to_point(np.array(tool[:3]))
        elif self.kind is FrameType.MOTION:
            self._turn_along(np.array(velocity[:3]))
        return self.axes

    def _turn_to_point(self, tool: NDArray[np.float64]) -> None:
        offset = self._origin - tool
        distance = float(np.linalg.norm(offset))
        if distance < MIN_DISTANCE:
            return
        y = offset / distance
        # z is as close to the given one as possible; if that is parallel to y, the given x takes its place.
        z = self._given[:, 2] - (self._given[:, 2] @ y) * y
        if np.linalg.norm(z) < 1e-6:
            z = np.cross(self._given[:, 0], y)
        z /= np.linalg.norm(z)
        self.axes = np.column_stack([np.cross(y, z), y, z])

    def _turn_along(self, velocity: NDArray[np.float64]) -> None:
        z = self._given[:, 2]
        x = velocity - (velocity @ z) * z
        speed = float(np.linalg.norm(x))
        if speed > _MOTION:
            x /= speed
            self.axes = np.column_stack([x, np.cross(z, x), z])


# Dry friction of free motion [N, Nm]. So noise and the error of the zero do not accelerate a free arm.
_IDLE_WRENCH = np.repeat([1.5, 0.25], 3)
# Inertia of free motion times the rate of control [kg/s, kg m^2/s]: 20 kg and 1 kg m^2 on an e-Series arm.
_INERTIA_RATE = np.repeat([480.0, 24.0], 3)
# The damping is the share of a free speed that is lost in this time [s]: the cycle of an e-Series box.
_DAMPING_TIME = 0.002
# The free speed is at most this multiple of the measured one [1], which is late while the tool accelerates.
_FREE_SHARE = 1.3
# Accelerations of the displacement [m/s^2, rad/s^2].
_ACCELERATION = np.repeat([5.0, 20.0], 3)
# Lower bound of the compliance, for stretched poses [m/N, rad/Nm].
_STIFFEST = np.repeat([5e-6, 2e-4], 3)
# Compliance beside that of the servos [m/N, rad/Nm]: far below theirs, it keeps the stiffness finite.
_LEAST_COMPLIANCE = np.diag(np.repeat([1e-9, 1e-8], 3))
# `pressing` answers an acceleration of the arm itself by at most the speed of this time [s].
_OWN_TIME = 0.004
# Stiff axes deviate by this much without any fault [m, rad]; lower limits count as these.
_LEAST_DEVIATION = np.repeat([0.002, 0.01], 3)
# No joint moves a tool further than this per radian [m/rad, rad/rad].
_LONGEST_LEVER = 2.0
# The gains are computed anew after this time [s]: the tool has moved a few millimetres.
_GAIN_TIME = 0.064


class ArmMeasurement(NamedTuple):
    """What force mode measures of the arm.

    Attributes:
        q: joint angles [rad].
        wrench: on the tool from outside, at the tool centre point in base axes [N, Nm].
        twist: of the tool centre point in base axes [m/s, rad/s].
    """

    q: Vector6
    wrench: Vector6
    twist: Vector6


@dataclass(frozen=True, slots=True)
class ForceSettings:
    """Arguments of force_mode, and the damping (0..1) and gain scaling (0..2) set before it.

    Attributes:
        selection: by axis of the task frame, True for compliant.
        wrench: demanded from the tool on its environment, task axes [N, Nm].
        limits: speed of compliant axes [m/s, rad/s], deviation of stiff ones [m, rad].
    """

    selection: tuple[bool, ...]
    wrench: Vector6
    limits: Vector6
    damping: float = 0.0
    gain_scaling: float = 1.0


class Deviation(NamedTuple):
    """The deviation of a stiff axis (0..5) beyond the greatest allowed one [m or rad]."""

    axis: int
    size: float
    limit: float


class ForceMode:
    """The overlay of force mode; it begins without displacement and speed.

    How the wrench is sensed says how fast the mode may act. `stiffness` is that of the joint servos (6,)
    [Nm/rad], `servo_frequency` the one that all of them have with the inertia of the arm [Hz].
    """

    def __init__(
        self,
        tool: Tool,
        frame: TaskFrame,
        settings: ForceSettings,
        sensing: ForceSensing,
        stiffness: Sequence[float],
        servo_frequency: float,
        measure: Callable[[], ArmMeasurement],
    ) -> None:
        self.tool = tool
        self._measure = measure
        self._sensing = sensing
        self._joint_compliance = 1.0 / np.array(stiffness)
        # Mobility of the arm by the compliance of its servos [1/s²].
        self._mobility_by_compliance = (2.0 * pi * servo_frequency) ** 2
        self._shift: Pose = ZERO6
        self._speed = np.zeros(6)  # of the displacement, beside what it cancels of the path; base axes
        self._cancelling = np.zeros((6, 6))
        measured = measure()
        self._wrench = np.array(measured.wrench)
        self._twist = np.array(measured.twist)
        self._path_pose: Pose | None = None
        self._gain = self._mobility = np.zeros(6)
        self._gain_time_left = 0.0
        self._settings: ForceSettings | None = None
        self.set(frame, settings)

    def set(self, frame: TaskFrame, settings: ForceSettings) -> None:
        """Continue with another frame and other settings, without a step of the speed."""
        self.frame = frame
        if settings == self._settings:
            return
        self._settings = settings
        self._rate = settings.gain_scaling * self._sensing.control_rate
        self._kept = 1.0 - settings.damping
        self._chosen = np.array(settings.selection)
        self._demanded = np.array(settings.wrench)
        self._limits = np.array(settings.limits)
        self._gain_time_left = 0.0
        stiff = np.maximum(self._limits, _LEAST_DEVIATION)[~self._chosen]
        self._tightest = float(stiff.min()) if stiff.size else inf

    def displace(self, tool_pose: Pose, dt: float) -> Pose:
        """Return where a tool on its path is after a cycle of the law, displaced."""
        along_path = ZERO6 if self._path_pose is None else pose_sub(tool_pose, self._path_pose)
        measured = self._measure()
        share = dt / (self._sensing.filter_time + dt)
        self._wrench += share * (np.array(measured.wrench) - self._wrench)
        self._twist += share * (np.array(measured.twist) - self._twist)
        place = pose_add(self._shift, tool_pose)
        axes = self.frame.turn(place, [displacement / dt for displacement in along_path])
        rotation = np.eye(6) if axes is None else _block_diagonal(axes)
        chosen = np.zeros(6, dtype=bool) if axes is None else self._chosen
        # The program's motion along compliant axes, turned by the displacement, is cancelled. Where axes
        # begin or cease to be compliant the tool keeps its speed.
        displacement = np.array(along_path)
        displacement[3:] = rotvec_to_matrix(self._shift[3:]) @ displacement[3:]
        if self._path_pose is not None:
            before, self._cancelling = self._cancelling, (rotation * chosen) @ rotation.T
            self._speed = self._speed + (self._cancelling - before) @ displacement / dt
        speed = rotation @ self._axis_speeds(rotation, chosen, measured.q, dt)
        step = 0.5 * dt * (self._speed + speed) - self._cancelling @ displacement
        self._path_pose = tool_pose
        self._speed = speed
        self._shift = pose_add(six(step.tolist()), self._shift)
        return pose_add(self._shift, tool_pose)

    def deviation(self, q: Sequence[float], position_error: Sequence[float]) -> Deviation | None:
        """Return the stiff axis on which the arm is further from its set-point than its limit allows.

        `position_error` is that of the joints (6,) [rad].
        """
        if self.frame.axes is None or _LONGEST_LEVER * add_up(map(abs, position_error)) < self._tightest:
            return None
        off = np.abs(_block_diagonal(self.frame.axes).T @ self.tool.twist(q, position_error))
        limits = np.maximum(self._limits, _LEAST_DEVIATION)
        beyond = np.flatnonzero(~self._chosen & (off > limits))
        if not beyond.size:
            return None
        axis = int(beyond[0])
        return Deviation(axis, float(off[axis]), float(limits[axis]))

    def _axis_speeds(
        self, rotation: NDArray[np.float64], chosen: NDArray[np.bool_], q: Sequence[float], dt: float
    ) -> NDArray[np.float64]:
        """Return the speeds along the axes of the task frame at the end of this cycle, 0 of stiff axes."""
        before = rotation.T @ self._speed
        if not chosen.any():
            return before - np.clip(before, -_ACCELERATION * dt, _ACCELERATION * dt)
        if self._gain_time_left < 0.5 * dt:
            self._set_gains(rotation, q)
            self._gain_time_left = _GAIN_TIME
        self._gain_time_left -= dt
        gain = self._gain
        missing = self._demanded + rotation.T @ self._wrench
        pressing = gain * missing
        kept = self._kept ** (dt / _DAMPING_TIME)
        # The exact solution: the force acts for a shorter time while the damping takes from what it gives.
        gained = self._mobility * dt * ((kept - 1.0) / log(kept) if 0.0 < kept < 1.0 else kept)
        free = _shortened(kept * (before - pressing) + gained * missing, gained * _IDLE_WRENCH)
        # A motion that a wrench within the friction causes is not free.
        moved = _FREE_SHARE * _shortened(rotation.T @ self._twist, gain * _IDLE_WRENCH)
        wanted = pressing + np.clip(free, np.minimum(moved, 0.0), np.maximum(moved, 0.0))
        wanted = np.where(chosen, np.clip(wanted, -self._limits, self._limits), 0.0)
        return np.clip(wanted, before - _ACCELERATION * dt, before + _ACCELERATION * dt)

    def _set_gains(self, rotation: NDArray[np.float64], q: Sequence[float]) -> None:
        """Set gain and mobility for a pose, each the same along all compliant axes of a kind."""
        jacobian = rotation.T @ self.tool.arm.jacobian(q, self.tool.tcp)
        compliance = (jacobian * self._joint_compliance) @ jacobian.T
        least = self._of_kinds(compliance, lambda block: np.linalg.eigvalsh(block)[0])
        self._gain = self._rate * np.maximum(least, _STIFFEST)
        self._mobility = self._rate / _INERTIA_RATE
        if not self._sensing.has_sensor:
            # The tool moves along compliant axes only: a block of the stiffness is that with all others held.
            stiffness = np.asarray(np.linalg.inv(compliance + _LEAST_COMPLIANCE), np.float64)
            held = self._of_kinds(stiffness, lambda block: 1.0 / np.linalg.eigvalsh(block)[-1])
            own_mobility = self._mobility_by_compliance * held
            self._mobility = np.minimum(self._mobility, own_mobility)
            self._gain = np.minimum(self._gain, _OWN_TIME * own_mobility)

    def _of_kinds(
        self, matrix: NDArray[np.float64], value: Callable[[NDArray[np.float64]], float]
    ) -> NDArray[np.float64]:
        """Return a value (6,) of the block of compliant axes of a matrix: of forces, then of moments."""
        values = np.zeros(6)
        for kind in (slice(0, 3), slice(3, 6)):
            chosen = np.flatnonzero(self._chosen[kind])
            if chosen.size:
                values[kind] = value(matrix[kind, kind][np.ix_(chosen, chosen)])
        return values


def _shortened(values: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values that are closer to 0 by these sizes, none beyond it."""
    return np.sign(values) * np.maximum(np.abs(values) - sizes, 0.0)


def _block_diagonal(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation of wrenches and twists (6, 6) for a rotation of axes (3, 3)."""
    rotation = np.zeros((6, 6))
    rotation[:3, :3] = rotation[3:, 3:] = axes
    return rotation
