"""Temperatures and currents of box and tool as functions of a snapshot; the energy that the arm takes.

No manual gives numbers, so all of them are chosen: outputs drive the inputs of a PLC, the tool is
a resistor, the box warms up after it was switched on. They are computed when a port reads them.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import exp

from protocol.ur_types import JointMode, RobotMode
from ur_emulator.controller.io.lines import CONFIGURABLE, STANDARD, TOOL
from ur_emulator.controller.robot_mode import POWERED
from ur_emulator.models.robot_generation import Electrics, RobotGeneration
from ur_emulator.models.robot_model import Vector6

# The part of the joints' currents that shows on the arm's bus, as the drives chop.
BUS_SHARE = 0.1
# What one high output of the box or one switched output of the tool carries [A]: a PLC's input.
OUTPUT_CURRENT = 0.006
# Resistance of what hangs at the tool's supply: 24 V give 60 mA, 12 V half of that [ohm].
TOOL_RESISTANCE = 400.0
# The masterboard goes from the temperature of the room to this much above, exponentially [degree C, s].
ROOM_TEMPERATURE, BOARD_RISE, BOARD_TIME = 24.0, 8.0, 900.0

_BOX_OUTPUTS = STANDARD.mask | CONFIGURABLE.mask

# The tool has fewer modes than a joint: what it reports when the last joint is in one of the others.
TOOL_MODES: dict[int, JointMode] = {
    JointMode.BACKDRIVE: JointMode.RUNNING,
    JointMode.FREEDRIVE: JointMode.RUNNING,
    JointMode.READY_FOR_POWER_OFF: JointMode.SHUTTING_DOWN,
    JointMode.VIOLATION: JointMode.FAULT,
}


def arm_current(supply: Electrics, joint_currents: Iterable[float]) -> float:
    """Return the current on the arm's bus [A] for those of the joints."""
    return supply.idle_current + BUS_SHARE * sum(map(abs, joint_currents))


def io_current(digital_out: int) -> float:
    """Return the current of the outputs of the box [A] for the word of the digital outputs."""
    return OUTPUT_CURRENT * (digital_out & _BOX_OUTPUTS).bit_count()


def tool_current(voltage: float, digital_out: int) -> float:
    """Return the current out of the tool's supply [A]; 0 while it is off."""
    if not voltage:
        return 0.0
    return voltage / TOOL_RESISTANCE + OUTPUT_CURRENT * (digital_out & TOOL.mask).bit_count()


def board_temperature(uptime: float) -> float:
    """Return the temperature of the masterboard [degree C] this long [s] after the controller has started."""
    return ROOM_TEMPERATURE + BOARD_RISE * (1.0 - exp(-uptime / BOARD_TIME))


def tool_mode(last_joint: int) -> int:
    """Return the mode of the tool for that of the last joint."""
    return int(TOOL_MODES.get(last_joint, last_joint))


# --- EnergyMeter: the energy that the arm has taken since the controller started


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
