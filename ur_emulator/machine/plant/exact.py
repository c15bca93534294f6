"""ExactPlant: an arm without physics, always at its target, as in the maker's simulator.

What is measured equals the target to the last bit, in the cycle of the target; both are published in the
next. Torques are those that the controller's model expects, currents these over a constant, without friction.
Nothing acts on the arm: no load but the declared payload, no push, no contact, no hand. The accelerometer
reads gravity alone, also in motion.
"""

from collections.abc import Sequence
from operator import truediv

import mujoco
import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import RefusedError
from ur_emulator.machine.models.mjcf import GRAVITY
from ur_emulator.machine.models.robot_model import ZERO6, Vector6, six
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.arm_physics import ArmPhysics
from ur_emulator.machine.plant.arm_plant import ArmPlant, PlantState
from ur_emulator.machine.plant.drives import check_target

# Joint torque per current [Nm/A] of a UR3 in recordings of the maker's simulator; of other arms it is not
# known, and taken from the arm.
_TORQUE_CONSTANTS = {"ur3": (13.13, 13.13, 9.312, 4.545, 4.545, 4.545)}


class ExactPlant(ArmPlant):
    """An arm that follows exactly; see `ArmPlant`."""

    def _set_up(self) -> None:
        self._torque_constant = _TORQUE_CONSTANTS.get(self.robot.name, self.robot.torque_constant)

    def _begin_cycle(
        self, target: JointTarget | None, mode: ControlMode, torque: TorqueCommand | None
    ) -> None:
        """Move to the target; without one, in freedrive and in torque control, the arm stands still."""
        if target is None:
            self._qd, self._moment = ZERO6, ZERO6
        elif mode in (ControlMode.TEACH, ControlMode.TORQUE):
            self._follow(self._q, ZERO6, ZERO6)
        else:
            check_target(target, self.cycle)
            self._follow(target.q, target.qd, target.qdd)
        for hand, command in zip(self._physics.hands, self.finger_commands, strict=True):
            hand.place(command, self.period_s)
        self._thermometers.step(self._current)
        self._physics.q[:] = self._q
        self._physics.qd[:] = self._qd

    def _follow(self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> None:
        moment = self._dynamics.evaluate(np.array(q), np.array(qd, dtype=np.float64), np.array(qdd))
        self._q, self._qd, self._moment = six(q), six(qd), six(moment.tolist())

    def _rest_at(self, q: NDArray[np.float64]) -> None:
        self._physics.place(q)
        self._q, self._qd, self._moment = six(q.tolist()), ZERO6, ZERO6

    @property
    def _current(self) -> Vector6:
        return six(list(map(truediv, self._moment, self._torque_constant)))

    def _read(self) -> PlantState:
        mujoco.mj_kinematics(self._physics.model, self._physics.data)
        x, y, z = (GRAVITY * self._physics.flange_rotation[2]).tolist()
        current = self._current
        return PlantState(
            actual_q=self._q,
            actual_qd=self._qd,
            actual_current=current,
            joint_voltage=(self.robot.generation.electrics.joint_voltage,) * 6,
            actual_tool_accelerometer=(x, y, z),
            estimated_force=ZERO6,
            joint_temperatures=self._thermometers.reading,
            target_current=current,
            target_moment=self._moment,
            joint_control_output=current,
            torque_saturated=False,
            position_error=ZERO6,
        )

    def report(self, before: PlantState) -> PlantState:
        """Return the state of the cycle before; see `ArmPlant.report`."""
        return before

    def _acted_on(self, what: str) -> ArmPhysics:
        raise RefusedError(f"{what}: nothing acts on an arm of fidelity exact, use ideal, typical or poor")
