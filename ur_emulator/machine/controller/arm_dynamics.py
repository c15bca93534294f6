"""ArmDynamics: the controller's dynamic model of the arm, with the declared payload, as programs can ask it.

It is the model that the drives' feed-forward uses: calibrated geometry, masses and inertias of the table.
"""

from collections.abc import Sequence
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.controller.settings import Payload, ToolSettings
from ur_emulator.machine.models.robot_model import VISCOUS_KINK, DhRow, RobotModel
from ur_emulator.machine.motion.generators import REST_SPEED, JointTarget
from ur_emulator.machine.plant.inverse_dynamics import InverseDynamics

_STILL = np.zeros(6)
# Share of the rated torque for gravity and acceleration; friction and the arm's motion take the rest. Chosen.
_TORQUE_SHARE = 0.7
# Share for a stop, in which the arm's motion is accounted for and friction helps. Chosen.
_BRAKING_SHARE = 0.9
_LEAST = 1e-9  # Nm; a joint that needs less does not limit anything
# A stop is never planned slower than this, even where the drives cannot hold the arm [rad/s^2].
_LEAST_DECELERATION = 1.0


class ArmDynamics:
    """Answers about the arm's dynamics; the model is built at the first question."""

    def __init__(self, robot: RobotModel, dh: Sequence[DhRow], tool: ToolSettings) -> None:
        self._robot = robot
        self._dh = dh
        self._tool = tool
        self._payload: Payload | None = None

    def mass_matrix(self, q: Sequence[float], *, with_rotors: bool) -> NDArray[np.float64]:
        """Return the joint-space inertia (6, 6) [kg m²]; with rotors and gears: as felt at the joints."""
        gravity = self.gravity_torque(q)
        columns = [self._torque(q, _STILL, axis) - gravity for axis in np.eye(6)]
        matrix = np.column_stack(columns)
        if not with_rotors:
            matrix -= np.diag(self._robot.armature)
        symmetric: NDArray[np.float64] = 0.5 * (matrix + matrix.T)
        return symmetric

    def velocity_torque(self, q: Sequence[float], qd: Sequence[float]) -> NDArray[np.float64]:
        """Return the Coriolis and centrifugal torques (6,) [Nm] at q (6,) [rad] and qd (6,) [rad/s]."""
        moving = self._torque(q, np.array(qd, dtype=np.float64), _STILL)
        return moving - self.gravity_torque(q)

    def gravity_torque(self, q: Sequence[float]) -> NDArray[np.float64]:
        """Return the torques that hold the arm at q (6,) [rad], (6,) [Nm]."""
        return self._torque(q, _STILL, _STILL)

    def greatest_acceleration(self, q: Sequence[float], slope: Sequence[float]) -> float:
        """Return the greatest acceleration along a path that the drives can give from rest at q.

        `slope` (6,): change of the joint angles per length of the path [rad per unit].
        """
        gravity = self.gravity_torque(q)
        per_acceleration = np.abs(self._torque(q, _STILL, np.array(slope, dtype=np.float64)) - gravity)
        left = np.maximum(_TORQUE_SHARE * np.array(self._robot.tau_max) - np.abs(gravity), 0.0)
        return float((left / np.maximum(per_acceleration, _LEAST)).min())

    def greatest_deceleration(self, target: JointTarget) -> float:
        """Return the greatest deceleration of the leading axis that the drives can give in a stop [rad/s^2].

        All joints come to rest together, see `ramp_towards`. Friction helps joints that move, and may take a
        part of the torque of joints that do not.
        """
        leading = max(map(abs, target.qd))
        if leading <= REST_SPEED:
            return inf
        qd = np.array(target.qd)
        gravity = self.gravity_torque(target.q)
        dry, drag = self._friction(qd)
        moving = self._torque(target.q, qd, _STILL) + drag
        per_deceleration = self._torque(target.q, _STILL, qd / -leading) - gravity
        left = _BRAKING_SHARE * np.array(self._robot.tau_max) - dry - moving * np.sign(per_deceleration)
        greatest = float((left / np.maximum(np.abs(per_deceleration), _LEAST)).min())
        return max(greatest, _LEAST_DECELERATION)

    def _friction(self, qd: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the dry friction of joints at rest, in either direction, and that of moving joints [Nm]."""
        robot, speed = self._robot, np.abs(qd)
        slow = np.minimum(speed, VISCOUS_KINK)
        dry = np.array(robot.coulomb)
        drag = dry + np.array(robot.viscous) * slow + np.array(robot.viscous_fast) * (speed - slow)
        return np.where(speed > REST_SPEED, 0.0, dry), np.sign(qd) * drag

    def _torque(
        self, q: Sequence[float], qd: NDArray[np.float64], qdd: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        payload = self._tool.payload
        if payload is not self._payload:
            self._payload = payload
            self._model.set_payload(payload.mass, payload.cog, payload.inertia)
        return self._model.evaluate(np.array(q, dtype=np.float64), qd, qdd).copy()

    @cached_property
    def _model(self) -> InverseDynamics:
        return InverseDynamics(self._robot, self._dh)
