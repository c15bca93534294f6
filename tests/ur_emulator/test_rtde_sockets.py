"""RTDE of a whole box over real sockets, in lockstep."""

import socket
import struct
from itertools import pairwise

import pytest
from box_support import TIMEOUT, FrameReader, MessageReader, connect
from rtde_support import RtdeClient

from protocol.primary.layout import MasterboardData, ToolData
from protocol.rtde import codec as M
from protocol.rtde.fields import INPUTS, output_fields
from protocol.ur_types import ProgramState, SoftwareVersion
from ur_emulator import ControlBox

COUNT = "def c():\n  i = 0\n  while i < {}:\n    i = i + 1\n    write_output_integer_register(24, i)\n    sync()\n  end\nend\n"

# What ur_rtde 1.6.5 asks of a 3.15, each list with its trailing comma.
UR_RTDE_RECEIVE = (
    "timestamp,target_q,target_qd,target_qdd,target_current,target_moment,actual_q,actual_qd,actual_current,"
    "joint_control_output,actual_TCP_pose,actual_TCP_speed,actual_TCP_force,target_TCP_pose,target_TCP_speed,"
    "actual_digital_input_bits,joint_temperatures,actual_execution_time,robot_mode,joint_mode,safety_mode,"
    "actual_tool_accelerometer,speed_scaling,target_speed_fraction,actual_momentum,actual_main_voltage,"
    "actual_robot_voltage,actual_robot_current,actual_joint_voltage,actual_digital_output_bits,runtime_state,"
    "standard_analog_input0,standard_analog_input1,standard_analog_output0,standard_analog_output1,"
    "robot_status_bits,safety_status_bits,payload,payload_cog,payload_inertia,output_int_register_2,"
    + "".join(f"output_int_register_{i}," for i in range(12, 20))
    + "".join(f"output_double_register_{i}," for i in range(12, 20))
)


@pytest.fixture
def box():
    with ControlBox(pace="lockstep", port_base=None, seed=7) as running:
        yield running


@pytest.fixture
def client(box):
    with connect(box, "rtde") as sock:
        yield RtdeClient(sock)


def run(box, text):
    with connect(box, "secondary") as sock:
        sock.sendall(text.encode())


def raw_ask(sock, kind, payload):
    """One request in bytes, one package back: what a client that looks at nothing does."""
    sock.sendall(struct.pack(">HB", 3 + len(payload), kind) + payload)
    return raw_next(sock)


def raw_next(sock):
    size, kind = struct.unpack(">HB", sock.recv(3, socket.MSG_WAITALL))
    return kind, sock.recv(size - 3, socket.MSG_WAITALL) if size > 3 else b""


def test_the_version_is_that_of_the_dashboard(box, client):
    reply = client.ask(M.GetControllerVersion())
    assert reply.version == SoftwareVersion(3, 15, 8, 106339)
    with connect(box, "dashboard") as sock:
        lines = sock.makefile("rw", newline="\n")
        lines.readline()
        lines.write("PolyscopeVersion\n")
        lines.flush()
        assert str(reply.version) in lines.readline()


def test_start_up_of_ur_rtde_reads_exactly_one_package_after_each_request(box):
    with connect(box, "rtde") as sock:
        assert raw_ask(sock, ord("V"), b"\0\2") == (ord("V"), b"\1")
        assert raw_ask(sock, ord("v"), b"") == (ord("v"), struct.pack(">4I", 3, 15, 8, 106339))
        kind, types = raw_ask(sock, ord("O"), struct.pack(">d", 125.0) + UR_RTDE_RECEIVE.encode())
        assert (kind, types[0]) == (ord("O"), 1)
        words = types[1:].decode().split(",")
        names = UR_RTDE_RECEIVE.rstrip(",").split(",")
        fields = output_fields(SoftwareVersion(3, 15, 8))
        assert words == [fields[name].type.value for name in names]
        assert raw_ask(sock, ord("S"), b"") == (ord("S"), b"\1")
        kind, values = raw_next(sock)
        assert (kind, values[0]) == (ord("U"), 1)
        assert len(values) == 1 + sum(fields[name].type.size for name in names)


