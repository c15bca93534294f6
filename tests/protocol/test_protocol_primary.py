"""Ports 30001 and 30002: captured bytes, documented totals, and every codec four ways."""

import math
import struct
from dataclasses import asdict, fields, replace
from functools import partial
from types import SimpleNamespace

import pytest
from codec_ways import check_reading

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.frame_buffer import FrameBuffer
from protocol.primary import framing as F
from protocol.primary import layout as L
from protocol.primary import messages as M
from protocol.primary import packages as P
from protocol.primary import values as V
from protocol.primary.framing import encode_package
from protocol.primary.messages import encode_message
from protocol.primary.packages import encode_message_package
from protocol.primary.values import TypedValue, ValueType
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import codec_for, wire_fields

V3_15 = SoftwareVersion(3, 15, 8)
NO_TIME = "ff" * 8


def reader(version=V3_15):
    """Return a function that takes pieces of a stream and returns the packages that are complete."""
    buffer = FrameBuffer(F.MAX_PACKAGE_SIZE, F.MIN_PACKAGE_SIZE)

    def feed(data):
        buffer.feed(data)
        return [P.decode_package(frame, version) for frame in iter(buffer.next_frame, None)]

    return feed


def encoder_of(message):
    return V.encode_program_state if isinstance(message, V.ProgramStateMessage) else encode_message_package


def read(data, version=V3_15):
    """Return all packages in some bytes."""
    return reader(version)(data)


