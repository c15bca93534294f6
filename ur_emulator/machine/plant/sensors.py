"""Sensors: the measurements of the arm, with noise, quantisation and filters as on real arms.

Input is a record of true values of some moment (see the REC slices); output are plain floats. All noise
comes in blocks from seeded streams, so equal seeds and equal motions give equal bits.
"""

from collections.abc import Callable
from math import exp, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.models.fidelity import Fidelity, random_stream
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector3, Vector6, six


class ForceDrift:
    """The slow error of the measured force: offset and steady drift of all six components.

    The sensor of an e-Series arm has an offset that the first zero takes away, and drifts steadily. A CB3 arm
    has none: what it estimates follows from its currents, also at rest, where dry friction holds the joints.
    Source: see `models/generations.py`.

    Args:
        fidelity: gives their sizes.
        period: control cycle [s].
    """

    def __init__(self, fidelity: Fidelity, seed: int, period: float) -> None:
        shares = np.repeat([1.0, 1.0 / fidelity.force_ratio], 3)
        self._error = (
            fidelity.force_offset * shares * random_stream(seed, "force offset").uniform(-1.0, 1.0, 6)
        )
        rates = fidelity.force_drift * shares * random_stream(seed, "force drift").standard_normal(6)
        self._step = rates * period

    def next_block(self, n: int) -> NDArray[np.float64]:
        """Return the error (n, 6) [N, Nm] of n cycles; the next block begins where this one ends."""
        errors: NDArray[np.float64] = self._error + np.arange(n)[:, None] * self._step
        self._error = self._error + n * self._step
        return errors


# A record of true values: what `Plant` captures in a sub-step.
REC_Q = slice(0, 6)  # joint angles [rad]
REC_QD = slice(6, 12)  # joint speeds [rad/s]
REC_TORQUE = slice(12, 18)  # motor torques at the joint [Nm]
REC_ACCELERATION = slice(18, 21)  # specific force at the flange, flange axes [m/s²]
REC_WRENCH = slice(21, 27)  # external, or the estimate of it, at the flange, base axes [N, Nm]
REC_VOLTAGE = slice(27, 33)  # supply of the joints, beyond what the sensors add themselves: 0 [V]
N_RECORD = 33
REC_DRIVEN = slice(0, 18)  # angles, speeds and torques
REC_SIMULATED = slice(0, 21)  # the part that MuJoCo's sensors fill, in their order

_BLOCK = 256  # cycles of noise drawn at once
_SPEED_STEP = 2.0**-40  # rad/s; far below any noise: speeds are rounded in one call with angles and currents

# The noise has the columns of the record, then the sampling moment.
_N_NOISE = N_RECORD + 1
_NOISE_MOMENT = N_RECORD


WrenchFor = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Record:
    """True values of some moment, with names for its parts.

    Attributes:
        values: (N_RECORD,), see the REC slices.
        simulated: the part that MuJoCo's sensors fill.
        q: joint angles (6,) [rad].
        qd: joint speeds (6,) [rad/s].
        driven: angles, speeds and torques of the motors, (18,).
        wrench: external wrench (6,) [N, Nm].
        expected_current: of the motors, by the controller's model (6,) [A].
    """

    __slots__ = ("driven", "expected_current", "q", "qd", "simulated", "values", "wrench")

    def __init__(self) -> None:
        self.values: NDArray[np.float64] = np.zeros(N_RECORD)
        self.simulated: NDArray[np.float64] = self.values[REC_SIMULATED]
        self.q: NDArray[np.float64] = self.values[REC_Q]
        self.qd: NDArray[np.float64] = self.values[REC_QD]
        self.driven: NDArray[np.float64] = self.values[REC_DRIVEN]
        self.wrench: NDArray[np.float64] = self.values[REC_WRENCH]
        self.expected_current: NDArray[np.float64] = np.zeros(6)


class Reading(NamedTuple):
    """Measurements: the first fields of `PlantState`, with their names and units."""

    actual_q: Vector6
    actual_qd: Vector6
    actual_current: Vector6
    joint_voltage: Vector6
    actual_tool_accelerometer: Vector3
    estimated_force: Vector6


