"""RTDE connections: both ends wired together, every package in every state, and what must be survived."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import pytest
from codec_ways import events_of
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.rtde import codec as M
from protocol.rtde.client_connection import DataReceived, RtdeClientConnection
from protocol.rtde.codec import MAX_NAMES_SIZE, encode_message
from protocol.rtde.fields import input_fields, output_fields
from protocol.rtde.server_connection import (
    InputReceived,
    RtdeServerConnection,
    UnknownPackage,
    cycles_per_package,
    request_limits,
)
from protocol.rtde.types import RtdeState
from protocol.ur_types import SoftwareVersion

V3_15 = SoftwareVersion(3, 15, 8)
SNAPSHOT = SimpleNamespace(timestamp=1.5, robot_mode=7, actual_q=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))


class Pair:
    """Both ends without a network."""

    def __init__(self, version=2):
        self.robot = RtdeServerConnection(V3_15, output_fields(V3_15), input_fields(V3_15))
        self.pc = RtdeClientConnection()
        if version == 2:
            assert self.ask(M.RequestProtocolVersion(2)) == M.RequestProtocolVersionReply(True)

    def ask(self, request, in_use=()):
        """One request and its reply."""
        self.robot.receive_data(self.pc.send(request))
        assert self.robot.next_event() == request
        (reply,) = self.to_pc(self.robot.reply(in_use))
        assert self.robot.next_event() is None
        return reply

    def to_pc(self, data):
        return events_of(self.pc)(data)

    def to_robot(self, data):
        self.robot.receive_data(data)
        return self.robot.next_event()


@pytest.fixture
def pair():
    return Pair()


@pytest.mark.parametrize("version", [1, 2])
def test_a_session_with_both_ends(version):
    pair = Pair(version)
    assert pair.ask(M.GetControllerVersion()) == M.GetControllerVersionReply(V3_15)
    outputs = M.SetupOutputs(("timestamp", "actual_q"), 125.0 if version == 2 else None)
    number = 1 if version == 2 else None
    assert pair.ask(outputs) == M.SetupOutputsReply(("DOUBLE", "VECTOR6D"), number)
    inputs = M.SetupInputs(("input_int_register_0", "external_force_torque"))
    assert pair.ask(inputs) == M.SetupInputsReply(("INT32", "VECTOR6D"), 1)
    assert pair.robot.encoder is None
    assert pair.ask(M.Start()) == M.StartReply(True)
    assert pair.to_pc(pair.robot.encoder(SNAPSHOT) * 2) == 2 * [
        DataReceived(("timestamp", "actual_q"), (1.5, SNAPSHOT.actual_q))
    ]
    values = (-5, (0.0, 1.0, 2.0, 3.0, 4.0, 5.0))
    assert pair.to_robot(pair.pc.send_data(1, values)) == InputReceived(inputs.names, values)
    for recipe_id, wrong in ((2, values), (1, (-5,)), (1, ("-5", values[1]))):
        with pytest.raises(LocalProtocolError):
            pair.pc.send_data(recipe_id, wrong)
    assert pair.ask(M.Pause()) == M.PauseReply(True)
    assert pair.robot.encoder is None
    assert pair.ask(M.Start()) == M.StartReply(True)
    assert pair.robot.encoder is not None


REQUESTS = [
    *map(M.RequestProtocolVersion, (1, 2, 3)), M.GetControllerVersion(),
    *(M.SetupOutputs((name,), 10.0) for name in ("robot_mode", "nonsense")),
    *(M.SetupInputs((name,)) for name in ("input_int_register_0", "nonsense")), M.Start(), M.Pause(),
]  # fmt: skip


@pytest.mark.parametrize("state", list(RtdeState))
@pytest.mark.parametrize("request_", REQUESTS)
def test_every_request_in_every_state_gets_one_reply(pair, state, request_):
    pair.ask(M.SetupOutputs(("timestamp",), 125.0))
    if state is RtdeState.STARTED:
        pair.ask(M.Start())
    reply = pair.ask(request_)
    assert type(reply) is M.REQUESTS[type(request_)]
    after = {M.Start: RtdeState.STARTED, M.Pause: RtdeState.PAUSED}.get(type(request_), state)
    assert pair.robot.state is pair.pc.state is after
    if isinstance(request_, M.Start | M.Pause):
        assert reply.accepted
    if isinstance(request_, M.RequestProtocolVersion):
        assert reply.accepted == (state is RtdeState.PAUSED and request_.version in M.VERSIONS)
        assert pair.robot.protocol_version == pair.pc.protocol_version
        assert pair.robot.protocol_version == (request_.version if reply.accepted else 2)


@pytest.mark.parametrize("state", list(RtdeState))
def test_data_and_text_are_taken_in_every_state_and_never_answered(pair, state):
    pair.ask(M.SetupInputs(("input_int_register_0",)))
    if state is RtdeState.STARTED:
        pair.ask(M.SetupOutputs(("timestamp",), 125.0))
        pair.ask(M.Start())
    assert pair.robot.state is state
    data, text = M.DataPackage(struct.pack(">i", 3), 1), M.RtdeTextMessage("hello", "test")
    assert pair.to_robot(encode_message(data, M.Role.PC, 2)) == InputReceived(("input_int_register_0",), (3,))
    assert pair.to_robot(encode_message(text, M.Role.PC, 2)) == text
    with pytest.raises(LocalProtocolError, match="nothing has been asked"):
        pair.robot.reply()


def test_a_request_must_be_answered_before_the_next_event(pair):
    pair.robot.receive_data(pair.pc.send(M.Start()) + pair.pc.send(M.Pause()))
    assert pair.robot.next_event() == M.Start()
    with pytest.raises(LocalProtocolError, match="no reply yet"):
        pair.robot.next_event()
    data = pair.robot.reply()
    assert pair.robot.next_event() == M.Pause()
    assert pair.to_pc(data + pair.robot.reply()) == [M.StartReply(False), M.PauseReply(True)]


def test_a_pipelined_version_request_decides_how_the_next_package_is_read():
    robot = RtdeServerConnection(V3_15, output_fields(V3_15), input_fields(V3_15))
    robot.receive_data(
        encode_message(M.RequestProtocolVersion(2), M.Role.PC, 1)
        + encode_message(M.SetupOutputs(("timestamp",), 50.0), M.Role.PC, 2)
    )
    assert robot.next_event() == M.RequestProtocolVersion(2)
    assert robot.reply() == bytes.fromhex("00045601")
    assert robot.next_event() == M.SetupOutputs(("timestamp",), 50.0)
    assert robot.reply() == b"\x00\x0aO\x01DOUBLE"
    assert robot.frequency == 50.0


# --- recipes


def test_the_second_output_recipe_replaces_the_first(pair):
    pair.ask(M.SetupOutputs(("timestamp",), 125.0))
    pair.ask(M.Start())
    pair.ask(M.SetupOutputs(("robot_mode",), 125.0))
    assert pair.to_pc(pair.robot.encoder(SNAPSHOT)) == [DataReceived(("robot_mode",), (7,))]


def test_an_unknown_output_makes_the_recipe_invalid_as_a_whole(pair):
    reply = pair.ask(M.SetupOutputs(("timestamp", "ft_raw_wrench", "actual_q"), 125.0))
    assert reply == M.SetupOutputsReply(("DOUBLE", "NOT_FOUND", "VECTOR6D"), 0)
    assert pair.ask(M.SetupOutputs(("timestamp",), 125.0)).recipe_id == 1


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("names", [None, (), ("no_such_variable",), ("timestamp", "ft_raw_wrench")])
@pytest.mark.parametrize("was_started", [False, True])
def test_there_is_no_start_without_an_output_recipe(version, names, was_started):
    pair, frequency = Pair(version), 125.0 if version == 2 else None
    pair.ask(M.SetupInputs(("input_int_register_0",)))
    if was_started and names is not None:
        pair.ask(M.SetupOutputs(("timestamp",), frequency))
        assert pair.ask(M.Start()) == M.StartReply(True)
    if names is not None:
        pair.ask(M.SetupOutputs(names, frequency))
    assert pair.ask(M.Start()) == M.StartReply(False)
    assert pair.robot.state is pair.pc.state is RtdeState.PAUSED
    pair.ask(M.SetupOutputs(("timestamp",), frequency))
    assert pair.robot.encoder is None
    assert pair.ask(M.Start()) == M.StartReply(True)
    assert pair.robot.encoder is not None


def test_an_input_in_use_makes_the_recipe_invalid_and_takes_no_id(pair):
    names = ("input_int_register_0", "input_int_register_1", "nonsense")
    reply = pair.ask(M.SetupInputs(names), {"input_int_register_1"})
    assert reply == M.SetupInputsReply(("INT32", "IN_USE", "NOT_FOUND"), 0)
    assert not pair.robot.input_recipes
    assert pair.ask(M.SetupInputs(names[:2])).recipe_id == 1


def test_empty_recipes_get_a_reply_and_no_id(pair):
    assert pair.ask(M.SetupInputs(())) == M.SetupInputsReply((), 0)
    assert pair.ask(M.SetupOutputs((), 125.0)) == M.SetupOutputsReply((), 0)


def test_recipes_of_each_direction_are_counted_and_end_with_the_last_id(pair):
    assert pair.ask(M.SetupOutputs(("timestamp",), 1.0)).recipe_id == 1
    ids = [pair.ask(M.SetupInputs(("input_int_register_0",))).recipe_id for _ in range(255)]
    assert ids == list(range(1, 256))
    assert pair.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 0
    ids = [pair.ask(M.SetupOutputs(("timestamp",), 1.0)).recipe_id for _ in range(255)]
    assert ids == [*range(2, 256), 1]


def test_a_list_of_names_beyond_the_limit_is_answered_but_not_found(pair):
    names = ["input_double_register_0"] * 100  # 23 characters and a comma each
    pair.robot.receive_data(b"\x09\x62I" + ",".join(names).encode())
    assert pair.robot.next_event() == M.SetupInputs(tuple(names))
    words = pair.robot.reply()[4:].decode().split(",")
    fit = (MAX_NAMES_SIZE + 1) // 24
    assert words == ["DOUBLE"] * fit + ["NOT_FOUND"] * (100 - fit)
    assert not pair.robot.input_recipes


def test_an_e_series_takes_the_names_of_all_its_outputs_at_once():
    version = SoftwareVersion(5, 26)
    known = output_fields(version)

    def answer(names):
        robot = RtdeServerConnection(version, known, input_fields(version))
        listed = ",".join(names).encode()
        robot.receive_data((3 + len(listed)).to_bytes(2, "big") + b"O" + listed)
        assert robot.next_event() == M.SetupOutputs(tuple(names), None)
        return robot.reply()[3:].decode().split(",")

    assert len(",".join(known)) > 9000
    assert answer(known) == [field.type.value for field in known.values()]
    fit = (MAX_NAMES_SIZE + 1) // 8
    assert answer([*["payload"] * 300, "robot_mode"]) == (
        ["DOUBLE"] * fit + ["NOT_FOUND"] * (300 - fit) + ["INT32"]
    )
    most = request_limits(version).package - 3
    assert len(answer(["x"] * (most // 2))) == most // 2  # the reply fits into a package


# --- rates


@pytest.mark.parametrize(
    ("frequency", "cycles"),
    [
        *((125, 1), (100, 1), (63, 1), (62.5, 2), (60, 2), (50, 2), (25, 5), (10, 12), (1, 125)),
        *((1000, 1), (0, 125), (-1, 125), (0.1, 125), (float("nan"), 1), (float("inf"), 1), (None, 1)),
    ],
)
def test_cycles_per_package(frequency, cycles):
    assert cycles_per_package(frequency, 125) == cycles
    assert cycles_per_package(125.0, 500) == 4


# --- wrong bytes, robot's side


@pytest.mark.parametrize("data", [b"\0\0", b"\0\2S", b"\0\1", b"GET / HTTP/1.1\r\n", b"\x20\x00S"])
def test_absurd_sizes_end_the_connection_for_good(pair, data):
    pair.robot.receive_data(data + b"\0\3S")
    for _ in range(2):
        with pytest.raises(RemoteProtocolError, match="RTDE package of"):
            pair.robot.next_event()
    (text,) = pair.to_pc(pair.robot.text(M.RtdeTextMessage("not RTDE", "test", 1)))
    assert text == M.RtdeTextMessage("not RTDE", "test", 1)


@pytest.mark.parametrize("data", [b"\0\3V", b"\0\4V\0", b"\0\x0aO1234567"])
def test_requests_without_what_they_ask_end_the_connection(pair, data):
    pair.robot.receive_data(data)
    with pytest.raises(RemoteProtocolError, match="cannot have only"):
        pair.robot.next_event()


@pytest.mark.parametrize(
    "junk",
    [
        b"\0\3U",  # no recipe id
        b"\0\4U\0",
        b"\0\4U\1",  # not one value
        b"\0\x08U\2abcd",  # no such recipe
        b"\0\3M",
        b"\0\6M\xffab",
    ],
)
def test_senseless_data_and_text_are_skipped(pair, junk):
    pair.ask(M.SetupInputs(("input_int_register_0",)))
    assert pair.to_robot(junk + pair.pc.send(M.Start())) == M.Start()


def test_a_package_of_an_unknown_type_gets_a_text_in_reply(pair):
    for kind in set(range(256)) - set(M.RtdePackageType):
        assert pair.to_robot(bytes((0, 5, kind)) + b"ab" + pair.pc.send(M.Pause())) == UnknownPackage(kind)
        data = pair.robot.reply()
        assert pair.robot.next_event() == M.Pause()
        text, pause = pair.to_pc(data + pair.robot.reply())
        assert f"({kind})" in text.message
        assert pause == M.PauseReply(True)


def test_data_of_the_wrong_size_as_ur_rtde_sends_it(pair):
    """Source: ur_rtde 1.6.5, getForwardKinematics and setExternalForceTorque."""
    doubles = tuple(f"input_double_register_{i}" for i in range(6))
    assert pair.ask(M.SetupInputs(("input_int_register_0", *doubles))).recipe_id == 1
    assert pair.ask(M.SetupInputs(("input_int_register_0", *doubles, "input_int_register_1"))).recipe_id == 2
    command = struct.pack(">i12d", 44, *range(12))
    too_long = encode_message(M.DataPackage(command, 1), M.Role.PC, 2)
    assert pair.to_robot(too_long).values == (44, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    too_short = encode_message(M.DataPackage(command[:52], 2), M.Role.PC, 2)
    received = pair.to_robot(too_short)
    assert received.values == (44, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    assert received.names == ("input_int_register_0", *doubles)


@given(st.binary(max_size=200), st.integers(1, 50))
def test_no_bytes_do_more_than_end_the_connection(data, step):
    robot = RtdeServerConnection(V3_15, output_fields(V3_15), input_fields(V3_15))
    robot.receive_data(b"\0\5V\0\2\0\x17Iinput_int_register_0")
    for start in range(0, len(data), step):
        robot.receive_data(data[start : start + step])
        try:
            while (event := robot.next_event()) is not None:
                if type(event) in {*M.REQUESTS, UnknownPackage}:
                    reply = robot.reply()
                    assert int.from_bytes(reply[:2], "big") == len(reply)
        except RemoteProtocolError:
            return


def test_the_longest_package_is_taken(pair):
    size = request_limits(V3_15).package
    pair.robot.receive_data(size.to_bytes(2, "big") + b"I" + b"x" * (size - 3))
    assert pair.robot.next_event() == M.SetupInputs(("x" * (size - 3),))
    assert pair.robot.reply() == b"\0\x0dI\0NOT_FOUND"


# --- wrong bytes, PC's side


@pytest.mark.parametrize(
    ("before", "package", "match"),
    [
        ([], M.StartReply(True), "nothing was asked"),
        ([], M.DataPackage(bytes(8), 1), "before it had answered"),
        ([M.SetupOutputs(("timestamp",), 1.0)], M.DataPackage(bytes(8), 1), "before it had answered"),
        (
            [M.SetupOutputs(("timestamp",), 1.0), M.Start(), M.SetupOutputs((), 1.0)],
            M.DataPackage(bytes(8), 1),
            "not set up",
        ),
        ([M.SetupOutputs(("timestamp",), 1.0), M.Start()], M.DataPackage(bytes(7), 1), "bytes of values"),
        ([M.SetupOutputs(("timestamp",), 1.0), M.Start()], M.DataPackage(bytes(8), 2), "not set up"),
    ],
)
def test_a_robot_that_breaks_the_rules_is_named(pair, before, package, match):
    for request in before:
        pair.ask(request)
    with pytest.raises(RemoteProtocolError, match=match):
        pair.to_pc(encode_message(package, M.Role.ROBOT, 2))


@pytest.mark.parametrize(
    ("request_", "reply", "match"),
    [
        (M.Start(), M.PauseReply(True), "Start.. was asked"),
        (M.SetupOutputs(("a", "b"), 1.0), M.SetupOutputsReply(("INT32",), 1), "1 types for 2 names"),
        (M.SetupOutputs(("a",), 1.0), M.SetupOutputsReply(("FLOAT",), 1), "unknown type"),
    ],
)
def test_a_wrong_reply_is_named(pair, request_, reply, match):
    pair.pc.send(request_)
    with pytest.raises(RemoteProtocolError, match=match):
        pair.to_pc(encode_message(reply, M.Role.ROBOT, 2))


def test_a_robot_with_unknown_packages_is_named(pair):
    with pytest.raises(RemoteProtocolError, match="unknown type 88"):
        pair.to_pc(b"\0\3X")


def test_text_may_come_between_request_and_reply(pair):
    """Source: newer software warns before its version reply, see the public client library."""
    pair.pc.send(M.Start())
    warning = M.RtdeTextMessage("SafetySetup has not been confirmed yet", "", 2)
    data = encode_message(warning, M.Role.ROBOT, 2) + encode_message(M.StartReply(True), M.Role.ROBOT, 2)
    assert pair.to_pc(data) == [warning, M.StartReply(True)]


def test_data_on_its_way_when_we_paused_is_skipped(pair):
    pair.ask(M.SetupOutputs(("timestamp",), 1.0))
    pair.ask(M.Start())
    data = pair.robot.encoder(SNAPSHOT)
    pair.ask(M.Pause())
    assert pair.to_pc(data) == []


def test_what_cannot_be_sent_is_not_waited_for(pair):
    with pytest.raises(LocalProtocolError):
        pair.pc.send(M.SetupOutputs(("timestamp",)))
    assert pair.ask(M.Pause()) == M.PauseReply(True)