# (version, record, bytes of the package). The first two and the key and exception messages are captures.
MESSAGES = [
    ("3.3.1",
     M.VersionMessage(major=3, minor=3, bugfix=1, build=60, build_date="Jul 08 2016, 16:07:20"),
     f"00000038 14 {NO_TIME} fe 03 09 {b'URControl'.hex()} 03 03 00000001 0000003c "
     f"{b'Jul 08 2016, 16:07:20'.hex()}"),
    ("3.10",
     M.VersionMessage(major=3, minor=10, build_date="03-05-2019, 06:39:00"),
     f"00000037 14 {NO_TIME} fe 03 09 {b'URControl'.hex()} 03 0a 00000000 00000000 "
     f"{b'03-05-2019, 06:39:00'.hex()}"),
    ("5.24",
     M.VersionMessage(timestamp=0, major=5, minor=24, build_date="04-10-2025, 00:25:33"),
     f"00000037 14 {'00' * 8} fe 03 09 {b'URControl'.hex()} 05 18 00000000 00000000 "
     f"{b'04-10-2025, 00:25:33'.hex()}"),
    ("5.24",
     M.KeyMessage(timestamp=0, source=-2, title="PROGRAM_XXX_STARTED", text="textmsg"),
     f"00000032 14 {'00' * 8} fe 07 00000000 00000000 13 {b'PROGRAM_XXX_STARTED'.hex()} {b'textmsg'.hex()}"),
    ("5.24", M.ErrorCodeMessage(source=7, code=210, report_level=2, data_type=2, data=1, text="C210A0"),
     f"00000029 14 {NO_TIME} 07 06 000000d2 00000000 00000002 00000002 00000001 {b'C210A0'.hex()}"),
    ("5.24", M.SafetyModeMessage(source=7, safety_mode=13, data_type=4),
     f"00000020 14 {NO_TIME} 07 05 00000000 00000000 0d 00000004 00000000"),
    ("5.24", M.PopupMessage(request_id=1, is_error=True, title="T", text="text"),
     f"00000020 14 {NO_TIME} fd 02 00000001 00000008 00 01 00 01 54 {b'text'.hex()}"),
    ("5.0.5", M.RuntimeExceptionMessage(timestamp=0, line=3, column=1, text="compile_error_name_not_found:txtmsg:"),
     f"0000003b 14 {'00' * 8} fd 0a 00000003 00000001 {b'compile_error_name_not_found:txtmsg:'.hex()}"),
    ("3.10", M.StartupMessage(first=510, second=259),
     f"00000018 14 {NO_TIME} fe 0c 000001fe 00000103 01"),
    # as UR's client library reads it
    ("5.26", M.HardwareInfoMessage(robot_type=7, box_series=7, tool_flange_type=2),
     f"0000001b 14 {NO_TIME} fe 12 00000007 0000 0007 0000 0002"),
    ("3.15.8", M.TextMessage(timestamp=16_634_482_000, text="hello\xe9"),
     f"00000015 14 {16_634_482_000:016x} fd 00 {b'hello'.hex()} e9"),
    ("3.15.8", M.ErrorCodeMessage(source=20, code=210, report_level=3, data_type=4, data=0xC0FFEE, text="x"),
     f"00000024 14 {NO_TIME} 14 06 000000d2 00000000 00000003 00000004 00c0ffee 78"),
    ("3.15.8", M.SafetyModeMessage(safety_mode=3, code=1, argument=-1, data_type=2, data=5),
     f"00000020 14 {NO_TIME} fd 05 00000001 ffffffff 03 00000002 00000005"),
    ("3.15.8", M.PopupMessage(request_id=1, is_warning=True, is_blocking=True, title="T", text="text"),
     f"00000020 14 {NO_TIME} fd 02 00000001 00000008 01 00 01 01 54 {b'text'.hex()}"),
    ("3.15.8", M.RequestValueMessage(timestamp=5, request_id=7, requested_type=M.RequestedType.FLOAT, text="x?"),
     f"00000019 14 {5:016x} fd 09 00000007 00000002 {b'x?'.hex()}"),
    # the forms of software up to 3.2
    ("3.2", M.VersionMessage(major=3, minor=2, bugfix=19171, build_date="May 01 2016, 00:00:00"),
     f"00000034 14 {NO_TIME} fe 03 09 {b'URControl'.hex()} 03 02 00004ae3 "
     f"{b'May 01 2016, 00:00:00'.hex()}"),
    ("3.2", M.ErrorCodeMessage(code=4, argument=5, text="old"),
     f"0000001a 14 {NO_TIME} fd 06 00000004 00000005 {b'old'.hex()}"),
    ("3.2", M.PopupMessage(is_error=True, title="T", text="x"),
     f"00000014 14 {NO_TIME} fd 02 00 01 01 54 78"),
    ("3.2", M.RuntimeExceptionMessage(text="old"), f"00000012 14 {NO_TIME} fd 0a {b'old'.hex()}"),
]  # fmt: skip
MESSAGE_IDS = [f"{type(message).__name__} {version}" for version, message, _ in MESSAGES]


def test_a_version_message_is_read_without_knowing_the_version():
    for version, message, data in MESSAGES:
        if isinstance(message, M.VersionMessage):
            for believed in (SoftwareVersion(3, 0), V3_15, SoftwareVersion(5, 24)):
                assert read(bytes.fromhex(data), believed) == [message], version


@pytest.mark.parametrize(("version", "message", "data"), MESSAGES, ids=MESSAGE_IDS)
def test_messages_cut_anywhere_are_refused_or_shorter_texts(version, message, data):
    version, data = SoftwareVersion.parse(version), bytes.fromhex(data)
    codec = codec_for(type(message), version)
    ends_with_text = codec.fields[-1].code == "s"
    refused = 0
    for end in range(5, len(data)):
        package = F.encode_package(20, data[5:end])
        try:
            (short,) = read(package, version)
        except RemoteProtocolError:
            refused += 1
        else:
            assert ends_with_text
            assert replace(short, **{codec.fields[-1].name: ""}) == replace(
                message, **{codec.fields[-1].name: ""}
            )
    text = getattr(message, codec.fields[-1].name)
    assert refused == len(data) - 5 - (len(text) if ends_with_text else 0)


