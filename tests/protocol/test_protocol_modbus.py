"""Modbus TCP: every frame four ways, and pymodbus at the other end."""

from contextlib import suppress

import pytest
from codec_ways import check_reading, taken_by
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse
from pymodbus.pdu import bit_message as bits
from pymodbus.pdu import register_message as registers

from protocol.errors import RemoteProtocolError
from protocol.modbus import (
    ExceptionCode,
    ModbusFrame,
    ModbusFunction,
    ModbusRequest,
    ModbusRequestError,
    decode_request,
    decode_values,
    encode_answer,
    encode_exception,
    encode_frame,
    encode_read,
    encode_read_write,
    encode_write,
    take_frame,
)

F = ModbusFunction
REQUESTS = {
    F.READ_COILS: bits.ReadCoilsRequest,
    F.READ_DISCRETE_INPUTS: bits.ReadDiscreteInputsRequest,
    F.READ_HOLDING_REGISTERS: registers.ReadHoldingRegistersRequest,
    F.READ_INPUT_REGISTERS: registers.ReadInputRegistersRequest,
    F.WRITE_COIL: bits.WriteSingleCoilRequest,
    F.WRITE_REGISTER: registers.WriteSingleRegisterRequest,
    F.WRITE_COILS: bits.WriteMultipleCoilsRequest,
    F.WRITE_REGISTERS: registers.WriteMultipleRegistersRequest,
}
FRAMES = [
    (ModbusFrame(1, 255, encode_read(F.READ_COILS, 16)), "0001 0000 0006 ff 01 0010 0001"),
    (ModbusFrame(0xFFFF, 0, encode_read(F.READ_INPUT_REGISTERS, 258)), "ffff 0000 0006 00 04 0102 0001"),
    (ModbusFrame(2, 1, encode_write(F.WRITE_COIL, 5, (1,))), "0002 0000 0006 01 05 0005 ff00"),
    (ModbusFrame(3, 1, encode_write(F.WRITE_REGISTER, 128, (4711,))), "0003 0000 0006 01 06 0080 1267"),
    (
        ModbusFrame(4, 1, encode_answer(ModbusRequest(F.READ_COILS, 0, 9), [1, 0, 1] + [0] * 5 + [1])),
        "0004 0000 0005 01 01 02 05 01",
    ),
    (
        ModbusFrame(5, 1, encode_answer(ModbusRequest(F.READ_HOLDING_REGISTERS, 0, 2), [3, 15])),
        "0005 0000 0007 01 03 04 0003 000f",
    ),
    (
        ModbusFrame(6, 1, encode_answer(ModbusRequest(F.WRITE_REGISTERS, 128, 2, (1, 2)))),
        "0006 0000 0006 01 10 0080 0002",
    ),
    (ModbusFrame(7, 1, encode_exception(3, ExceptionCode.ILLEGAL_DATA_ADDRESS)), "0007 0000 0003 01 83 02"),
    (ModbusFrame(8, 1, bytes(253)), "0008 0000 00fe 01" + "00" * 253),
]


@pytest.mark.parametrize(("frame", "data"), FRAMES)
def test_every_frame_by_four_methods(frame, data):
    data = bytes.fromhex(data)
    assert encode_frame(*frame) == data
    check_reading(lambda: taken_by(take_frame), data, [frame], trailing=b"\0\1\0")


@pytest.mark.parametrize(
    "data",
    [b"\0\1\0\1\0\5\xff", b"\0\1\0\0\0\0\0", b"\0\1\0\0\0\1\xff", b"\0\1\0\0\0\xff\xff", b"GET / HTTP"],
)
def test_what_is_no_frame_is_an_error(data):
    with pytest.raises(RemoteProtocolError, match="allowed are protocol 0 and lengths from 2 to 254"):
        take_frame(bytearray(data))


@given(st.binary(max_size=600))
def test_any_bytes_are_frames_or_an_error(data):
    with suppress(RemoteProtocolError):
        assert all(1 <= len(frame.pdu) <= 253 for frame in taken_by(take_frame)(data))


def request_of_pymodbus(function, address, values):
    payload = (
        {"count": len(values)}
        if function.is_read
        else {"bits": [bool(value) for value in values]}
        if function.is_bits
        else {"registers": values}
    )
    return REQUESTS[function](dev_id=1, transaction_id=7, address=address, **payload)


@st.composite
def conversations(draw):
    """Function, address, and the values that are read or written."""
    function = draw(st.sampled_from(sorted(REQUESTS)))
    size = draw(st.integers(1, function.max_count))
    top = 1 if function.is_bits else 0xFFFF
    edge = draw(st.lists(st.integers(0, top), min_size=1, max_size=4))
    values = ([top] * size)[: size - len(edge)] + edge[:size]
    return function, draw(st.integers(0, 0x10000 - len(values))), values


