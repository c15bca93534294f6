"""What is wired to the inputs of the box and the tool: levels and values from outside.

No client of a real box can send these; they are for tests and for people at the emulator.
"""

from __future__ import annotations

from typing import Literal

from ur_emulator.commands.operation import CommandOperation
from ur_emulator.commands.parameters import parameter
from ur_emulator.controller.command import Box
from ur_emulator.controller.io.lines import ANALOG_RANGE, DIGITAL_GROUPS
from ur_emulator.errors import ArgumentError, RefusedError


class SetDigitalInput(CommandOperation):
    """Let a digital input be high or low from now on."""

    group: Literal["standard", "configurable", "tool"] = parameter("which inputs")
    n: int = parameter("number of the input: 0 to 7, of the tool 0 to 1", low=0, high=7)
    level: bool = parameter("high or low")

    def check_together(self) -> None:
        count = DIGITAL_GROUPS[self.group].count
        if self.n >= count:
            raise ArgumentError(f"{self.group} digital input {self.n} given: allowed are 0 to {count - 1}")

    def apply(self, box: Box) -> None:
        box.state.io.write_digital_in(DIGITAL_GROUPS[self.group].bits[self.n], self.level)


class SetAnalogInput(CommandOperation):
    """Let an analogue input have a voltage or a current from now on."""

    group: Literal["standard", "tool"] = parameter("which inputs")
    n: int = parameter("number of the input", low=0, high=1)
    value: float = parameter("in V, or in A where the input measures current", low=0.0, high=10.0)

    def apply(self, box: Box) -> None:
        io = box.state.io
        line = (io.analog_in if self.group == "standard" else io.tool_analog_in)[self.n]
        low, high = ANALOG_RANGE[line.domain]
        if not low <= self.value <= high:
            raise RefusedError(
                f"{self.value:g} given for {self.group} analog input {self.n}, which measures {low:g} to "
                f"{high:g} {'V' if line.domain else 'A'} now"
            )
        line.value = self.value
