"""The robot's Modbus map as two tables: registers and coils, read from and written to the controller's state.

Scripts reach it with `read_port_register` and related builtins, Modbus clients by port 502. To add an
address, add a row. Registers are words of 16 bits, signed values in two's complement.
Source: UR "Modbus server" article and its register table (docs/protocol/modbus.md). Joint angles count up
from 0 to one turn, the turns beside them: UR forum, thread 641. Analogue levels are taken as parts of
the range of their domain, and the clock as the time since the controller started: chosen.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import SafetyMode
from ur_emulator.machine.controller.io.lines import (
    CONFIGURABLE,
    N_EUROMAP,
    STANDARD,
    STANDARD_AND_TOOL,
    TOOL,
    AnalogLine,
)
from ur_emulator.machine.controller.io.registers import FIRST_GENERAL, N_BOOLEAN, N_GENERAL
from ur_emulator.machine.controller.robot_mode import POWERED
from ur_emulator.machine.controller.safety.modes import EMERGENCY_MODES
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.controller.state import ControllerState

WORD_MAX = 0xFFFF

Reader = Callable[[ControllerState, int], float]
"""Returns the value at an offset within a row."""
Writer = Callable[[ControllerState, int, int], None]
"""Takes a value at an offset within a row."""


def box_word(word: int) -> int:
    """Return the standard and tool bits of the digital word, side by side."""
    return STANDARD.levels(word) | TOOL.levels(word) << STANDARD.count


def write_bits(bits: Sequence[int], forced: bool | None = None) -> Writer:
    """Write outputs from a word; with `forced`, only those whose bit is set, to that value."""
    write_one = write_bit(bits, forced)

    def write(state: ControllerState, offset: int, value: int) -> None:
        for i in range(len(bits)):
            write_one(state, i, value >> i & 1)

    return write


def write_bit(bits: Sequence[int], forced: bool | None = None) -> Writer:
    """Write one output from a coil; with `forced`, only when the coil is written True, to that value."""

    def write(state: ControllerState, offset: int, value: int) -> None:
        if offset < len(bits) and (forced is None or value):
            state.io.write_digital_out(bits[offset], bool(value) if forced is None else forced)

    return write


def write_tool_voltage(state: ControllerState, offset: int, value: int) -> None:
    """Set the supply of the tool [V]; other values than the allowed ones change nothing."""
    if value in (0, 12, 24):
        state.io.tool_voltage = value


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
            bool(state.pendant.buttons & RobotStatusBits.TEACH_BUTTON_PRESSED),
            bool(state.pendant.buttons & RobotStatusBits.POWER_BUTTON_PRESSED),
            state.safety.is_stopped,
        )[offset]
    )


def latch_clock(state: ControllerState, offset: int, value: int) -> None:
    """Remember the present time."""
    state.modbus_map.latched_tick = state.clock.tick


def clock(state: ControllerState, offset: int) -> int:
    """Read the latched time: ms, s, min, h, days since the controller started."""
    milliseconds = state.modbus_map.latched_tick * state.clock.generation.period_us // 1000
    seconds = milliseconds // 1000
    return (milliseconds % 1000, seconds % 60, seconds // 60 % 60, seconds // 3600 % 24, seconds // 86400)[
        offset
    ]


def write_gp_input(state: ControllerState, offset: int, value: int) -> None:
    """Write an input boolean."""
    state.registers.inputs.booleans[offset] = bool(value)


def write_word(state: ControllerState, offset: int, word: int) -> None:
    """Write a general purpose word."""
    state.modbus_map.words[offset] = word


TURN = 2.0 * math.pi


class MapAddressError(LookupError):
    """The map has nothing at this address."""


@dataclass(frozen=True, slots=True)
class MapRow:
    """Neighbouring addresses of one kind.

    Attributes:
        meaning: what is there, and its unit.
        read: gives the value at an offset from `first`; None where reading gives 0.
        write: takes a value there; None where nothing can be written.
    """

    first: int
    count: int
    meaning: str
    read: Reader | None = None
    write: Writer | None = None


def _analog_rows(first: int, what: str, lines: str, *, is_output: bool) -> tuple[MapRow, ...]:
    """Two lines, each a level as a part of its range and then a domain; `lines` names their list."""
    return tuple(
        row for i in (0, 1) for row in _analog_line(first + 2 * i, f"{what} {i}", lines, i, is_output)
    )


def _analog_line(first: int, what: str, lines: str, index: int, is_output: bool) -> tuple[MapRow, MapRow]:
    def line(state: ControllerState) -> AnalogLine:
        found: AnalogLine = getattr(state.io, lines)[index]
        return found

    def set_level(state: ControllerState, offset: int, value: int) -> None:
        line(state).set_ratio(value / WORD_MAX)

    return (
        MapRow(first, 1, f"{what}, part of its range", lambda s, i: float(line(s).ratio) * WORD_MAX,
            set_level if is_output else None),
        MapRow(first + 1, 1, f"its domain, {what}: 0 current, 1 voltage", lambda s, i: int(line(s).domain),
            lambda s, i, value: line(s).set_domain(value & 1)),
    )  # fmt: skip


REGISTERS: tuple[MapRow, ...] = (
    MapRow(0, 1, "digital inputs, bits 0-7 standard, 8-9 tool", lambda s, i: box_word(s.io.digital_in)),
    MapRow(1, 1, "digital outputs, same bits", lambda s, i: box_word(s.io.digital_out),
            write_bits(STANDARD_AND_TOOL)),
    MapRow(2, 1, "outputs to set", None, write_bits(STANDARD_AND_TOOL, True)),
    MapRow(3, 1, "outputs to clear", None, write_bits(STANDARD_AND_TOOL, False)),
    *_analog_rows(4, "analogue input", "analog_in", is_output=False),
    *_analog_rows(8, "tool analogue input", "tool_analog_in", is_output=False),
    *_analog_rows(16, "analogue output", "analog_out", is_output=True),
    MapRow(20, 1, "tool supply, V", lambda s, i: s.io.tool_voltage, write_tool_voltage),
    MapRow(21, 1, "tool inputs", lambda s, i: TOOL.levels(s.io.digital_in)),
    MapRow(22, 1, "tool outputs", lambda s, i: TOOL.levels(s.io.digital_out), write_bits(TOOL.bits)),
    MapRow(24, 2, "Euromap67 inputs", lambda s, i: s.io.euromap_inputs >> 16 * i),
    MapRow(26, 2, "Euromap67 outputs", lambda s, i: s.io.euromap_outputs >> 16 * i),
    MapRow(28, 2, "Euromap67 supply, V and mA; none connected"),
    MapRow(30, 1, "configurable inputs", lambda s, i: CONFIGURABLE.levels(s.io.digital_in)),
    MapRow(31, 1, "configurable outputs", lambda s, i: CONFIGURABLE.levels(s.io.digital_out),
            write_bits(CONFIGURABLE.bits)),
    MapRow(32, 1, "configurable outputs to set", None, write_bits(CONFIGURABLE.bits, True)),
    MapRow(33, 1, "configurable outputs to clear", None, write_bits(CONFIGURABLE.bits, False)),
    MapRow(34, 94, "reserved"),
    MapRow(FIRST_GENERAL, N_GENERAL, "general purpose", lambda s, i: s.modbus_map.words[i],
            write_word),
    MapRow(256, 2, "software version, major and minor", lambda s, i: s.modbus_map.version[i]),
    MapRow(258, 1, "robot mode", lambda s, i: s.past.snapshot.robot_mode),
    MapRow(260, 6, "flags, see the coils", flag),
    MapRow(266, 1, "safety mode", lambda s, i: s.past.snapshot.safety_mode),
    MapRow(270, 6, "joint angle within its turn, mrad",
            lambda s, i: s.past.snapshot.actual_q[i] % TURN * 1e3),
    MapRow(280, 6, "joint velocity, mrad/s", of_snapshot(lambda snap: snap.actual_qd, 1e3)),
    MapRow(290, 6, "joint current, mA", of_snapshot(lambda snap: snap.actual_current, 1e3)),
    MapRow(300, 6, "joint temperature, degree C", of_snapshot(lambda snap: snap.joint_temperatures)),
    MapRow(310, 6, "joint mode", of_snapshot(lambda snap: snap.joint_mode)),
    MapRow(320, 6, "turns of the joint", lambda s, i: s.past.snapshot.actual_q[i] // TURN),
    MapRow(400, 3, "TCP in base, 0.1 mm", of_snapshot(lambda snap: snap.actual_tcp_pose[:3], 1e4)),
    MapRow(403, 3, "its rotation vector, mrad", of_snapshot(lambda snap: snap.actual_tcp_pose[3:], 1e3)),
    MapRow(410, 6, "TCP speed, mm/s and mrad/s", of_snapshot(lambda snap: snap.actual_tcp_speed, 1e3)),
    MapRow(420, 6, "TCP offset, mm and mrad", of_snapshot(lambda snap: snap.tcp_offset, 1e3)),
    MapRow(450, 1, "robot current, mA", lambda s, i: s.past.snapshot.actual_robot_current * 1e3),
    MapRow(451, 1, "I/O current, mA", lambda s, i: s.past.snapshot.io_current * 1e3),
    MapRow(768, 1, "tool mode", lambda s, i: s.past.snapshot.tool_mode),
    MapRow(769, 1, "tool temperature, degree C: that of the last joint",
            lambda s, i: s.past.snapshot.tool_temperature),
    MapRow(770, 1, "tool current, mA", lambda s, i: s.past.snapshot.tool_output_current * 1e3),
    MapRow(1024, 1, "state of the user interface, reserved"),
    MapRow(2048, 1, "write anything to latch the clock", None, latch_clock),
    MapRow(2049, 5, "latched clock: ms, s, min, h, day", clock),
)  # fmt: skip

COILS: tuple[MapRow, ...] = (
    MapRow(0, 16, "digital inputs, 0-7 standard, 8-9 tool",
            lambda s, i: box_word(s.io.digital_in) >> i & 1),
    MapRow(16, 16, "digital outputs, same order",
            lambda s, i: box_word(s.io.digital_out) >> i & 1, write_bit(STANDARD_AND_TOOL)),
    MapRow(32, 16, "output to set", None, write_bit(STANDARD_AND_TOOL, True)),
    MapRow(48, 16, "output to clear", None, write_bit(STANDARD_AND_TOOL, False)),
    MapRow(64, N_EUROMAP, "Euromap67 inputs", lambda s, i: s.io.euromap_inputs >> i & 1),
    MapRow(96, N_EUROMAP, "Euromap67 outputs", lambda s, i: s.io.euromap_outputs >> i & 1),
    MapRow(128, 8, "configurable inputs", lambda s, i: CONFIGURABLE.levels(s.io.digital_in) >> i & 1),
    MapRow(136, 8, "configurable outputs", lambda s, i: CONFIGURABLE.levels(s.io.digital_out) >> i & 1,
            write_bit(CONFIGURABLE.bits)),
    MapRow(144, 8, "configurable output to set", None, write_bit(CONFIGURABLE.bits, True)),
    MapRow(152, 8, "configurable output to clear", None, write_bit(CONFIGURABLE.bits, False)),
    MapRow(260, 6, "power on, protective and emergency stop, teach and power button, any stop", flag),
    MapRow(300, N_BOOLEAN, "general purpose input booleans",
            lambda s, i: s.registers.inputs.booleans[i], write_gp_input),
    MapRow(500, N_BOOLEAN, "general purpose output booleans", lambda s, i: s.registers.outputs.booleans[i]),
)  # fmt: skip


def _by_address(rows: tuple[MapRow, ...]) -> dict[int, MapRow]:
    return {address: row for row in rows for address in range(row.first, row.first + row.count)}


_REGISTERS, _COILS = _by_address(REGISTERS), _by_address(COILS)


def _row(is_coil: bool, address: int) -> MapRow:
    row = (_COILS if is_coil else _REGISTERS).get(address)
    if row is None:
        raise MapAddressError(
            f"there is no {'bit' if is_coil else 'register'} {address} in the robot's Modbus map"
        )
    return row


def read_register(state: ControllerState, address: int) -> int:
    """Return a register, 0 to 65535; MapAddressError if there is none."""
    row = _row(False, address)
    return 0 if row.read is None else round(row.read(state, address - row.first)) & WORD_MAX


def read_coil(state: ControllerState, address: int) -> bool:
    """Return a coil; MapAddressError if there is none."""
    row = _row(True, address)
    return row.read is not None and bool(row.read(state, address - row.first))


def can_write(is_coil: bool, address: int) -> bool:
    """Whether something can be written at an address; False also where there is nothing."""
    row = (_COILS if is_coil else _REGISTERS).get(address)
    return row is not None and row.write is not None


def write(state: ControllerState, is_coil: bool, address: int, value: int) -> bool:
    """Write a coil, or a register, of which the low 16 bits count; False if it can only be read.

    MapAddressError if there is none.
    """
    row = _row(is_coil, address)
    if row.write is None:
        return False
    row.write(state, address - row.first, value & WORD_MAX)
    return True