def test_unknown_messages_and_packages_come_out_as_they_are():
    header = f"{NO_TIME} fd"
    (message,) = read(F.encode_package(20, bytes.fromhex(f"{header} 08 00112233")))
    assert message == M.UnknownMessage(message_type=8, body=b"\x00\x11\x22\x33")
    with pytest.raises(LocalProtocolError, match="UnknownMessage has no table"):
        encode_message(message, V3_15)
    # a 5.4 simulator's type 5
    assert read(bytes.fromhex("00000009 05 00000000")) == [P.UnknownPackage(5, bytes(4))]


def test_safety_tolerances_have_the_captured_size():
    data = P.encode_safety_tolerances()
    assert len(data) == 181
    assert data[:13].hex() == "000000b5183fc3333333333333"
    check_reading(reader, data, [P.SafetyTolerances()], trailing=data[:9])


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (M.TextMessage(timestamp=-1), "timestamp -1"),
        (M.TextMessage(source=200), "source 200"),
        (M.KeyMessage(title="x" * 256), "title has 256 characters"),
        (M.KeyMessage(code=2**31), "KeyMessage cannot be sent: code is 2147483648"),
        (M.VersionMessage(major=256), "major is 256"),
        (V.GlobalVariablesSetup(start_index=70_000), "start index 70000"),
        (V.GlobalVariablesUpdate(timestamp=-1), "timestamp -1"),
        (V.GlobalVariablesSetup(names=("a\nb",)), "no line feed"),
        (V.VariableUpdate(title="x" * 256), "256 characters"),
    ],
)
def test_values_that_do_not_fit_are_named(message, problem):
    with pytest.raises(LocalProtocolError, match=problem):
        encoder_of(message)(message, V3_15)


# --- robot state ---

TOTALS = [
    ("3.0", 1247, 577), ("3.1", 1295, 625), ("3.3", 1306, 636), ("3.4.5", 1306, 636), ("3.5", 1350, 680),
    ("3.9.1", 1350, 680), ("3.14.3", 1352, 682), ("3.15.8", 1352, 682), ("5.0.5", 1376, 706),
    ("5.1", 1384, 714), ("5.3", 1384, 714), ("5.8", 1386, 716), ("5.9.4", 1393, 723), ("5.24", 1393, 723),
    ("5.25", 1393, 723), ("5.25.1", 1397, 723),
]  # fmt: skip


def distinct(record):
    """A record whose every number differs from its neighbours; all exact in 32-bit floats."""
    values, number = {}, 1
    for field in wire_fields(record):
        one = []
        for _ in range(field.count):
            number = number % 100 + 1
            one.append(
                number % 2 == 1 if field.code == "?" else number + 0.5 if field.code in "df" else number
            )
        values[field.name] = tuple(one) if field.count > 1 else one[0]
    if "euromap67_installed" in values:
        values["euromap67_installed"] = False
    return record(**values)


def as_sent(record, version):
    """A record with defaults where a version does not send the field."""
    present = ("euromap67_installed",) if getattr(record, "euromap67_installed", False) else ()
    sent = {field.name for field in codec_for(type(record), version, present).fields}
    absent = {field.name for field in fields(record)} - sent
    defaults = type(record)()
    return replace(record, **{name: getattr(defaults, name) for name in absent})


@pytest.mark.parametrize(("version", "first", "later"), TOTALS)
def test_state_totals_are_the_documented_ones(version, first, later):
    version = SoftwareVersion.parse(version)
    records = [record() for record in L.SUB_PACKAGES]
    data = P.encode_state(records, version)
    assert len(data) == first == P.state_size(version, first=True)
    data = P.encode_state([record for record in records if not record.FIRST_STATE_ONLY], version)
    assert len(data) == later == P.state_size(version, first=False)


@pytest.mark.parametrize("version", [version for version, _, _ in TOTALS])
def test_states_by_four_methods(version):
    version = SoftwareVersion.parse(version)
    records = [distinct(record) for record in P.state_types(version, first=True)]
    data = P.encode_state(reversed(records), version)
    state = P.RobotState(tuple(as_sent(record, version) for record in records))
    check_reading(lambda: reader(version), data, [state], trailing=data[:100])


