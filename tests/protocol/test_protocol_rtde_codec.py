"""RTDE's variables and packages: what the table says, golden bytes, every package four ways, round trips."""

import math
import struct
from itertools import chain
from types import SimpleNamespace

import pytest
from codec_ways import check_reading
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.realtime.layout import COLUMNS
from protocol.rtde import codec as M
from protocol.rtde.codec import HEADER_SIZE, MAX_NAMES_SIZE, data_header, decode_message, encode_message
from protocol.rtde.fields import INPUTS, OUTPUTS, input_fields, output_fields
from protocol.rtde.recipe import Recipe, snapshot_encoder
from protocol.rtde.server_connection import RtdeServerConnection
from protocol.rtde.types import RtdeType
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ValueOrigin

# --- variables


V3_15 = SoftwareVersion(3, 15, 8)


@pytest.mark.parametrize("table", [OUTPUTS, INPUTS])
def test_names_are_unique_ascii_and_free_of_commas(table):
    names = [field.name for field in table]
    assert len(set(names)) == len(names)
    assert all(name.isascii() and name.isidentifier() for name in names)


def test_registers_are_complete_in_both_directions():
    for table, sides in ((OUTPUTS, ("input", "output")), (INPUTS, ("input",))):
        names = {field.name: field.type for field in table}
        for side in sides:
            assert names[f"{side}_bit_registers0_to_31"] is RtdeType.UINT32
            assert names[f"{side}_bit_registers32_to_63"] is RtdeType.UINT32
            for i in range(64, 128):
                assert names[f"{side}_bit_register_{i}"] is RtdeType.BOOL
            for i in range(48):
                assert names[f"{side}_int_register_{i}"] is RtdeType.INT32
                assert names[f"{side}_double_register_{i}"] is RtdeType.DOUBLE
            assert f"{side}_bit_register_63" not in names
            assert f"{side}_int_register_48" not in names


def test_every_output_is_filled():
    for field in OUTPUTS:
        assert field.origin is not None
        assert field.comes_from or field.origin is ValueOrigin.CONSTANT, field.name
    assert set(output_fields(SoftwareVersion(5, 26))) == {field.name for field in OUTPUTS}


@pytest.mark.parametrize(
    ("name", "first", "before"),
    [
        ("timestamp", (3, 3), None), ("output_int_register_0", (3, 4), (3, 3)),
        ("elbow_position", (3, 5), (3, 4)), ("output_int_register_24", (3, 9), (3, 8)),
        ("safety_status", (3, 10), (3, 9)), ("payload", (3, 11), (3, 10)),
        ("tcp_offset", (3, 12, 3), (3, 12, 2)), ("script_control_line", (3, 14), (3, 13)),
        ("payload_inertia", (3, 15), (3, 14)), ("ft_raw_wrench", (5, 9), (3, 15)),
        ("elbow_position", (5, 0), None), ("output_int_register_24", (5, 3), (5, 2)),
        ("safety_status", (5, 4), (5, 3)), ("payload", (5, 5, 1), (5, 5, 0)),
        ("tcp_offset", (5, 5, 1), (5, 5, 0)), ("script_control_line", (5, 9), (5, 8)),
        ("ft_raw_wrench", (5, 9), (5, 8)), ("payload_inertia", (5, 11), (5, 10)),
        ("joint_position_deviation_ratio", (5, 11), (5, 10)), ("encoder1_raw", (5, 14), (3, 15)),
        ("time_scale_source", (5, 19), (5, 15)), ("collision_detection_ratio", (5, 19), (5, 15)),
        ("actual_robot_energy_consumed", (5, 23), (5, 22, 2)),
        ("actual_current_as_torque", (5, 23), (5, 22, 9)), ("target_gravity", (5, 26), (5, 25, 1)),
        ("control_step", (5, 26), (5, 25, 1)),
    ],
)  # fmt: skip
def test_first_version_of_a_variable(name, first, before):
    assert name in output_fields(SoftwareVersion(*first))
    if before:
        assert name not in output_fields(SoftwareVersion(*before))


