"""The error of the gears, found from the streams of finished runs, and how to drive a joint against it.

A strain wave gear runs ahead of and behind its motor by up to a tenth of a milliradian, once and twice per
motor turn. The error hangs on the position alone, so what one movement shows holds for every other one:

    q_joint = q_motor + e(q_motor),    e(q) = sum over n = 1, 2 of  a_n sin(n G q) + b_n cos(n G q)

A joint follows its reference when the motor is sent to q_ref - e(q_ref).

Source: gear ratio G = 101 of UR's joints; speed error of a real UR3e's joints at 97-101 and 195-207 cycles a
joint turn (public logs, kevinhpham/DalESelfEBot).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.control.loop_model import LoopModel, velocity_response
from pc_client.control.reference import JointReference

Array = NDArray[np.float64]

GEAR_RATIO = 101.0
_CYCLES = np.array([GEAR_RATIO, 2.0 * GEAR_RATIO])

LARGEST_SLOPE = 0.08
"""A wave that would change the speed by more than this share is no gear's error and is left out."""

_LEAST_SIGNIFICANCE = 3.0
"""A wave counts when it is this many times its standard error."""


@dataclass(frozen=True, slots=True)
class GearModel:
    """Waves of six gears.

    Attributes:
        sines: (2, 6) a_n [rad].
        cosines: (2, 6) b_n [rad].
    """

    sines: Array
    cosines: Array

    @property
    def n_waves(self) -> int:
        """How many of the twelve waves are known."""
        return int(np.count_nonzero(np.hypot(self.sines, self.cosines)))

    def error(self, q: Array) -> tuple[Array, Array]:
        """Error e [rad] and its slope de/dq [1] at joint angles q (6,), (6,) each."""
        angles = _CYCLES[:, None] * q
        sin, cos = np.sin(angles), np.cos(angles)
        error: Array = (self.sines * sin + self.cosines * cos).sum(axis=0)
        slope: Array = (_CYCLES[:, None] * (self.sines * cos - self.cosines * sin)).sum(axis=0)
        return error, slope


class MotorReference:
    """What the motors have to do so that the joints follow a reference.

    Args:
        joints: what the joints shall do.
        gear: their gears.
    """

    __slots__ = ("_gear", "_joints", "duration")

    def __init__(self, joints: JointReference, gear: GearModel) -> None:
        self._joints = joints
        self._gear = gear
        self.duration = joints.duration

    def at(self, t: float) -> tuple[Sequence[float] | Array, Sequence[float] | Array]:
        """Positions (6,) [rad] and velocities (6,) [rad/s] of the motors, counted at the joints."""
        q, qd = (np.asarray(x, dtype=np.float64) for x in self._joints.at(t))
        error, slope = self._gear.error(q)
        return q - error, qd * (1.0 - slope)


class GearObserver:
    """Collects runs; each makes the waves better known.

    Args:
        loop: the identified loop: what of a motion the commands explain.
        period: control cycle [s].
    """

    __slots__ = ("_moments", "_n", "_normal", "_power", "_response")

    def __init__(self, loop: LoopModel, period: float) -> None:
        self._response = velocity_response(loop, period) * period
        self._normal = np.zeros((6, 4, 4))
        self._moments = np.zeros((6, 4))
        self._power = np.zeros(6)
        self._n = 0

    def take(self, qd_cmd: Array, q: Array) -> None:
        """Take a run without gaps.

        Args:
            qd_cmd: (n, 6) commands, one a cycle, from rest [rad/s].
            q: (n, 6) reported positions [rad].
        """
        n = len(q)
        for j in range(q.shape[1]):
            commanded = np.convolve(qd_cmd[:, j], self._response)[1:n]  # the steps up to frames 1, 2, ...
            surprise = np.diff(q[:, j]) - commanded
            waves = np.diff(_waves(q[:, j]), axis=0)
            self._normal[j] += waves.T @ waves
            self._moments[j] += waves.T @ surprise
            self._power[j] += float(surprise @ surprise)
        self._n += n - 1

    def model(self) -> GearModel | None:
        """The waves that are known by now; None when there are none."""
        sines, cosines = np.zeros((2, 6)), np.zeros((2, 6))
        for j in range(6):
            if not self._n or np.linalg.cond(self._normal[j]) > 1e6:
                continue  # the joint has hardly moved
            inverse = np.linalg.inv(self._normal[j])
            weights = inverse @ self._moments[j]
            left = max(self._power[j] - float(weights @ self._moments[j]), 0.0) / self._n
            for n in range(2):
                pair = weights[2 * n : 2 * n + 2]
                size = float(np.hypot(*pair))
                spread = np.sqrt(left * float(np.trace(inverse[2 * n : 2 * n + 2, 2 * n : 2 * n + 2])))
                if _LEAST_SIGNIFICANCE * spread < size < LARGEST_SLOPE / _CYCLES[n]:
                    sines[n, j], cosines[n, j] = pair
        return GearModel(sines, cosines) if sines.any() or cosines.any() else None


def _waves(q: Array) -> Array:
    """Sine and cosine, first and second wave, at the angles q (n,): (n, 4)."""
    return np.column_stack([wave(cycles * q) for cycles in _CYCLES for wave in (np.sin, np.cos)])