@pytest.mark.parametrize(
    ("version", "more"),
    [("3.15.8", []), ("5.0.5", [(11, 26)]), ("5.8", [(11, 26), (12, 8)]), ("5.12", [(11, 26), (12, 8), (13, 7)])],
)  # fmt: skip
def test_order_and_sizes_on_the_wire(version, more):
    data = P.encode_state([record() for record in L.SUB_PACKAGES], SoftwareVersion.parse(version))
    seen, position = [], 5
    while position < len(data):
        size, sub_type = struct.unpack_from(">iB", data, position)
        seen.append((sub_type, size))
        position += size
    board, info = (74, 8) if version == "5.0.5" else (75, 9)
    assert seen == [
        (0, 47), (1, 251), (4, 101), (5, 225), (9, 53), (3, board), (2, 37), (6, 445), (7, 61), (8, info), (10, 43),
        *more,
    ]  # fmt: skip


def test_configuration_grows_with_5_25_1():
    record = L.ConfigurationData(box_series=7, tool_flange_type=2)
    for version, end in (("5.25", ""), ("5.25.1", "0007 0002")):
        data = P.encode_sub_package(L.ConfigurationData, record, SoftwareVersion.parse(version))
        assert data[445:] == bytes.fromhex(end)
    assert P.decode_sub_package(6, data[5:]) == record


def test_robot_mode_data_byte_by_byte():
    record = L.RobotModeData(
        timestamp=6_242_520_000, is_real_robot_enabled=True, is_robot_power_on=True, is_program_running=True,
        robot_mode=7, control_mode=0, target_speed_fraction=1.0, speed_scaling=0.5,
    )  # fmt: skip
    data = P.encode_sub_package(L.RobotModeData, record, V3_15)
    assert data.hex(" ") == bytes.fromhex(
        "0000002f 00 0000000174154bc0 01 01 01 00 00 01 00 07 00"
        "3ff0000000000000 3fe0000000000000 3ff0000000000000 00"
    ).hex(" ")
    assert P.encode_sub_package(L.RobotModeData, replace(record, robot_mode=-1), V3_15)[20] == 0xFF
    for minor, size in ((1, 38), (2, 46), (4, 46), (5, 47)):
        assert len(P.encode_sub_package(L.RobotModeData, record, SoftwareVersion(3, minor))) == size