def test_frames_agree_with_the_realtime_port(box, client):
    with connect(box, "realtime") as sock:
        frame = FrameReader(sock).next()
    client.subscribe("timestamp", "actual_q", "actual_TCP_pose", "joint_temperatures", "robot_mode")
    values = client.data()
    assert values["timestamp"] == frame.timestamp  # time stands still
    assert values["actual_q"] == tuple(frame.actual_q)
    assert values["actual_TCP_pose"] == tuple(frame.actual_tcp_pose)
    assert values["joint_temperatures"] == tuple(frame.joint_temperatures)
    assert values["robot_mode"] == frame.robot_mode


def test_no_cycle_is_lost_in_lockstep(box, client):
    client.subscribe("timestamp", "output_int_register_24", "runtime_state")
    run(box, COUNT.format(500))
    counts, stamps = [], []
    while not counts or counts[-1] != 500:
        values = client.data()
        if values["runtime_state"] == ProgramState.PLAYING and values["timestamp"] not in stamps[-1:]:
            counts.append(values["output_int_register_24"])
            stamps.append(values["timestamp"])
    assert counts == list(range(counts[0], 501))
    assert counts[0] == 1
    steps = [round((after - before) / 0.008, 6) for before, after in pairwise(stamps)]
    assert set(steps) == {1.0}


def test_a_lower_rate_gives_stamps_that_far_apart(box, client):
    client.subscribe("timestamp", "output_int_register_24", frequency=25.0)
    client.data()  # the first one sets the phase
    run(box, COUNT.format(400))
    playing = [client.until(lambda v: v["output_int_register_24"] > 0)]
    while playing[-1]["output_int_register_24"] < 390:
        playing.append(client.data())
    assert {round(b["timestamp"] - a["timestamp"], 6) for a, b in pairwise(playing)} == {0.04}
    assert {b["output_int_register_24"] - a["output_int_register_24"] for a, b in pairwise(playing)} == {5}


def test_while_time_stands_still_packages_keep_coming(client):
    client.subscribe("timestamp", "runtime_state")
    last = client.data()
    while (values := client.data()) != last:  # until time stands still
        last = values
    assert client.data() == client.data() == last


def test_a_script_and_a_client_hand_values_to_and_fro(box, client):
    command = client.own("input_int_register_24", "input_double_register_24")
    client.subscribe("output_double_register_24", "output_int_register_24", "runtime_state")
    client.write(command, 0, 0.0)
    run(
        box,
        "def dialogue():\n"
        "  write_output_integer_register(24, 1)\n"
        "  while read_input_integer_register(24) != 7:\n    sync()\n  end\n"
        "  write_output_float_register(24, 2 * read_input_float_register(24))\n"
        "  write_output_integer_register(24, 2)\n"
        "end\n",
    )
    client.until(lambda v: v["output_int_register_24"] == 1)
    client.write(command, 7, 1.25)
    done = client.until(lambda v: v["output_int_register_24"] == 2)
    assert done["output_double_register_24"] == 2.5
    client.until(lambda v: v["runtime_state"] == ProgramState.STOPPED)


def test_an_output_switched_by_a_client_is_seen_by_all(box, client):
    client.subscribe("actual_digital_output_bits")
    with connect(box, "rtde") as sock:
        other = RtdeClient(sock)
        recipe = other.own("standard_digital_output_mask", "standard_digital_output")
        other.write(recipe, 0b1000, 0b1000)
        client.until(lambda v: v["actual_digital_output_bits"] & 0b1000)
        other.write(recipe, 0b1000, 0)
        client.until(lambda v: not v["actual_digital_output_bits"] & 0b1000)


def test_analog_lines_agree_with_the_primary_port(box, client):
    names = ("standard_analog_output0", "standard_analog_output1", "tool_analog_input0", "analog_io_types")
    client.subscribe(*names)
    recipe = client.own(
        "standard_analog_output_mask", "standard_analog_output_type", "standard_analog_output_1"
    )
    client.write(recipe, 0b10, 0b10, 0.5)
    values = client.until(lambda v: v["standard_analog_output1"] == 5.0)
    with connect(box, "primary") as sock:
        records = {type(record): record for record in MessageReader(sock).state().sub_packages}
    board, tool = records[MasterboardData], records[ToolData]
    assert values["standard_analog_output0"] == board.analog_output0
    assert values["standard_analog_output1"] == board.analog_output1
    assert values["tool_analog_input0"] == tool.analog_input2
    domains = (
        board.analog_input_range0,
        board.analog_input_range1,
        board.analog_output_domain0,
        board.analog_output_domain1,
    )
    assert values["analog_io_types"] == sum(domain << i for i, domain in enumerate(domains))


