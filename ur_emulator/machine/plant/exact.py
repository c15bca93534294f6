"""ExactPlant: an arm without physics, always at its target, as in the maker's simulator.

What is measured equals the target to the last bit, in the cycle of the target; both are published in the
next. Torques are those that the controller's model expects, currents these over a constant, without friction.
Nothing acts on the arm: no load but
the declared payload, no push, no contact, no hand. The accelerometer reads gravity alone, also in motion.
"""

from collections.abc import Sequence
from operator import truediv
from pathlib import Path

import mujoco

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError, RefusedError
from ur_emulator.machine.models.fidelity import Fidelity
from ur_emulator.machine.models.mjcf import GRAVITY
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector3, Vector6, six
from ur_emulator.machine.models.things import Thing
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.drives import TARGET_MAX
from ur_emulator.machine.plant.obstacles import Obstacles
from ur_emulator.machine.plant.plant import Plant, PlantState
from ur_hil.cell import Cell
from ur_hil.tools import ToolModel

# Joint torque per current [Nm/A] of a UR3 in recordings of the maker's simulator; of other arms it is not
# known, and taken from the arm.
_TORQUE_CONSTANTS = {"ur3": (13.13, 13.13, 9.312, 4.545, 4.545, 4.545)}


class ExactPlant(Plant):
    """An arm that follows exactly; arguments and the rest of the interface as `Plant`."""

    def __init__(
        self, robot: RobotModel, fidelity: Fidelity, seed: int, tools: Sequence[ToolModel] = ()
    ) -> None:
        self._torque_constant = _TORQUE_CONSTANTS.get(robot.name, robot.torque_constant)
        super().__init__(robot, fidelity, seed, tools)
        self._physics.obstacles = _NoObstacles()

    def reset(self, q: Sequence[float]) -> None:
        """Put the arm at rest at q (6,) [rad], brakes on; PlantError if these are not six finite numbers."""
        super().reset(q)
        self._q: Vector6 = six([float(angle) for angle in q])
        self._qd = ZERO6

    def step(
        self,
        target: JointTarget | None,
        mode: ControlMode = ControlMode.POSITION,
        torque: TorqueCommand | None = None,
    ) -> None:
        """Move to the target; see `Plant.step`. PlantError if it is not finite.

        Without one, in freedrive and in torque control, the arm stands still.
        """
        self._state = None
        self.cycle += 1
        if target is None:
            self._qd = ZERO6
            self._drives.release()
        elif mode in (ControlMode.TEACH, ControlMode.TORQUE):
            self._qd = ZERO6
            self._drives.expect(self._q, ZERO6, ZERO6)
        elif self._drives.expect(target.q, target.qd, target.qdd):
            self._q, self._qd = six(target.q), six(target.qd)
        else:
            raise PlantError(
                f"target {target} in cycle {self.cycle}: finite numbers below {TARGET_MAX:g} are needed",
                cycle=self.cycle,
            )
        for hand, command in zip(self._physics.hands, self._finger_commands, strict=True):
            hand.place(command, self.period_s)
        self._thermometers.step(self._current)
        self._physics.q[:] = self._q
        self._physics.qd[:] = self._qd

    def complete_cycle(self) -> None:
        """Do nothing: the position depends on the target alone."""

    @property
    def _current(self) -> Vector6:
        return six(list(map(truediv, self._drives.target_moment, self._torque_constant)))

    def sense(self) -> PlantState:
        """Read the sensors; asking again before the next step gives the same state."""
        if self._state is None:
            mujoco.mj_kinematics(self._physics.model, self._physics.data)
            x, y, z = (GRAVITY * self._physics.flange_rotation[2]).tolist()
            current = self._current
            self._state = PlantState(
                actual_q=self._q,
                actual_qd=self._qd,
                actual_current=current,
                joint_voltage=(self.robot.generation.electrics.joint_voltage,) * 6,
                tool_accelerometer=(x, y, z),
                tcp_force=ZERO6,
                joint_temperatures=self._thermometers.reading,
                target_current=current,
                target_moment=self._drives.target_moment,
                joint_control_output=current,
                torque_saturated=False,
                position_error=ZERO6,
            )
        return self._state

    def report(self, before: PlantState) -> PlantState:
        """Return the state of the cycle before; see `Plant.report`."""
        return before

    def attach_load(self, mass: float, cog: Vector3 = (0.0, 0.0, 0.0)) -> None:
        """Raise RefusedError: no load acts on this arm."""
        raise _refusal("payload")

    def furnish(self, surroundings: Cell | Path) -> None:
        """Refuse, as `put_thing`."""
        raise _refusal("scene")

    def put_thing(self, thing: Thing) -> None:
        """Refuse: this arm would pass through it; RefusedError always."""
        raise _refusal(f"thing {thing.name}")

    def push(self, force: Sequence[float], point: Sequence[float] | None = None) -> None:
        """Raise RefusedError unless the push is to end: no force acts on this arm."""
        if any(force):
            raise _refusal("push")


class _NoObstacles(Obstacles):
    """This arm has no obstacles: it would pass through them."""

    def put(self, name: str, shape: str, size: Sequence[float], pose: Vector6) -> None:
        """Refuse.

        Raises:
            RefusedError: always.
        """
        raise _refusal(f"obstacle {name}")


def _refusal(what: str) -> RefusedError:
    return RefusedError(f"{what}: nothing acts on an arm of fidelity exact, use ideal, typical or poor")
