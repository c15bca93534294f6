"""Digital and analogue lines of the box and the tool.

Digital words carry bits 0-7 standard, 8-15 configurable, 16-17 tool (UR realtime sheet; RTDE guide).
Analogue values are kept in the unit of their domain: ampere (4-20 mA) or volt (0-10 V).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import attrgetter

N_STANDARD = 8
N_CONFIGURABLE = 8
N_TOOL = 2
CONFIGURABLE_SHIFT = 8
TOOL_SHIFT = 16

CURRENT, VOLTAGE = 0, 1
# Full range of an analogue line by domain: (lowest, highest) value.
ANALOG_RANGE = {CURRENT: (0.004, 0.020), VOLTAGE: (0.0, 10.0)}


@dataclass(slots=True)
class AnalogLine:
    """One analogue line: its domain and its value in A or V."""

    domain: int = CURRENT
    value: float = 0.004

    def set_ratio(self, ratio: float) -> None:
        """Set the value to a ratio 0..1 of the range of the domain, clipped."""
        low, high = ANALOG_RANGE[self.domain]
        self.value = low + min(1.0, max(0.0, ratio)) * (high - low)


_VALUE, _DOMAIN = attrgetter("value"), attrgetter("domain")


@dataclass(slots=True)
class InputOutput:
    """The lines of one box.

    Attributes:
        digital_in: word of the digital inputs.
        digital_out: word of the digital outputs.
        analog_in: standard analogue inputs.
        analog_out: standard analogue outputs.
        tool_analog_in: analogue inputs of the tool.
        tool_voltage: supply of the tool: 0, 12 or 24 V.
        flags: of the scripts.
    """

    digital_in: int = 0
    digital_out: int = 0
    analog_in: list[AnalogLine] = field(default_factory=lambda: [AnalogLine(VOLTAGE, 0.0) for _ in range(2)])
    analog_out: list[AnalogLine] = field(default_factory=lambda: [AnalogLine() for _ in range(2)])
    tool_analog_in: list[AnalogLine] = field(
        default_factory=lambda: [AnalogLine(VOLTAGE, 0.0) for _ in range(2)]
    )
    tool_voltage: int = 0
    flags: list[bool] = field(default_factory=lambda: [False] * 32)
    _analog_lines: tuple[AnalogLine, ...] = field(init=False)

    def __post_init__(self) -> None:
        self._analog_lines = (*self.analog_in, *self.analog_out, *self.tool_analog_in)

    def analog_values(self) -> tuple[float, ...]:
        """Return all analogue values [A or V]: standard inputs, standard outputs, tool inputs, two each."""
        return tuple(map(_VALUE, self._analog_lines))

    def analog_domains(self) -> tuple[int, ...]:
        """Return the domains of the same lines: CURRENT or VOLTAGE."""
        return tuple(map(_DOMAIN, self._analog_lines))

    def read_digital_in(self, bit: int) -> bool:
        """Return the state of input `bit` of the digital word."""
        return bool(self.digital_in >> bit & 1)

    def read_digital_out(self, bit: int) -> bool:
        """Return the state of output `bit` of the digital word."""
        return bool(self.digital_out >> bit & 1)

    def write_digital_out(self, bit: int, value: bool) -> None:
        """Set output `bit` of the digital word."""
        mask = 1 << bit
        self.digital_out = self.digital_out | mask if value else self.digital_out & ~mask