def test_inputs_are_free_after_their_owner_is_gone(box):
    names = tuple(field.name for field in INPUTS if field.name.startswith("input_int"))
    with connect(box, "rtde") as first, connect(box, "rtde") as second:
        owner, other = RtdeClient(first), RtdeClient(second)
        assert owner.own(*names) == 1
        assert other.own(names[5]) == 0
        # Closed with data unread, which resets the connection: a crash or ur_rtde's way to end.
        owner.subscribe("timestamp")
        owner.data()
        first.close()
        while not (number := other.own(names[5])):
            pass
        assert number == 1


def test_pause_is_answered_and_ends_the_data(client):
    assert client.ask(M.Pause()) == M.PauseReply(True)
    client.subscribe("timestamp")
    client.data()
    assert client.ask(M.Pause()) == M.PauseReply(True)
    assert client.ask(M.GetControllerVersion()).version.major == 3
    assert client.ask(M.Start()) == M.StartReply(True)
    client.data()


def test_what_is_no_rtde_gets_a_text_and_the_end(box):
    with connect(box, "rtde") as sock:
        sock.sendall(b"HELO this is no robot\r\n\r\n")
        kind, text = raw_next(sock)
        assert kind == ord("M")
        assert b"RTDE" in text
        assert sock.recv(1) == b""


def test_wrong_sizes_are_survived(client):
    recipe = client.own("input_int_register_0", "input_double_register_0")
    client.subscribe("input_int_register_0", "input_double_register_0")
    for values, expected in (
        (struct.pack(">id", 1, 1.5) + bytes(48), (1, 1.5)),
        (struct.pack(">i", 2), (2, 1.5)),
        (struct.pack(">id", 3, 3.5), (3, 3.5)),
    ):
        client.sock.sendall(b"\0\3U" + struct.pack(">HBB", 4 + len(values), ord("U"), recipe) + values)
        client.until(lambda v, expected=expected: tuple(v.values()) == expected)


def test_a_client_that_does_not_read_gets_whole_packages_and_does_not_stop_the_others():
    """In real time, as fast as the processor goes: the sleeper loses packages, what it gets is whole."""
    with (
        ControlBox(pace="realtime", speed=100.0, port_base=None, seed=7) as fast,
        socket.socket() as sleeper,
        connect(fast, "rtde") as sock,
    ):
        sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sleeper.settimeout(TIMEOUT)
        sleeper.connect((fast.host, fast.ports.rtde))
        names = tuple(output_fields(SoftwareVersion(3, 15, 8)))[:60]
        asleep = RtdeClient(sleeper)
        asleep.subscribe(*names)
        awake = RtdeClient(sock)
        awake.subscribe("timestamp")
        first = awake.data()["timestamp"]
        size = sum(output_fields(SoftwareVersion(3, 15, 8))[name].type.size for name in names)
        enough = 600_000 // size  # cycles that certainly fill every buffer on the way
        awake.until(lambda v: v["timestamp"] > first + 0.008 * enough)
        stamps = [asleep.data()["timestamp"]]
        while stamps[-1] < first + 0.008 * enough:  # decoding would fail on a package that is cut
            stamps.append(asleep.data()["timestamp"])
        gaps = [round((b - a) / 0.008) for a, b in pairwise(stamps)]
        assert max(gaps) > 1
        assert min(gaps) == 1


def test_in_lockstep_time_waits_for_a_client_that_reads_late(box):
    fields = output_fields(SoftwareVersion(3, 15, 8))
    names = ("output_int_register_24", *[name for name in fields if fields[name].type.count == 6])
    n_cycles = 2000
    size = sum(fields[name].type.size for name in names)
    assert size * n_cycles > 1_000_000  # more than the buffers on the way hold
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.settimeout(TIMEOUT)
        sock.connect((box.host, box.ports.rtde))
        late = RtdeClient(sock)
        late.subscribe(*names)
        run(box, COUNT.format(n_cycles))
        with connect(box, "primary") as other:
            other.recv(1)  # the box goes on serving others meanwhile
        counts = [0]
        while counts[-1] < n_cycles:
            counts.append(late.data()["output_int_register_24"])
    assert {after - before for before, after in pairwise(counts)} <= {0, 1}
