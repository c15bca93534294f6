"""Modbus on a serial line: frames with a unit and a checksum; their lengths stand in place of a header.

    frame: u8 unit | PDU | u16 CRC, low byte first

A line has no header that says how long a frame is; pauses end one. Through a forwarder there are no pauses:
the length of a request follows from its function (`protocol.modbus`). Bytes that are no request of a known
function, or whose checksum is wrong, are dropped with all that waits behind them, as a slave waits for the
next pause. Source: Modbus over serial line V1.02, sections 2.5 and 6.2.
"""

import struct
from typing import NamedTuple

from protocol.modbus import ExceptionCode, ModbusFunction, ModbusRequest, ModbusRequestError

__all__ = ["RtuFrame", "crc16", "decode_read_write", "encode_rtu", "take_request"]

MOST_WAITING = 1024
"""More bytes than this are never kept."""

_SHORT, _SIZE_AT = 8, {ModbusFunction.WRITE_COILS: 6, ModbusFunction.WRITE_REGISTERS: 6, 23: 10}
_BROADCAST = 0


class RtuFrame(NamedTuple):
    """A frame: the number of the unit, and function code with data."""

    unit: int
    pdu: bytes


def crc16(data: bytes) -> int:
    """Return the checksum of Modbus over some bytes; it is sent low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def encode_rtu(unit: int, pdu: bytes) -> bytes:
    """Return the bytes of a frame."""
    body = bytes((unit,)) + pdu
    return body + struct.pack("<H", crc16(body))


def take_request(inbox: bytearray) -> RtuFrame | None:
    """Take the first request out of received bytes; None while none is complete."""
    while len(inbox) >= 2:
        size = _size(inbox)
        if size is None:
            return None
        if size == 0 or crc16(bytes(inbox[: size - 2])) != struct.unpack_from("<H", inbox, size - 2)[0]:
            inbox.clear()
            return None
        frame = RtuFrame(inbox[0], bytes(inbox[1 : size - 2]))
        del inbox[:size]
        return frame
    return None


def _size(inbox: bytearray) -> int | None:
    """Bytes of the frame at the beginning; None while they have not come, 0 if that is no request."""
    function = inbox[1]
    size_at = _SIZE_AT.get(function)
    if size_at is None:
        size = _SHORT if 1 <= function <= 6 else 0
    elif len(inbox) <= size_at:
        return None
    else:
        size = size_at + 1 + inbox[size_at] + 2
    return size if len(inbox) >= size else None


def decode_read_write(pdu: bytes) -> tuple[ModbusRequest, ModbusRequest]:
    """Return what a request of function 23 reads, and what it writes before.

    Raises:
        ModbusRequestError: counts, sizes or addresses are not allowed.
    """
    if len(pdu) < 10:
        raise ModbusRequestError(ExceptionCode.ILLEGAL_DATA_VALUE)
    _, address, count, write_address, write_count, size = struct.unpack_from(">BHHHHB", pdu)
    values = pdu[10:]
    if not (1 <= count <= 0x7D and 1 <= write_count <= 0x79 and size == len(values) == 2 * write_count):
        raise ModbusRequestError(ExceptionCode.ILLEGAL_DATA_VALUE)
    return (
        ModbusRequest(ModbusFunction.READ_HOLDING_REGISTERS, address, count),
        ModbusRequest(
            ModbusFunction.WRITE_REGISTERS,
            write_address,
            write_count,
            struct.unpack(f">{write_count}H", values),
        ),
    )
