"""Modbus TCP: frames, the requests of functions 1 to 6, 15, 16 and 23, their answers, and exceptions.

    frame: u16 transaction | u16 protocol = 0 | u16 length of what follows | u8 unit | PDU       big-endian
    PDU:   u8 function code | data, at most 253 bytes together

| function              | request                          | answer                   |
|-----------------------|----------------------------------|--------------------------|
| 1, 2 read bits        | u16 address, u16 count           | u8 size, 8 bits a byte   |
| 3, 4 read registers   | u16 address, u16 count           | u8 size, u16 values      |
| 5 write a bit         | u16 address, u16 0xFF00 or 0     | the request              |
| 6 write a register    | u16 address, u16 value           | the request              |
| 15, 16 write several  | u16 address, u16 count, u8 size, values | u16 address, u16 count |
| 23 write, then read   | u16 address, u16 count (twice), u8 size, values | u8 size, u16 values |
| an exception          |                                  | code of the function + 0x80, u8 exception code |

Sources: Modbus application protocol V1.1b3, sections 4.1, 6 and 7; Modbus messaging on TCP/IP V1.0b,
section 3.1.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from protocol.errors import RemoteProtocolError

__all__ = [
    "EXCEPTION_BIT",
    "ExceptionCode",
    "ModbusFrame",
    "ModbusFunction",
    "ModbusRequest",
    "ModbusRequestError",
    "decode_request",
    "decode_values",
    "encode_answer",
    "encode_exception",
    "encode_frame",
    "encode_read",
    "encode_read_write",
    "encode_write",
    "take_frame",
]

EXCEPTION_BIT = 0x80
"""Set in the function code of an answer that is an exception."""

_HEADER = struct.Struct(">HHH")
_MIN_LENGTH, _MAX_LENGTH = 2, 254
"""What the length field may say: unit and function code at least."""
_SHORT = struct.Struct(">BHH")
_ON = 0xFF00
_ADDRESSES = 0x10000


class ModbusFunction(IntEnum):
    """Function codes."""

    READ_COILS = 1
    READ_DISCRETE_INPUTS = 2
    READ_HOLDING_REGISTERS = 3
    READ_INPUT_REGISTERS = 4
    WRITE_COIL = 5
    WRITE_REGISTER = 6
    WRITE_COILS = 15
    WRITE_REGISTERS = 16
    READ_WRITE_REGISTERS = 23

    @property
    def is_bits(self) -> bool:
        """Whether it is about bits; otherwise about registers."""
        return self in _BIT_FUNCTIONS

    @property
    def is_read(self) -> bool:
        """Whether it reads."""
        return self <= ModbusFunction.READ_INPUT_REGISTERS

    @property
    def is_single_write(self) -> bool:
        """Whether it writes one address; the answer repeats the request."""
        return self in (ModbusFunction.WRITE_COIL, ModbusFunction.WRITE_REGISTER)

    @property
    def max_count(self) -> int:
        """Most addresses of one request; of the functions that a server has."""
        return _MAX_COUNTS[self]

    def size(self, count: int) -> int:
        """Return the number of bytes of `count` values."""
        return (count + 7) // 8 if self.is_bits else 2 * count


_BIT_FUNCTIONS = frozenset({1, 2, 5, 15})
_MAX_COUNTS = {1: 2000, 2: 2000, 3: 125, 4: 125, 5: 1, 6: 1, 15: 0x7B0, 16: 0x7B}


class ExceptionCode(IntEnum):
    """Why a request is refused."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_DATA_ADDRESS = 2
    ILLEGAL_DATA_VALUE = 3
    SLAVE_DEVICE_FAILURE = 4
    ACKNOWLEDGE = 5
    SLAVE_DEVICE_BUSY = 6


class ModbusRequestError(Exception):
    """A request that is answered with an exception."""

    def __init__(self, code: ExceptionCode) -> None:
        super().__init__(f"Modbus exception {code.value}: {code.name}")
        self.code = code


class ModbusFrame(NamedTuple):
    """One frame.

    Attributes:
        transaction: number by which request and answer find each other, 0 to 65535.
        unit: number of the unit behind the address, 0 to 255.
        pdu: function code and data, 1 to 253 bytes.
    """

    transaction: int
    unit: int
    pdu: bytes


@dataclass(frozen=True, slots=True)
class ModbusRequest:
    """A request to read or write neighbouring addresses, at least one from the lowest; none is above 65535.

    The values are those to write, 0 or 1 for a bit; empty for a read.
    """

    function: ModbusFunction
    address: int
    count: int
    values: tuple[int, ...] = ()


def encode_frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    """Return the bytes of a frame."""
    return _HEADER.pack(transaction, 0, 1 + len(pdu)) + bytes((unit,)) + pdu


