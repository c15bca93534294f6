"""The requests that signals need, and the values of their answers.

Source: UR3 user manual CB3, section "MODBUS client I/O setup": functions by type, names of the exceptions;
script manual e-Series 5.2x, modbus_add_signal and modbus_add_rw_signal: functions of several addresses.
"""

from __future__ import annotations

from dataclasses import dataclass

from protocol.modbus import (
    EXCEPTION_BIT,
    ExceptionCode,
    ModbusFunction,
    encode_read,
    encode_read_write,
    encode_write,
)
from ur_emulator.controller.io.modbus_signals import ModbusSignal, SignalType

_READ = {
    SignalType.DIGITAL_INPUT: ModbusFunction.READ_DISCRETE_INPUTS,
    SignalType.DIGITAL_OUTPUT: ModbusFunction.READ_COILS,
    SignalType.REGISTER_INPUT: ModbusFunction.READ_INPUT_REGISTERS,
    SignalType.REGISTER_OUTPUT: ModbusFunction.READ_HOLDING_REGISTERS,
}
_WRITE_ONE = {
    SignalType.DIGITAL_OUTPUT: ModbusFunction.WRITE_COIL,
    SignalType.REGISTER_OUTPUT: ModbusFunction.WRITE_REGISTER,
}
_WRITE = {
    SignalType.DIGITAL_OUTPUT: ModbusFunction.WRITE_COILS,
    SignalType.REGISTER_OUTPUT: ModbusFunction.WRITE_REGISTERS,
}


@dataclass(slots=True)
class SentRequest:
    """A request that waits for its answer.

    Attributes:
        signal: for which it was sent; None if its answer is not used.
        pdu: function code and data.
        sent_at: monotonic time [s].
    """

    signal: ModbusSignal | None
    pdu: bytes
    sent_at: float


def request_for(signal: ModbusSignal) -> bytes:
    """Return the request that a signal needs: write its output if a program has set it, else read."""
    if signal.output is None:
        return encode_read(_READ[signal.type.single], signal.address, signal.count)
    if signal.reads_back:
        return encode_read_write(signal.address, signal.count, signal.write_address, signal.output)
    is_one = signal.count == 1 and signal.type in _WRITE_ONE
    function = _WRITE_ONE[signal.type] if is_one else _WRITE[signal.type.single]
    return encode_write(function, signal.address, signal.output)


def error_of(answer: bytes, request: bytes) -> int:
    """Return the code of an answer that has no value: of its exception, or of a failure of the server."""
    is_exception = answer[0] == request[0] | EXCEPTION_BIT and len(answer) > 1
    return answer[1] if is_exception else ExceptionCode.SLAVE_DEVICE_FAILURE


def problem_of(answer: bytes, request: bytes) -> str:
    """Return what is wrong with an answer that has no value."""
    if answer[0] == request[0] | EXCEPTION_BIT and len(answer) > 1:
        code = answer[1]
        known = code in ExceptionCode.__members__.values()
        name = ExceptionCode(code).name.lower().replace("_", " ") if known else "unknown"
        return f"answers with exception E{code} ({name})"
    return "gives an answer that makes no sense"
