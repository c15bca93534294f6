"""GearRipple: the kinematic transmission error of the strain wave gears.

The ratio of a strain wave gear is not constant: the joint leads and lags the motor by up to a tenth of a
milliradian, once and twice per motor turn, i.e. 101 and 202 times per joint turn. The motor is what the drive
holds; the joint is what the encoder at the output reports. The phases are the box's own, by its seed; the
sizes are those of its fidelity.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import RobotModel
from ur_emulator.plant.sensors import Record


class GearRipple:
    """q_joint = q_motor + e(q_motor), both counted at the joint [rad].

    Args:
        robot: gives the gear ratio.
        fidelity: gives the rms speed ripple of both harmonics.
        seed: gives the phases.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        phases = random_stream(seed, "gear").uniform(0.0, 2.0 * np.pi, (2, 6))
        first, second = robot.gear_ratio, 2.0 * robot.gear_ratio
        # A speed ripple of rms r has the slope amplitude sqrt(2) r.
        slopes = sqrt(2.0) * np.array([fidelity.ripple_first, fidelity.ripple_second])
        # Four waves a joint: error and slope of the first harmonic, error and slope of the second. Products
        # with matrices cost less than broadcasting at this size.
        self._cycles = np.kron([[first], [first], [second], [second]], np.eye(6))
        self._phases = np.concatenate([phases[0], phases[0] + np.pi / 2, phases[1], phases[1] + np.pi / 2])
        sizes = [[slopes[0] / first, 0.0, slopes[1] / second, 0.0], [0.0, slopes[0], 0.0, slopes[1]]]
        self._sizes = np.kron(sizes, np.eye(6))
        self._waves = np.zeros(24)
        # Difference of joint and motor: position and, after `apply`, speed.
        self._sum = np.zeros(12)
        self.error: NDArray[np.float64] = self._sum[:6]
        self.slope: NDArray[np.float64] = self._sum[6:]

    def evaluate(self, q_motor: NDArray[np.float64]) -> None:
        """Set `error` e [rad] and `slope` de/dq [1] for motor positions q_motor (6,)."""
        waves = self._waves
        self._cycles.dot(q_motor, waves)
        np.add(waves, self._phases, waves)
        np.sin(waves, waves)
        self._sizes.dot(waves, self._sum)

    def apply(self, record: Record) -> None:
        """Turn positions and speeds of the motors in a record into those of the joints; sets `error`."""
        self.evaluate(record.q)
        np.multiply(self.slope, record.qd, self.slope)
        np.add(record.motion, self._sum, record.motion)

    def motor_position(self, q_joint: NDArray[np.float64]) -> NDArray[np.float64]:
        """Invert the gear: motor positions (6,) that put the joints at q_joint (6,) [rad]."""
        q_motor = np.array(q_joint, dtype=np.float64)
        # The slope of e is a few percent, so this contracts to rounding within a dozen turns.
        for _ in range(12):
            self.evaluate(q_motor)
            q_motor = q_joint - self.error
        return q_motor
