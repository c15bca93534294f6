"""Plant: one arm with its drives and sensors, advanced a control cycle at a time.

A cycle is: target -> controller's model torque -> command path (delay, interpolation, lag) -> joint servos
and physics in sub-steps -> a record of true values -> sensors. The plant knows nothing of programs, modes or
safety; it does what it is told or raises `PlantError`. It reads no clock, and its only chance comes from the
seed: equal seeds and equal targets give bit-identical states.

Where the dead time is at least a cycle, no target acts within its own cycle: the arm can move before the
target is known (`run_ahead`), while a client works on it. What acts on the arm meanwhile takes that back.

The arm has three ways to be driven (`ControlMode`): by position; by position with the slow outer loop of the
servos at rest, for the contacts of force mode; and guided by hand, where no joint holds a position.

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
from ur_emulator.models.robot_model import ZERO6, RobotModel, Vector3, six
from ur_emulator.plant.arm_physics import ArmPhysics
from ur_emulator.plant.drives import TARGET_MAX, Drives
from ur_emulator.plant.gear import GearRipple
from ur_emulator.plant.obstacles import Obstacles
from ur_emulator.plant.physics import ServoGains
from ur_emulator.plant.plant_state import PlantState, Target
from ur_emulator.plant.sensors import REC_ACCELERATION, Record, Sensors
from ur_emulator.plant.thermometers import Thermometers


class Plant:
    """An arm on a table.

    Starts at the robot's home pose with its brakes on.

    Args:
        robot: type of the arm; its generation has the control cycle and the physics step.
        fidelity: how imperfect it is.
        seed: which one of all such arms; fixes calibration, gear phases, delays and noise.

    Attributes:
        calibration: the factory calibration of this arm, for the controller's kinematics.
        dead_time: the delay drawn for this box, from the start of a cycle to the drives acting on it [s].
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
            robot, calibrated_dh(robot, self.calibration), mass_scale.tolist(), gains, substep
        )
        self._drives = Drives(
            robot, self.calibration, fidelity, seed, gains, dead_substeps, substep, self.period_s
        )
        self._gear = GearRipple(robot, fidelity, seed)
        self._sensors = Sensors(robot, fidelity, seed, self.period_s)
        self._thermometers = Thermometers(self.period_s)

        # The measurement is taken in this sub-step of a cycle and reported so many cycles later.
        age_substeps = max(1, round(fidelity.feedback_age / substep))
        self._capture_at = -age_substeps % self._n_substeps
        # The record of this cycle stands last; the oldest one is read.
        # The first record is that of this cycle; the next one, which is the oldest, is read.
        self._records = deque(Record() for _ in range(1 + (age_substeps - 1) // self._n_substeps))
        self._read_at = 1 % len(self._records)

        self._per_torque = 1.0 / np.array(robot.torque_constant)
        self._currents = np.zeros(6)
        # Below this no joint can be at its torque limit [A].
        self._unsaturated = min(map(truediv, robot.tau_max, robot.torque_constant))
        self._mode = ControlMode.POSITION
        # In force mode and after it, until the arm is moved away; see `rest_trim`.
        self._trim_rests = False
        self._error = np.zeros(6)
        self._braked = True
        self._saturated_before = self._saturated_now = False
        self._control_current = ZERO6
        self._rest = Record()
        self._state: PlantState | None = None
        # The next cycle has run, but was not kept.
        self._is_ahead = False
        self.reset(robot.home_q)

    # --- state for tests and for the control API ---

    @property
    def obstacles(self) -> Obstacles:
        """What stands around the arm."""
        self._take_back()
        return self._physics.obstacles

    @property
    def q_true(self) -> NDArray[np.float64]:
        """True joint angles (6,) now [rad]; no real controller knows them."""
        self._take_back()
        self._gear.evaluate(self._physics.q)
        return self._physics.q + self._gear.error

    @property
    def qd_true(self) -> NDArray[np.float64]:
        """True joint speeds (6,) now [rad/s]."""
        self._take_back()
        self._gear.evaluate(self._physics.q)
        return self._physics.qd * (1.0 + self._gear.slope)

    @property
    def n_contacts(self) -> int:
        """Number of contact points of the arm with itself, its base or the table."""
        self._take_back()
        return self._physics.n_contacts

    @property
    def flange_position(self) -> NDArray[np.float64]:
        """True position of the flange (3,) in the base frame [m], at the start of the last sub-step."""
        self._take_back()
        return self._physics.flange_position.copy()

    @property
    def contact_wrench(self) -> NDArray[np.float64]:
        """What table and base press on the arm (6,), at the flange in base axes [N, Nm]: the truth."""
        self._take_back()
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
        self._take_back()
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

    def set_payload(self, mass: float, cog: Vector3) -> None:
        """Declare a payload to the controller; it hangs on the flange unless `hang` has put another there.

        Args:
            mass: [kg].
            cog: centre of gravity in the flange frame [m].

        Raises:
            PlantError: when the mass is negative or a number is not finite.
        """
        self._take_back()
        self._physics.loads.declare(mass, cog)
        self._drives.set_payload(mass, cog)

    def hang(self, mass: float, cog: Vector3 = (0.0, 0.0, 0.0)) -> None:
        """Hang a payload on the flange without a word to the controller: what it believes may be wrong.

        From now on `set_payload` only declares.

        Args:
            mass: [kg].
            cog: centre of gravity in the flange frame [m].

        Raises:
            PlantError: when the mass is negative or a number is not finite.
        """
        self._take_back()
        self._physics.loads.hang(mass, cog)

    def rest_trim(self) -> None:
        """Let the slow outer loop of the servos rest until the target moves, where the arm presses something.

        It would press harder and harder for the sake of its encoders.
        """
        self._trim_rests = True

    def push(self, force: Sequence[float], point: Sequence[float] | None = None) -> None:
        """Push the flange from now on; a zero force ends it.

        Args:
            force: (3,) in base axes [N].
            point: where it acts, in the flange frame [m]; None for the flange's origin.

        Raises:
            PlantError: when a number is not finite.
        """
        self._take_back()
        self._physics.loads.push(force, point)

    # --- the cycle ---

    def step(self, target: Target | None, mode: ControlMode = ControlMode.POSITION) -> None:
        """Advance one control cycle.

        Args:
            target: set-point for the end of this cycle; the drives act on it from the beginning of the cycle
                plus the dead time. None puts or keeps the brakes on: the joints stand still.
            mode: how the arm is driven. TEACH leaves it to the hand that pushes it; the target does not
                count then, but the first one afterwards should be where the arm is.

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
        elif self._trim_rests and mode is ControlMode.POSITION and any(target.qd):
            self._trim_rests = False
        if mode is ControlMode.TEACH:
            self._drives.guide(self._physics.q, self._physics.qd)
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
        """Let the arm move for the next cycle already, if nothing that is unknown yet acts on it.

        `step` does what is left then; its results are the same to the last bit.
        """
        drives = self._drives
        if not (drives.target_acts_later and self._state) or self._braked or self._is_ahead:
            return
        if self._mode is not ControlMode.TEACH and not self._physics.loads.is_felt:
            self._physics.remember()
            self._run()
            self._is_ahead = True

    def _take_back(self) -> None:
        """Undo `run_ahead`."""
        if self._is_ahead:
            self._is_ahead = False
            self._physics.take_back()

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

    def _run(self) -> None:
        """Let the arm move for a cycle and read its sensors; nobody knows of it before `_keep`."""
        physics, drives, gear = self._physics, self._drives, self._gear
        record, error = self._records[0], self._error
        is_guided = self._mode is ControlMode.TEACH
        if not is_guided:
            drives.actual_speed[:] = physics.qd
            drives.advance()
        physics.run(drives, self._capture_at, record.simulated)
        np.multiply(physics.torque, self._per_torque, self._currents)
        self._control_current = six(self._currents.tolist())
        gear.apply(record)
        record.wrench[:] = physics.loads.wrench if physics.loads.is_felt else 0.0
        if physics.data.ncon:
            record.wrench += physics.contact_wrench
        if is_guided:
            error[:] = 0.0
        else:
            np.add(physics.q, gear.error, error)
            np.subtract(drives.q_final, error, error)
        self._reading = self._sensors.read(self._records[self._read_at])

    def _keep(self) -> None:
        """Take the cycle that ran for done."""
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
        if self._mode is not ControlMode.TEACH:
            trims = not (self._saturated_now or (self._trim_rests and self._presses))
            self._drives.keep(self._error if trims else None)
        self._keep_reading()

    def _keep_reading(self) -> None:
        self._records.rotate(-1)
        self._sensors.keep()
        self._thermometers.step(self._reading.actual_current)

    @property
    def _presses(self) -> bool:
        """True in force mode, and after it while the joints press against something."""
        return self._mode is ControlMode.FORCE or self._drives.presses(self._physics.q)

    # --- ways to be driven ---

    def _switch(self, mode: ControlMode, target: Target) -> None:
        """Change the way that the arm is driven, without a jump of the torques."""
        self._take_back()
        was_guided, self._mode = self._mode is ControlMode.TEACH, mode
        self._physics.servos.set_free(mode is ControlMode.TEACH)
        if was_guided:
            self._drives.take_over_moving(target, self._physics.q)
        self._trim_rests = mode is ControlMode.FORCE or (self._trim_rests and not was_guided)

    # --- brakes ---

    def _stand_still(self) -> None:
        """Let a cycle pass with the brakes on."""
        self._take_back()
        if not self._braked:
            self._engage_brakes()
        self._records[0].values[:] = self._rest.values
        self._reading = self._sensors.read(self._records[self._read_at])
        self._keep_reading()

    def _engage_brakes(self) -> None:
        """Stand still at once, wherever the arm is."""
        self._braked = True
        self._trim_rests = False
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
        """Hand the load over to the drives, at the pose in which the brakes hold it."""
        self._braked = False
        self._drives.take_over(self._rest.q, self._physics.q)