@given(conversations())
def test_requests_of_pymodbus_are_understood_and_our_answers_by_pymodbus(conversation):
    function, address, values = conversation
    data = FramerSocket(DecodePDU(False)).buildFrame(request_of_pymodbus(function, address, values))
    frame = take_frame(bytearray(data))
    request = decode_request(frame.pdu)
    assert request == ModbusRequest(function, address, len(values), () if function.is_read else tuple(values))
    answer = DecodePDU(False).decode(encode_answer(request, values))
    assert answer.function_code == function
    if function.is_read:
        read = answer.bits[: len(values)] if function.is_bits else answer.registers
        assert list(map(int, read)) == values
    elif function.is_single_write:
        assert (answer.address, list(map(int, answer.bits if function.is_bits else answer.registers))) == (
            address,
            values,
        )
    else:
        assert (answer.address, answer.count) == (address, len(values))


@given(conversations())
def test_our_requests_are_understood_by_pymodbus_and_its_answers_by_us(conversation):
    function, address, values = conversation
    n = len(values)
    pdu = encode_read(function, address, n) if function.is_read else encode_write(function, address, values)
    asked = DecodePDU(True).decode(pdu)
    assert (asked.function_code, asked.address) == (function, address)
    if function.is_read:
        assert asked.count == n
        kind = {1: bits.ReadCoilsResponse, 2: bits.ReadDiscreteInputsResponse,
                3: registers.ReadHoldingRegistersResponse, 4: registers.ReadInputRegistersResponse}[function]  # fmt: skip
        answer = kind(bits=list(map(bool, values))) if function.is_bits else kind(registers=values)
    else:
        assert list(map(int, asked.bits if function.is_bits else asked.registers))[:n] == values
        several = {15: bits.WriteMultipleCoilsResponse, 16: registers.WriteMultipleRegistersResponse}
        answer = several[function](address=address, count=n) if function in several else asked
    assert decode_values(pdu, bytes((function,)) + answer.encode()) == tuple(values)
    refusal = ExceptionResponse(function, exception_code=2)
    assert decode_values(pdu, bytes((refusal.function_code,)) + refusal.encode()) is None


@given(
    st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=121),
    st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=123),
)
def test_pymodbus_understands_that_we_write_and_read_in_one_request(written, read):
    pdu = encode_read_write(5, len(read), 15, written)
    asked = DecodePDU(True).decode(pdu)
    assert (asked.read_address, asked.read_count, asked.write_address, asked.write_count) == (
        (5, len(read), 15, len(written))
    )
    assert asked.write_registers == written
    answer = registers.ReadWriteMultipleRegistersResponse(registers=read)
    assert decode_values(pdu, bytes((F.READ_WRITE_REGISTERS,)) + answer.encode()) == tuple(read)


@pytest.mark.parametrize("code", ExceptionCode)
def test_an_exception_is_understood_by_pymodbus(code):
    answer = DecodePDU(False).decode(encode_exception(16, code))
    assert (answer.function_code, answer.exception_code) == (0x90, code)


@given(st.binary(min_size=1, max_size=253))
def test_any_pdu_is_a_request_or_an_exception(pdu):
    with suppress(ModbusRequestError):
        request = decode_request(pdu)
        assert 1 <= request.count <= request.function.max_count
        assert request.address + request.count <= 0x10000
        assert len(request.values) == (0 if request.function.is_read else request.count)


@given(st.sampled_from([F.READ_COILS, F.READ_INPUT_REGISTERS]), st.binary(max_size=253))
def test_any_answer_has_a_value_or_none(function, answer):
    values = decode_values(encode_read(function, 5, 3), answer)
    top = 1 if function.is_bits else 0xFFFF
    assert values is None or (len(values) == 3 and all(0 <= value <= top for value in values))


@pytest.mark.parametrize(
    ("function", "most"), [(F.READ_COILS, 2000), (F.READ_HOLDING_REGISTERS, 125), (F.WRITE_REGISTERS, 123)]
)
def test_a_request_has_so_many_addresses_at_most(function, most):
    for count, is_taken in ((1, True), (most, True), (most + 1, False)):
        is_read = function.is_read
        pdu = encode_read(function, 0, count) if is_read else encode_write(function, 0, (1,) * count)
        if is_taken:
            assert decode_request(pdu).count == count
        else:
            with pytest.raises(ModbusRequestError, match="ILLEGAL_DATA_VALUE"):
                decode_request(pdu)


@pytest.mark.parametrize(("count", "size"), [(1, 1), (8, 1), (9, 2), (16, 2)])
def test_eight_bits_are_a_byte(count, size):
    request = decode_request(pdu := encode_write(F.WRITE_COILS, 0, (1,) * count))
    assert (request.values, pdu[5], len(pdu)) == ((1,) * count, size, 6 + size)
