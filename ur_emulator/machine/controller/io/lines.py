"""Digital, analogue and Euromap67 lines of the box and the tool, and outputs that follow the program.

Digital words carry bits 0-7 standard, 8-15 configurable, 16-17 tool (UR realtime sheet; RTDE guide).
Analogue values are kept in the unit of their domain: ampere (4-20 mA) or volt (0-10 V). No injection
moulding machine is connected to the Euromap67 interface. Source of outputs that follow the program: URScript
manuals CB3 3.15 and e-Series 5.11, module ioconfiguration.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class DigitalGroup:
    """Digital lines side by side, of inputs or outputs; `first` is their lowest bit in the digital word."""

    name: str
    first: int
    count: int

    @property
    def bits(self) -> range:
        """Bits of the lines in the digital word."""
        return range(self.first, self.first + self.count)

    @property
    def mask(self) -> int:
        """The bits as a mask of the digital word."""
        return (1 << self.count) - 1 << self.first

    def levels(self, word: int) -> int:
        """Return the levels of the lines in a digital word, the first line in the lowest bit."""
        return (word & self.mask) >> self.first


STANDARD = DigitalGroup("standard", 0, 8)
CONFIGURABLE = DigitalGroup("configurable", 8, 8)
TOOL = DigitalGroup("tool", 16, 2)
DIGITAL_GROUPS = {group.name: group for group in (STANDARD, CONFIGURABLE, TOOL)}
# Bits of the lines that old builtins and the Modbus map number from 0: 0-7 standard, 8-9 tool.
STANDARD_AND_TOOL = (*STANDARD.bits, *TOOL.bits)


def with_bit(word: int, bit: int, value: bool) -> int:
    """Return a word with one of its bits set or cleared."""
    return word | 1 << bit if value else word & ~(1 << bit)


CURRENT, VOLTAGE = 0, 1
# Full range of an analogue line by domain: (lowest, highest) value.
ANALOG_RANGE = {CURRENT: (0.004, 0.020), VOLTAGE: (0.0, 10.0)}


@dataclass(slots=True)
class AnalogLines:
    """All analogue lines of a box: standard inputs, standard outputs, tool inputs, two each [V or A].

    They are kept as what is published every cycle: a write makes new tuples, a cycle without one nothing.
    """

    domains: tuple[int, ...] = (VOLTAGE, VOLTAGE, CURRENT, CURRENT, VOLTAGE, VOLTAGE)
    values: tuple[float, ...] = (0.0, 0.0, 0.004, 0.004, 0.0, 0.0)


class AnalogLine:
    """One analogue line: its domain and its value in A or V."""

    __slots__ = ("_index", "_lines")

    def __init__(self, lines: AnalogLines, index: int) -> None:
        self._lines = lines
        self._index = index

    @property
    def domain(self) -> int:
        """CURRENT or VOLTAGE."""
        return self._lines.domains[self._index]

    @domain.setter
    def domain(self, domain: int) -> None:
        domains = self._lines.domains
        self._lines.domains = (*domains[: self._index], domain, *domains[self._index + 1 :])

    @property
    def value(self) -> float:
        """Present value [A or V]."""
        return self._lines.values[self._index]

    @value.setter
    def value(self, value: float) -> None:
        values = self._lines.values
        self._lines.values = (*values[: self._index], value, *values[self._index + 1 :])

    @property
    def ratio(self) -> float:
        """Present value as a ratio 0..1 of the range of the domain, clipped."""
        low, high = ANALOG_RANGE[self.domain]
        return min(1.0, max(0.0, (self.value - low) / (high - low)))

    def set_domain(self, domain: int) -> None:
        """Change the domain; the value stays at the same ratio of the range."""
        if domain != self.domain:
            ratio = self.ratio
            self.domain = domain
            self.set_ratio(ratio)

    def set_ratio(self, ratio: float) -> None:
        """Set the value to a ratio 0..1 of the range of the domain, clipped."""
        low, high = ANALOG_RANGE[self.domain]
        self.value = low + min(1.0, max(0.0, ratio)) * (high - low)


class ToolLine(NamedTuple):
    """Settings of the serial line at the tool of an e-Series arm.

    Attributes:
        baud_rate: bits a second.
        parity: 0 none, 1 odd, 2 even.
        rx_idle_chars: characters of silence before what was received is passed on.
        tx_idle_chars: the same before sending.
    """

    is_enabled: bool = False
    baud_rate: int = 115200
    parity: int = 0
    stop_bits: int = 1
    rx_idle_chars: float = 1.5
    tx_idle_chars: float = 3.5


# Signals of Euromap67 in each direction: two words of the Modbus map (docs/protocol/modbus.md).
N_EUROMAP = 32


class RunState(IntEnum):
    """What an output does when programs start and stop: the codes of set_runstate_*.

    An unscheduled stop is one by a protective stop, a fault, a violation or an error of the program; that an
    emergency stop is one: chosen.
    """

    KEEP = 0
    LOW_WHEN_STOPPED = 1
    HIGH_WHEN_STOPPED = 2
    HIGH_WHEN_RUNNING = 3  # and low when stopped
    # Of the e-Series:
    LOW_WHEN_UNSCHEDULED = 4  # low after an unscheduled stop
    HIGH_UNTIL_UNSCHEDULED = 5  # and high from the start on


# Level of an output when a program runs, has stopped, was stopped unscheduled; None does not change it.
_LEVELS: dict[RunState, tuple[bool | None, bool | None, bool | None]] = {
    RunState.KEEP: (None, None, None),
    RunState.LOW_WHEN_STOPPED: (None, False, False),
    RunState.HIGH_WHEN_STOPPED: (None, True, True),
    RunState.HIGH_WHEN_RUNNING: (True, False, False),
    RunState.LOW_WHEN_UNSCHEDULED: (None, None, False),
    RunState.HIGH_UNTIL_UNSCHEDULED: (True, None, False),
}


def level(rule: RunState, program_runs: bool, *, unscheduled: bool = False) -> bool | None:
    """Return the level of an output (True is high); None does not change it.

    `unscheduled`: the program has just been stopped, and not by itself or by a user.
    """
    running, stopped, stopped_unscheduled = _LEVELS[rule]
    if program_runs:
        return running
    return stopped_unscheduled if unscheduled else stopped


class InputOutput:
    """The lines of one box.

    Attributes:
        analog: all analogue lines; the three lists below are its parts.
        tool_voltage: supply of the tool: 0, 12 or 24 V.
        tool_output_modes: how the tool outputs drive: 0 each by itself, 1 both as power; then of each output
            1 sinking, 2 sourcing, 3 push-pull. It is only reported.
        tool_line: settings of the tool's serial line, which are only reported.
        euromap_inputs, euromap_outputs: words of the signals from and to a moulding machine, signal 0 in the
            lowest bit.
    """

    def __init__(self) -> None:
        self.digital_in = self.digital_out = self.tool_voltage = 0
        self.euromap_inputs = self.euromap_outputs = 0
        self.tool_output_modes = (0, 1, 1)
        self.tool_line = ToolLine()
        self.flags = [False] * 32
        self.analog = AnalogLines()
        self.analog_in = [AnalogLine(self.analog, i) for i in (0, 1)]
        self.analog_out = [AnalogLine(self.analog, i) for i in (2, 3)]
        self.tool_analog_in = [AnalogLine(self.analog, i) for i in (4, 5)]

    def read_digital_in(self, bit: int) -> bool:
        """Return the state of input `bit` of the digital word."""
        return bool(self.digital_in >> bit & 1)

    def read_digital_out(self, bit: int) -> bool:
        """Return the state of output `bit` of the digital word."""
        return bool(self.digital_out >> bit & 1)

    def write_digital_in(self, bit: int, value: bool) -> None:
        """Set input `bit` of the digital word."""
        self.digital_in = with_bit(self.digital_in, bit, value)

    def write_digital_out(self, bit: int, value: bool) -> None:
        """Set output `bit` of the digital word."""
        self.digital_out = with_bit(self.digital_out, bit, value)

    def write_digital_outputs(self, word: int, mask: int) -> None:
        """Set the outputs in `mask` to the bits of `word`."""
        self.digital_out = self.digital_out & ~mask | word & mask

    def write_euromap_output(self, port: int, value: bool) -> None:
        """Switch a signal to the moulding machine."""
        self.euromap_outputs = with_bit(self.euromap_outputs, port, value)

    def set_tool_output_mode(self, index: int, mode: int) -> None:
        """Set one of `tool_output_modes`."""
        modes = self.tool_output_modes
        self.tool_output_modes = (*modes[:index], mode, *modes[index + 1 :])  # type: ignore[assignment]
