"""DrivenArm: an arm with its drives, brakes and sensors, and what a command does to it in a cycle.

A cycle is: target -> controller's model torque -> command path (interpolation, lag) -> joint servos
and physics in sub-steps -> a record of true values -> sensors.

The arm has four control modes (`ControlMode`): position; force, with the slow outer loop of the servos held;
freedrive and torque control, where no joint holds a position.

Angles: the physics' hinge is the motor side of the gear, which the drive holds; the joint is there plus the
gear's transmission error. Links move with the hinge: collisions leave out that error of 0.1 mrad.
"""

from collections.abc import Sequence
from operator import ge, truediv
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError
from ur_emulator.machine.models.calibration import Calibration, calibrated_dh
from ur_emulator.machine.models.fidelity import Fidelity, random_stream
from ur_emulator.machine.models.robot_model import ZERO6, RobotModel, Vector6, six
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.arm_physics import ArmPhysics
from ur_emulator.machine.plant.drives import TARGET_MAX, Drives, ServoGains
from ur_emulator.machine.plant.feedback import Feedback
from ur_emulator.machine.plant.hand import FingerCommand
from ur_hil.tools import ToolModel

# Control modes in which no joint holds a position.
_FREE = (ControlMode.TEACH, ControlMode.TORQUE)


class ArmCommand(NamedTuple):
    """What the arm gets in a cycle, see `Plant.step`.

    Attributes:
        cycle: number of the cycle, for errors.
        target: set-point for its end; None puts or keeps the brakes on.
        torque: of free joints.
        fingers: of each tool; None: they hold.
    """

    cycle: int
    target: JointTarget | None
    mode: ControlMode
    torque: TorqueCommand | None
    fingers: Sequence[FingerCommand | None]


