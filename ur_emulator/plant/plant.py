"""Plant: one arm with its drives and sensors, advanced a control cycle at a time.

A cycle is: target -> controller's model torque -> command path (delay, interpolation, lag) -> joint servos
and physics in sub-steps -> a record of true values -> sensors. The plant knows nothing of programs, modes or
safety; it follows its targets or raises `PlantError`. It reads no clock, and all randomness comes from the
seed: equal seeds and equal targets give bit-identical states.

Where the dead time is at least a cycle, no target acts within its own cycle: the arm can move before the
target is known (`run_ahead`), while a client computes it. A change of the loads meanwhile undoes that.

The arm has four control modes (`ControlMode`): position; force, with the slow outer loop of the servos held;
freedrive and torque control, where no joint holds a position.

Angles: the physics' hinge is the motor side of the gear, which the drive holds; the joint is there plus the
gear's transmission error. Links move with the hinge: collisions leave out that error of 0.1 mrad.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from operator import ge, truediv

import numpy as np
from numpy.typing import NDArray

from protocol.ur_types import ControlMode
from ur_emulator.errors import PlantError
from ur_emulator.models.calibration import calibrated_dh, draw_calibration
from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.mjcf import GRAVITY
from ur_emulator.models.random_streams import random_stream
from ur_emulator.models.robot_model import ZERO6, RobotModel, Vector3, Vector6, six
from ur_emulator.motion.direct_torque import TorqueCommand
from ur_emulator.plant.arm_physics import ArmPhysics
from ur_emulator.plant.drives import TARGET_MAX, Drives
from ur_emulator.plant.gear import GearRipple, GearWithPlay
from ur_emulator.plant.obstacles import Obstacles
from ur_emulator.plant.physics import ServoGains
from ur_emulator.plant.plant_state import PlantState, Target
from ur_emulator.plant.sensors import REC_ACCELERATION, Record, Sensors
from ur_emulator.plant.thermometers import Thermometers

# Control modes in which no joint holds a position.
_FREE = (ControlMode.TEACH, ControlMode.TORQUE)
_WANDER_LEVELS = 64
"""A dead time that wanders goes through so many values: steps of 30 us for 2 ms."""


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
        self._n_substeps = generation.n_substeps
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
        self._gear = (GearWithPlay if fidelity.backlash else GearRipple)(fidelity, seed)
        self._sensors = Sensors(robot, fidelity, seed, self.period_s)
        self._thermometers = Thermometers(generation)

        # The measurement is taken in this sub-step of a cycle and reported so many cycles later.
        age_substeps = max(1, round(fidelity.feedback_age / substep))
        self._capture_at = -age_substeps % self._n_substeps
        # The first record is that of this cycle; the next one, which is the oldest, is read.
        self._records = deque(Record() for _ in range(1 + (age_substeps - 1) // self._n_substeps))
        self._read_at = 1 % len(self._records)

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
        self._rest = Record()
        self._state: PlantState | None = None
        # The next cycle is computed, but not completed.
        self._is_ahead = False
        self.reset(robot.home_q)

    # --- state for tests and for the control API ---

    @property
    def obstacles(self) -> Obstacles:
        """Obstacles around the arm."""
        self._undo_run_ahead()
        return self._physics.obstacles

    @property
    def q_true(self) -> NDArray[np.float64]:
        """True joint angles (6,) now [rad]; no real controller knows them."""
        self._undo_run_ahead()
        self._gear.evaluate(self._physics.q)
        return self._physics.q + self._gear.error

    @property
    def qd_true(self) -> NDArray[np.float64]:
        """True joint speeds (6,) now [rad/s]."""
        self._undo_run_ahead()
        self._gear.evaluate(self._physics.q)
        return self._physics.qd * (1.0 + self._gear.slope)

    @property
    def n_contacts(self) -> int:
        """Number of contact points of the arm with itself, its base or the table."""
        self._undo_run_ahead()
        return self._physics.n_contacts

    @property
    def flange_position(self) -> NDArray[np.float64]:
        """True position of the flange (3,) in the base frame [m], at the start of the last sub-step."""
        self._undo_run_ahead()
        return self._physics.flange_position.copy()

    @property
    def contact_wrench(self) -> NDArray[np.float64]:
        """True contact wrench of table and base on the arm (6,), at the flange in base axes [N, Nm]."""
        self._undo_run_ahead()
        return self._physics.contact_wrench

    def reset(self, q: Sequence[float]) -> None:
        """Put the arm at rest at q (6,) [rad], brakes on; payload, push and random streams stay.

        Raises:
            PlantError: when q is not six finite numbers.
        """
        angles = np.array(q, dtype=np.float64)
        if angles.shape != (6,) or not np.isfinite(angles).all():
            raise PlantError(f"joint angles {list(q)} given: six finite numbers are needed")
        self.cycle = 0
        self._undo_run_ahead()
        self._physics.place(self._gear.motor_position(angles))
        self._sensors.reset()
        self._engage_brakes()
        for record in self._records:
            record.values[:] = self._rest.values
        self._reading = self._sensors.read(self._records[self._read_at])
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
        self._undo_run_ahead()
        self._physics.loads.declare(mass, cog, inertia)
        self._drives.set_payload(mass, cog, inertia)

    def set_range(self, q_min: Vector6, q_max: Vector6) -> None:
        """Set the joint ranges that freedrive keeps [rad]."""
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
        self._undo_run_ahead()
        self._physics.loads.attach(mass, cog)

    def hold_trim(self) -> None:
        """Hold the trim of the servos until the target moves, if the arm presses against an obstacle.

        Otherwise its integral would raise the contact force more and more.
        """
        self._trim_is_held = True

    def push(self, force: Sequence[float], point: Sequence[float] | None = None) -> None:
        """Push the flange from now on; a zero force ends it.

        Args:
            force: (3,) in base axes [N].
            point: where it acts, in the flange frame [m]; None for the flange's origin.

        Raises:
            PlantError: when a number is not finite.
        """
        self._undo_run_ahead()
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
        """Compute the arm's next cycle, if nothing that is still unknown acts in it.

        `step` completes the cycle; the results are the same to the last bit.
        """
        drives = self._drives
        if not (drives.target_acts_later and self._state) or self._braked or self._is_ahead:
            return
        if self._mode not in _FREE and not self._physics.loads.is_unexpected:
            self._physics.store_state()
            self._run()
            self._is_ahead = True

    def _undo_run_ahead(self) -> None:
        """Undo `run_ahead`."""
        if self._is_ahead:
            self._is_ahead = False
            self._physics.restore_state()
            self._gear.undo()

    def sense(self) -> PlantState:
        """Read the sensors; asking again before the next step gives the same state."""
        if self._state is None:
            self._state = PlantState(
                *self._reading,
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
        now, current = self.sense(), before.target_current
        control = current if self._reports_control_as_target else now.joint_control_output
        return now._replace(
            target_current=current, target_moment=before.target_moment, joint_control_output=control
        )

    def _run(self) -> None:
        """Advance the arm by a cycle and read its sensors; `_keep` completes the cycle."""
        physics, drives, gear = self._physics, self._drives, self._gear
        record, error = self._records[0], self._error
        is_free = self._mode in _FREE
        if not is_free:
            drives.actual_speed[:] = physics.qd
            drives.advance()
        physics.run(drives, self._capture_at, record.simulated)
        np.multiply(physics.torque, self._per_torque, self._currents)
        self._control_current = six(self._currents.tolist())
        gear.apply(record)
        record.wrench[:] = physics.loads.wrench if physics.loads.is_unexpected else 0.0
        if physics.data.ncon:
            record.wrench += physics.contact_wrench
        if is_free:
            error[:] = 0.0
        else:
            np.add(physics.q, gear.error, error)
            np.subtract(drives.q_final, error, error)
        self._reading = self._sensors.read(self._records[self._read_at])

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
        self._records.rotate(-1)
        self._sensors.keep()
        self._thermometers.step(self._reading.actual_current)

    @property
    def _is_pressing(self) -> bool:
        """True in force mode, and after it while the joints press against an obstacle."""
        return self._mode is ControlMode.FORCE or self._drives.are_pressing(self._physics.q)

    # --- control modes ---

    def _switch(self, mode: ControlMode, target: Target) -> None:
        """Change the control mode without a jump of the torques."""
        self._undo_run_ahead()
        was_free, self._mode = self._mode in _FREE, mode
        self._physics.servos.set_free(mode in _FREE)
        if was_free:
            self._drives.follow_moving(target, self._physics.q)
        self._trim_is_held = mode is ControlMode.FORCE or (self._trim_is_held and not was_free)

    # --- brakes ---

    def _stand_still(self) -> None:
        """Advance by a cycle with the brakes on."""
        self._undo_run_ahead()
        if not self._braked:
            self._engage_brakes()
        self._records[0].values[:] = self._rest.values
        self._reading = self._sensors.read(self._records[self._read_at])
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
        self._rest.q[:] = self.q_true
        self._rest.values[REC_ACCELERATION] = GRAVITY * self._physics.flange_rotation[2]

    def _release_brakes(self) -> None:
        """Let the drives hold the arm, at the pose in which the brakes hold it."""
        self._braked = False
        self._drives.hold(self._rest.q, self._physics.q)


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
