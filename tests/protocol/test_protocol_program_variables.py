"""Program state messages of port 30001: names and values of global variables, every codec four ways."""

import math

import pytest

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.frame_buffer import FrameBuffer
from protocol.primary import values as V
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE, encode_package
from protocol.primary.packages import decode_package
from protocol.primary.values import TypedValue, ValueType
from protocol.ur_types import SoftwareVersion

V3_15 = SoftwareVersion(3, 15, 8)
NO_TIME = "ff" * 8


def read(data, version=V3_15, step=None):
    """All packages in some bytes, fed in pieces; what is left over must be a beginning of a package."""
    buffer, packages = FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE), []
    for start in range(0, len(data), step or len(data)):
        buffer.feed(data[start : start + (step or len(data))])
        while (frame := buffer.next_frame()) is not None:
            packages.append(decode_package(frame, version))
    return packages


def boolean(value):
    return TypedValue(ValueType.BOOL, value)


def text(value):
    return TypedValue(ValueType.CONST_STRING, value)


def integer(value):
    return TypedValue(ValueType.INT, value)


def real(value):
    return TypedValue(ValueType.FLOAT, value)


def listed(*values):
    return TypedValue(ValueType.LIST, values)


POSE = TypedValue(ValueType.POSE, (0.5, -0.25, 1.0, 0.0, 2.0, -4.0))
POSE_HEX = "3f000000 be800000 3f800000 00000000 40000000 c0800000"
MATRIX = TypedValue(
    ValueType.MATRIX, ((integer(1), integer(2), integer(3)), (integer(4), integer(5), integer(6)))
)

# (version, message, bytes). The first update is the example of the document, the second a capture.
MESSAGES = [
    ("3.3", V.GlobalVariablesUpdate(timestamp=0, values=(boolean(True), text("aaaa"))),
     f"0000001b 19 {'00' * 8} 01 0000 0c 01 0a 03 0004 61616161 0a"),
    ("5.4", V.GlobalVariablesUpdate(), f"00000010 19 {NO_TIME} 01 0000"),
    ("3.15.8", V.GlobalVariablesSetup(timestamp=16_634_482_000, names=("i", "pose_1")),
     f"00000019 19 {16_634_482_000:016x} 00 0000 690a {b'pose_1'.hex()}0a"),
    ("3.15.8", V.GlobalVariablesSetup(start_index=300, names=("\xe9",)), f"00000012 19 {NO_TIME} 00 012c e90a"),
    ("3.15.8", V.GlobalVariablesSetup(), f"00000010 19 {NO_TIME} 00 0000"),
    ("3.15.8", V.GlobalVariablesUpdate(start_index=2, values=(integer(10), POSE)),
     f"00000030 19 {NO_TIME} 01 0002 0f 0000000a 0a 0c {POSE_HEX} 0a"),
    ("3.15.8", V.GlobalVariablesUpdate(values=(listed(real(0.5), real(-2.0)), TypedValue(ValueType.NONE))),
     f"00000020 19 {NO_TIME} 01 0000 11 0002 10 3f000000 10 c0000000 0a 00 0a"),
    ("3.15.8", V.GlobalVariablesUpdate(values=(MATRIX,)),
     f"00000034 19 {NO_TIME} 01 0000 12 0002 0003 0f 00000001 0f 00000002 0f 00000003"
     "0f 00000004 0f 00000005 0f 00000006 0a"),
    ("3.15.8", V.VariableUpdate(title="x", text="1.5"), f"00000013 19 {NO_TIME} 02 01 78 312e35"),
]  # fmt: skip
IDS = [f"{type(message).__name__} {version} {i}" for i, (version, message, _) in enumerate(MESSAGES)]


@pytest.mark.parametrize(("version", "message", "data"), MESSAGES, ids=IDS)
def test_messages_by_four_methods(version, message, data):
    version, data = SoftwareVersion.parse(version), bytes.fromhex(data)
    assert V.encode_program_state(message, version).hex(" ") == data.hex(" ")
    assert read(data, version) == [message]
    assert read(data, version, step=1) == [message]
    assert read(data + data[:7], version) == [message]


# One value of each type and its bytes behind the code, which is that of the version.
VALUES = [
    (TypedValue(ValueType.NONE), ""),
    (text("a\nb"), "0003 610a62"),
    (TypedValue(ValueType.VAR_STRING, ""), "0000"),
    (POSE, POSE_HEX),
    (boolean(False), "00"),
    (TypedValue(ValueType.NUM, 1.0), "3f800000"),
    (integer(-2), "fffffffe"),
    (real(-0.5), "bf000000"),
    (listed(), "0000"),
    (MATRIX, None),
    (TypedValue(ValueType.MATRIX, ()), "0000 0000"),
    (listed(listed(boolean(True)), listed(boolean(False))), None),
]
CODES = {
    "3.0": {"const string": 3, "list": 4, "pose": 9, "bool": 11, "num": 12, "int": 13, "float": 14},
    "3.3": {"var string": 4, "list": 5, "pose": 10, "bool": 12, "num": 13, "int": 14, "float": 15},
    "3.14": {
        "var string": 4,
        "pose": 12,
        "bool": 13,
        "num": 14,
        "int": 15,
        "float": 16,
        "list": 17,
        "matrix": 18,
    },
}
VERSIONS = [("3.0", "3.0"), ("3.2.19", "3.0"), ("3.3", "3.3"), ("3.13.9", "3.3"), ("3.14", "3.14"), ("3.15.8", "3.14"),
            ("5.0", "3.3"), ("5.8.2", "3.3"), ("5.9", "3.14"), ("5.24", "3.14")]  # fmt: skip