# Sub-packages of a 5.8 simulator's first state.
CAPTURED = [
    (L.AdditionalInfo(freedrive_button_enabled=True), "00000009 08 00 01 00 01"),
    (L.ToolCommunicationInfo(), "0000001a 0b 00 0001c200 00000000 00000001 3fc00000 40600000"),
    (L.ToolModeInfo(), "00000008 0c 00 01 01"),
    (
        L.MasterboardData(analog_output0=0.004000000189989805, analog_output1=0.004000000189989805, safety_checksum=0x57F4285B),
        "0000004b 03 00000000 00000000 01 01" + "00" * 18 + "3f70624de0000000" * 2
        + "41c00000 42400000 00000000 00000000 01 00 00 57f4285b 01 01 01",
    ),
    (
        L.SafetyData(safety_checksum=0x57F4285B, elbow_sphere=(0.0, 0.0, 0.0, 0.13)),
        "0000002b 0a 57f4285b 01 01" + "00" * 24 + "3fc0a3d70a3d70a4",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("record", "data"), CAPTURED, ids=[type(record).__name__ for record, _ in CAPTURED])
def test_captured_sub_packages(record, data):
    data = bytes.fromhex(data)
    assert P.encode_sub_package(type(record), record, SoftwareVersion(5, 8)) == data
    assert P.decode_sub_package(data[4], data[5:]) == record


def test_joints_stand_together_and_pairs_alternate():
    joints = distinct(L.JointData)
    data = P.encode_sub_package(L.JointData, joints, V3_15)
    for k in range(6):
        block = struct.unpack_from(">3d4fB", data, 5 + 41 * k)
        assert block == tuple(getattr(joints, field.name)[k] for field in fields(joints))
    configuration = distinct(L.ConfigurationData)
    data = P.encode_sub_package(L.ConfigurationData, configuration, V3_15)
    limits = configuration.joint_min_limit, configuration.joint_max_limit
    rates = configuration.joint_max_speed, configuration.joint_max_acceleration
    assert struct.unpack_from(">2d", data, 5 + 16 * 4) == tuple(values[4] for values in limits)
    assert struct.unpack_from(">2d", data, 101 + 16 * 5) == tuple(values[5] for values in rates)
    names = "masterboard_version", "controller_box_type", "robot_type", "robot_sub_type"
    assert struct.unpack_from(">4i", data, 429) == tuple(getattr(configuration, name) for name in names)


@pytest.mark.parametrize(("version", "size"), [("3.1", 88), ("3.5", 90), ("3.15", 91)])
def test_euromap_fields_are_there_only_with_the_board(version, size):
    version = SoftwareVersion.parse(version)
    record = replace(distinct(L.MasterboardData), euromap67_installed=True)
    data = P.encode_sub_package(L.MasterboardData, record, version)
    assert len(data) == size
    assert data[67] == 1
    assert struct.unpack_from(">II", data, 68) == (record.euromap67_input_bits, record.euromap67_output_bits)
    assert P.decode_sub_package(3, data[5:]) == as_sent(record, version)


def test_records_may_be_mappings_or_any_object():
    record = distinct(L.CartesianInfo)
    expected = P.encode_sub_package(L.CartesianInfo, record, V3_15)
    assert P.encode_sub_package(L.CartesianInfo, asdict(record), V3_15) == expected
    assert P.encode_sub_package(L.CartesianInfo, SimpleNamespace(**asdict(record)), V3_15) == expected
    board = asdict(distinct(L.MasterboardData))
    assert len(P.encode_sub_package(L.MasterboardData, board, V3_15)) == 75
    with pytest.raises(LocalProtocolError, match=r"CartesianInfo needs the field .*tcp_offset"):
        P.encode_sub_package(L.CartesianInfo, {"tcp_pose": (0.0,) * 6}, V3_15)
    with pytest.raises(LocalProtocolError, match="tcp_pose has 5 values instead of 6"):
        P.encode_sub_package(L.CartesianInfo, replace(record, tcp_pose=(0.0,) * 5), V3_15)


def test_a_reader_skips_what_newer_software_appends():
    record = distinct(L.ConfigurationData)
    data = P.encode_sub_package(L.ConfigurationData, record, SoftwareVersion(5, 25, 1))
    assert P.decode_sub_package(6, data[5:] + b"\x00\x01\x00\x02") == record
    body = F.encode_package(14, b"\x01\x02") + P.encode_sub_package(L.ForceModeData, L.ForceModeData(), V3_15)
    (state,) = read(F.encode_package(16, body))
    assert state.sub_packages == (P.UnknownSubPackage(14, b"\x01\x02"), L.ForceModeData())
    assert state.find(L.ForceModeData) == L.ForceModeData()
    assert state.find(L.JointData) is None


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("0000002f 00", "says 47 bytes, 5 are left"),
        ("00000004 00 00", "says 4 bytes"),
        ("ffffffff 00 00", "says -1 bytes"),
        ("00", "1 are left"),
        ("00000006 0c 00", "ToolModeInfo needs 3 bytes or more, these are 1"),
    ],
)
def test_states_that_do_not_add_up_are_refused(body, problem):
    with pytest.raises(RemoteProtocolError, match=problem):
        read(F.encode_package(16, bytes.fromhex(body)))


def test_a_state_takes_each_sub_package_once():
    with pytest.raises(LocalProtocolError, match="ToolData is unknown or repeated"):
        P.encode_state([L.ToolData(), L.ToolData()], V3_15)
    with pytest.raises(LocalProtocolError, match="SubPackage is unknown"):
        P.encode_state([F.SubPackage()], V3_15)


