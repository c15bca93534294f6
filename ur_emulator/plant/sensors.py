"""Sensors: what the box reads of the arm, with the noise, grain and filters of the real ones.

Input is a record of true values of some moment (see the REC slices); output are plain floats. All chance
comes in blocks from seeded streams, so equal seeds and equal motions give equal bits.
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import RobotModel, Vector3, Vector6, six
from ur_emulator.plant.force_estimate import ForceDrift

# A record of true values: what `Plant` captures in a sub-step.
REC_Q = slice(0, 6)  # joint angles [rad]
REC_QD = slice(6, 12)  # joint speeds [rad/s]
REC_TORQUE = slice(12, 18)  # motor torques at the joint [Nm]
REC_ACCELERATION = slice(18, 21)  # specific force at the flange, flange axes [m/s²]
REC_VELOCITY = slice(21, 24)  # of the flange, base axes [m/s]
REC_WRENCH = slice(24, 30)  # external, at the flange, base axes [N, Nm]
N_RECORD = 30
REC_SIMULATED = slice(0, 24)  # the part that MuJoCo's sensors fill, in their order

_BLOCK = 256  # cycles of noise drawn at once
_SUPPLY = 48.0  # V, robot bus; its drop along the arm's cable is small and left out
_SLOW = 0.02  # m/s; the direction of motion is smoothed below this
_SMALLEST_SPEED = 1.4e-45  # smallest float32: the joints filter in float32, whose decay ends there

# The noise has the columns of the record, then voltage and sampling moment.
_N_NOISE = N_RECORD + 7
_NOISE_VOLTAGE = slice(N_RECORD, N_RECORD + 6)
_NOISE_MOMENT = N_RECORD + 6


class Reading(NamedTuple):
    """What the sensors say; names, units and order as in `PlantState`."""

    actual_q: Vector6
    actual_qd: Vector6
    actual_current: Vector6
    joint_voltage: Vector6
    tool_accelerometer: Vector3
    tcp_force: Vector6


class Sensors:
    """All sensors of one arm.

    Args:
        robot: gives the torque constants.
        fidelity: gives noise, grain, filters.
        seed: of the box.
        period: control cycle [s].
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int, period: float) -> None:
        self._rng = random_stream(seed, "sensors")
        self._drift = ForceDrift(fidelity, seed, _BLOCK * period)
        step = fidelity.encoder_step
        self._step = np.full(6, step)
        sigmas = np.zeros(_N_NOISE)
        sigmas[REC_Q] = np.array(fidelity.encoder_sigma) / step
        sigmas[REC_QD] = fidelity.speed_sigma
        sigmas[REC_TORQUE] = fidelity.current_sigma
        sigmas[REC_ACCELERATION] = fidelity.accelerometer_sigma
        sigmas[REC_WRENCH] = np.repeat([fidelity.force_sigma, fidelity.force_sigma / 10.0], 3)
        sigmas[_NOISE_VOLTAGE] = fidelity.voltage_sigma
        sigmas[_NOISE_MOMENT] = fidelity.sample_jitter
        self._sigmas = sigmas
        # From the record's units to those of the sensors: encoder steps and amperes.
        self._scale = np.ones(N_RECORD)
        self._scale[REC_Q] = 1.0 / step
        self._scale[REC_TORQUE] = 1.0 / np.array(robot.torque_constant)
        self._keep = [exp(-2.0 * pi * pole * period) for pole in fidelity.speed_filter_hz]
        self._dead_band = fidelity.speed_dead_band
        self._force_friction = fidelity.force_friction
        self._block = np.empty((0, _N_NOISE))
        self._next_row = 0
        self._speeds = [0.0] * 6
        self._values = np.zeros(N_RECORD)
        self._steps = self._values[REC_Q]
        self._work = np.zeros(6)

    def reset(self) -> None:
        """Forget the state of the filters; the random stream goes on."""
        self._speeds = [0.0] * 6

    def read(self, record: NDArray[np.float64]) -> Reading:
        """Read all sensors of an arm whose true values are `record` (N_RECORD,); for one call a cycle."""
        noise = self._next_noise()
        values, steps, work = self._values, self._steps, self._work
        # Sampled a moment early or late, in the sensors' units, noisy, in whole encoder steps.
        np.multiply(record[REC_QD], noise[_NOISE_MOMENT], work)
        np.add(work, record[REC_Q], work)
        np.multiply(record, self._scale, values)
        np.divide(work, self._step, steps)
        np.add(values, noise[:N_RECORD], values)
        np.rint(steps, steps)
        np.multiply(steps, self._step, steps)
        reading: list[float] = values.tolist()
        # Speeds: a one-pole filter y = u + keep (y - u) whose input u is gated to zero at rest.
        dead_band = self._dead_band
        speeds = self._speeds
        true_speeds: list[float] = record[REC_QD].tolist()
        for i, keep in enumerate(self._keep):
            if -dead_band < true_speeds[i] < dead_band:
                speed = keep * speeds[i]
                speeds[i] = speed if abs(speed) >= _SMALLEST_SPEED else 0.0
            else:
                speed = reading[6 + i]
                speeds[i] = speed + keep * (speeds[i] - speed)
        # The force estimate takes some of the friction for a force against the motion.
        vx, vy, vz, fx, fy, fz, mx, my, mz = reading[21:30]
        if self._force_friction:
            against = -self._force_friction / (sqrt(vx * vx + vy * vy + vz * vz) + _SLOW)
            fx, fy, fz = fx + against * vx, fy + against * vy, fz + against * vz
        ax, ay, az = reading[REC_ACCELERATION]
        return Reading(
            six(reading[REC_Q]),
            six(speeds),
            six(reading[REC_TORQUE]),
            six(noise[_NOISE_VOLTAGE].tolist()),
            (ax, ay, az),
            (fx, fy, fz, mx, my, mz),
        )

    def _next_noise(self) -> NDArray[np.float64]:
        if self._next_row == len(self._block):
            block = self._rng.standard_normal((_BLOCK, _N_NOISE))
            block *= self._sigmas
            block[:, REC_WRENCH] += self._drift.next_block(_BLOCK)
            block[:, _NOISE_VOLTAGE] += _SUPPLY
            self._block = block
            self._next_row = 0
        row: NDArray[np.float64] = self._block[self._next_row]
        self._next_row += 1
        return row
