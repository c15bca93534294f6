"""How single addresses of the robot's Modbus map are read from the controller's state and written to it.

The map itself, and what it rests on, are in `robot_map`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import SafetyMode
from ur_emulator.controller.io.lines import STANDARD, TOOL
from ur_emulator.controller.robot_mode import POWERED
from ur_emulator.controller.safety.modes import EMERGENCY_MODES
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.controller.state import ControllerState

WORD_MAX = 0xFFFF

Reader = Callable[[ControllerState, int], float]
"""Returns the value at an offset within a row."""
Writer = Callable[[ControllerState, int, int], None]
"""Takes a value at an offset within a row."""


# --- digital lines


def box_word(word: int) -> int:
    """Return the standard and tool bits of the digital word, side by side."""
    return STANDARD.levels(word) | TOOL.levels(word) << STANDARD.count


def write_bits(bits: Sequence[int], forced: bool | None = None) -> Writer:
    """Write outputs from a word; with `forced`, only those whose bit is set, to that value."""

    def write(state: ControllerState, offset: int, value: int) -> None:
        for i, bit in enumerate(bits):
            is_set = bool(value >> i & 1)
            if forced is None or is_set:
                state.io.write_digital_out(bit, is_set if forced is None else forced)

    return write


def write_bit(bits: Sequence[int], forced: bool | None = None) -> Writer:
    """Write one output from a coil; with `forced`, only when the coil is written True, to that value."""

    def write(state: ControllerState, offset: int, value: int) -> None:
        if offset < len(bits) and (forced is None or value):
            state.io.write_digital_out(bits[offset], bool(value) if forced is None else forced)

    return write


def in_bit(state: ControllerState, offset: int) -> int:
    """Read one input."""
    return box_word(state.io.digital_in) >> offset & 1


def out_bit(state: ControllerState, offset: int) -> int:
    """Read one output."""
    return box_word(state.io.digital_out) >> offset & 1


# --- analogue lines, by the name of their list


def analog_level(lines: str, index: int) -> Reader:
    """Read a line as a part of its range, 0 to 65535."""
    return lambda state, offset: float(getattr(state.io, lines)[index].ratio) * WORD_MAX


def set_analog_level(lines: str, index: int) -> Writer:
    """Set a line to a part of its range, 0 to 65535."""
    return lambda state, offset, value: getattr(state.io, lines)[index].set_ratio(value / WORD_MAX)


def analog_domain(lines: str, index: int) -> Reader:
    """Read the domain of a line: 0 current, 1 voltage."""
    return lambda state, offset: int(getattr(state.io, lines)[index].domain)


def set_analog_domain(lines: str, index: int) -> Writer:
    """Set the domain of a line."""
    return lambda state, offset, value: getattr(state.io, lines)[index].set_domain(value & 1)


def write_tool_voltage(state: ControllerState, offset: int, value: int) -> None:
    """Set the supply of the tool [V]; other values than the allowed ones change nothing."""
    if value in (0, 12, 24):
        state.io.set_tool_voltage(value)


# --- state of the robot


def of_snapshot(values: Callable[[Snapshot], tuple[float, ...]], scale: float = 1.0) -> Reader:
    """Read one element of something that is published, in other units."""
    return lambda state, offset: values(state.past.snapshot)[offset] * scale


def flag(state: ControllerState, offset: int) -> int:
    """Read 260-265: power, protective stop, emergency stop, two buttons, any safety stop."""
    safety = state.safety.mode
    return int(
        (
            state.mode.mode in POWERED,
            safety is SafetyMode.PROTECTIVE_STOP,
            safety in EMERGENCY_MODES,
            bool(state.operator.buttons & RobotStatusBits.TEACH_BUTTON_PRESSED),
            bool(state.operator.buttons & RobotStatusBits.POWER_BUTTON_PRESSED),
            state.safety.is_stopped,
        )[offset]
    )


def latch_clock(state: ControllerState, offset: int, value: int) -> None:
    """Remember the present time."""
    state.modbus_map.latch_clock(state.clock.tick)


def clock(state: ControllerState, offset: int) -> int:
    """Read the latched time: ms, s, min, h, days since the controller started."""
    milliseconds = state.modbus_map.latched_tick * state.clock.generation.period_us // 1000
    seconds = milliseconds // 1000
    return (milliseconds % 1000, seconds % 60, seconds // 60 % 60, seconds // 3600 % 24, seconds // 86400)[
        offset
    ]


def write_general(state: ControllerState, offset: int, value: int) -> None:
    """Write a general purpose word."""
    state.modbus_map.write(offset, value)


def write_gp_input(state: ControllerState, offset: int, value: int) -> None:
    """Write an input boolean."""
    state.registers.inputs.booleans[offset] = bool(value)
