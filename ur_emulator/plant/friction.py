"""Joint friction: the physics' own, and the controller's slightly wrong idea of it.

Viscous friction is a joint damping in MuJoCo, Coulomb friction its frictionloss, whose size follows the
speed: real joints lose two thirds of it towards standstill (see the robot's numbers), which is also why they
do not stick and slip. The controller compensates friction in its feed-forward with parameters that are off by
what `Fidelity.friction_error` says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import RobotModel

_REVERSAL_SPEED = 0.005  # rad/s; the compensation changes sign smoothly over this, as a drive's must


class Friction:
    """Evaluates true Coulomb friction and the controller's compensation together, once a cycle."""

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        errors = 1.0 + fidelity.friction_error * random_stream(seed, "friction").standard_normal((2, 6))
        # A model worse than that would have been caught at commissioning.
        errors = errors.clip(0.3, 1.7)
        self._believed_viscous = np.array(robot.viscous) * errors[0]
        # Row 0 is the truth at the actual speed, row 1 the belief at the target speed.
        self._coulomb = np.array([robot.coulomb, np.array(robot.coulomb) * errors[1]])
        self._lost = self._coulomb * (1.0 - robot.coulomb_standstill)
        self._per_speed = -1.0 / robot.coulomb_speed
        self._speeds = np.zeros((2, 6))
        self._work = np.zeros((2, 6))
        self._direction = np.zeros(6)
        self.coulomb: NDArray[np.float64] = self._work[0]
        """True size of the Coulomb friction (6,) [Nm]."""
        self.compensation: NDArray[np.float64] = np.zeros(6)
        """Torque that the controller adds against friction (6,) [Nm]."""

    def evaluate(self, qd_actual: NDArray[np.float64], qd_target: NDArray[np.float64]) -> None:
        """Set `coulomb` for the actual and `compensation` for the target speeds (6,) [rad/s]."""
        speeds, work, direction = self._speeds, self._work, self._direction
        speeds[0] = qd_actual
        speeds[1] = qd_target
        # coulomb - lost * exp(-|qd| / coulomb_speed)
        np.abs(speeds, out=work)
        np.multiply(work, self._per_speed, out=work)
        np.exp(work, out=work)
        np.multiply(work, self._lost, out=work)
        np.subtract(self._coulomb, work, out=work)
        np.divide(qd_target, _REVERSAL_SPEED, out=direction)
        np.tanh(direction, out=direction)
        np.multiply(direction, work[1], out=direction)
        np.multiply(qd_target, self._believed_viscous, out=self.compensation)
        np.add(self.compensation, direction, out=self.compensation)
