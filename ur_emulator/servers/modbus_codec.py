"""Modbus TCP frames by pymodbus without its I/O: bytes in, values out; no sockets, no clock.

Importing pymodbus takes some 50 ms: only `modbus_loading` imports this module, in a thread.
"""

from __future__ import annotations

import logging
import struct
from typing import NamedTuple

from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteSingleRegisterRequest,
)

from protocol.errors import RemoteProtocolError

# What the library thinks of foreign bytes is no news for the user of a box.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())

# Transaction id, protocol id, length of what follows. Source: Modbus messaging on TCP/IP, section 3.1.
_HEADER = struct.Struct(">HHH")
# Unit id and function code at least, 253 bytes of function code and data at most.
_SHORTEST, _LONGEST = 2, 254

_WHAT_DECODING_RAISES = (ModbusException, ValueError, IndexError, struct.error)
_READS: dict[int, type[ModbusPDU]] = {
    pdu.function_code: pdu
    for pdu in (
        ReadCoilsRequest,
        ReadDiscreteInputsRequest,
        ReadHoldingRegistersRequest,
        ReadInputRegistersRequest,
    )
}


class Frame(NamedTuple):
    """One frame.

    Attributes:
        transaction: number by which request and answer find each other.
        slave: number of the unit behind the address.
        pdu: function code and data, at least one byte.
    """

    transaction: int
    slave: int
    pdu: bytes


class ModbusCodec:
    """Makes and takes apart frames; has no state."""

    def __init__(self) -> None:
        self._answers = DecodePDU(is_server=False)
        self._framer = FramerSocket(self._answers)

    def take_frame(self, inbox: bytearray) -> Frame | None:
        """Take the first frame out of the bytes that have come; None if it is not whole yet.

        Raises:
            RemoteProtocolError: they are no frames; where the next one begins cannot be known.
        """
        if len(inbox) < _HEADER.size:
            return None
        _, protocol, length = _HEADER.unpack_from(inbox)
        if protocol or not _SHORTEST <= length <= _LONGEST:
            raise RemoteProtocolError("no Modbus TCP")
        size, slave, transaction, pdu = self._framer.decode(bytes(inbox[: _HEADER.size + length]))
        if not size:
            return None
        del inbox[:size]
        return Frame(transaction, slave, pdu)

    def read_one(self, function: int, slave: int, address: int, transaction: int) -> bytes:
        """Return the request for one coil or register."""
        return self._framer.buildFrame(
            _READS[function](dev_id=slave, transaction_id=transaction, address=address, count=1)
        )

    def write_coil(self, slave: int, address: int, value: int, transaction: int) -> bytes:
        """Return the request that switches a coil."""
        return self._framer.buildFrame(
            WriteSingleCoilRequest(
                dev_id=slave, transaction_id=transaction, address=address, bits=[bool(value)]
            )
        )

    def write_register(self, slave: int, address: int, value: int, transaction: int) -> bytes:
        """Return the request that writes a register."""
        return self._framer.buildFrame(
            WriteSingleRegisterRequest(
                dev_id=slave, transaction_id=transaction, address=address, registers=[value]
            )
        )

    def own_request(self, function: int, slave: int, data: bytes, transaction: int) -> bytes:
        """Return a request of any kind."""
        return self._framer.encode(bytes([function]) + data, slave, transaction)

    def answer(self, pdu: bytes) -> ModbusPDU | None:
        """Return an answer decoded; None if it makes no sense."""
        try:
            return self._answers.decode(pdu)
        except _WHAT_DECODING_RAISES:
            return None
