"""Plant: one arm with its drives, brakes and sensors in MuJoCo, advanced a control cycle at a time.

A cycle is: target -> controller's model torque -> command path (interpolation, lag) -> joint servos
and physics in sub-steps -> a record of true values -> sensors.

Measurements are a cycle old, or older, when they are reported: the report of a cycle does not need its
motion. The step of the next cycle computes it, or `complete_cycle` does, while a client computes the next
target.

The arm has four control modes (`ControlMode`): position; force, with the slow outer loop of the servos held;
freedrive and torque control, where no joint holds a position.

Angles: the physics' hinge is the motor side of the gear, which the drive holds; the joint is there plus the
gear's transmission error. Links move with the hinge: collisions leave out that error of 0.1 mrad.
"""

from collections.abc import Sequence
from operator import ge, truediv

import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError
from ur_emulator.machine.models.robot_model import ZERO6, six
from ur_emulator.machine.motion.generators import JointTarget, TorqueCommand
from ur_emulator.machine.plant.arm_plant import ArmPlant, PlantState
from ur_emulator.machine.plant.drives import Drives, check_target
from ur_emulator.machine.plant.feedback import Feedback
from ur_emulator.machine.plant.hand import FingerCommand

# Control modes in which no joint holds a position.
_FREE = (ControlMode.TEACH, ControlMode.TORQUE)
# What `step` gets, and what the fingers of each tool do in its cycle.
_Command = tuple[JointTarget | None, ControlMode, TorqueCommand | None, Sequence[FingerCommand | None]]


class Plant(ArmPlant):
    """An arm with physics; see `ArmPlant`."""

    def _set_up(self) -> None:
        robot, fidelity, seed = self.robot, self.fidelity, self.seed
        self._drives = Drives(robot, self._dynamics, self.range, fidelity, seed)
        self._feedback = Feedback(robot, fidelity, seed)
        # The command of the present cycle, by which the arm has not moved yet.
        self._command: _Command | None = None
        self._per_torque = 1.0 / np.array(robot.torque_constant)
        self._currents = np.zeros(6)
        # Below this no joint can be at its torque limit [A].
        self._unsaturated = min(map(truediv, robot.tau_max, robot.torque_constant))
        self._mode = ControlMode.POSITION
        self._is_braked, self._control_current = True, ZERO6
        self._saturated_before = self._saturated_now = False
        # In force mode and after it, until the arm is moved away; see `hold_trim`.
        self._trim_is_held = False
        self._error = np.zeros(6)

    # --- state for tests and for the control API

    @property
    def q_true(self) -> NDArray[np.float64]:
        """True joint angles (6,) now [rad]; no real controller knows them."""
        q = self.physics.q
        self._feedback.gear.evaluate(q)
        return q + self._feedback.gear.error

    @property
    def qd_true(self) -> NDArray[np.float64]:
        """True joint speeds (6,) now [rad/s]."""
        physics = self.physics
        self._feedback.gear.evaluate(physics.q)
        return physics.qd * (1.0 + self._feedback.gear.slope)

    # --- what the controller sets up

    def hold_trim(self) -> None:
        """See `ArmPlant.hold_trim`."""
        self.complete_cycle()
        self._trim_is_held = True

    # --- the cycle

    def _begin_cycle(
        self, target: JointTarget | None, mode: ControlMode, torque: TorqueCommand | None
    ) -> None:
        self._command = (target, mode, torque, self.finger_commands)

    def complete_cycle(self) -> None:
        """See `ArmPlant.complete_cycle`; raises what `step` raises."""
        command, self._command = self._command, None
        if command is None:
            return
        target, mode, torque, fingers = command
        for hand, finger_command in zip(self._physics.hands, fingers, strict=True):
            hand.drive(finger_command, self.period_s)
        if target is None:
            self._stand_still()
        else:
            self._drive(target, mode, torque)
            self._move()
        self._thermometers.step(self._feedback.reading.actual_current)

    def _read(self) -> PlantState:
        return PlantState(
            *self._feedback.reading,
            self._thermometers.reading,
            self._drives.target_current,
            self._drives.target_moment,
            self._control_current,
            self._saturated_before and self._saturated_now,
            six(self._error.tolist()),
        )

    def report(self, before: PlantState) -> PlantState:
        """See `ArmPlant.report`."""
        if not self.robot.generation.reports_control_as_target:
            return self._state
        return self._state._replace(joint_control_output=self._state.target_current)

    def _drive(self, target: JointTarget, mode: ControlMode, torque: TorqueCommand | None) -> None:
        drives, physics = self._drives, self._physics
        if self._is_braked:
            # At the pose in which the brakes hold the arm.
            self._is_braked = False
            drives.hold(self._feedback.q_rest, physics.q)
        if mode is not self._mode:
            self._switch(mode, target)
        elif self._trim_is_held and mode is ControlMode.POSITION and any(target.qd):
            self._trim_is_held = False
        if mode is ControlMode.TEACH:
            drives.drive_freely(physics.q, physics.qd, torque and torque.torque)
        elif torque is not None:
            drives.drive_by_torque(physics.q, physics.qd, torque)
        else:
            check_target(target, self.cycle)
            drives.command(target)

    def _move(self) -> None:
        physics, drives, feedback = self._physics, self._drives, self._feedback
        is_free = self._mode in _FREE
        if not is_free:
            drives.actual_speed[:] = physics.qd
            drives.advance()
        feedback.follow(physics, drives)
        np.multiply(physics.torque, self._per_torque, self._currents)
        self._control_current = currents = six(self._currents.tolist())
        if physics.has_diverged:
            raise PlantError(
                f"the simulation diverged in cycle {self.cycle}: joint speeds {physics.qd.tolist()} rad/s; "
                "reset the plant and check the targets",
                cycle=self.cycle,
            )
        self._saturated_before = self._saturated_now
        self._saturated_now = not (max(currents) < self._unsaturated > -min(currents)) and any(
            map(ge, map(abs, physics.torque.tolist()), self.robot.tau_max)
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
        return self._mode is ControlMode.FORCE or self._drives.are_pressing(self._physics.q)

    def _switch(self, mode: ControlMode, target: JointTarget) -> None:
        """Change the control mode without a jump of the torques."""
        was_free, self._mode = self._mode in _FREE, mode
        self._physics.set_free(mode in _FREE)
        if was_free:
            self._drives.follow_moving(target, self._physics.q)
        self._trim_is_held = mode is ControlMode.FORCE or (self._trim_is_held and not was_free)

    # --- brakes

    def _rest_at(self, q: NDArray[np.float64]) -> None:
        self._physics.place(self._feedback.gear.motor_position(q))
        self._engage_brakes()
        self._feedback.reset()

    def _stand_still(self) -> None:
        if not self._is_braked:
            self._engage_brakes()
        self._physics.run_beside(self.robot.generation.n_substeps)
        self._feedback.take_rest()

    def _engage_brakes(self) -> None:
        """Stand still at once, wherever the arm is."""
        self._is_braked = True
        self._trim_is_held = False
        if self._mode is not ControlMode.POSITION:
            self._mode = ControlMode.POSITION
            self._physics.set_free(False)
        self._saturated_before = self._saturated_now = False
        self._error[:] = 0.0
        self._control_current = ZERO6
        self._drives.release()
        self._physics.stop()
        self._feedback.stop(self._physics)