def test_inputs_of_the_newest_cb3():
    fields = input_fields(V3_15)
    assert len(fields) == len(INPUTS) == 14 + 64 + 48 + 48 + 1
    assert "input_int_register_24" not in input_fields(SoftwareVersion(3, 8))


def test_variables_that_the_realtime_interface_has_too_come_from_the_same_attribute():
    rtde = {field.name: field for field in OUTPUTS}
    shared = [column for column in COLUMNS if column.name in rtde]
    assert len(shared) > 30
    for column in shared:
        field = rtde[column.name]
        assert field.comes_from == column.attribute
        assert field.origin is column.origin
        assert field.type.count == column.count
        assert field.unit == column.unit


# --- packages


ROBOT, PC = M.Role.ROBOT, M.Role.PC
DOUBLE = struct.pack(">d", 1.5)

# (sender, protocol version, package, bytes); 40 5f 40 .. is 125.0
PACKAGES = [
    (PC, 1, M.RequestProtocolVersion(2), "00 05 56 00 02"),
    (ROBOT, 1, M.RequestProtocolVersionReply(True), "00 04 56 01"),
    (ROBOT, 2, M.RequestProtocolVersionReply(False), "00 04 56 00"),
    (PC, 2, M.GetControllerVersion(), "00 03 76"),
    (ROBOT, 2, M.GetControllerVersionReply(SoftwareVersion(3, 15, 8, 106339)),
     "00 13 76 00000003 0000000f 00000008 00019f63"),
    (PC, 2, M.SetupOutputs(("timestamp", "actual_q"), 125.0),
     f"00 1d 4f 40 5f 40 00 00 00 00 00 {b'timestamp,actual_q'.hex()}"),
    (PC, 1, M.SetupOutputs(("timestamp",)), f"00 0c 4f {b'timestamp'.hex()}"),
    (ROBOT, 2, M.SetupOutputsReply(("DOUBLE", "VECTOR6D"), 1), f"00 13 4f 01 {b'DOUBLE,VECTOR6D'.hex()}"),
    (ROBOT, 1, M.SetupOutputsReply(("DOUBLE",)), f"00 09 4f {b'DOUBLE'.hex()}"),
    (PC, 2, M.SetupInputs(("input_int_register_0",)), f"00 17 49 {b'input_int_register_0'.hex()}"),
    (PC, 2, M.SetupInputs(()), "00 03 49"),
    (ROBOT, 2, M.SetupInputsReply(("IN_USE",), 0), f"00 0a 49 00 {b'IN_USE'.hex()}"),
    (ROBOT, 1, M.SetupInputsReply((), 7), "00 04 49 07"),
    (PC, 2, M.Start(), "00 03 53"),
    (ROBOT, 2, M.StartReply(True), "00 04 53 01"),
    (PC, 1, M.Pause(), "00 03 50"),
    (ROBOT, 1, M.PauseReply(True), "00 04 50 01"),
    (PC, 1, M.RtdeTextMessage("hi"), "00 05 4d 6869"),
    (ROBOT, 1, M.RtdeTextMessage("hi", level=1), "00 06 4d 01 6869"),
    (PC, 2, M.RtdeTextMessage("hi", "me", 2), "00 0a 4d 02 6869 02 6d65 02"),
    (ROBOT, 2, M.RtdeTextMessage("", "", 0), "00 06 4d 00 00 00"),
    (PC, 2, M.DataPackage(DOUBLE, 1), "00 0c 55 01 3ff8000000000000"),
    (PC, 1, M.DataPackage(DOUBLE, 1), "00 0c 55 01 3ff8000000000000"),
    (ROBOT, 2, M.DataPackage(DOUBLE, 1), "00 0c 55 01 3ff8000000000000"),
    (ROBOT, 1, M.DataPackage(DOUBLE), "00 0b 55 3ff8000000000000"),
]  # fmt: skip
IDS = [f"{sender.value}-v{version}-{type(message).__name__}" for sender, version, message, _ in PACKAGES]