@pytest.mark.parametrize(("version", "like"), VERSIONS)
def test_codes_follow_the_version(version, like):
    codes = V.value_codes(SoftwareVersion.parse(version))
    assert codes[ValueType.NONE] == 0
    for name, code in CODES[like].items():
        assert codes[ValueType(name)] == code
    assert (ValueType.MATRIX in codes) == (like == "3.14")
    assert (ValueType.VAR_STRING in codes) == (like != "3.0")


@pytest.mark.parametrize(("version", "like"), VERSIONS)
@pytest.mark.parametrize(("value", "data"), VALUES, ids=[str(value) for value, _ in VALUES])
def test_values_go_there_and_back(version, like, value, data):
    version = SoftwareVersion.parse(version)
    codes = V.value_codes(version)
    if value.type not in codes:
        with pytest.raises(LocalProtocolError, match=f"no variables of type {value.type.value}"):
            V.encode_value(value, version)
        return
    encoded = V.encode_value(value, version)
    assert encoded[0] == codes[value.type]
    if data is not None:
        assert encoded[1:] == bytes.fromhex(data)
    assert V.decode_value(b"??" + encoded + b"\n", 2, version) == (value, 2 + len(encoded))
    for end in range(len(encoded)):
        with pytest.raises(RemoteProtocolError):
            V.decode_value(encoded[:end], 0, version)


def test_floats_beyond_32_bits_become_infinite_and_no_number_stays_none():
    for value, expected in ((1e300, math.inf), (-1e300, -math.inf), (math.inf, math.inf)):
        assert V.decode_value(V.encode_value(real(value), V3_15), 0, V3_15)[0] == real(expected)
    (back, _) = V.decode_value(V.encode_value(real(math.nan), V3_15), 0, V3_15)
    assert math.isnan(back.value)


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        (integer(2**31), "cannot be sent"),
        (integer("x"), "cannot be sent"),
        (text("x" * 40_000), "cannot be sent"),
        (TypedValue(ValueType.POSE, (1.0,) * 5), "a pose has 6 numbers, not 5"),
        (TypedValue(ValueType.MATRIX, ((integer(1),), ())), "equally long"),
        (listed(1.0), "cannot be sent"),
    ],
)
def test_values_that_do_not_fit_are_named(value, problem):
    with pytest.raises(LocalProtocolError, match=problem):
        V.encode_value(value, V3_15)


def test_lists_are_read_and_written_to_a_depth():
    value = integer(1)
    for _ in range(V.MAX_NESTING):
        value = listed(value)
    encoded = V.encode_value(value, V3_15)
    assert V.decode_value(encoded, 0, V3_15) == (value, len(encoded))
    with pytest.raises(LocalProtocolError, match="nested deeper than 32"):
        V.encode_value(listed(value), V3_15)
    with pytest.raises(RemoteProtocolError, match="nested deeper than 32"):
        V.decode_value(bytes.fromhex("110001") * 5000, 0, V3_15)


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("", "shorter than its header"),
        (f"{NO_TIME} 00", "before its start index"),
        (f"{NO_TIME} 01 00", "before its start index"),
        (f"{NO_TIME} 00 0000 61", "not ended by a line feed"),
        (f"{NO_TIME} 01 0005 0d 01", "no line feed ends the value of variable 5"),
        (f"{NO_TIME} 01 0000 0d 01 0b", "no line feed ends the value of variable 0"),
        (f"{NO_TIME} 01 0000 63 0a", "99 at byte 2 is not a type"),
        (f"{NO_TIME} 01 0000 03 ffff 0a", "cut off"),
        (f"{NO_TIME} 01 0000 11 ffff 0a", "has -1 elements"),
        (f"{NO_TIME} 01 0000 12 7fff 7fff 00", "cut off"),
        (f"{NO_TIME} 02", "title of a variable is cut off"),
        (f"{NO_TIME} 02 05 61", "title of a variable is cut off"),
    ],
)
def test_messages_that_do_not_add_up_are_refused(body, problem):
    with pytest.raises(RemoteProtocolError, match=problem):
        read(encode_package(25, bytes.fromhex(body)))


def test_an_unknown_sub_type_comes_out_as_it_is():
    (message,) = read(encode_package(25, bytes.fromhex(f"{NO_TIME} 07 0102")))
    assert message == V.UnknownProgramState(sub_type=7, body=b"\x01\x02")
    with pytest.raises(LocalProtocolError, match="UnknownProgramState has no table"):
        V.encode_program_state(message, V3_15)


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (V.GlobalVariablesSetup(start_index=70_000), "start index 70000"),
        (V.GlobalVariablesUpdate(timestamp=-1), "timestamp -1"),
        (V.GlobalVariablesSetup(names=("a\nb",)), "no line feed"),
        (V.VariableUpdate(title="x" * 256), "256 characters"),
    ],
)
def test_messages_that_do_not_fit_are_named(message, problem):
    with pytest.raises(LocalProtocolError, match=problem):
        V.encode_program_state(message, V3_15)