def take_frame(inbox: bytearray) -> ModbusFrame | None:
    """Take the first frame out of received bytes; None while it is not complete.

    RemoteProtocolError: the bytes are not Modbus TCP; the next frame cannot be found.
    """
    if len(inbox) < _HEADER.size:
        return None
    transaction, protocol, length = _HEADER.unpack_from(inbox)
    if protocol or not _MIN_LENGTH <= length <= _MAX_LENGTH:
        raise RemoteProtocolError(
            f"Modbus header with protocol {protocol} and length {length}: allowed are protocol 0 and "
            f"lengths from {_MIN_LENGTH} to {_MAX_LENGTH}"
        )
    end = _HEADER.size + length
    if len(inbox) < end:
        return None
    unit, pdu = inbox[_HEADER.size], bytes(inbox[_HEADER.size + 1 : end])
    del inbox[:end]
    return ModbusFrame(transaction, unit, pdu)


# --- PDUs of a client


def encode_read(function: ModbusFunction, address: int, count: int = 1) -> bytes:
    """Return the request that reads neighbouring addresses."""
    return _SHORT.pack(function, address, count)


def encode_write(function: ModbusFunction, address: int, values: Sequence[int]) -> bytes:
    """Return the request that writes one value (functions 5 and 6) or several (15 and 16)."""
    if function.is_single_write:
        (value,) = values
        return _SHORT.pack(function, address, _ON * bool(value) if function.is_bits else value)
    return _SHORT.pack(function, address, len(values)) + _packed(function, values)


def encode_read_write(address: int, count: int, write_address: int, values: Sequence[int]) -> bytes:
    """Return the request that writes some registers and reads others."""
    function = ModbusFunction.READ_WRITE_REGISTERS
    places = struct.pack(">HHHH", address, count, write_address, len(values))
    return bytes((function,)) + places + _packed(function, values)


def decode_values(request: bytes, answer: bytes) -> tuple[int, ...] | None:
    """Return the values that the PDU of an answer reads or confirms; None if it answers another request."""
    function = ModbusFunction(request[0])
    _, _, word = _SHORT.unpack_from(request)
    if function.is_single_write:
        return _written(function, word, 1, b"") if answer == request else None
    if function in (ModbusFunction.WRITE_COILS, ModbusFunction.WRITE_REGISTERS):
        is_right = answer == request[: _SHORT.size]
        return _written(function, word, word, request[_SHORT.size + 1 :]) if is_right else None
    size = function.size(word)
    if answer[:2] != bytes((function, size)) or len(answer) != 2 + size:
        return None
    return _unpacked(function, word, answer[2:])


# --- PDUs of a server


def decode_request(pdu: bytes) -> ModbusRequest:
    """Return a request decoded.

    ModbusRequestError: the function is unknown, or count, sizes, values or addresses are not allowed.
    """
    if pdu[0] not in _MAX_COUNTS:
        raise ModbusRequestError(ExceptionCode.ILLEGAL_FUNCTION)
    function = ModbusFunction(pdu[0])
    if len(pdu) < _SHORT.size:
        raise ModbusRequestError(ExceptionCode.ILLEGAL_DATA_VALUE)
    _, address, word = _SHORT.unpack_from(pdu)
    data = pdu[_SHORT.size :]
    count = 1 if function.is_single_write else word
    size = 0 if function.is_read or function.is_single_write else 1 + function.size(count)
    if (
        not 1 <= count <= function.max_count
        or len(data) != size
        or (size and data[0] != size - 1)
        or (function is ModbusFunction.WRITE_COIL and word not in (0, _ON))
    ):
        raise ModbusRequestError(ExceptionCode.ILLEGAL_DATA_VALUE)
    if address + count > _ADDRESSES:
        raise ModbusRequestError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
    return ModbusRequest(function, address, count, _written(function, word, count, data[1:]))


def _written(function: ModbusFunction, word: int, count: int, data: bytes) -> tuple[int, ...]:
    """Return the values that a request writes."""
    match function:
        case ModbusFunction.WRITE_COIL:
            return (int(word == _ON),)
        case ModbusFunction.WRITE_REGISTER:
            return (word,)
        case ModbusFunction.WRITE_COILS | ModbusFunction.WRITE_REGISTERS:
            return _unpacked(function, count, data)
        case _:
            return ()


def _packed(function: ModbusFunction, values: Sequence[int]) -> bytes:
    """Return several values as they travel, with their size before them."""
    size = function.size(len(values))
    if function.is_bits:
        data = sum(bool(value) << i for i, value in enumerate(values)).to_bytes(size, "little")
    else:
        data = struct.pack(f">{len(values)}H", *values)
    return bytes((size,)) + data


def _unpacked(function: ModbusFunction, count: int, data: bytes) -> tuple[int, ...]:
    if function.is_bits:
        bits = int.from_bytes(data, "little")
        return tuple(bits >> i & 1 for i in range(count))
    return struct.unpack(f">{count}H", data)


def encode_answer(request: ModbusRequest, values: Sequence[int] = ()) -> bytes:
    """Return the answer to a request that was done, with what was read, one value for each address."""
    function = request.function
    if function.is_single_write:
        return encode_write(function, request.address, request.values)
    if not function.is_read:
        return _SHORT.pack(function, request.address, request.count)
    return bytes((function,)) + _packed(function, values)


def encode_exception(function: int, code: ExceptionCode) -> bytes:
    """Return the answer that refuses a request; `function` is the code as it came."""
    return bytes((function | EXCEPTION_BIT, code))