class Sensors:
    """All sensors of one arm.

    Args:
        robot: gives the torque constants and the supply.
        period: control cycle [s].
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int, period: float) -> None:
        self._rng = random_stream(seed, "sensors")
        self._drift = ForceDrift(fidelity, seed, period)
        step = fidelity.encoder_step
        self._step = np.repeat([step, _SPEED_STEP, 1.0], 6)
        self._step[REC_TORQUE] = fidelity.current_step
        sigmas = np.zeros(_N_NOISE)
        sigmas[REC_Q] = fidelity.encoder_sigma
        sigmas[REC_QD] = fidelity.speed_sigma
        sigmas[REC_TORQUE] = fidelity.current_sigma
        sigmas[REC_DRIVEN] /= self._step
        sigmas[REC_ACCELERATION] = fidelity.accelerometer_sigma
        sigmas[REC_WRENCH] = np.repeat([fidelity.force_sigma, fidelity.force_sigma / fidelity.force_ratio], 3)
        sigmas[REC_VOLTAGE] = fidelity.voltage_sigma
        sigmas[_NOISE_MOMENT] = fidelity.sample_jitter / step
        self._sigmas = sigmas
        # From the record's units to steps of the sensors.
        self._scale = np.ones(N_RECORD)
        self._scale[REC_TORQUE] = 1.0 / np.array(robot.torque_constant)
        self._scale[REC_DRIVEN] /= self._step
        self._keep = [exp(-2.0 * pi * pole * period) for pole in fidelity.speed_filter_hz]
        offsets = random_stream(seed, "voltage").uniform(-1.0, 1.0, 6) * fidelity.voltage_offset
        self._supply_voltage = robot.generation.electrics.joint_voltage + offsets
        self._dead_band, self._least_speed = fidelity.speed_dead_band, fidelity.speed_least
        bandwidth = robot.generation.force_sensing.bandwidth
        self._force_keep = None if bandwidth is None else exp(-2.0 * pi * bandwidth * period)
        self._force = np.zeros(6)
        self._noise: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self._at = _BLOCK
        self._speeds = ZERO6
        self._values = np.zeros(N_RECORD)
        self._angles, self._steps = self._values[REC_Q], self._values[REC_DRIVEN]
        self._estimate = self._values[REC_WRENCH]
        self._torque_constant = np.array(robot.torque_constant)
        self._work = np.zeros(6)

    def reset(self) -> None:
        """Reset the filters; the random stream continues."""
        self._speeds = ZERO6
        self._force = np.zeros(6)

    def read(self, record: Record, wrench_for: WrenchFor | None = None) -> Reading:
        """Read all sensors of an arm whose true values are `record`, once a cycle.

        Args:
            wrench_for: tells for joint torques (6,) [Nm] the wrench on the flange that asks for them. Of an
                arm without a sensor the wrench is that of measured less expected currents. Source:
                recordings of a real UR3, of each package (correlation 1.000 of joint torques).
        """
        if self._at == _BLOCK:
            self._draw_noise()
        noise, moment = self._noise[self._at]
        self._at += 1
        values, angles, steps, work = self._values, self._angles, self._steps, self._work
        # In the sensors' units and noisy; angles also sampled a moment early or late; all in whole steps.
        np.multiply(record.values, self._scale, values)
        if self._force_keep is not None:
            # One pole, as for the speeds.
            self._force = record.wrench + self._force_keep * (self._force - record.wrench)
            values[REC_WRENCH] = self._force
        np.add(values, noise, values)
        np.multiply(record.qd, moment, work)
        np.add(angles, work, angles)
        np.rint(steps, steps)
        np.multiply(steps, self._step, steps)
        if wrench_for is not None:
            np.subtract(values[REC_TORQUE], record.expected_current, work)
            np.multiply(work, self._torque_constant, work)
            self._estimate += wrench_for(work)
        reading: list[float] = values.tolist()
        self._speeds = speeds = self._filtered(record.qd.tolist(), reading[REC_QD])
        ax, ay, az = reading[REC_ACCELERATION]
        return Reading(
            six(reading[REC_Q]),
            speeds,
            six(reading[REC_TORQUE]),
            six(reading[REC_VOLTAGE]),
            (ax, ay, az),
            six(reading[REC_WRENCH]),
        )

    def _filtered(self, true_qd: list[float], measured: list[float]) -> Vector6:
        """One pole a joint: y = u + keep (y - u), whose input u is gated to zero at rest."""
        band, least = self._dead_band, self._least_speed
        return six(
            [
                (keep * before if abs(keep * before) >= least else 0.0)
                if -band < true < band
                else speed + keep * (before - speed)
                for true, speed, before, keep in zip(true_qd, measured, self._speeds, self._keep, strict=True)
            ]
        )

    def _draw_noise(self) -> None:
        """Draw the noise of a block of cycles: of the record's columns, and of the sampling moment."""
        block = self._rng.standard_normal((_BLOCK, _N_NOISE))
        block *= self._sigmas
        block[:, REC_WRENCH] += self._drift.next_block(_BLOCK)
        block[:, REC_VOLTAGE] += self._supply_voltage
        moments = np.repeat(block[:, _NOISE_MOMENT, None], 6, axis=1)
        self._noise = list(zip(np.ascontiguousarray(block[:, :N_RECORD]), moments, strict=True))
        self._at = 0
