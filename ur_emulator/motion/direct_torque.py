"""direct_torque: a program gives the torques of the joints, cycle by cycle; no position is held.

Source: URScript manual e-Series 5.25.1, direct_torque: gravity is always compensated; without a call in every
cycle the robot returns to position control. Chosen: the set-point is the measured arm meanwhile, and position
control begins by bringing the joints to rest.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ur_emulator.models.robot_model import Vector6
from ur_emulator.motion.generators import Generator, StopJ, Streamed
from ur_emulator.motion.target import JointTarget

# Deceleration when no further torque comes [rad/s^2]. Chosen: as when no further servoj comes.
LOST_DECELERATION = 20.0


class TorqueCommand(NamedTuple):
    """What the drives shall give in one cycle.

    Attributes:
        torque: beside gravity and friction [Nm].
        viscous: share of the modelled viscous friction to compensate, by joint.
        coulomb: share of the modelled Coulomb friction, likewise.
    """

    torque: Vector6
    viscous: Vector6
    coulomb: Vector6


class DirectTorque(Streamed):
    """Follow the measured arm while the drives give a torque.

    Args:
        command: for the drives.
        measure: gives the measured angles and speeds.
    """

    done = False

    def __init__(self, command: TorqueCommand, measure: Callable[[], JointTarget]) -> None:
        self.command = command
        self._measure = measure

    def step(self, target: JointTarget, dt: float, scale: float) -> JointTarget:
        """Return the measured arm; speed scaling has no effect."""
        return self._measure()

    def when_lost(self) -> Generator:
        """Hold the position where the arm comes to rest."""
        return StopJ(LOST_DECELERATION)
