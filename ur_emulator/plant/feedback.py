"""Feedback: from the motors and what acts on the arm to what the control box measures.

The gear's transmission error lies between motor and joint. The sensors read a record of true values, which is
as old as the feedback age.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from ur_emulator.models.fidelity import Fidelity
from ur_emulator.models.mjcf import GRAVITY
from ur_emulator.models.robot_model import RobotModel
from ur_emulator.plant.arm_physics import ArmPhysics
from ur_emulator.plant.gear import GearRipple, GearWithPlay
from ur_emulator.plant.sensors import REC_ACCELERATION, Record, Sensors


class Feedback:
    """Gears and sensors of one arm.

    A cycle is `take` or `take_rest`, then `keep`. Before `keep` a cycle may be taken again, after `undo`.

    Args:
        robot: type of the arm.
        fidelity: its imperfections.
        seed: of the box.
        age_substeps: from the measured moment to the end of the cycle's physics.

    Attributes:
        capture_at: number of the sub-step whose beginning is the measured moment; after the last sub-step:
            its end.
        gear: between motors and joints.
        reading: what the sensors say of the last cycle.
    """

    def __init__(self, robot: RobotModel, fidelity: Fidelity, seed: int, age_substeps: int) -> None:
        generation = robot.generation
        n_substeps = generation.n_substeps
        self.capture_at = -age_substeps % n_substeps if age_substeps else n_substeps
        self.gear = (GearWithPlay if fidelity.backlash else GearRipple)(fidelity, seed)
        self._sensors = Sensors(robot, fidelity, seed, generation.period_s)
        # The first record is that of this cycle; the next one, which is the oldest, is read.
        self._records = deque(Record() for _ in range(1 + max(0, age_substeps - 1) // n_substeps))
        self._read_at = 1 % len(self._records)
        self._rest = Record()
        self.reading = self._sensors.read(self._rest)

    @property
    def q_rest(self) -> NDArray[np.float64]:
        """Joint angles (6,) at which the brakes hold the arm [rad]."""
        return self._rest.q

    @property
    def captured(self) -> NDArray[np.float64]:
        """Takes what MuJoCo's sensors say at the measured moment, see `sensors.REC_SIMULATED`."""
        return self._records[0].simulated

    def take(self, physics: ArmPhysics) -> None:
        """Read the sensors of an arm whose cycle has been computed."""
        record, loads = self._records[0], physics.loads
        self.gear.apply(record)
        record.wrench[:] = loads.wrench if loads.is_unexpected else 0.0
        if physics.n_contacts:
            record.wrench += physics.contact_wrench
        self.reading = self._sensors.read(self._records[self._read_at])

    def undo(self) -> None:
        """Take back `take`."""
        self.gear.undo()

    def take_rest(self) -> None:
        """Read the sensors of an arm that the brakes hold."""
        self._records[0].values[:] = self._rest.values
        self.reading = self._sensors.read(self._records[self._read_at])

    def keep(self) -> None:
        """End the cycle."""
        self._records.rotate(-1)
        self._sensors.keep()

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
