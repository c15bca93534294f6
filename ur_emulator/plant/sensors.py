"""Sensors: what the box reads of the arm, with the noise, grain and filters of the real ones.

Input is a record of true values of some moment (see RECORD slices); output are plain floats. All chance comes
in blocks from one seeded stream, so equal seeds and equal motions give equal bits.
"""

from __future__ import annotations

from math import exp, pi

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import RobotModel
from ur_emulator.plant.force_estimate import ForceDrift

# A record of true values: what `Plant` captures in a sub-step.
REC_Q = slice(0, 6)  # joint angles [rad]
REC_QD = slice(6, 12)  # joint speeds [rad/s]
REC_TORQUE = slice(12, 18)  # motor torques at the joint [Nm]
REC_ACCELERATION = slice(18, 21)  # specific force at the flange, flange axes [m/s²]
REC_VELOCITY = slice(21, 24)  # of the flange, base axes [m/s]
REC_WRENCH = slice(24, 30)  # external, at the flange, base axes [N, Nm]
N_RECORD = 30

# The reading, in this order.
OUT_Q = slice(0, 6)
OUT_QD = slice(6, 12)
OUT_CURRENT = slice(12, 18)
OUT_ACCELERATION = slice(18, 21)
OUT_WRENCH = slice(21, 27)
OUT_VOLTAGE = slice(27, 33)
_N_OUT = 33
_JITTER = 33  # last column of the noise

_BLOCK = 256  # cycles of noise drawn at once
_SUPPLY = 48.0  # V, robot bus
_VOLTAGE_DROP = 0.12  # V/A along the arm's cable; assumed
_SLOW = 0.02  # m/s; the direction of motion is smoothed below this

# Adding and taking away this number leaves multiples of 1.4e-45, the smallest float32: the joints compute in
# float32, so their decaying speed filter passes through exactly these values and then is 0.
_FLOAT32_GRAIN = 2.0**-97


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
        self._step = step
        self._sigmas = np.concatenate(
            [
                np.array(fidelity.encoder_sigma) / step,
                np.full(6, fidelity.speed_sigma),
                fidelity.current_sigma,
                np.full(3, fidelity.accelerometer_sigma),
                np.full(3, fidelity.force_sigma),
                np.full(3, fidelity.force_sigma / 10.0),
                np.full(6, fidelity.voltage_sigma),
                [fidelity.sample_jitter],
            ]
        )
        self._block = np.empty((0, _N_OUT + 1))
        self._next_row = 0
        self._per_torque = 1.0 / np.array(robot.torque_constant)
        self._keep = np.exp(-2.0 * pi * np.array(fidelity.speed_filter_hz) * period)
        self._dead_band = fidelity.speed_dead_band
        self._force_friction = fidelity.force_friction
        self._qd_filtered = np.zeros(6)
        self._moving = np.zeros(6)
        self._out = np.zeros(_N_OUT)
        self._out_q = self._out[OUT_Q]
        self._out_qd = self._out[OUT_QD]
        self._out_current = self._out[OUT_CURRENT]
        self._out_acceleration = self._out[OUT_ACCELERATION]
        self._out_wrench = self._out[OUT_WRENCH]
        self._out_force = self._out_wrench[:3]
        self._out_voltage = self._out[OUT_VOLTAGE]
        self._work = np.zeros(6)

    def reset(self) -> None:
        """Forget the state of the filters; the random stream goes on."""
        self._qd_filtered[:] = 0.0

    def read(self, record: NDArray[np.float64]) -> list[float]:
        """Read all sensors once; call it once a cycle.

        Args:
            record: true values (N_RECORD,).

        Returns:
            The reading as floats, laid out by the OUT slices: rad, rad/s, A, m/s², N and Nm, V.
        """
        noise = self._noise()
        work, out_qd = self._work, self._out_qd
        qd = record[REC_QD]
        # Angles: sampled a moment early or late, noisy, in whole encoder steps.
        np.multiply(qd, noise[_JITTER], out=work)
        np.add(work, record[REC_Q], out=work)
        np.divide(work, self._step, out=self._out_q)
        # Speeds, with their filter's input gated to zero at rest (below, after the noise).
        out_qd[:] = qd
        np.multiply(record[REC_TORQUE], self._per_torque, out=self._out_current)
        np.abs(self._out_current, out=work)
        np.multiply(work, -_VOLTAGE_DROP, out=work)
        np.add(work, _SUPPLY, out=self._out_voltage)
        self._out_acceleration[:] = record[REC_ACCELERATION]
        self._out_wrench[:] = record[REC_WRENCH]
        out = self._out
        np.add(out, noise[:_N_OUT], out=out)
        np.rint(self._out_q, out=self._out_q)
        np.multiply(self._out_q, self._step, out=self._out_q)
        # y = u + keep (y - u), u gated
        np.abs(qd, out=work)
        np.greater(work, self._dead_band, out=self._moving)
        np.multiply(out_qd, self._moving, out=out_qd)
        filtered = self._qd_filtered
        np.subtract(filtered, out_qd, out=filtered)
        np.multiply(filtered, self._keep, out=filtered)
        np.add(filtered, out_qd, out=filtered)
        np.add(filtered, _FLOAT32_GRAIN, out=filtered)
        np.subtract(filtered, _FLOAT32_GRAIN, out=filtered)
        out_qd[:] = filtered
        if self._force_friction:
            vx, vy, vz = record[REC_VELOCITY].tolist()
            against = -self._force_friction / ((vx * vx + vy * vy + vz * vz) ** 0.5 + _SLOW)
            self._out_force += (against * vx, against * vy, against * vz)
        reading: list[float] = out.tolist()
        return reading

    def _noise(self) -> NDArray[np.float64]:
        if self._next_row == len(self._block):
            self._block = self._rng.standard_normal((_BLOCK, len(self._sigmas)))
            self._block *= self._sigmas
            self._block[:, OUT_WRENCH] += self._drift.next_block(_BLOCK)
            self._next_row = 0
        row = self._block[self._next_row]
        self._next_row += 1
        return row


class Thermometers:
    """Joint temperatures: a slow, deterministic warming by the currents' heat.

    Source: production log of a UR3 (UCI "UR3 CobotOps"): 28 to 45 °C, wrists hottest; steps of 1/16 °C as in
    the log. Time constant and heat per current assumed.
    """

    _IDLE = (28.0, 29.0, 31.0, 36.0, 38.0, 39.0)  # °C, powered and still for long
    _RISE = (0.25, 0.25, 0.5, 0.8, 0.8, 0.8)  # °C per A²
    _HOTTEST_RISE = 20.0  # °C
    _TIME_CONSTANT = 900.0  # s
    _INTERVAL = 1.0  # s between updates

    def __init__(self, period: float) -> None:
        self._every = max(1, round(self._INTERVAL / period))
        self._gain = 1.0 - exp(-self._every * period / self._TIME_CONSTANT)
        self._countdown = self._every
        self._exact = list(self._IDLE)
        self.reading: tuple[float, ...] = self._IDLE

    def step(self, current: list[float]) -> None:
        """Go on by one cycle with these motor currents (6,) [A]."""
        self._countdown -= 1
        if self._countdown:
            return
        self._countdown = self._every
        for i, amperes in enumerate(current):
            final = self._IDLE[i] + min(self._HOTTEST_RISE, self._RISE[i] * amperes * amperes)
            self._exact[i] += self._gain * (final - self._exact[i])
        self.reading = tuple(round(16.0 * value) / 16.0 for value in self._exact)
