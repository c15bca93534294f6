"""Electrics: currents and temperatures of box and tool, and the energy that the arm takes.

No manual gives numbers, so all of them are chosen: outputs drive the inputs of a PLC, the tool is a resistor,
the box warms up after it was switched on.
"""

from collections.abc import Iterable
from math import exp

from protocol.ur_types import RobotMode
from ur_emulator.machine.controller.robot_mode import POWERED
from ur_emulator.machine.models.robot_generation import Electrics, RobotGeneration
from ur_emulator.machine.models.robot_model import Vector6
from ur_hil.arithmetic import add_up

# The part of the joints' currents that shows on the arm's bus, as the drives chop.
BUS_SHARE = 0.1
# What one high output of the box or one switched output of the tool carries [A]: a PLC's input.
OUTPUT_CURRENT = 0.006
# Resistance of what hangs at the tool's supply: 24 V give 60 mA, 12 V half of that [ohm].
TOOL_RESISTANCE = 400.0
# The masterboard goes from the temperature of the room to this much above, exponentially [degree C, s].
ROOM_TEMPERATURE, BOARD_RISE, BOARD_TIME = 24.0, 8.0, 900.0


def arm_current(supply: Electrics, joint_currents: Iterable[float]) -> float:
    """Return the current on the arm's bus [A] for those of the joints."""
    return supply.idle_current + BUS_SHARE * add_up(map(abs, joint_currents))


def board_temperature(timestamp: float) -> float:
    """Return the temperature inside the box [degree C] so long after it was switched on [s]."""
    return ROOM_TEMPERATURE + BOARD_RISE * (1.0 - exp(-timestamp / BOARD_TIME))


class EnergyMeter:
    """Sums up the power on the arm's bus; `consumed` [J]."""

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
