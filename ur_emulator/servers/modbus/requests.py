"""What is asked of a Modbus unit for a signal, and what its answer says.

Source: UR3 user manual CB3, section "MODBUS client I/O setup": functions by type, names of the exceptions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ur_emulator.controller.modbus.signals import ModbusSignal, SignalType

if TYPE_CHECKING:
    from ur_emulator.servers.modbus.codec import ModbusCodec

READ_FUNCTION = {
    SignalType.DIGITAL_INPUT: 2,
    SignalType.DIGITAL_OUTPUT: 1,
    SignalType.REGISTER_INPUT: 4,
    SignalType.REGISTER_OUTPUT: 3,
}
WRITE_FUNCTION = {SignalType.DIGITAL_OUTPUT: 5, SignalType.REGISTER_OUTPUT: 6}
EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "slave device failure",
    5: "acknowledge",
    6: "slave device busy",
}
# Set in the function code of an answer that is an exception.
_IS_EXCEPTION = 0x80


@dataclass(slots=True)
class Request:
    """A request that waits for its answer.

    Attributes:
        signal: for which it was sent; None if nobody reads the answer.
        function: its code.
        written: value that it writes, None if it reads.
        sent_at: monotonic time [s].
    """

    signal: ModbusSignal | None
    function: int
    written: int | None
    sent_at: float


def request_for(
    codec: ModbusCodec, signal: ModbusSignal, transaction: int, now: float
) -> tuple[Request, bytes]:
    """Return the request that a signal needs, and its bytes: write its output if it has one, else read."""
    value = signal.output
    if value is None:
        function = READ_FUNCTION[signal.type]
        frame = codec.read_one(function, signal.slave, signal.address, transaction)
    else:
        function = WRITE_FUNCTION[signal.type]
        write = codec.write_coil if signal.type.is_digital else codec.write_register
        frame = write(signal.slave, signal.address, value, transaction)
    return Request(signal, function, value, now), frame


def value_of_answer(codec: ModbusCodec, pdu: bytes, signal: ModbusSignal, request: Request) -> int | None:
    """Return the value that an answer gives or confirms; None if it does neither."""
    answer = codec.answer(pdu)
    if answer is None or answer.function_code != request.function:
        return None
    values = answer.bits if signal.type.is_digital else answer.registers
    if request.written is not None:
        is_echo = answer.address == signal.address and int(values[0]) == request.written
        return request.written if is_echo else None
    # One bit comes as a byte of eight.
    return int(values[0]) if len(values) == (8 if signal.type.is_digital else 1) else None


def complaint(pdu: bytes, function: int) -> str:
    """Say what is wrong with an answer that gave no value."""
    if pdu[0] == function | _IS_EXCEPTION and len(pdu) > 1:
        return f"answers with exception E{pdu[1]} ({EXCEPTIONS.get(pdu[1], 'unknown')})"
    return "gives an answer that makes no sense"