def test_software_before_3_0_has_no_table():
    old = SoftwareVersion(1, 8)
    assert P.state_types(old, first=True) == ()
    with pytest.raises(LocalProtocolError, match=r"1\.8\.0: use 3\.0\.0 or later"):
        P.encode_state([L.ToolData()], old)
    with pytest.raises(LocalProtocolError, match=r"1\.8\.0 had other layouts"):
        encode_message(M.TextMessage(text="x"), old)
    data = P.encode_message_package(M.TextMessage(text="x"), V3_15)
    assert read(data, old) == [M.TextMessage(text="x")]  # a reader makes the best of it


# --- where a program stands in PolyScope's tree


TWO = M.ProgramThreadsMessage(
    threads=(
        M.ThreadLabel(label_id=3, text="Move", thread_name="main"),
        M.ThreadLabel(label_id=-1, thread_name="t"),
    )
)
LABELS = [
    ("3.2", M.ProgramLabelMessage(label_id=12, text="Wait"), f"00000017 14 {NO_TIME} fd 01 0000000c 57616974"),
    ("3.15.8", TWO,
     f"00000030 14 {NO_TIME} fd 0e 00000003 00000004 4d6f7665 00000004 6d61696e ffffffff 00000000 00000001 74"),
    ("3.15.8", M.ProgramThreadsMessage(timestamp=8000), "0000000f 14 0000000000001f40 fd 0e"),
]  # fmt: skip


def test_a_threads_message_ends_between_threads_only():
    data = encode_message_package(TWO, V3_15)
    whole = {15: 0, 35: 1, 48: 2}  # bytes to threads
    for end in range(15, len(data) + 1):
        package = encode_package(20, data[5:end])
        if end in whole:
            assert len(read(package)[0].threads) == whole[end]
        else:
            with pytest.raises(RemoteProtocolError):
                read(package)


@pytest.mark.parametrize("length", ["ffffffff", "7fffffff", "00000005"])
def test_a_text_longer_than_its_package_is_refused(length):
    body = bytes.fromhex(f"{NO_TIME} fd 0e 00000001 {length} 41")
    with pytest.raises(RemoteProtocolError, match="cut off"):
        read(encode_package(20, body))


# --- names and values of global variables


boolean = partial(TypedValue, ValueType.BOOL)
text = partial(TypedValue, ValueType.CONST_STRING)
integer = partial(TypedValue, ValueType.INT)
real = partial(TypedValue, ValueType.FLOAT)


def listed(*values):
    return TypedValue(ValueType.LIST, values)


POSE = TypedValue(ValueType.POSE, (0.5, -0.25, 1.0, 0.0, 2.0, -4.0))
POSE_HEX = "3f000000 be800000 3f800000 00000000 40000000 c0800000"
MATRIX = TypedValue(ValueType.MATRIX, (tuple(map(integer, (1, 2, 3))), tuple(map(integer, (4, 5, 6)))))

# (version, message, bytes). The first update is the example of the document, the second a capture.
VARIABLES = [
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


@pytest.mark.parametrize(
    ("version", "message", "data"),
    [*MESSAGES, *LABELS, *VARIABLES],
    ids=lambda value: type(value).__name__ if hasattr(value, "timestamp") else "",
)
def test_messages_by_four_methods(version, message, data):
    version, data = SoftwareVersion.parse(version), bytes.fromhex(data)
    assert encoder_of(message)(message, version).hex(" ") == data.hex(" ")
    check_reading(lambda: reader(version), data, [message], trailing=data[:7])


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
    "3.14": {"var string": 4, "pose": 12, "bool": 13, "num": 14, "int": 15, "float": 16, "list": 17, "matrix": 18},
}  # fmt: skip
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
def test_values_of_variables_that_do_not_fit_are_named(value, problem):
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
