"""Modbus TCP frames by pymodbus without its I/O: bytes in, values out; no sockets, no clock.

Importing pymodbus takes some 50 ms: only `modbus_loading` imports this module, in a thread.
"""

from __future__ import annotations

import logging
import struct

from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.bit_message import (
    ReadCoilsRequest,
    ReadCoilsResponse,
    ReadDiscreteInputsRequest,
    ReadDiscreteInputsResponse,
    WriteMultipleCoilsResponse,
    WriteSingleCoilRequest,
)
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadHoldingRegistersResponse,
    ReadInputRegistersRequest,
    ReadInputRegistersResponse,
    WriteMultipleRegistersResponse,
    WriteSingleRegisterRequest,
)

from protocol.errors import RemoteProtocolError
from ur_emulator.servers.modbus.messages import (
    COIL_FUNCTIONS,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    MULTIPLE_WRITES,
    READ_FUNCTIONS,
    SINGLE_WRITES,
    Frame,
    MapRequest,
    RefusedError,
)

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
_READ_RESPONSES: dict[int, type[ModbusPDU]] = {
    pdu.function_code: pdu
    for pdu in (
        ReadCoilsResponse,
        ReadDiscreteInputsResponse,
        ReadHoldingRegistersResponse,
        ReadInputRegistersResponse,
    )
}
# Most addresses that one request writes. Source: Modbus application protocol, sections 6.11 and 6.12.
_MAX_WRITTEN = {15: 0x7B0, 16: 0x7B}
# Function code, address and count or value.
_SHORT_REQUEST = 5
# The two values of a coil in a request for one.
_COIL_VALUES = (b"\0\0", b"\xff\0")


class ModbusCodec:
    """Makes and takes apart frames; has no state."""

    def __init__(self) -> None:
        self._answers = DecodePDU(is_server=False)
        self._requests = DecodePDU(is_server=True)
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

    # --- as a server

    def request(self, pdu: bytes) -> MapRequest:
        """Return a request decoded.

        Raises:
            RefusedError: it is none that a map of coils and registers knows, or not well formed.
        """
        function = pdu[0]
        if function not in READ_FUNCTIONS | SINGLE_WRITES | MULTIPLE_WRITES:
            raise RefusedError(ILLEGAL_FUNCTION)
        try:
            request = self._requests.decode(pdu)
        except _WHAT_DECODING_RAISES:
            request = None
        if request is None or not _is_well_formed(pdu, request):
            raise RefusedError(ILLEGAL_VALUE)
        values: tuple[int, ...] = ()
        if function not in READ_FUNCTIONS:
            values = tuple(map(int, request.bits if function in COIL_FUNCTIONS else request.registers))
        count = len(values) or request.count
        if request.address + count > 0x10000:
            raise RefusedError(ILLEGAL_ADDRESS)
        return MapRequest(function, request.address, count, values)

    def values(self, frame: Frame, values: list[int]) -> bytes:
        """Return the answer to a read."""
        kind = _READ_RESPONSES[frame.pdu[0]]
        if kind.function_code in COIL_FUNCTIONS:
            return self._response(frame, kind(bits=[bool(value) for value in values]))
        return self._response(frame, kind(registers=values))

    def confirmation(self, frame: Frame, request: MapRequest) -> bytes:
        """Return the answer to a write: an echo for one address, else how many were written."""
        if request.function in SINGLE_WRITES:
            return self._framer.encode(frame.pdu, frame.slave, frame.transaction)
        kind = (
            WriteMultipleCoilsResponse
            if request.function in COIL_FUNCTIONS
            else WriteMultipleRegistersResponse
        )
        return self._response(frame, kind(address=request.first, count=request.count))

    def refusal(self, frame: Frame, code: int) -> bytes:
        """Return an exception as the answer to a request."""
        return self._response(frame, ExceptionResponse(frame.pdu[0], exception_code=code))

    def _response(self, frame: Frame, response: ModbusPDU) -> bytes:
        response.dev_id, response.transaction_id = frame.slave, frame.transaction
        return self._framer.buildFrame(response)


def _is_well_formed(pdu: bytes, request: ModbusPDU) -> bool:
    """What the library leaves open: sizes that do not match, coils that are neither on nor off."""
    function = pdu[0]
    if function not in MULTIPLE_WRITES:
        return len(pdu) == _SHORT_REQUEST and (function != 5 or pdu[3:] in _COIL_VALUES)
    size = (request.count + 7) // 8 if function == 15 else 2 * request.count
    return (
        1 <= request.count <= _MAX_WRITTEN[function]
        and pdu[_SHORT_REQUEST] == size
        and len(pdu) == _SHORT_REQUEST + 1 + size
    )
