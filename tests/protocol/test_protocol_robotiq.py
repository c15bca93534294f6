"""The socket of a Robotiq gripper and its registers: bytes of the maker's programs and of public clients."""

from contextlib import suppress

import pytest
from codec_ways import in_pieces, taken_by
from hypothesis import given
from hypothesis import strategies as st

from protocol import modbus, robotiq
from protocol.errors import RemoteProtocolError
from protocol.modbus_rtu import crc16, decode_read_write, encode_rtu, take_request
from protocol.robotiq import Get, GripperConnection, Malformed, Set, encode_request, encode_value, take_answer

STREAM = (
    (b"SET POS 100 SPE 255 FOR 10 GTO 1\n", Set((("POS", 100), ("SPE", 255), ("FOR", 10), ("GTO", 1)))),
    (b"GET PRE\n", Get("PRE", bare=False)),
    (b"SET  POS 7\r\n", Set((("POS", 7),))),
    (b"SET SID 9\n", Set((("SID", 9),))),
    (b"GET NOTHING\n", Malformed("GET NOTHING", is_set=False)),
    (b"SET POS 256\n", Malformed("SET POS 256", is_set=True)),
    (b"SET POS -1\n", Malformed("SET POS -1", is_set=True)),
    (b"SET POS\n", Malformed("SET POS", is_set=True)),
    (b"SET STA 3\n", Malformed("SET STA 3", is_set=True)),
    (b"SET SID 9 POS 3\n", Malformed("SET SID 9 POS 3", is_set=True)),
    (b"hello\n", Malformed("hello", is_set=False)),
)  # fmt: skip


def test_lines_are_requests_whole_bytewise_and_with_others_behind_them():
    for line, request in STREAM:
        assert GripperConnection().receive(line) == [request]
    stream = b"".join(line for line, _ in STREAM)
    assert GripperConnection().receive(stream) == [request for _, request in STREAM]
    connection = GripperConnection()
    # Byte by byte a GET is complete with the last letter of its name; its newline is then no line.
    bytewise = [request for byte in stream for request in connection.receive(bytes([byte]))]
    assert bytewise == [
        Get(request.name, bare=True) if isinstance(request, Get) else request for _, request in STREAM
    ]


def test_a_get_without_a_newline_ends_with_its_segment():
    connection = GripperConnection()
    assert connection.receive(b"GET PR") == []
    assert connection.receive(b"E") == [Get("PRE", bare=True)]
    assert connection.receive(b"\nGET SID") == [Get("SID", bare=True)]
    assert connection.receive(b"GET STA\nGET FL") == [Get("STA", bare=False)]
    assert connection.receive(b"T\n") == [Get("FLT", bare=False)]


@given(st.lists(st.binary(max_size=3000), max_size=4))
def test_no_bytes_are_kept_without_end(segments):
    connection = GripperConnection()
    for segment in segments:
        connection.receive(segment)
        assert len(connection._inbox) <= robotiq.MAX_LINE


@pytest.mark.parametrize(
    ("request_", "value", "answer"),
    [
        (Get("PRE", bare=True), 77, b"077"),
        (Get("FLT", bare=True), 5, b"05"),
        (Get("STA", bare=True), 3, b"3"),
        (Get("MSC", bare=True), 45, b"45"),
        (Get("POS", bare=False), 77, b"POS 77\n"),
        (Get("POS", bare=False), "?", b"POS ?\n"),
        (Get("VER", bare=True), "1.8.0", b"1.8.0"),
        (Get("SID", bare=False), "[9, 2]", b"[9, 2]"),
        (Get("SID", bare=True), "[]", b"[]"),
    ],
)
def test_answers_have_the_widths_that_programs_read(request_, value, answer):
    assert encode_value(request_, value) == answer


