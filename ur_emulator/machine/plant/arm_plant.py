"""ArmPlant: an arm on a table with its tools, as the control box sees it; PlantState: what the box reads.

Two arms are of this kind: `Plant` has physics, `ExactPlant` has none. The plant knows nothing of programs,
modes or safety; it follows its targets or raises `PlantError`. It reads no clock, and all randomness comes
from the seed: equal seeds and equal targets give bit-identical states.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError
from ur_emulator.machine.models.calibration import draw_dh
from ur_emulator.machine.models.fidelity import Fidelity
from ur_emulator.machine.models.robot_model import ZERO6, JointRange, RobotModel, Vector3, Vector6
from ur_emulator.machine.models.things import Thing
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.arm_physics import ArmPhysics
from ur_emulator.machine.plant.hand import FingerCommand, FingerState
from ur_emulator.machine.plant.inverse_dynamics import InverseDynamics
from ur_emulator.machine.plant.shapes import collide
from ur_emulator.machine.plant.thermometers import Thermometers
from ur_hil.cell import Cell
from ur_hil.tools import ToolModel


class PlantState(NamedTuple):
    """The state of the arm after a cycle, as the control box reads it; names as in a snapshot.

    The first group is measured: noisy, and as old as the feedback age. The second group is computed inside
    the box for the present target. The third is for the safety system: the present state.

    Attributes:
        actual_q: joint angles [rad].
        actual_qd: joint speeds [rad/s]; exactly 0 at rest.
        actual_current: motor currents [A].
        joint_voltage: joint supply voltages [V].
        actual_tool_accelerometer: specific force in the flange frame [m/s²]; +g upwards at rest.
        estimated_force: the box's estimate of the external wrench at the flange, base axes [N, Nm].
        joint_temperatures: [°C].
        target_current: current that the controller's model expects for the target, friction included [A].
        target_moment: torque of the controller's rigid-body model for the target [Nm].
        joint_control_output: current that the drives ask for at the end of the cycle [A].
        torque_saturated: some joint was at its torque limit at the start and at the end of the cycle.
        position_error: set-point of the drives (after delay and lag) minus true angle, end of cycle [rad].
    """

    actual_q: Vector6
    actual_qd: Vector6
    actual_current: Vector6
    joint_voltage: Vector6
    actual_tool_accelerometer: Vector3
    estimated_force: Vector6
    joint_temperatures: Vector6
    target_current: Vector6
    target_moment: Vector6
    joint_control_output: Vector6
    torque_saturated: bool
    position_error: Vector6


_NOTHING: Vector3 = (0.0, 0.0, 0.0)


class ArmPlant(ABC):
    """An arm on a table.

    Starts at the robot's home pose with its brakes on.

    Args:
        robot: type of the arm; its generation has the control cycle and the physics step.
        fidelity: how imperfect it is.
        seed: of calibration, gear phases and noise.
        tools: on the flange, fingers half open.

    Attributes:
        dh: six calibrated rows of this arm, for the controller's kinematics.
        range: the joint ranges, for all who keep them.
        cycle: number of the last cycle since the arm was put at rest.
        finger_commands: what the fingers of each tool do from the next cycle on; None: they hold.
        push_left: cycles after which the present push ends; 0: none does by itself.
    """

    def __init__(
        self, robot: RobotModel, fidelity: Fidelity, seed: int, tools: Sequence[ToolModel] = ()
    ) -> None:
        self.robot = robot
        self.fidelity = fidelity
        self.seed = seed
        self.period_s = robot.generation.period_s
        self.dh = draw_dh(robot, fidelity, seed)
        self.range = JointRange(robot.q_min, robot.q_max)
        self._dynamics = InverseDynamics(robot, self.dh)
        self._physics = ArmPhysics(robot, self.dh, fidelity, seed, tools)
        self._thermometers = Thermometers(robot.generation)
        self.finger_commands: Sequence[FingerCommand | None] = [None] * len(tools)
        self.push_left = 0
        self._set_up()
        self.reset(robot.home_q)

    @abstractmethod
    def _set_up(self) -> None:
        """Make what this kind of arm has beside the rest."""

    # --- the cycle

    def step(
        self,
        target: JointTarget | None,
        mode: ControlMode = ControlMode.POSITION,
        torque: TorqueCommand | None = None,
    ) -> None:
        """Advance one control cycle.

        Args:
            target: set-point for the end of this cycle. None puts or keeps the brakes on: the joints stand
                still.
            mode: control mode. In TEACH (freedrive) and TORQUE the target has no effect, but the first one
                afterwards should be at the measured position.
            torque: of the joints; in TORQUE, and in TEACH where something holds the arm beside the hand [Nm].

        Raises:
            PlantError: the target is not finite, or the simulation diverged and needs a reset.
        """
        self.complete_cycle()
        self.cycle += 1
        self._begin_cycle(target, mode, torque)
        self._state = self._read()

    @abstractmethod
    def _begin_cycle(
        self, target: JointTarget | None, mode: ControlMode, torque: TorqueCommand | None
    ) -> None:
        """Take the command of a cycle; arguments as of `step`."""

    def complete_cycle(self) -> None:
        """Let the arm move by the command that waits, if one does; that changes no bit."""
        return

    def sense(self) -> PlantState:
        """Return what the sensors say; it stays the same until the next step."""
        return self._state

    @abstractmethod
    def report(self, before: PlantState) -> PlantState:
        """Return the state of the arm as the box publishes it: that of about the beginning of the cycle."""

    def reset(self, q: Sequence[float]) -> None:
        """Put the arm at rest at q (6,) [rad], brakes on; payload, push and random streams stay.

        PlantError when q is not six finite numbers.
        """
        angles = np.array(q, dtype=np.float64)
        if angles.shape != (6,) or not np.isfinite(angles).all():
            raise PlantError(f"joint angles {list(q)} given: six finite numbers are needed")
        self.complete_cycle()
        self.cycle = 0
        self._rest_at(angles)
        self._state = self._read()

    @abstractmethod
    def _rest_at(self, q: NDArray[np.float64]) -> None:
        """Put the arm at rest at joint angles (6,) [rad], brakes on."""

    @abstractmethod
    def _read(self) -> PlantState:
        """Read the sensors."""

    # --- what surrounds the arm and acts on it

    @property
    def physics(self) -> ArmPhysics:
        """The arm and what is around it, after the last cycle."""
        self.complete_cycle()
        return self._physics

    def _acted_on(self, what: str) -> ArmPhysics:
        """The arm on which something acts now; RefusedError, which says what, if nothing can."""
        return self.physics

    def touches(self, q: Sequence[float]) -> bool:
        """Return whether the arm would touch itself, its base, the table or an obstacle at q (6,) [rad]."""
        physics = self.physics
        model, now = physics.model, physics.data
        there = mujoco.MjData(model)
        there.qpos[:] = [*q, *now.qpos[6:]]
        collide(model, there)
        return bool(there.ncon)

    def furnish(self, surroundings: Cell | Path) -> None:
        """Put a scene around the arm, see `Scene.furnish`."""
        self._acted_on("scene").scene.furnish(surroundings)

    def put(self, thing: Thing) -> None:
        """Add a thing or an obstacle, see `Scene.put`."""
        self._acted_on(f"{thing.kind} {thing.name}").scene.put(thing)

    def attach_load(self, mass: float, cog: Vector3 = (0.0, 0.0, 0.0)) -> None:
        """Set the true payload; from now on `set_payload` only declares. See `Loads.attach`."""
        self._acted_on("payload").loads.attach(mass, cog)

    def push(
        self, force: Sequence[float], point: Sequence[float] = _NOTHING, duration: float | None = None
    ) -> None:
        """Push the flange from this cycle on; a zero force ends it.

        Args:
            force: in base axes (3,) [N].
            point: where it acts, in the flange frame (3,) [m].
            duration: how long, in whole cycles [s]; None: until the next push.
        """
        n_cycles = 0 if duration is None else round(duration / self.period_s)
        if duration is not None and not n_cycles:
            force = _NOTHING
        arm = self._acted_on("push") if any(force) else self.physics
        arm.loads.push(force, point)
        self.push_left = n_cycles

    def count_push(self) -> None:
        """Count a cycle of a push with a duration; end it after the last."""
        self.push_left -= 1
        if not self.push_left:
            self.push(_NOTHING)

    # --- what the controller sets up

    def set_payload(self, mass: float, cog: Vector3, inertia: Vector6 = ZERO6) -> None:
        """Set the payload that the controller assumes, and the true one unless `attach_load` has set it.

        Arguments as in `set_payload_body`; PlantError when the mass is negative or a number is not finite.
        """
        self.physics.loads.declare(mass, cog, inertia)
        self._dynamics.set_payload(mass, cog, inertia)

    def set_range(self, q_min: Vector6, q_max: Vector6) -> None:
        """Set the joint ranges [rad], from the next cycle on."""
        self.complete_cycle()
        self.range.q_min, self.range.q_max = q_min, q_max

    def hold_trim(self) -> None:
        """Hold the trim of the servos, if there are some, until the target moves, if the arm presses.

        Otherwise its integral would raise the contact force more and more.
        """
        return

    @property
    def fingers(self) -> list[FingerState]:
        """The fingers of each tool as the last cycle that is computed left them."""
        return [hand.state for hand in self._physics.hands]
