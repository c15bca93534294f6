"""Feedback: from the motors and what acts on the arm to what the control box measures.

The gear's transmission error lies between motor and joint. The sensors read a record of true values, which is
as old as the feedback age.
"""

from collections import deque
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ur_emulator.machine.models.fidelity import Fidelity, random_stream
from ur_emulator.machine.models.mjcf import GRAVITY
from ur_emulator.machine.models.robot_model import RobotModel
from ur_emulator.machine.plant.arm_physics import ArmPhysics
from ur_emulator.machine.plant.drives import Drives
from ur_emulator.machine.plant.sensors import REC_ACCELERATION, Record, Sensors, WrenchFor

_GEAR_RATIO = 101.0  # of all sizes
_CURRENT_CYCLES = 4.0 * _GEAR_RATIO


class GearRipple:
    """Strain wave gears: q_joint = q_motor + e(q_motor), both counted at the joint [rad]; ripple of motors.

    The ratio of a strain wave gear is not constant: the joint leads and lags the motor by up to a tenth of a
    milliradian, in waves along the joint's angle. The motor is what the drive holds; the joint is what the
    encoder at the output reports. The waves are those of the fidelity, their phases the box's own.

    A motor's torque constant and cogging change with its angle, too: four waves a motor turn, which the
    current compensates, also at rest. Of a real UR3's base 45 mA (O); that the servo lets none of it into the
    motion is chosen.

    Attributes:
        error: e (6,) [rad], after `evaluate`.
        slope: de/dq (6,) [1], after `evaluate`.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        ripples = fidelity.ripples
        phases = random_stream(seed, "gear").uniform(0.0, 2.0 * np.pi, (len(ripples), 6))
        # Error and slope of each wave of all joints, then the motors' ripple. Products with matrices cost
        # less than broadcasting at this size.
        n_waves = 12 * len(ripples) + 6
        cycles = [*np.repeat([ripple.cycles for ripple in ripples], 2), _CURRENT_CYCLES]
        self._cycles = np.kron(np.array(cycles)[:, None], np.eye(6))
        self._phases = np.zeros(n_waves)
        self._sizes = np.zeros((18, n_waves))
        self._phases[-6:] = random_stream(seed, "current").uniform(0.0, 2.0 * np.pi, 6)
        self._sizes[12:, -6:] = np.diag(
            sqrt(2.0) * np.multiply(fidelity.current_ripple, robot.torque_constant)
        )
        for n, ripple in enumerate(ripples):
            if ripple.phase is not None:
                phases[n] = ripple.phase
            # A speed ripple of rms r has the slope amplitude sqrt(2) r.
            slope = sqrt(2.0) * ripple.rms
            has_wave = np.diag(np.isin(np.arange(6), ripple.joints).astype(float))
            error, change = slice(12 * n, 12 * n + 6), slice(12 * n + 6, 12 * n + 12)
            self._phases[error], self._phases[change] = phases[n], phases[n] + np.pi / 2
            self._sizes[:6, error], self._sizes[6:12, change] = (
                slope / ripple.cycles * has_wave,
                slope * has_wave,
            )
        # What a joint does not have costs nothing.
        used = self._sizes.any(axis=0)
        self._cycles, self._phases = self._cycles[used], self._phases[used]
        self._sizes = np.ascontiguousarray(self._sizes[:, used])
        self._waves = np.zeros(len(self._phases))
        # Difference of joint and motor: position and, after `apply`, speed; torque of the ripple.
        self._sum = np.zeros(18)
        self.error: NDArray[np.float64] = self._sum[:6]
        self.slope: NDArray[np.float64] = self._sum[6:12]

    def evaluate(self, q_motor: NDArray[np.float64]) -> None:
        """Set `error` and `slope` for motor positions q_motor (6,) [rad]."""
        waves = self._waves
        self._cycles.dot(q_motor, waves)
        np.add(waves, self._phases, waves)
        np.sin(waves, waves)
        self._sizes.dot(waves, self._sum)

    def apply(self, record: Record) -> None:
        """Turn positions and speeds of the motors in a record into those of the joints; sets `error`.

        The torques get the ripple of the motors.
        """
        self.evaluate(record.q)
        np.multiply(self.slope, record.qd, self.slope)
        np.add(record.driven, self._sum, record.driven)

    def motor_position(self, q_joint: NDArray[np.float64]) -> NDArray[np.float64]:
        """Invert the gear: motor positions (6,) that put the joints at q_joint (6,) [rad]."""
        q_motor = np.array(q_joint, dtype=np.float64)
        # The slope of e is a few percent, so this contracts to rounding within a dozen turns.
        for _ in range(12):
            GearRipple.evaluate(self, q_motor)
            q_motor = q_joint - self.error
        return q_motor


class GearWithPlay(GearRipple):
    """q_joint = play(q_motor) + e(q_motor): in the gap the joint stays where friction holds it.

    The gap is centred on the motor: the joint trails by half the backlash in either direction.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        super().__init__(robot, fidelity, seed)
        self._half = 0.5 * fidelity.backlash
        # The joint without its waves.
        self._held = np.zeros(6)

    def evaluate(self, q_motor: NDArray[np.float64]) -> None:
        """See `GearRipple`; a joint in the gap has the slope -1, which is no motion."""
        super().evaluate(q_motor)
        behind = self._held - q_motor
        self.slope[np.abs(behind) < self._half] = -1.0
        np.add(self.error, behind.clip(-self._half, self._half), self.error)

    def apply(self, record: Record) -> None:
        """See `GearRipple`; the joint is carried along."""
        q_motor = record.q.copy()
        super().apply(record)
        np.clip(self._held, q_motor - self._half, q_motor + self._half, out=self._held)

    def motor_position(self, q_joint: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `GearRipple`; the joints are then in the middle of their gaps."""
        self._held[:] = super().motor_position(q_joint)
        return self._held.copy()


class Feedback:
    """Gears and sensors of one arm.

    A cycle is `follow` or `take_rest`.

    Attributes:
        q_rest: joint angles (6,) at which the brakes hold the arm [rad].
        reading: what the sensors say of the last cycle.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int) -> None:
        generation = robot.generation
        n_substeps = generation.n_substeps
        # From the measured moment to the end of the plant's cycle, which comes a cycle later, see `Plant`.
        age_substeps = max(0, round(fidelity.feedback_age / (generation.substep_us * 1e-6)) - n_substeps)
        # Number of the sub-step whose beginning is the measured moment; after the last sub-step: its end.
        self._capture_at = -age_substeps % n_substeps if age_substeps else n_substeps
        self.gear = (GearWithPlay if fidelity.backlash else GearRipple)(robot, fidelity, seed)
        self._sensors = Sensors(robot, fidelity, seed, generation.period_s)
        # The first record is that of this cycle; the next one, which is the oldest, is read.
        self._records = deque(Record() for _ in range(1 + max(0, age_substeps - 1) // n_substeps))
        self._read_at = 1 % len(self._records)
        self._rest = Record()
        self.q_rest = self._rest.q
        self._has_force_sensor = generation.force_sensing.has_sensor
        self.reading = self._sensors.read(self._rest)

    def follow(self, physics: ArmPhysics, drives: Drives) -> None:
        """Let the drives move the arm for a cycle, and read its sensors."""
        record, loads = self._records[0], physics.loads
        physics.run(drives, self._capture_at, record.simulated)
        self.gear.apply(record)
        if not self._has_force_sensor:
            record.expected_current[:] = drives.expected_current
            self._read(physics.wrench_for)
            return
        record.wrench[:] = loads.wrench if loads.is_unexpected else 0.0
        if physics.data.ncon:
            record.wrench += physics.contact_wrench
        self._read()

    def take_rest(self) -> None:
        """Read the sensors of an arm that the brakes hold."""
        self._records[0].values[:] = self._rest.values
        self._read()

    def _read(self, wrench_for: WrenchFor | None = None) -> None:
        """Read the oldest record, and make room for the next."""
        self.reading = self._sensors.read(self._records[self._read_at], wrench_for)
        self._records.rotate(-1)

    def stop(self, physics: ArmPhysics) -> None:
        """The arm comes to rest where it is: see `take_rest`."""
        self.gear.evaluate(physics.q)
        self._rest.q[:] = physics.q + self.gear.error
        self._rest.values[REC_ACCELERATION] = GRAVITY * physics.flange_rotation[2]

    def reset(self) -> None:
        """Let the arm have been at rest for ever."""
        self._sensors.reset()
        for record in self._records:
            record.values[:] = self._rest.values
        self.reading = self._sensors.read(self._records[self._read_at])