ASKED = (
    (Set((("POS", 100), ("GTO", 1))), b"SET POS 100 GTO 1\n", b"ack", "ack"),
    (Get("PRE", bare=False), b"GET PRE\n", b"PRE 77\n", 77),
    (Get("FLT", bare=False), b"GET FLT\n", b"FLT 05\n", 5),
    (Get("POS", bare=False), b"GET POS\n", b"POS ?\n", "?"),
)


@pytest.mark.parametrize(("request_", "line", "answer", "value"), ASKED)
def test_a_client_asks_and_takes_the_answer_whole_bytewise_and_before_others(request_, line, answer, value):
    assert encode_request(request_) == line
    assert GripperConnection().receive(line) == [request_]
    for others in (b"", b"ack", b"STA 3\n"):
        inbox = bytearray(answer + others)
        assert (take_answer(inbox, request_), inbox) == (value, others)
    take = taken_by(lambda inbox: take_answer(inbox, request_))
    assert in_pieces(take, answer, 1) == [value]


@given(st.binary(max_size=3000), st.sampled_from([request for request, *_ in ASKED]))
def test_a_client_takes_nothing_else_for_an_answer(data, request_):
    inbox = bytearray(data)
    with suppress(RemoteProtocolError):
        take_answer(inbox, request_)
    assert len(inbox) < robotiq.MAX_LINE or len(inbox) < len(data)


# The maker's manual and public drivers; reference grippers.md, section 2.
REQUESTS = (
    "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30",
    "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1",
    "09 10 03 E8 00 01 02 01 00 E4 28",
    "09 03 07 D0 00 01 85 CF",
    "09 04 07 D0 00 01 30 0F",
    "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29",
    "09 03 07 D0 00 03 04 0E",
    "09 17 07 D0 00 03 03 E9 00 02 04 00 FF FF FF BC 28",
)


def test_requests_of_the_serial_line_are_taken_whole_bytewise_and_with_others_behind_them():
    frames = [bytes.fromhex(text) for text in REQUESTS]
    for frame in frames:
        request = (9, frame[1:-2])
        assert encode_rtu(*request) == frame
        assert in_pieces(taken_by(take_request), frame, 1) == [request]
    assert taken_by(take_request)(b"".join(frames)) == [(9, frame[1:-2]) for frame in frames]


@pytest.mark.parametrize(
    "noise", ["09 03 07 D0 00 01 85 CE", "09 63 00 00", "09 00", "09 10 03 E8 00 01 02 01 00 E4 29"]
)
def test_what_is_no_request_is_dropped_with_what_waits_behind_it(noise):
    inbox = bytearray(bytes.fromhex(noise) + bytes.fromhex(REQUESTS[3])[:3])
    assert take_request(inbox) is None
    assert not inbox


def test_a_request_that_writes_and_reads():
    read, write = decode_read_write(bytes.fromhex(REQUESTS[-1])[1:-2])
    assert (read.address, read.count) == (0x07D0, 3)
    assert (write.address, write.values) == (0x03E9, (0x00FF, 0xFFFF))
    with pytest.raises(modbus.ModbusRequestError):
        decode_read_write(bytes.fromhex(REQUESTS[-1])[1:-3])


def test_registers_have_the_variables_of_the_socket():
    assert robotiq.decode_request([0x0900, 0x00FF, 0xFFFE]) == {
        "ACT": 1, "MOD": 0, "GTO": 1, "ATR": 0, "ARD": 0, "POS": 255, "SPE": 255, "FOR": 254,
    }  # fmt: skip
    gripped = robotiq.encode_status(
        active=True, going=True, status=robotiq.Status.ACTIVE, objects=robotiq.Objects.CONTACT_CLOSING,
        fault=robotiq.Fault.NONE, requested=255, position=0xBD, current=0,
    )  # fmt: skip
    assert gripped == (0xB900, 0x00FF, 0xBD00)
    assert crc16(bytes.fromhex("09 03 06 B9 00 00 FF BD 00")) == 0x7C1D
