"""Plant: one arm with its drives and sensors, advanced a control cycle at a time.

The plant knows nothing of programs, modes or safety; it follows its targets or raises `PlantError`. It reads
no clock, and all randomness comes from the seed: equal seeds and equal targets give bit-identical states.

Measurements are a cycle old, or older, when they are reported: the report of a cycle does not need its
motion. The step of the next cycle computes it, or `complete_cycle` does, while a client computes the next
target.
"""

from collections.abc import Sequence
from math import exp
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError
from ur_emulator.machine.models.calibration import draw_calibration
from ur_emulator.machine.models.fidelity import Fidelity
from ur_emulator.machine.models.robot_generation import RobotGeneration
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector3, Vector6
from ur_emulator.machine.models.things import BodyShape, Contact, Thing
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.driven_arm import ArmCommand, DrivenArm
from ur_emulator.machine.plant.hand import FingerCommand, FingerState
from ur_emulator.machine.plant.obstacles import Obstacles
from ur_emulator.machine.plant.scene import Scene
from ur_hil.cell import Cell
from ur_hil.tools import ToolModel


class PlantState(NamedTuple):
    """The state of the arm after a cycle, as the control box reads it; names as in RTDE where one exists.

    The first group is measured: noisy, and as old as the feedback age. The second group is computed inside
    the box for the present target. The third is for the safety system: the present state.

    Attributes:
        actual_q: joint angles [rad].
        actual_qd: joint speeds [rad/s]; exactly 0 at rest.
        actual_current: motor currents [A].
        joint_voltage: joint supply voltages [V].
        tool_accelerometer: specific force in the flange frame [m/s²]; +g upwards at rest.
        tcp_force: the box's estimate of the external wrench at the flange, base axes [N, Nm].
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
    tool_accelerometer: Vector3
    tcp_force: Vector6
    joint_temperatures: Vector6
    target_current: Vector6
    target_moment: Vector6
    joint_control_output: Vector6
    torque_saturated: bool
    position_error: Vector6


# --- thermometers: joint temperatures that follow the heat of the motors; deterministic
#
# Source: production log of a UR3 (UCI "UR3 CobotOps"): 28 to 45 °C, wrists hottest. Time constant and heat
# per current are assumed.

_RISE: Vector6 = (0.25, 0.25, 0.5, 0.8, 0.8, 0.8)  # °C per A²
_LARGEST_RISE = 20.0  # °C
_TIME_CONSTANT = 900.0  # s
_INTERVAL = 1.0  # s between updates
_STEPS_PER_DEGREE = 16.0


class Thermometers:
    """Six thermometers; `reading` has their values [°C]."""

    def __init__(self, generation: RobotGeneration) -> None:
        period, self._idle = generation.period_s, generation.electrics.joint_temperatures
        self._every = max(1, round(_INTERVAL / period))
        self._gain = 1.0 - exp(-self._every * period / _TIME_CONSTANT)
        self._countdown = self._every
        self._exact = list(self._idle)
        self.reading = self._idle

    def step(self, current: Sequence[float]) -> None:
        """Advance by one cycle with these motor currents (6,) [A]."""
        self._countdown -= 1
        if self._countdown:
            return
        self._countdown = self._every
        for i, amperes in enumerate(current):
            final = self._idle[i] + min(_LARGEST_RISE, _RISE[i] * amperes * amperes)
            self._exact[i] += self._gain * (final - self._exact[i])
        a, b, c, d, e, f = (round(_STEPS_PER_DEGREE * value) / _STEPS_PER_DEGREE for value in self._exact)
        self.reading = (a, b, c, d, e, f)


class Plant:
    """An arm on a table.

    Starts at the robot's home pose with its brakes on.

    Args:
        robot: type of the arm; its generation has the control cycle and the physics step.
        fidelity: how imperfect it is.
        seed: of calibration, gear phases and noise.
        tools: on the flange, fingers half open.

    Attributes:
        calibration: the factory calibration of this arm, for the controller's kinematics.
    """

    def __init__(
        self, robot: RobotModel, fidelity: Fidelity, seed: int, tools: Sequence[ToolModel] = ()
    ) -> None:
        generation = robot.generation
        self.robot = robot
        self.fidelity = fidelity
        self.seed = seed
        self.period_s = generation.period_s
        self.calibration = draw_calibration(robot, fidelity, seed)
        self._arm = arm = DrivenArm(robot, self.calibration, fidelity, seed, tools)
        self._physics, self._drives, self._feedback = arm.physics, arm.drives, arm.feedback
        self._thermometers = Thermometers(generation)
        self._reports_control_as_target = generation.reports_control_as_target
        self._state: PlantState | None = None
        # The command of the present cycle, by which the arm has not moved yet.
        self._command: ArmCommand | None = None
        self._finger_commands: Sequence[FingerCommand | None] = [None] * len(tools)
        self.reset(robot.home_q)

    # --- state for tests and for the control API ---

    @property
    def obstacles(self) -> Obstacles:
        """Obstacles around the arm."""
        self.complete_cycle()
        return self._physics.obstacles

    @property
    def scene(self) -> Scene:
        """Things around the arm that can be moved."""
        self.complete_cycle()
        return self._physics.scene

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Where bodies touch."""
        self.complete_cycle()
        return self._physics.contacts

    @property
    def shapes(self) -> tuple[BodyShape, ...]:
        """Shapes around the arm and on its flange."""
        self.complete_cycle()
        return self._physics.shapes

    def furnish(self, surroundings: Cell | Path) -> None:
        """Put a scene around the arm, see `Scene.furnish`."""
        self.scene.furnish(surroundings)

    def put_thing(self, thing: Thing) -> None:
        """Add a thing at rest, see `Scene.put`."""
        self.scene.put(thing)

    @property
    def q_true(self) -> NDArray[np.float64]:
        """True joint angles (6,) now [rad]; no real controller knows them."""
        self.complete_cycle()
        self._feedback.gear.evaluate(self._physics.q)
        return self._physics.q + self._feedback.gear.error

    @property
    def qd_true(self) -> NDArray[np.float64]:
        """True joint speeds (6,) now [rad/s]."""
        self.complete_cycle()
        self._feedback.gear.evaluate(self._physics.q)
        return self._physics.qd * (1.0 + self._feedback.gear.slope)

    @property
    def n_contacts(self) -> int:
        """Number of contact points of the arm with itself, its base or the table."""
        self.complete_cycle()
        return self._physics.n_contacts

    @property
    def flange_position(self) -> NDArray[np.float64]:
        """True position of the flange (3,) in the base frame [m], at the start of the last sub-step."""
        self.complete_cycle()
        return self._physics.flange_position.copy()

    @property
    def contact_wrench(self) -> NDArray[np.float64]:
        """True contact wrench of table and base on the arm (6,), at the flange in base axes [N, Nm]."""
        self.complete_cycle()
        return self._physics.contact_wrench

    def reset(self, q: Sequence[float]) -> None:
        """Put the arm at rest at q (6,) [rad], brakes on; payload, push and random streams stay.

        PlantError when q is not six finite numbers.
        """
        angles = np.array(q, dtype=np.float64)
        if angles.shape != (6,) or not np.isfinite(angles).all():
            raise PlantError(f"joint angles {list(q)} given: six finite numbers are needed")
        self.complete_cycle()
        self.cycle = 0
        self._arm.reset(angles)
        self._state = None

    def touches(self, q: Sequence[float]) -> bool:
        """Return whether the arm would touch itself, its base, the table or an obstacle at q (6,) [rad]."""
        return self._physics.touches(q)

    def set_payload(self, mass: float, cog: Vector3, inertia: Vector6 = ZERO6) -> None:
        """Set the payload that the controller assumes, and the true one unless `attach_load` has set it.

        Arguments as in `set_payload_body`; PlantError when the mass is negative or a number is not finite.
        """
        self.complete_cycle()
        self._physics.loads.declare(mass, cog, inertia)
        self._drives.set_payload(mass, cog, inertia)

    def set_range(self, q_min: Vector6, q_max: Vector6) -> None:
        """Set the joint ranges that freedrive keeps [rad]."""
        self.complete_cycle()
        self._drives.set_range(q_min, q_max)

    def attach_load(self, mass: float, cog: Vector3 = (0.0, 0.0, 0.0)) -> None:
        """Set the true payload at the flange, which the controller does not know.

        From now on `set_payload` only declares. The mass is in kg, the centre of gravity in the flange frame
        [m]. PlantError when the mass is negative or a number is not finite.
        """
        self.complete_cycle()
        self._physics.loads.attach(mass, cog)

    def hold_trim(self) -> None:
        """Hold the trim of the servos until the target moves, if the arm presses against an obstacle.

        Otherwise its integral would raise the contact force more and more.
        """
        self.complete_cycle()
        self._arm.hold_trim()

    def push(self, force: Sequence[float], point: Sequence[float] | None = None) -> None:
        """Push the flange from now on; a zero force ends it.

        The force (3,) is in base axes [N]; the point where it acts in the flange frame [m], None for its
        origin. PlantError when a number is not finite.
        """
        self.complete_cycle()
        self._physics.loads.push(force, point)

    @property
    def fingers(self) -> list[FingerState]:
        """The fingers of each tool as the last cycle that is computed left them."""
        return [hand.state for hand in self._physics.hands]

    def drive_fingers(self, commands: Sequence[FingerCommand | None]) -> None:
        """Set what the fingers of each tool do from the next cycle on; None: they hold."""
        self._finger_commands = commands

    # --- the cycle ---

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
        self._finish()
        self._state = None
        self.cycle += 1
        self._command = ArmCommand(self.cycle, target, mode, torque, self._finger_commands)

    def complete_cycle(self) -> None:
        """Let the arm move by the command that waits; the results are the same to the last bit."""
        if self._command is not None:
            self.sense()  # before the arm moves
            self._finish()

    def _finish(self) -> None:
        """Let the arm move by the command that waits, if one does."""
        command, self._command = self._command, None
        if command is not None:
            self._arm.advance(command)
            self._thermometers.step(self._feedback.reading.actual_current)

    def sense(self) -> PlantState:
        """Read the sensors; asking again before the next step gives the same state."""
        if self._state is None:
            self._state = PlantState(
                *self._feedback.reading,
                self._thermometers.reading,
                self._drives.target_current,
                self._drives.target_moment,
                self._arm.control_current,
                self._arm.is_saturated,
                self._arm.position_error,
            )
        return self._state

    def report(self, before: PlantState) -> PlantState:
        """Return the state of the arm as the box publishes it: that of about the beginning of the cycle."""
        now = self.sense()
        return (
            now._replace(joint_control_output=now.target_current) if self._reports_control_as_target else now
        )


_NOTHING: Vector3 = (0.0, 0.0, 0.0)


class FlangePush:
    """Pushes the flange of a plant, for a time or until the next push."""

    __slots__ = ("_cycles_left", "_plant")

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._cycles_left = 0

    @property
    def will_end(self) -> bool:
        """True during a push with a duration."""
        return self._cycles_left > 0

    def begin(self, force: Vector3, point: Vector3, duration: float | None) -> None:
        """Push from this cycle on.

        The force is in base axes [N], zero ends the push before; the point where it acts in the flange frame
        [m]. Without a duration [s] it lasts until the next one.
        """
        n_cycles = 0 if duration is None else round(duration / self._plant.period_s)
        self._plant.push(force if duration is None or n_cycles else _NOTHING, point)
        self._cycles_left = n_cycles

    def step(self) -> None:
        """Count a cycle of a push with a duration; end it after the last."""
        self._cycles_left -= 1
        if not self._cycles_left:
            self._plant.push(_NOTHING)
