"""InverseDynamics: the torque by the controller's own model of the arm.

The model has the calibrated geometry, the table's masses, the declared payload and the rotors' inertia, but
neither friction nor the true masses of the arm: the joint loops compensate its errors. On small e-Series arms
it takes the links for points.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.models.mjcf import arm_spec
from ur_emulator.machine.models.robot_model import ZERO6, DhRow, RobotModel, Vector3, Vector6
from ur_emulator.machine.plant.loads import set_payload_body


class InverseDynamics:
    """tau = M(q) qdd + c(q, qd) + g(q), rotor inertia included."""

    def __init__(self, robot: RobotModel, dh: Sequence[DhRow]) -> None:
        self._model = arm_spec(robot, dh, (1.0,) * 6).compile()
        self._model.opt.gravity[2] = -robot.generation.gravity
        # Points alone would leave the last joint without inertia, which MuJoCo warns of; `evaluate` adds the
        # rotors by itself.
        self._model.dof_armature[:] = robot.armature
        if robot.has_point_masses:
            self._model.body_inertia[:] = 0.0
        self._data = mujoco.MjData(self._model)
        self._armature = np.array(robot.armature)
        self._rotor = np.zeros(6)
        self._qpos = self._data.qpos
        self._qvel = self._data.qvel
        self._qacc = self._data.qacc
        self.torque: NDArray[np.float64] = np.zeros(6)
        """Result of the last evaluation (6,) [Nm]."""

    def set_payload(self, mass: float, cog: Vector3, inertia: Vector6 = ZERO6) -> None:
        """Set the payload at the flange, see `set_payload_body`."""
        set_payload_body(self._model, mass, cog, inertia)

    def evaluate(
        self, q: NDArray[np.float64], qd: NDArray[np.float64], qdd: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Set and return `torque` for a state of motion; each argument (6,), SI."""
        model, data = self._model, self._data
        self._qpos[:] = q
        self._qvel[:] = qd
        self._qacc[:] = qdd
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, self.torque)
        np.multiply(self._armature, qdd, self._rotor)
        np.add(self.torque, self._rotor, self.torque)
        return self.torque