class DrivenArm:
    """The arm of a plant.

    Attributes:
        physics: masses, joints and contacts.
        control_current: what the drives ask for at the end of the cycle (6,) [A].
    """

    def __init__(
        self,
        robot: RobotModel,
        calibration: Calibration,
        fidelity: Fidelity,
        seed: int,
        tools: Sequence[ToolModel],
    ) -> None:
        generation = robot.generation
        period, substep = generation.period_s, generation.substep_us * 1e-6
        mass_scale = 1.0 + fidelity.mass_error * random_stream(seed, "masses").standard_normal(6)
        gains = ServoGains.of(robot)
        dh, presliding = calibrated_dh(robot, calibration), fidelity.friction_presliding
        self.physics = ArmPhysics(
            robot, dh, mass_scale.tolist(), gains, substep, presliding, fidelity.friction_rise, tools
        )
        self._period, self._n_substeps = period, generation.n_substeps
        self.drives = Drives(robot, calibration, fidelity, seed, gains, substep, period)
        # Of the plant's cycle, which comes a cycle later, see `Plant`.
        age_substeps = round(fidelity.feedback_age / substep) - generation.n_substeps
        self.feedback = Feedback(robot, fidelity, seed, max(0, age_substeps))
        self._tau_max = robot.tau_max
        self._per_torque = 1.0 / np.array(robot.torque_constant)
        self._currents = np.zeros(6)
        # Below this no joint can be at its torque limit [A].
        self._unsaturated = min(map(truediv, robot.tau_max, robot.torque_constant))
        self._mode = ControlMode.POSITION
        # In force mode and after it, until the arm is moved away; see `hold_trim`.
        self._trim_is_held = False
        self._error = np.zeros(6)
        self._is_braked = True
        self._saturated_before = self._saturated_now = False
        self.control_current = ZERO6

    @property
    def is_saturated(self) -> bool:
        """A joint was at its torque limit at the start and at the end of the cycle."""
        return self._saturated_before and self._saturated_now

    @property
    def position_error(self) -> Vector6:
        """Set-point of the drives minus true angle at the end of the cycle [rad]."""
        return six(self._error.tolist())

    def reset(self, q: NDArray[np.float64]) -> None:
        """Put the arm at rest at joint angles q (6,) [rad], brakes on."""
        self.physics.place(self.feedback.gear.motor_position(q))
        self._engage_brakes()
        self.feedback.reset()

    def hold_trim(self) -> None:
        """See `Plant.hold_trim`."""
        self._trim_is_held = True

    # --- the cycle ---

    def advance(self, command: ArmCommand) -> None:
        """Advance by a cycle.

        Raises:
            PlantError: the target is not finite, or the simulation diverged.
        """
        cycle, target, mode, torque, fingers = command
        for hand, finger_command in zip(self.physics.hands, fingers, strict=True):
            hand.drive(finger_command, self._period)
        if target is None:
            self._stand_still()
            return
        if self._is_braked:
            self._release_brakes()
        if mode is not self._mode:
            self._switch(mode, target)
        elif self._trim_is_held and mode is ControlMode.POSITION and any(target.qd):
            self._trim_is_held = False
        if mode is ControlMode.TEACH:
            self.drives.drive_freely(self.physics.q, self.physics.qd, torque and torque.torque)
        elif torque is not None:
            self.drives.drive_by_torque(self.physics.q, self.physics.qd, torque)
        elif not self.drives.command(target):
            raise PlantError(
                f"target {target} in cycle {cycle}: finite numbers below {TARGET_MAX:g} are needed",
                cycle=cycle,
            )
        self._run(cycle)

    def _run(self, cycle: int) -> None:
        """Advance the arm by a cycle and read its sensors."""
        physics, drives, feedback = self.physics, self.drives, self.feedback
        is_free = self._mode in _FREE
        if not is_free:
            drives.actual_speed[:] = physics.qd
            drives.advance()
        physics.run(drives, feedback.capture_at, feedback.captured)
        np.multiply(physics.torque, self._per_torque, self._currents)
        self.control_current = six(self._currents.tolist())
        feedback.take(physics, drives.expected_current)
        currents = self.control_current
        if physics.has_diverged:
            raise PlantError(
                f"the simulation diverged in cycle {cycle}: joint speeds {physics.qd.tolist()} rad/s; "
                "reset the plant and check the targets",
                cycle=cycle,
            )
        self._saturated_before = self._saturated_now
        self._saturated_now = not (max(currents) < self._unsaturated > -min(currents)) and any(
            map(ge, map(abs, physics.torque.tolist()), self._tau_max)
        )
        error = self._error
        if is_free:
            error[:] = 0.0
        else:
            np.add(physics.q, feedback.gear.error, error)
            np.subtract(drives.q_final, error, error)
            trims = not (self._saturated_now or (self._trim_is_held and self._is_pressing))
            drives.keep(error if trims else None)

    @property
    def _is_pressing(self) -> bool:
        """True in force mode, and after it while the joints press against an obstacle."""
        return self._mode is ControlMode.FORCE or self.drives.are_pressing(self.physics.q)

    # --- control modes ---

    def _switch(self, mode: ControlMode, target: JointTarget) -> None:
        """Change the control mode without a jump of the torques."""
        was_free, self._mode = self._mode in _FREE, mode
        self.physics.set_free(mode in _FREE)
        if was_free:
            self.drives.follow_moving(target, self.physics.q)
        self._trim_is_held = mode is ControlMode.FORCE or (self._trim_is_held and not was_free)

    # --- brakes ---

    def _stand_still(self) -> None:
        """Advance by a cycle with the brakes on."""
        if not self._is_braked:
            self._engage_brakes()
        if self.physics.has_company:
            self.physics.run_beside(self._n_substeps)
        self.feedback.take_rest()

    def _engage_brakes(self) -> None:
        """Stand still at once, wherever the arm is."""
        self._is_braked = True
        self._trim_is_held = False
        if self._mode is not ControlMode.POSITION:
            self._mode = ControlMode.POSITION
            self.physics.set_free(False)
        self._saturated_before = self._saturated_now = False
        self._error[:] = 0.0
        self.control_current = ZERO6
        self.drives.release()
        self.physics.stop()
        self.feedback.stop(self.physics)

    def _release_brakes(self) -> None:
        """Let the drives hold the arm, at the pose in which the brakes hold it."""
        self._is_braked = False
        self.drives.hold(self.feedback.q_rest, self.physics.q)
