"""Joint friction: the true one, and the controller's model of it, which is not exact.

Viscous friction is a joint damping in MuJoCo, Coulomb friction its frictionloss, whose size follows the
speed: real joints lose two thirds of it towards standstill (see the robot's numbers), so they
do not stick and slip. The controller compensates friction in its feed-forward with parameters that are off by
what `Fidelity.friction_error` says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import RobotModel

_REVERSAL_SPEED = 0.012  # rad/s; friction changes sign over about this, see `physics.py`


class Friction:
    """Evaluates true Coulomb friction and the controller's compensation together, once a cycle.

        size(qd) = coulomb - lost exp(-|qd| / coulomb speed)
        model(qd) = size(qd) tanh(qd / reversal speed) + viscous qd

    Attributes:
        coulomb: true size of the Coulomb friction (6,) [Nm].
        expected: friction that the controller expects at its target (6,) [Nm].
        compensation: torque that the drives add against friction (6,) [Nm].
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        errors = 1.0 + fidelity.friction_error * random_stream(seed, "friction").standard_normal((2, 6))
        # Greatest error of the model [1]: a worse one would be found at commissioning.
        errors = errors.clip(0.3, 1.7)
        viscous = np.array(robot.viscous) * errors[0]
        believed = np.array(robot.coulomb) * errors[1]
        # One row a use: the true size at the actual speed, the model at the speeds of target and set-point.
        # Constants have the full shape: broadcasting costs twice the arithmetic at this size.
        self._coulomb = np.array([robot.coulomb, believed, believed])
        self._lost = self._coulomb * (1.0 - robot.coulomb_standstill)
        self._believed_viscous = np.array([viscous, viscous])
        self._per_speed = np.full((3, 6), -1.0 / robot.coulomb_speed)
        self._per_reversal = np.full((2, 6), 1.0 / _REVERSAL_SPEED)
        self._sizes = np.zeros((3, 6))
        self._beliefs = np.zeros((2, 6))
        self._viscous = np.zeros((2, 6))
        self._believed_sizes = self._sizes[1:]
        self.coulomb: NDArray[np.float64] = self._sizes[0]
        self.expected: NDArray[np.float64] = self._beliefs[0]
        self.compensation: NDArray[np.float64] = self._beliefs[1]

    @property
    def dry_compensation(self) -> NDArray[np.float64]:
        """Return the part of `compensation` that does not grow with the speed (6,) [Nm]."""
        dry: NDArray[np.float64] = self.compensation - self._viscous[1]
        return dry

    def evaluate(self, speeds: NDArray[np.float64]) -> None:
        """Set the attributes for speeds (3, 6) [rad/s]: actual, of the target, of the set-point."""
        sizes, beliefs, viscous, believed_speeds = self._sizes, self._beliefs, self._viscous, speeds[1:]
        np.abs(speeds, sizes)
        np.multiply(sizes, self._per_speed, sizes)
        np.exp(sizes, sizes)
        np.multiply(sizes, self._lost, sizes)
        np.subtract(self._coulomb, sizes, sizes)
        np.multiply(believed_speeds, self._per_reversal, beliefs)
        np.tanh(beliefs, beliefs)
        np.multiply(beliefs, self._believed_sizes, beliefs)
        np.multiply(believed_speeds, self._believed_viscous, viscous)
        np.add(beliefs, viscous, beliefs)