@pytest.mark.parametrize(("sender", "version", "message", "golden"), PACKAGES, ids=IDS)
def test_packages_are_written_and_read(sender, version, message, golden):
    data = bytes.fromhex(golden)
    assert encode_message(message, sender, version) == data
    assert int.from_bytes(data[:2], "big") == len(data)
    assert decode_message(data[2], data[HEADER_SIZE:], sender, version) == message


def server(version):
    """Return a function that gives a connection of the robot bytes, and returns the requests that it answers."""
    robot = RtdeServerConnection(V3_15, output_fields(V3_15), input_fields(V3_15))
    robot.protocol_version = version

    def feed(data):
        robot.receive_data(data)
        requests = []
        while (request := robot.next_event()) is not None:
            requests.append(request)
            robot.reply()
        return requests

    return feed


REQUESTS = [row for row in PACKAGES if row[0] is PC and type(row[2]) in M.REQUESTS]


@pytest.mark.parametrize(("sender", "version", "message", "golden"), REQUESTS)
def test_read_from_a_stream_bytewise_and_with_trailing_data(sender, version, message, golden):
    data = bytes.fromhex(golden)
    check_reading(lambda: server(version), data, [message], trailing=b"\0")
    check_reading(lambda: server(version), data + b"\0\3S", [message, M.Start()])


@pytest.mark.parametrize(("sender", "version", "message", "golden"), PACKAGES, ids=IDS)
def test_cut_payloads_raise_or_lose_the_end_but_nothing_else(sender, version, message, golden):
    data = bytes.fromhex(golden)
    for end in range(HEADER_SIZE, len(data)):
        try:
            decoded = decode_message(data[2], data[HEADER_SIZE:end], sender, version)
        except RemoteProtocolError:
            continue
        assert type(decoded) is type(message)


def test_unknown_types_are_nobodys():
    assert decode_message(ord("X"), b"", PC, 2) is None


def test_a_trailing_comma_is_ignored_as_public_clients_send_one():
    assert decode_message(ord("I"), b"a,b,", PC, 2) == M.SetupInputs(("a", "b"))
    assert decode_message(ord("O"), bytes(8), PC, 2) == M.SetupOutputs((), 0.0)


@pytest.mark.parametrize(
    "bad",
    [
        M.SetupOutputs(("a",)),
        M.SetupInputs(("a,b",)),
        M.SetupInputs(("",)),
        M.SetupInputs(("é",)),
        M.SetupInputs(("x" * (MAX_NAMES_SIZE + 1),)),
        M.RequestProtocolVersion(70000),
        M.DataPackage(b"", 256),
        M.DataPackage(bytes(70000), 1),
        M.SetupOutputsReply(("DOUBLE",)),
    ],
)
def test_what_cannot_be_sent_is_refused(bad):
    with pytest.raises(LocalProtocolError):
        encode_message(bad, PC, 2)


def test_long_texts_lose_their_end():
    data = encode_message(M.RtdeTextMessage("m" * 300, "s" * 300), ROBOT, 2)
    message = decode_message(data[2], data[3:], ROBOT, 2)
    assert message == M.RtdeTextMessage("m" * 255, "s" * 255)


# --- values

_NUMBERS = {
    "?": st.booleans(),
    "B": st.integers(0, 2**8 - 1),
    "I": st.integers(0, 2**32 - 1),
    "i": st.integers(-(2**31), 2**31 - 1),
    "Q": st.integers(0, 2**64 - 1),
    "d": st.floats(allow_nan=False),
}


def value_of(kind):
    number = _NUMBERS[kind.letters[0]]
    return number if kind.count == 1 else st.tuples(*[number] * kind.count)


typed_values = st.lists(
    st.sampled_from(RtdeType).flatmap(lambda kind: value_of(kind).map(lambda value: (kind, value)))
)


