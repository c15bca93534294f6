"""Plant: one arm with its drives and sensors, advanced a control cycle at a time.

A cycle is: target -> controller's model torque -> command path (delay, interpolation, lag) -> joint servos
and physics in sub-steps -> a record of true values -> sensors. The plant knows nothing of programs, modes or
safety; it follows its targets or raises `PlantError`. It reads no clock, and all randomness comes from the
seed: equal seeds and equal targets give bit-identical states.

Part of the work needs not wait for the next target: `run_ahead` does it while a client computes that target.

| arm                                               | what runs ahead                                        |
|---------------------------------------------------|--------------------------------------------------------|
| no target acts within its own cycle (dead time)   | the next cycle; a change of the loads meanwhile        |
|                                                   | undoes it                                              |
| measurements are a cycle old when they are        | the present cycle: its report did not need it, so the  |
| reported, and targets act at once                 | step of the next cycle computes it, or `run_ahead`     |

The arm has four control modes (`ControlMode`): position; force, with the slow outer loop of the servos held;
freedrive and torque control, where no joint holds a position.

Angles: the physics' hinge is the motor side of the gear, which the drive holds; the joint is there plus the
gear's transmission error. Links move with the hinge: collisions leave out that error of 0.1 mrad.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import ge, truediv
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError
from ur_emulator.models.calibration import calibrated_dh, draw_calibration
from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import ZERO6, RobotModel, Vector3, Vector6, six
from ur_emulator.motion.direct_torque import TorqueCommand
from ur_emulator.plant.arm_physics import ArmPhysics
from ur_emulator.plant.drives import TARGET_MAX, Drives
from ur_emulator.plant.feedback import Feedback
from ur_emulator.plant.obstacles import Obstacles
from ur_emulator.plant.physics import ServoGains
from ur_emulator.plant.plant_state import PlantState, Target
from ur_emulator.plant.thermometers import Thermometers

# Control modes in which no joint holds a position.
_FREE = (ControlMode.TEACH, ControlMode.TORQUE)
_WANDER_LEVELS = 64
"""A dead time that wanders goes through so many values: steps of 30 us for 2 ms."""


class _Command(NamedTuple):
    """Arguments of `Plant.step`."""

    target: Target | None
    mode: ControlMode
    torque: TorqueCommand | None


class Plant:
    """An arm on a table.

    Starts at the robot's home pose with its brakes on.

    Args:
        robot: type of the arm; its generation has the control cycle and the physics step.
        fidelity: how imperfect it is.
        seed: of calibration, gear phases, delays and noise.

    Attributes:
        calibration: the factory calibration of this arm, for the controller's kinematics.
        dead_time: the delay drawn for this box, from the start of a cycle to the drives acting on it [s];
            where it wanders, its least value.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        generation = robot.generation
        self.robot = robot
        self.fidelity = fidelity
        self.seed = seed
        self.period_s = generation.period_s
        self.calibration = draw_calibration(fidelity, seed)
        substep = generation.substep_us * 1e-6

        spread = fidelity.dead_time_spread * float(random_stream(seed, "delay").uniform())
        dead_substeps = int((fidelity.dead_time + spread) / substep + 1e-9)
        self.dead_time = dead_substeps * substep
        mass_scale = 1.0 + fidelity.mass_error * random_stream(seed, "masses").standard_normal(6)
        gains = ServoGains.of(robot)
        self._physics = ArmPhysics(
            robot,
            calibrated_dh(robot, self.calibration),
            mass_scale.tolist(),
            gains,
            substep,
            fidelity.friction_presliding,
        )
        self._drives = Drives(
            robot,
            self.calibration,
            fidelity,
            seed,
            gains,
            _dead_times(fidelity, seed, dead_substeps, substep, self.period_s),
            substep,
            self.period_s,
        )
        # The measurement is taken in a sub-step of a cycle and reported so many sub-steps later.
        age_substeps = max(1, round(fidelity.feedback_age / substep))
        # See the table above: whether the arm moves by a command only when the cycle has been reported.
        self._moves_later = age_substeps >= generation.n_substeps and not self._drives.target_acts_later
        if self._moves_later:
            age_substeps -= generation.n_substeps
        self._feedback = Feedback(robot, fidelity, seed, age_substeps)
        self._gear = self._feedback.gear
        self._thermometers = Thermometers(generation)

        self._reports_control_as_target = generation.reports_control_as_target
        self._per_torque = 1.0 / np.array(robot.torque_constant)
        self._currents = np.zeros(6)
        # Below this no joint can be at its torque limit [A].
        self._unsaturated = min(map(truediv, robot.tau_max, robot.torque_constant))
        self._mode = ControlMode.POSITION
        # In force mode and after it, until the arm is moved away; see `hold_trim`.
        self._trim_is_held = False
        self._error = np.zeros(6)
        self._braked = True
        self._saturated_before = self._saturated_now = False
        self._control_current = ZERO6
        self._state: PlantState | None = None
        # The next cycle is computed, but not completed.
        self._is_ahead = False
        # The command of the present cycle, by which the arm has not moved yet.
        self._command: _Command | None = None
        self.reset(robot.home_q)

    # --- state for tests and for the control API ---

    @property
    def obstacles(self) -> Obstacles:
        """Obstacles around the arm."""
        self._be_current()
        return self._physics.obstacles

    @property
    def q_true(self) -> NDArray[np.float64]:
        """True joint angles (6,) now [rad]; no real controller knows them."""
        self._be_current()
        self._gear.evaluate(self._physics.q)
        return self._physics.q + self._gear.error

    @property
    def qd_true(self) -> NDArray[np.float64]:
        """True joint speeds (6,) now [rad/s]."""
        self._be_current()
        self._gear.evaluate(self._physics.q)
        return self._physics.qd * (1.0 + self._gear.slope)

    @property
    def n_contacts(self) -> int:
        """Number of contact points of the arm with itself, its base or the table."""
        self._be_current()
        return self._physics.n_contacts

    @property
    def flange_position(self) -> NDArray[np.float64]:
        """True position of the flange (3,) in the base frame [m], at the start of the last sub-step."""
        self._be_current()
        return self._physics.flange_position.copy()

    @property
    def contact_wrench(self) -> NDArray[np.float64]:
        """True contact wrench of table and base on the arm (6,), at the flange in base axes [N, Nm]."""
        self._be_current()
        return self._physics.contact_wrench

    def reset(self, q: Sequence[float]) -> None:
        """Put the arm at rest at q (6,) [rad], brakes on; payload, push and random streams stay.

        Raises:
            PlantError: when q is not six finite numbers.
        """
        angles = np.array(q, dtype=np.float64)
        if angles.shape != (6,) or not np.isfinite(angles).all():
            raise PlantError(f"joint angles {list(q)} given: six finite numbers are needed")
        self._be_current()
        self.cycle = 0
        self._physics.place(self._gear.motor_position(angles))
        self._engage_brakes()
        self._feedback.reset()
        self._state = None

    def touches(self, q: Sequence[float]) -> bool:
        """Return whether the arm would touch itself, its base, the table or an obstacle at q (6,) [rad]."""
        return self._physics.touches(q)

    def set_payload(self, mass: float, cog: Vector3, inertia: Vector6 = ZERO6) -> None:
        """Set the payload that the controller assumes, and the true one unless `attach_load` has set it.

        Args:
            mass: [kg].
            cog: centre of gravity in the flange frame [m].
            inertia: see `set_payload_body`.

        Raises:
            PlantError: when the mass is negative or a number is not finite.
        """
        self._be_current()
        self._physics.loads.declare(mass, cog, inertia)
        self._drives.set_payload(mass, cog, inertia)

    def set_range(self, q_min: Vector6, q_max: Vector6) -> None:
        """Set the joint ranges that freedrive keeps [rad]."""
        self._be_current()
        self._drives.set_range(q_min, q_max)

    def attach_load(self, mass: float, cog: Vector3 = (0.0, 0.0, 0.0)) -> None:
        """Set the true payload at the flange, which the controller does not know.

        From now on `set_payload` only declares.

        Args:
            mass: [kg].
            cog: centre of gravity in the flange frame [m].

        Raises:
            PlantError: when the mass is negative or a number is not finite.
        """
        self._be_current()
        self._physics.loads.attach(mass, cog)

    def hold_trim(self) -> None:
        """Hold the trim of the servos until the target moves, if the arm presses against an obstacle.

        Otherwise its integral would raise the contact force more and more.
        """
        self._be_current()
        self._trim_is_held = True

    def push(self, force: Sequence[float], point: Sequence[float] | None = None) -> None:
        """Push the flange from now on; a zero force ends it.

        Args:
            force: (3,) in base axes [N].
            point: where it acts, in the flange frame [m]; None for the flange's origin.

        Raises:
            PlantError: when a number is not finite.
        """
        self._be_current()
        self._physics.loads.push(force, point)

    # --- the cycle ---

    def step(
        self,
        target: Target | None,
        mode: ControlMode = ControlMode.POSITION,
        torque: TorqueCommand | None = None,
    ) -> None:
        """Advance one control cycle.

        Args:
            target: set-point for the end of this cycle; the drives act on it from the beginning of the cycle
                plus the dead time. None puts or keeps the brakes on: the joints stand still.
            mode: control mode. In TEACH (freedrive) and TORQUE the target has no effect, but the first one
                afterwards should be at the measured position.
            torque: of the joints; in TORQUE, and in TEACH where something holds the arm beside the hand [Nm].

        Raises:
            PlantError: the target is not finite, or the simulation diverged and needs a reset.
        """
        self._state = None
        self.cycle += 1
        command = _Command(target, mode, torque)
        if self._moves_later:
            self._finish()
            self._command = command
        else:
            self._advance(command)

    def _advance(self, command: _Command) -> None:
        """Advance the arm by a cycle."""
        target, mode, torque = command
        if target is None:
            self._stand_still()
            return
        if self._braked:
            self._release_brakes()
        if mode is not self._mode:
            self._switch(mode, target)
        elif self._trim_is_held and mode is ControlMode.POSITION and any(target.qd):
            self._trim_is_held = False
        if mode is ControlMode.TEACH:
            self._drives.drive_freely(self._physics.q, self._physics.qd, torque and torque.torque)
        elif torque is not None:
            self._drives.drive_by_torque(self._physics.q, self._physics.qd, torque)
        elif not self._drives.command(target):
            raise PlantError(
                f"target {target} in cycle {self.cycle}: finite numbers below {TARGET_MAX:g} are needed",
                cycle=self.cycle,
            )
        if self._is_ahead:
            self._drives.evaluate_friction()  # again, for the current that is expected at the target
        else:
            self._run()
        self._is_ahead = False
        self._keep()

    def run_ahead(self) -> None:
        """Compute what the next target cannot change; the results are the same to the last bit."""
        self._finish()
        drives = self._drives
        if not (drives.target_acts_later and self._state) or self._braked or self._is_ahead:
            return
        if self._mode not in _FREE and not self._physics.loads.is_unexpected:
            self._physics.store_state()
            self._run()
            self._is_ahead = True

    def _be_current(self) -> None:
        """Let the arm be where the commands so far have moved it: neither behind nor ahead."""
        self._finish()
        if self._is_ahead:
            self._is_ahead = False
            self._physics.restore_state()
            self._feedback.undo()

    def _finish(self) -> None:
        """Advance by the command that waits, if one does."""
        command, self._command = self._command, None
        if command is not None:
            self._advance(command)

    def sense(self) -> PlantState:
        """Read the sensors; asking again before the next step gives the same state."""
        if self._state is None:
            self._state = PlantState(
                *self._feedback.reading,
                self._thermometers.reading,
                self._drives.target_current,
                self._drives.target_moment,
                self._control_current,
                self._saturated_before and self._saturated_now,
                six(self._error.tolist()),
            )
        return self._state

    def report(self, before: PlantState) -> PlantState:
        """Return the state of the arm as the box publishes it: that of about the beginning of the cycle.

        Measurements are that old already; target current and moment are those of the cycle before.

        Args:
            before: what `sense` gave in the cycle before.
        """
        now = self.sense()
        if self._moves_later:
            before = now
        current = before.target_current
        control = current if self._reports_control_as_target else now.joint_control_output
        return now._replace(
            target_current=current, target_moment=before.target_moment, joint_control_output=control
        )

    def _run(self) -> None:
        """Advance the arm by a cycle and read its sensors; `_keep` completes the cycle."""
        physics, drives, feedback = self._physics, self._drives, self._feedback
        is_free = self._mode in _FREE
        if not is_free:
            drives.actual_speed[:] = physics.qd
            drives.advance()
        physics.run(drives, feedback.capture_at, feedback.captured)
        np.multiply(physics.torque, self._per_torque, self._currents)
        self._control_current = six(self._currents.tolist())
        feedback.take(physics)
        error = self._error
        if is_free:
            error[:] = 0.0
        else:
            np.add(physics.q, self._gear.error, error)
            np.subtract(drives.q_final, error, error)

    def _keep(self) -> None:
        """Complete the cycle that was computed."""
        physics, currents = self._physics, self._control_current
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
        if self._mode not in _FREE:
            trims = not (self._saturated_now or (self._trim_is_held and self._is_pressing))
            self._drives.keep(self._error if trims else None)
        self._keep_reading()

    def _keep_reading(self) -> None:
        self._feedback.keep()
        self._thermometers.step(self._feedback.reading.actual_current)

    @property
    def _is_pressing(self) -> bool:
        """True in force mode, and after it while the joints press against an obstacle."""
        return self._mode is ControlMode.FORCE or self._drives.are_pressing(self._physics.q)

    # --- control modes ---

    def _switch(self, mode: ControlMode, target: Target) -> None:
        """Change the control mode without a jump of the torques."""
        self._be_current()
        was_free, self._mode = self._mode in _FREE, mode
        self._physics.servos.set_free(mode in _FREE)
        if was_free:
            self._drives.follow_moving(target, self._physics.q)
        self._trim_is_held = mode is ControlMode.FORCE or (self._trim_is_held and not was_free)

    # --- brakes ---

    def _stand_still(self) -> None:
        """Advance by a cycle with the brakes on."""
        self._be_current()
        if not self._braked:
            self._engage_brakes()
        self._feedback.take_rest()
        self._keep_reading()

    def _engage_brakes(self) -> None:
        """Stand still at once, wherever the arm is."""
        self._braked = True
        self._trim_is_held = False
        if self._mode is not ControlMode.POSITION:
            self._mode = ControlMode.POSITION
            self._physics.servos.set_free(False)
        self._saturated_before = self._saturated_now = False
        self._error[:] = 0.0
        self._control_current = ZERO6
        self._drives.release()
        self._physics.stop()
        self._feedback.stop(self._physics)

    def _release_brakes(self) -> None:
        """Let the drives hold the arm, at the pose in which the brakes hold it."""
        self._braked = False
        self._drives.hold(self._feedback.q_rest, self._physics.q)


def _dead_times(
    fidelity: Fidelity, seed: int, dead_substeps: int, substep: float, period: float
) -> int | list[float]:
    """Dead time in sub-steps: one value, or those of successive cycles, over and over."""
    if not fidelity.dead_time_wander:
        return dead_substeps
    n = round(fidelity.dead_time_period / period)
    begin = random_stream(seed, "wander").uniform()
    share = 0.5 - 0.5 * np.cos(2.0 * np.pi * (begin + np.arange(n) / n))
    levels = np.rint(share * _WANDER_LEVELS) / _WANDER_LEVELS
    longer: list[float] = (dead_substeps + fidelity.dead_time_wander / substep * levels).tolist()
    return longer
