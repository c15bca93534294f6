"""What is wired to the inputs of the box and the tool, as commands: levels and values from outside.

No client of a real box can send them; they are for tests and for people at the emulator.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from ur_emulator.controller.io import (
    ANALOG_RANGE,
    CONFIGURABLE_SHIFT,
    N_CONFIGURABLE,
    N_STANDARD,
    N_TOOL,
    TOOL_SHIFT,
    InputOutput,
)
from ur_emulator.errors import EmulatorError

# Groups of digital inputs: (lowest bit of the digital word, number of inputs).
DIGITAL_GROUPS = {
    "standard": (0, N_STANDARD),
    "configurable": (CONFIGURABLE_SHIFT, N_CONFIGURABLE),
    "tool": (TOOL_SHIFT, N_TOOL),
}
# Groups of analogue inputs: number of inputs.
ANALOG_GROUPS = {"standard": 2, "tool": 2}
MAX_ANALOG = 10.0  # V


@dataclass(frozen=True, slots=True)
class SetDigitalInput:
    """Let an input be high or low from now on.

    Attributes:
        group: a name of DIGITAL_GROUPS.
        n: number of the input in its group.
        level: high.

    Raises:
        EmulatorError: there is no such input.
    """

    group: str
    n: int
    level: bool

    def __post_init__(self) -> None:
        _check_line("digital", self.group, self.n, {g: count for g, (_, count) in DIGITAL_GROUPS.items()})


@dataclass(frozen=True, slots=True)
class SetAnalogInput:
    """Let an input have a voltage or a current from now on.

    Attributes:
        group: a name of ANALOG_GROUPS.
        n: number of the input in its group.
        value: in the unit of the line's domain [V or A]; beyond its range the line reads its end.

    Raises:
        EmulatorError: there is no such input, or no such value on any.
    """

    group: str
    n: int
    value: float

    def __post_init__(self) -> None:
        _check_line("analog", self.group, self.n, ANALOG_GROUPS)
        if not (isfinite(self.value) and 0.0 <= self.value <= MAX_ANALOG):
            raise EmulatorError(f"analog value {self.value:g} given: allowed are 0 to {MAX_ANALOG:g}")


WireCommand = SetDigitalInput | SetAnalogInput


def set_wire(io: InputOutput, command: WireCommand) -> None:
    """Change an input."""
    match command:
        case SetDigitalInput(group, n, level):
            mask = 1 << (DIGITAL_GROUPS[group][0] + n)
            io.digital_in = io.digital_in | mask if level else io.digital_in & ~mask
        case SetAnalogInput(group, n, value):
            line = (io.analog_in if group == "standard" else io.tool_analog_in)[n]
            low, high = ANALOG_RANGE[line.domain]
            line.value = min(high, max(low, value))


def _check_line(kind: str, group: str, n: int, counts: dict[str, int]) -> None:
    if group not in counts:
        raise EmulatorError(f"{kind} input group {group!r} given: choose {' or '.join(counts)}")
    if not 0 <= n < counts[group]:
        raise EmulatorError(f"{group} {kind} input {n} given: allowed are 0 to {counts[group] - 1}")
