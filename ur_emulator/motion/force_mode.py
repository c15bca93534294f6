"""Force mode: along its compliant axes the tool moves until the wrench there is the one asked for.

An overlay of the tool path. In every cycle each compliant axis gets a speed

    v = (1 - damping) * v_actual + gain * (wrench asked + wrench felt)

within its limit. In free space the speed is maintained and grows while a force is missing, up to the limit;
in contact the tool stands still, so that only the second term is left and the force approaches the one asked
for as a first-order lag. Nobody has to find out whether there is contact. `gain` is that lag's rate times the
compliance that the joint servos give the tool at the present pose, so that contact is equally fast and stable
everywhere. Where a stiff axis is selected, or nothing compliant, the tool follows the program.

Source: URScript manual CB3 3.15, force_mode: compliant axes, limits; force_mode_set_damping: 1 "decelerates
quickly if no force is present", 0 "maintains the speed"; force_mode_set_gain_scaling. What the program moves
along compliant axes is not executed (documentation of the maker's ROS 2 driver, ForceModeController). The
control law is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, rotvec_to_matrix
from ur_emulator.models.robot_model import Vector6, six
from ur_emulator.motion.overlay import apply_shift, shift_between
from ur_emulator.motion.target import ZERO6, JointTarget
from ur_emulator.motion.task_frame import TaskFrame
from ur_emulator.motion.tool import Tool

# Rate at which the force approaches the one asked for at gain scaling 1 [1/s]. The whole loop takes about
# 60 ms (poor fidelity 75): 8 * .075 leaves more than 50 degrees of phase, and scaling 2 is still stable.
FORCE_RATE = 8.0
# Time constant of the filter of the felt wrench [s]: what is left of 3 N of noise moves the arm inaudibly.
FILTER_TIME = 0.024
# A speed that is not maintained: that of this force or moment missing [N, Nm]. It keeps noise and the error
# of the zero from setting a free arm adrift.
_IDLE_WRENCH = np.repeat([1.5, 0.25], 3)
# Accelerations of the displacement [m/s^2, rad/s^2].
_ACCELERATION = np.repeat([5.0, 20.0], 3)
# Least compliance to reckon with, in stretched poses [m/N, rad/Nm].
_STIFFEST = (5e-6, 2e-4)
# Deviations of stiff axes below this are the arm's own [m, rad]; tighter limits count as these.
_LEAST_DEVIATION = np.repeat([0.002, 0.01], 3)
# No joint moves a tool further than this per radian [m/rad, rad/rad].
_LONGEST_LEVER = 2.0
# Cycles for which the gains at a pose hold: the tool has gone a few millimetres.
_GAIN_CYCLES = 8


class Felt(NamedTuple):
    """What force mode feels of the arm.

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
    """Arguments of force_mode and what was set before it.

    Attributes:
        selection: by axis of the task frame, True for compliant.
        wrench: that the tool shall press with, task axes [N, Nm].
        limits: speed of compliant axes [m/s, rad/s], deviation of stiff ones [m, rad].
        damping: 0..1.
        gain_scaling: 0..2.
    """

    selection: tuple[bool, ...]
    wrench: Vector6
    limits: Vector6
    damping: float = 0.0
    gain_scaling: float = 1.0


class Deviation(NamedTuple):
    """A stiff axis that is too far off.

    Attributes:
        axis: 0..5.
        size: how far [m or rad].
        limit: allowed [m or rad].
    """

    axis: int
    size: float
    limit: float


