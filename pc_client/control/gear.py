"""The error of the gears, found from the streams of finished runs, and how to drive a joint against it.

A strain wave gear runs ahead of and behind its motor by up to a tenth of a milliradian, in waves along the
angle of its joint. The error depends on the position alone, so what one movement shows holds for every other:

    q_joint = q_motor + e(q_motor),    e(q) = sum over the waves of  a sin(order q) + b cos(order q)

Orders and sizes are found from the data, joint by joint (`gear_waves`). A joint follows its reference when
the motor is sent to q_ref - e(q_ref).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pc_client.control.gear_waves import find_waves
from pc_client.control.loop_model import LoopModel, velocity_response
from pc_client.control.reference import JointReference

Array = NDArray[np.float64]

_LONGEST = 480.0
"""Older runs are forgotten beyond so much time [s]: twice what ten movements take."""


@dataclass(frozen=True, slots=True)
class GearModel:
    """Waves of six gears; a joint with fewer than another has zeros.

    Attributes:
        orders: (n, 6) waves in a turn of the joint.
        sines: (n, 6) a [rad].
        cosines: (n, 6) b [rad].
    """

    orders: Array
    sines: Array
    cosines: Array

    @property
    def n_waves(self) -> int:
        """How many waves are known."""
        return int(np.count_nonzero(np.hypot(self.sines, self.cosines)))

    def error(self, q: Array) -> tuple[Array, Array]:
        """Error e [rad] and its slope de/dq [1] at joint angles q (6,), (6,) each."""
        angles = self.orders * q
        sin, cos = np.sin(angles), np.cos(angles)
        error: Array = (self.sines * sin + self.cosines * cos).sum(axis=0)
        slope: Array = (self.orders * (self.sines * cos - self.cosines * sin)).sum(axis=0)
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

    __slots__ = ("_most", "_response", "_runs")

    def __init__(self, loop: LoopModel, period: float) -> None:
        self._response = velocity_response(loop, period) * period
        self._most = round(_LONGEST / period)  # steps
        self._runs: deque[tuple[Array, Array]] = deque()

    def take(self, qd_cmd: Array, q: Array) -> None:
        """Take a run without gaps.

        Args:
            qd_cmd: (n, 6) commands, one a cycle, from rest [rad/s].
            q: (n, 6) reported positions [rad].
        """
        n = len(q)
        commanded = [np.convolve(joint, self._response)[1:n] for joint in qd_cmd.T]  # up to frames 1, 2, ...
        self._runs.append((q, np.diff(q, axis=0) - np.transpose(commanded)))
        while sum(len(surprise) for _, surprise in self._runs) > self._most and len(self._runs) > 1:
            self._runs.popleft()

    def model(self) -> GearModel | None:
        """The waves that are known by now; None when there are none."""
        if not self._runs:
            return None
        before, after, surprise = (
            np.concatenate(parts)
            for parts in zip(*((q[:-1], q[1:], rest) for q, rest in self._runs), strict=True)
        )
        joints = [find_waves(before[:, j], after[:, j], surprise[:, j]) for j in range(6)]
        table = np.zeros((3, max(map(len, joints)), 6))
        for j, waves in enumerate(joints):
            for n, wave in enumerate(waves):
                table[:, n, j] = wave
        return GearModel(*table) if table.any() else None
