"""Joint friction: the true one, and the controller's model of it, which is not exact.

Viscous friction grows faster up to a kink: the slope beyond it is a joint damping in MuJoCo, the rest is part
of the dry friction, its frictionloss. The controller compensates friction in its feed-forward with parameters
that are off by what `Fidelity.friction_error` says.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.models.fidelity import REVERSAL_SPEED, Fidelity, random_stream
from ur_emulator.machine.models.robot_model import VISCOUS_KINK, RobotModel

# Share of the modelled viscous friction that a full scale of direct_torque compensates [1]: the rest damps
# the free joints. Inferred: in the maker's example wrist 3 gets 2.5 Nm at 0.2 Hz with full scales; above 0.5
# a UR5e would exceed its speed limit, above 0.4 a UR3e. Warm grease has about half the viscous friction of
# cold one, and more than that must not be compensated.
_VISCOUS_IN_TORQUE_CONTROL = 1.0 / 3.0


class Friction:
    """Evaluates true dry friction and the controller's compensation together, once a cycle.

        size(qd) = coulomb + excess min(|qd|, kink)
        model(qd) = size(qd) tanh(qd / reversal speed) + viscous qd

    `viscous` is the slope beyond the kink, `excess` by how much the one before it is greater.

    Attributes:
        coulomb: true size of the dry friction (6,) [Nm].
        expected: friction that the controller expects at its target (6,) [Nm].
        compensation: torque that the drives add against friction (6,) [Nm].
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        errors = 1.0 + fidelity.friction_error * random_stream(seed, "friction").standard_normal((2, 6))
        # Greatest error of the model [1]: a worse one would be found at commissioning.
        errors = errors.clip(0.3, 1.7)
        viscous = np.array(robot.viscous_fast) * errors[0]
        believed = np.array(robot.coulomb) * errors[1]
        # One row a use: the true size at the actual speed, the model at the speeds of target and set-point.
        # Constants have the full shape: broadcasting costs twice the arithmetic at this size.
        self._coulomb = np.array([robot.coulomb, believed, believed])
        self._believed_viscous = np.array([viscous, viscous])
        self._per_reversal = np.full((2, 6), 1.0 / REVERSAL_SPEED)
        excess = np.array(robot.viscous) - robot.viscous_fast
        self._excess = np.array([excess, excess * errors[0], excess * errors[0]])
        self._kinks = np.full((3, 6), VISCOUS_KINK)
        self._slow = np.zeros((3, 6))
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

    def share(self, viscous: Sequence[float], coulomb: Sequence[float]) -> NDArray[np.float64]:
        """Return what torque control compensates with these scales of direct_torque, 0..1 each (6,) [Nm]."""
        wet, dry = self._viscous[1], self.dry_compensation
        slow = np.sign(dry) * self._slow[2]
        wet, dry = wet + slow, dry - slow
        part: NDArray[np.float64] = viscous * (_VISCOUS_IN_TORQUE_CONTROL * wet) + coulomb * dry
        return part

    def evaluate(self, speeds: NDArray[np.float64]) -> None:
        """Set the attributes for speeds (3, 6) [rad/s]: actual, of the target, of the set-point."""
        sizes, beliefs, viscous, believed_speeds = self._sizes, self._beliefs, self._viscous, speeds[1:]
        slow = self._slow
        np.abs(speeds, slow)
        np.minimum(slow, self._kinks, out=slow)
        np.multiply(slow, self._excess, slow)
        np.add(self._coulomb, slow, sizes)
        np.multiply(believed_speeds, self._per_reversal, beliefs)
        np.tanh(beliefs, beliefs)
        np.multiply(beliefs, self._believed_sizes, beliefs)
        np.multiply(believed_speeds, self._believed_viscous, viscous)
        np.add(beliefs, viscous, beliefs)


class Presliding:
    """Friction of six joints with hysteresis, as the contacts of gears and seals have it.

    The model is Dahl's, LuGre without its micro-damping: bristles of mean deflection z in [-1, 1] follow the
    motion over the presliding angle [rad], which is above 0,

        dz/dq = (sign(dq) - z) / angle,    torque = -size z

    so that after a reversal friction changes its sign along the path, whatever the speed, and a joint at rest
    is held by a spring. The equation is solved exactly for each sub-step: it is stable for all angles and
    speeds.

    Source: C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new model for control of systems
    with friction", IEEE Transactions on Automatic Control 40(3), 1995.
    """

    def __init__(self, angle: float) -> None:
        self._angle = angle
        self._last = np.zeros(6)
        self._bristles = np.zeros(6)

    def bind(self, q: NDArray[np.float64], torque: NDArray[np.float64]) -> None:
        """Follow positions (6,) [rad] from now on, and give the friction (6,) [Nm]."""
        self._now = q
        self._torque = torque

    def reset(self) -> None:
        """Begin at the present positions, with bristles that are not bent."""
        self._last[:] = self._now
        self._bristles[:] = 0.0

    def apply(self, size: NDArray[np.float64]) -> None:
        """Set the torque for the displacement since the last call; `size` of the friction (6,) [Nm]."""
        moved = self._now - self._last
        ahead = np.sign(moved)
        self._bristles += (ahead - self._bristles) * -np.expm1(-np.abs(moved) / self._angle)
        self._last[:] = self._now
        np.multiply(self._bristles, -size, self._torque)