class ForceMode:
    """The overlay. Starts without displacement and speed.

    Args:
        tool: what presses.
        frame: whose axes are compliant or stiff.
        settings: what is asked.
        stiffness: of the joint servos (6,) [Nm/rad].
        feel: gives the present measurements.
    """

    def __init__(
        self,
        tool: Tool,
        frame: TaskFrame,
        settings: ForceSettings,
        stiffness: Sequence[float],
        feel: Callable[[], Felt],
    ) -> None:
        self.tool = tool
        self._feel = feel
        self._joint_compliance = 1.0 / np.array(stiffness)
        self._shift: Pose = ZERO6
        self._speed = np.zeros(6)  # of the displacement, base axes
        felt = feel()
        self._wrench = np.array(felt.wrench)
        self._twist = np.array(felt.twist)
        self._path_pose: Pose | None = None
        self._gain = np.zeros(6)
        self._gain_age = 0
        self._settings: ForceSettings | None = None
        self.set(frame, settings)

    def set(self, frame: TaskFrame, settings: ForceSettings) -> None:
        """Go on with another frame and other settings, without a jump."""
        self.frame = frame
        if settings == self._settings:
            return
        self._settings = settings
        self._rate = settings.gain_scaling * FORCE_RATE
        self._maintained = 1.0 - settings.damping
        self._chosen = np.array(settings.selection)
        self._asked = np.array(settings.wrench)
        self._limits = np.array(settings.limits)
        self._gain_age = 0
        stiff = np.maximum(self._limits, _LEAST_DEVIATION)[~self._chosen]
        self._tightest = float(stiff.min()) if stiff.size else inf

    def displace(self, tool_pose: Pose, path: JointTarget, dt: float) -> Pose:
        """See Overlay."""
        along_path = ZERO6 if self._path_pose is None else shift_between(self._path_pose, tool_pose)
        self._path_pose = tool_pose
        felt = self._feel()
        share = dt / (FILTER_TIME + dt)
        self._wrench += share * (np.array(felt.wrench) - self._wrench)
        self._twist += share * (np.array(felt.twist) - self._twist)
        place = apply_shift(self._shift, tool_pose)
        axes = self.frame.turn(place, [way / dt for way in along_path])
        if axes is None or not self._chosen.any():
            speed = np.zeros(6)
            kept = np.zeros(6)
        else:
            turn = _both(axes)
            speed = turn @ self._axis_speeds(turn, felt.q, dt)
            # The path's own motion along compliant axes, where the displacement has turned it to, is undone.
            way = np.array(along_path)
            way[3:] = rotvec_to_matrix(self._shift[3:]) @ way[3:]
            kept = turn @ np.where(self._chosen, turn.T @ way, 0.0)
        step = 0.5 * dt * (self._speed + speed) - kept
        self._speed = speed
        self._shift = apply_shift(six(step.tolist()), self._shift)
        return apply_shift(self._shift, tool_pose)

    def deviation(self, q: Sequence[float], position_error: Sequence[float]) -> Deviation | None:
        """Return the stiff axis on which the arm is further from its set-point than its limit allows.

        Args:
            q: joint angles (6,) [rad].
            position_error: of the joints (6,) [rad].
        """
        if self.frame.axes is None or _LONGEST_LEVER * sum(map(abs, position_error)) < self._tightest:
            return None
        off = np.abs(_both(self.frame.axes).T @ self.tool.twist(q, position_error))
        limits = np.maximum(self._limits, _LEAST_DEVIATION)
        beyond = np.flatnonzero(~self._chosen & (off > limits))
        if not beyond.size:
            return None
        axis = int(beyond[0])
        return Deviation(axis, float(off[axis]), float(limits[axis]))

    def _axis_speeds(self, turn: NDArray[np.float64], q: Sequence[float], dt: float) -> NDArray[np.float64]:
        """Return the speeds along the axes of the task frame at the end of this cycle."""
        if self._gain_age == 0:
            self._gain = self._rate * self._compliance(turn, q)
        self._gain_age = (self._gain_age + 1) % _GAIN_CYCLES
        gain = self._gain
        missing = self._asked + turn.T @ self._wrench
        actual = turn.T @ self._twist
        idle = gain * _IDLE_WRENCH
        maintained = np.sign(actual) * np.maximum(np.abs(actual) - idle, 0.0)
        wanted = self._maintained * maintained + gain * missing
        before = turn.T @ self._speed
        wanted = np.clip(wanted, before - _ACCELERATION * dt, before + _ACCELERATION * dt)
        return np.where(self._chosen, np.clip(wanted, -self._limits, self._limits), 0.0)

    def _compliance(self, turn: NDArray[np.float64], q: Sequence[float]) -> NDArray[np.float64]:
        """Return the tool's least compliance (6,) among compliant axes, forces and moments apart."""
        jacobian = turn.T @ self.tool.arm.jacobian(q, self.tool.tcp)
        compliance = (jacobian * self._joint_compliance) @ jacobian.T
        values = np.zeros(6)
        for part, stiffest in ((slice(0, 3), _STIFFEST[0]), (slice(3, 6), _STIFFEST[1])):
            chosen = np.flatnonzero(self._chosen[part])
            if chosen.size:
                block = compliance[part, part][np.ix_(chosen, chosen)]
                least = block[0, 0] if chosen.size == 1 else np.linalg.eigvalsh(block)[0]
                values[part] = max(float(least), stiffest)
        return values


def _both(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turn of a wrench or twist (6, 6) that a turn of axes (3, 3) means."""
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = axes
    return turn