def encoded(pairs):
    numbers = (value if kind.count > 1 else (value,) for kind, value in pairs)
    return struct.pack(">" + "".join(kind.letters for kind, _ in pairs), *chain.from_iterable(numbers))


@given(typed_values)
def test_values_round_trip(pairs):
    recipe = Recipe([f"v{i}" for i in range(len(pairs))], [kind for kind, _ in pairs])
    values = tuple(value for _, value in pairs)
    data = encoded(pairs)
    assert len(data) == recipe.size
    assert recipe.decode(data) == recipe.decode_leading(data) == values


@given(typed_values, st.integers(0, 400))
def test_wrong_sizes_give_what_fits(pairs, size):
    recipe = Recipe([f"v{i}" for i in range(len(pairs))], [kind for kind, _ in pairs])
    values = tuple(value for _, value in pairs)
    data = (encoded(pairs) + b"\x7f" * 400)[:size]
    leading = recipe.decode_leading(data)
    assert leading == values[: len(leading)]
    whole = sum(kind.size for kind in recipe.types[: len(leading)])
    assert whole <= size
    assert len(leading) == len(values) or whole + recipe.types[len(leading)].size > size
    if size != recipe.size:
        with pytest.raises(RemoteProtocolError, match="bytes of values"):
            recipe.decode(data)


class Numbered:
    """An object that has every attribute of the table: numbered registers, six of everything else."""

    def __getattr__(self, name):
        if name == "registers":
            return self
        if name in ("analog_values", "encoder_counts", "joint_mode", "tool_output_modes"):
            return (10, 11, 12, 13, 14, 15)
        return tuple(range(128)) if name.startswith(("input_", "output_")) else 7


def test_data_package_of_the_guide():
    fields = [field for field in OUTPUTS if field.name in ("timestamp", "actual_q")]
    recipe = Recipe([f.name for f in fields], [f.type for f in fields])
    assert recipe.size == 56
    encode = snapshot_encoder(fields, data_header(recipe.size, 1))
    package = encode(SimpleNamespace(timestamp=1.5, actual_q=(0.5, -0.5, 1.0, 2.0, 3.0, math.pi)))
    assert len(package) == 60
    assert package.hex(" ", 8).startswith("003c5501")
    assert package[:12] == bytes.fromhex("00 3c 55 01 3ff8000000000000")
    assert recipe.decode(package[4:]) == (1.5, (0.5, -0.5, 1.0, 2.0, 3.0, math.pi))


@pytest.mark.parametrize("field", [f for f in OUTPUTS if f.type.count == 1])
def test_every_scalar_is_taken_from_where_the_table_says(field):
    encode = snapshot_encoder([field], data_header(field.type.size, None))
    (value,) = Recipe([field.name], [field.type]).decode(encode(Numbered())[HEADER_SIZE:])
    if field.comes_from.startswith("registers.") and field.type is not RtdeType.BOOL:
        digits = "".join(c for c in field.name.replace("registers0_to_31", "0") if c.isdigit())
        expected = 1 if field.name.endswith("registers32_to_63") else int(digits)
        assert value == expected
    elif field.comes_from:
        assert value in (7, True, 10, 11, 12, 13, 14, 15)
    else:
        assert value == field.constant


def test_a_snapshot_that_does_not_fit_is_explained():
    fields = [field for field in OUTPUTS if field.name in ("timestamp", "actual_q", "robot_mode")]
    encode = snapshot_encoder(fields, b"")
    good = {"timestamp": 0.0, "actual_q": (0.0,) * 6, "robot_mode": 7}
    assert len(encode(SimpleNamespace(**good))) == 60
    for name, value in (("actual_q", (0.0,) * 5), ("actual_q", 3.0), ("robot_mode", 2**31)):
        with pytest.raises(LocalProtocolError, match=name):
            encode(SimpleNamespace(**{**good, name: value}))
