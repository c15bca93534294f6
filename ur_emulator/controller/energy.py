"""EnergyMeter: the energy that the arm has taken since the controller started."""

from __future__ import annotations

from protocol.ur_types import RobotMode
from ur_emulator.controller.electrics import arm_current
from ur_emulator.controller.robot_mode import POWERED
from ur_emulator.models.robot_generation import RobotGeneration
from ur_emulator.models.robot_model import Vector6


class EnergyMeter:
    """Sums up the power on the arm's bus.

    Attributes:
        consumed: energy [J].
    """

    __slots__ = ("_joules_per_ampere", "_supply", "consumed")

    def __init__(self, generation: RobotGeneration) -> None:
        """Begin with nothing; the generation has the control cycle and the voltage of the bus."""
        self._supply = generation.electrics
        self._joules_per_ampere = self._supply.robot_voltage * generation.period_s
        self.consumed = 0.0

    def step(self, mode: RobotMode, joint_currents: Vector6) -> None:
        """Add the energy of a cycle with these currents [A]."""
        if mode in POWERED:
            self.consumed += self._joules_per_ampere * arm_current(self._supply, joint_currents)
