"""The robot's Modbus map as two tables: registers and coils, read from and written to the controller's state.

Scripts reach it with `read_port_register` and its kin, Modbus clients by port 502. To add an address: add a
row. Registers are words of 16 bits, signed values in two's complement.
Source: UR "Modbus server" article and its register table (protocol notes, section 9). Joint angles count up
from 0 to one turn, the turns beside them: UR forum, thread 641. Analogue levels are taken as parts of
the range of their domain, and the clock as the time since the controller started: chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from protocol.ur_types import SafetyMode
from ur_emulator.controller.cycle import PERIOD_US
from ur_emulator.controller.euromap import N_EUROMAP
from ur_emulator.controller.io import CONFIGURABLE_SHIFT, N_CONFIGURABLE, N_STANDARD, N_TOOL, TOOL_SHIFT
from ur_emulator.controller.port_memory import FIRST_GENERAL, N_GENERAL
from ur_emulator.controller.registers import N_BOOLEAN
from ur_emulator.controller.robot_mode import POWERED
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.controller.state import ControllerState

WORD_MAX = 0xFFFF
# Bits of the box and the tool side by side: 0-7 standard, 8-9 tool.
N_BOX_BITS = N_STANDARD + N_TOOL
TURN = 2.0 * math.pi

Reader = Callable[[ControllerState, int], float]
Writer = Callable[[ControllerState, int, int], None]


class PortAddressError(LookupError):
    """There is nothing at an address of the map."""


@dataclass(frozen=True, slots=True)
class PortRow:
    """Neighbouring addresses of one kind.

    Attributes:
        first: lowest address.
        count: how many addresses.
        meaning: what is there, and its unit.
        read: gives the value at an offset from `first`; None where reading gives 0.
        write: takes a value there; None where nothing can be written.
    """

    first: int
    count: int
    meaning: str
    read: Reader | None = None
    write: Writer | None = None


# --- digital lines


def _box_word(word: int) -> int:
    return word & (1 << N_STANDARD) - 1 | (word >> TOOL_SHIFT & (1 << N_TOOL) - 1) << N_STANDARD


def _box_bit(offset: int) -> int:
    """Return the bit of the digital word for a bit of the map: 0-7 standard, 8-9 tool."""
    return offset if offset < N_STANDARD else offset - N_STANDARD + TOOL_SHIFT


def _write_bits(bit_of: Callable[[int], int], size: int, forced: bool | None = None) -> Writer:
    """Write outputs from a word; with `forced`, only those whose bit is set, to that value."""

    def write(state: ControllerState, offset: int, value: int) -> None:
        for i in range(size):
            is_set = bool(value >> i & 1)
            if forced is None or is_set:
                state.io.write_digital_out(bit_of(i), is_set if forced is None else forced)

    return write


def _write_bit(bit_of: Callable[[int], int], size: int, forced: bool | None = None) -> Writer:
    """Write one output from a coil; with `forced`, only when the coil is written True, to that value."""

    def write(state: ControllerState, offset: int, value: int) -> None:
        if offset < size and (forced is None or value):
            state.io.write_digital_out(bit_of(offset), bool(value) if forced is None else forced)

    return write


def _in_bit(state: ControllerState, offset: int) -> int:
    return _box_word(state.io.digital_in) >> offset & 1


def _out_bit(state: ControllerState, offset: int) -> int:
    return _box_word(state.io.digital_out) >> offset & 1


def _configurable(word: int) -> int:
    return word >> CONFIGURABLE_SHIFT & (1 << N_CONFIGURABLE) - 1


def _configurable_bit(offset: int) -> int:
    return CONFIGURABLE_SHIFT + offset


def _tool_bit(offset: int) -> int:
    return TOOL_SHIFT + offset


def _tool_word(word: int) -> int:
    return word >> TOOL_SHIFT & (1 << N_TOOL) - 1


# --- analogue lines: a level and a domain, in turn


def _analog_rows(first: int, what: str, lines: str, *, is_output: bool) -> tuple[PortRow, ...]:
    def level(state: ControllerState, offset: int) -> float:
        return (
            getattr(state.io, lines)[offset // 2].ratio * WORD_MAX
            if offset % 2 == 0
            else domain(state, offset)
        )

    def domain(state: ControllerState, offset: int) -> int:
        return int(getattr(state.io, lines)[offset // 2].domain)

    def write(state: ControllerState, offset: int, value: int) -> None:
        line = getattr(state.io, lines)[offset // 2]
        if offset % 2:
            line.set_domain(value & 1)
        elif is_output:
            line.set_ratio(value / WORD_MAX)

    return (PortRow(first, 4, f"{what} 0 and 1: level, then domain (0 current, 1 voltage)", level, write),)


def _write_tool_voltage(state: ControllerState, offset: int, value: int) -> None:
    if value in (0, 12, 24):
        state.io.tool_voltage = value


# --- state of the robot


def _of_snapshot(values: Callable[[Snapshot], tuple[float, ...]], scale: float = 1.0) -> Reader:
    return lambda state, offset: values(state.snapshot)[offset] * scale


def _flag(state: ControllerState, offset: int) -> int:
    """Registers and coils 260-265: power, protective stop, emergency stop, two buttons, any safety stop."""
    safety = state.safety.mode
    is_emergency = safety in (SafetyMode.SYSTEM_EMERGENCY_STOP, SafetyMode.ROBOT_EMERGENCY_STOP)
    return int(
        (
            state.mode.mode in POWERED,
            safety is SafetyMode.PROTECTIVE_STOP,
            is_emergency,
            False,
            False,
            state.safety.is_stopped,
        )[offset]
    )


def _latch_clock(state: ControllerState, offset: int, value: int) -> None:
    state.ports.latched_tick = state.tick


def _clock(state: ControllerState, offset: int) -> int:
    milliseconds = state.ports.latched_tick * PERIOD_US // 1000
    seconds = milliseconds // 1000
    return (milliseconds % 1000, seconds % 60, seconds // 60 % 60, seconds // 3600 % 24, seconds // 86400)[
        offset
    ]


def _write_general(state: ControllerState, offset: int, value: int) -> None:
    state.ports.words[offset] = value


def _write_gp_input(state: ControllerState, offset: int, value: int) -> None:
    state.registers.inputs.booleans[offset] = bool(value)


REGISTERS: tuple[PortRow, ...] = (
    PortRow(0, 1, "digital inputs, bits 0-7 standard, 8-9 tool", lambda s, i: _box_word(s.io.digital_in)),
    PortRow(1, 1, "digital outputs, same bits", lambda s, i: _box_word(s.io.digital_out),
            _write_bits(_box_bit, N_BOX_BITS)),
    PortRow(2, 1, "outputs to set", None, _write_bits(_box_bit, N_BOX_BITS, True)),
    PortRow(3, 1, "outputs to clear", None, _write_bits(_box_bit, N_BOX_BITS, False)),
    *_analog_rows(4, "analogue inputs", "analog_in", is_output=False),
    *_analog_rows(8, "tool analogue inputs", "tool_analog_in", is_output=False),
    *_analog_rows(16, "analogue outputs", "analog_out", is_output=True),
    PortRow(20, 1, "tool supply, V", lambda s, i: s.io.tool_voltage, _write_tool_voltage),
    PortRow(21, 1, "tool inputs", lambda s, i: _tool_word(s.io.digital_in)),
    PortRow(22, 1, "tool outputs", lambda s, i: _tool_word(s.io.digital_out), _write_bits(_tool_bit, N_TOOL)),
    PortRow(24, 2, "Euromap67 inputs", lambda s, i: s.io.euromap.inputs >> 16 * i),
    PortRow(26, 2, "Euromap67 outputs", lambda s, i: s.io.euromap.outputs >> 16 * i),
    PortRow(28, 2, "Euromap67 supply, V and mA; none connected"),
    PortRow(30, 1, "configurable inputs", lambda s, i: _configurable(s.io.digital_in)),
    PortRow(31, 1, "configurable outputs", lambda s, i: _configurable(s.io.digital_out),
            _write_bits(_configurable_bit, N_CONFIGURABLE)),
    PortRow(32, 1, "configurable outputs to set", None, _write_bits(_configurable_bit, N_CONFIGURABLE, True)),
    PortRow(33, 1, "configurable outputs to clear", None,
            _write_bits(_configurable_bit, N_CONFIGURABLE, False)),
    PortRow(34, 94, "reserved"),
    PortRow(FIRST_GENERAL, N_GENERAL, "general purpose", lambda s, i: s.ports.words[i], _write_general),
    PortRow(256, 2, "software version, major and minor", lambda s, i: s.ports.version[i]),
    PortRow(258, 1, "robot mode", lambda s, i: s.snapshot.robot_mode),
    PortRow(260, 6, "flags, see the coils", _flag),
    PortRow(266, 1, "safety mode", lambda s, i: s.snapshot.safety_mode),
    PortRow(270, 6, "joint angle within its turn, mrad", lambda s, i: s.snapshot.actual_q[i] % TURN * 1e3),
    PortRow(280, 6, "joint velocity, mrad/s", _of_snapshot(lambda snap: snap.actual_qd, 1e3)),
    PortRow(290, 6, "joint current, mA", _of_snapshot(lambda snap: snap.actual_current, 1e3)),
    PortRow(300, 6, "joint temperature, degree C", _of_snapshot(lambda snap: snap.joint_temperatures)),
    PortRow(310, 6, "joint mode", _of_snapshot(lambda snap: snap.joint_mode)),
    PortRow(320, 6, "turns of the joint", lambda s, i: s.snapshot.actual_q[i] // TURN),
    PortRow(400, 3, "TCP in base, 0.1 mm", _of_snapshot(lambda snap: snap.actual_tcp_pose[:3], 1e4)),
    PortRow(403, 3, "its rotation vector, mrad", _of_snapshot(lambda snap: snap.actual_tcp_pose[3:], 1e3)),
    PortRow(410, 6, "TCP speed, mm/s and mrad/s", _of_snapshot(lambda snap: snap.actual_tcp_speed, 1e3)),
    PortRow(420, 6, "TCP offset, mm and mrad", _of_snapshot(lambda snap: snap.tcp_offset, 1e3)),
    PortRow(450, 1, "robot current, mA", lambda s, i: s.snapshot.actual_robot_current * 1e3),
    PortRow(451, 1, "I/O current, mA; no loads"),
    PortRow(768, 1, "tool mode", lambda s, i: s.snapshot.joint_mode[-1]),
    PortRow(769, 1, "tool temperature, degree C: that of the last joint",
            lambda s, i: s.snapshot.joint_temperatures[-1]),
    PortRow(770, 1, "tool current, mA; no electrical tool"),
    PortRow(1024, 1, "state of the user interface, reserved"),
    PortRow(2048, 1, "write anything to latch the clock", None, _latch_clock),
    PortRow(2049, 5, "latched clock: ms, s, min, h, day", _clock),
)  # fmt: skip

COILS: tuple[PortRow, ...] = (
    PortRow(0, 16, "digital inputs, 0-7 standard, 8-9 tool", _in_bit),
    PortRow(16, 16, "digital outputs, same order", _out_bit, _write_bit(_box_bit, N_BOX_BITS)),
    PortRow(32, 16, "output to set", None, _write_bit(_box_bit, N_BOX_BITS, True)),
    PortRow(48, 16, "output to clear", None, _write_bit(_box_bit, N_BOX_BITS, False)),
    PortRow(64, N_EUROMAP, "Euromap67 inputs", lambda s, i: s.io.euromap.read_input(i)),
    PortRow(96, N_EUROMAP, "Euromap67 outputs", lambda s, i: s.io.euromap.read_output(i)),
    PortRow(128, 8, "configurable inputs", lambda s, i: _configurable(s.io.digital_in) >> i & 1),
    PortRow(136, 8, "configurable outputs", lambda s, i: _configurable(s.io.digital_out) >> i & 1,
            _write_bit(_configurable_bit, N_CONFIGURABLE)),
    PortRow(144, 8, "configurable output to set", None, _write_bit(_configurable_bit, N_CONFIGURABLE, True)),
    PortRow(152, 8, "configurable output to clear", None,
            _write_bit(_configurable_bit, N_CONFIGURABLE, False)),
    PortRow(260, 6, "power on, protective and emergency stop, teach and power button, any stop", _flag),
    PortRow(300, N_BOOLEAN, "general purpose input booleans",
            lambda s, i: s.registers.inputs.booleans[i], _write_gp_input),
    PortRow(500, N_BOOLEAN, "general purpose output booleans", lambda s, i: s.registers.outputs.booleans[i]),
)  # fmt: skip


def _by_address(rows: tuple[PortRow, ...]) -> dict[int, PortRow]:
    return {address: row for row in rows for address in range(row.first, row.first + row.count)}


_REGISTER_AT = _by_address(REGISTERS)
_COIL_AT = _by_address(COILS)


def _row(rows: dict[int, PortRow], what: str, address: int) -> PortRow:
    row = rows.get(address)
    if row is None:
        raise PortAddressError(f"there is no {what} {address} in the robot's Modbus map")
    return row


def read_register(state: ControllerState, address: int) -> int:
    """Return a register, 0 to 65535.

    Raises:
        PortAddressError: there is none at this address.
    """
    row = _row(_REGISTER_AT, "register", address)
    return 0 if row.read is None else round(row.read(state, address - row.first)) & WORD_MAX


def write_register(state: ControllerState, address: int, value: int) -> bool:
    """Write a register, of which the low 16 bits count; False if it can only be read.

    Raises:
        PortAddressError: there is none at this address.
    """
    return _write(_row(_REGISTER_AT, "register", address), state, address, value & WORD_MAX)


def read_coil(state: ControllerState, address: int) -> bool:
    """Return a coil.

    Raises:
        PortAddressError: there is none at this address.
    """
    row = _row(_COIL_AT, "bit", address)
    return row.read is not None and bool(row.read(state, address - row.first))


def write_coil(state: ControllerState, address: int, value: bool) -> bool:
    """Write a coil; False if it can only be read.

    Raises:
        PortAddressError: there is none at this address.
    """
    return _write(_row(_COIL_AT, "bit", address), state, address, value)


def _write(row: PortRow, state: ControllerState, address: int, value: int) -> bool:
    if row.write is None:
        return False
    row.write(state, address - row.first, value)
    return True
