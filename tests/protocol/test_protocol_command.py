"""`python -m protocol`: captures in pieces, a look at a box that runs, one-line errors."""

import io
import struct
import sys
from types import SimpleNamespace

import pytest
from codec_ways import in_pieces

from protocol.__main__ import main
from protocol.as_text import RtdeDecoder, StreamDecoder
from protocol.errors import RemoteProtocolError
from protocol.primary.framing import encode_package
from protocol.primary.layout import SUB_PACKAGES, RobotModeData
from protocol.primary.messages import version_message
from protocol.primary.packages import encode_message_package, encode_state
from protocol.realtime.layout import COLUMNS, SNAPSHOT_FIELDS, layout_for_size
from protocol.rtde import codec as R
from protocol.rtde.client_connection import RtdeClientConnection
from protocol.rtde.codec import data_header, encode_message
from protocol.rtde.fields import input_fields, output_fields
from protocol.rtde.server_connection import RtdeServerConnection
from protocol.ur_types import SoftwareVersion
from ur_emulator import ControlBox

VERSION = SoftwareVersion(3, 15, 8)


def realtime_capture():
    layout = layout_for_size(1140)
    counts = {column.attribute: column.count for column in COLUMNS}
    values = {name: 0.25 if counts[name] == 1 else (0.5,) * counts[name] for name in SNAPSHOT_FIELDS}
    return layout.encoder()(SimpleNamespace(**values))


def test_decode_realtime(tmp_path, capsys):
    capture = tmp_path / "capture.bin"
    capture.write_bytes(realtime_capture() * 2 + b"\0\0")
    assert main(["decode", str(capture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "byte 0: realtime frame, 1140 bytes"
    assert lines[1].split() == ["timestamp", "0.25", "s"]
    assert "byte 1140: realtime frame, 1140 bytes" in lines
    assert lines[-1] == "byte 2280: 2 bytes of a package that is not complete"


def test_decode_primary_from_standard_input(monkeypatch, capsys):
    data = encode_message_package(version_message(VERSION), VERSION)
    data += encode_state([record() for record in SUB_PACKAGES], VERSION) + encode_package(5, bytes(4))
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(data)))
    assert main(["decode", "-", "--version", "3.0"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("byte 0: VersionMessage, 55 bytes\n")
    assert "  build_date                   '03-05-2019, 06:39:00'\n" in out
    assert "byte 55: RobotState, 1352 bytes\n  RobotModeData\n" in out
    assert "    tcp_pose                     [0, 0, 0, 0, 0, 0] m, rad\n" in out
    assert out.endswith("byte 1407: UnknownPackage, 9 bytes\n  package_type                 5\n  body  "
                        "                       00 00 00 00\n")  # fmt: skip


@pytest.mark.parametrize(
    "data", [b"", b"SSH-2.0-OpenSSH_9\r\n", b"\0\0\0\x40" + bytes(60), realtime_capture()[1:]]
)
def test_other_captures_are_refused_and_an_empty_one_is_nothing(data, tmp_path, capsys):
    capture = tmp_path / "capture.bin"
    capture.write_bytes(data)
    assert main(["decode", str(capture)]) == bool(data)
    captured = capsys.readouterr()
    assert captured.err.count("\n") == bool(data)
    assert captured.out == ""


@pytest.mark.parametrize(("version", "size"), [("3.15.8", 1140), ("5.12", 1220)])
def test_layout(version, size, capsys):
    assert main(["layout", "--version", version]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0].endswith(f"{size} bytes")
    assert ("robot_mode" in out) == (size > 756)
    assert ("first 1352 bytes, later 682" in out) == (version == "3.15.8")


# --- streams in pieces, RTDE, live


NAMES = ("timestamp", "actual_q")


def robot_says(*requests, version=2):
    """Everything a robot answers, and one data package."""
    pc, robot = (
        RtdeClientConnection(),
        RtdeServerConnection(VERSION, output_fields(VERSION), input_fields(VERSION)),
    )
    data = b""
    for request in requests:
        robot.receive_data(pc.send(request))
        robot.next_event()
        data += (reply := robot.reply())
        pc.receive_data(reply)
        pc.next_event()
    values = struct.pack(">7d", 60.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    return data + data_header(len(values), 1 if version == 2 else None) + values


SESSION = robot_says(
    R.RequestProtocolVersion(2), R.GetControllerVersion(), R.SetupOutputs(NAMES, 125.0), R.Start()
)


def lines_of(decoder, data, step):
    return [*in_pieces(decoder.feed, data, step), *decoder.end()]


@pytest.mark.parametrize("step", [1, 7, 1000])
def test_an_rtde_session_in_pieces(step):
    lines = lines_of(RtdeDecoder(NAMES), SESSION + b"\0", step)
    assert lines == [
        "byte 0: RequestProtocolVersionReply, 4 bytes",
        "  accepted                     True",
        "byte 4: GetControllerVersionReply, 19 bytes",
        "  version                      3.15.8",
        "byte 23: SetupOutputsReply, 19 bytes",
        "  types                        ['DOUBLE', 'VECTOR6D']",
        "  recipe_id                    1",
        "byte 42: StartReply, 4 bytes",
        "  accepted                     True",
        "byte 46: DataPackage, 60 bytes",
        "  timestamp                    60",
        "  actual_q                     [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]",
        "byte 106: 1 bytes of a package that is not complete",
    ]


def test_a_session_in_version_1_without_names():
    data = robot_says(R.SetupOutputs(NAMES), R.Start(), version=1)
    lines = lines_of(RtdeDecoder(), data, 1000)
    assert "  recipe_id                    none" in lines
    assert lines[-2:] == [
        "  value 1                      60",
        "  value 2                      [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]",
    ]


@pytest.mark.parametrize("data", [b"\0\2S", b"\0\3?", b"GE", encode_message(
    R.SetupOutputsReply(("DUOBLE",)), R.Role.ROBOT, 1)], ids=["size", "type", "half", "word"])  # fmt: skip
def test_what_is_no_rtde_is_refused_or_waited_for(data):
    decoder = RtdeDecoder()
    if data == b"GE":
        assert lines_of(decoder, data, 1) == ["byte 0: 2 bytes of a package that is not complete"]
    else:
        with pytest.raises(RemoteProtocolError):
            lines_of(decoder, data, 1000)


@pytest.mark.parametrize("step", [1, 60, 10_000])
def test_a_primary_stream_in_pieces(step):
    data = encode_message_package(version_message(VERSION), VERSION)
    data += encode_state([RobotModeData(timestamp=60_000_000)], VERSION)
    lines = lines_of(StreamDecoder(SoftwareVersion(3, 0)), data, step)
    assert lines[0] == "byte 0: VersionMessage, 55 bytes"
    assert lines[1] == "  timestamp                    none"
    assert "    timestamp                    60000000 us" in lines


@pytest.fixture(scope="module")
def box():
    with ControlBox(robot="ur5e", version="5.25.1", pace="lockstep", port_base=None) as box:
        yield box


@pytest.mark.parametrize(
    ("interface", "port", "count", "expected"),
    [
        ("realtime", "realtime_ro", 2, ["byte 0: realtime frame, 1220 bytes", "  payload_inertia ", "byte 1220: realtime"]),
        ("secondary", "secondary", 2, ["byte 0: VersionMessage, 55 bytes", "byte 55: "]),
        ("primary", "primary", 3, ["byte 0: VersionMessage, 55 bytes", "byte 79: RobotState, 1397 bytes",
                        "    robot_type                   1", "    tool_flange_type             1", "  SingularityInfo"]),
        ("rtde", "rtde", 5, ["byte 0: RequestProtocolVersionReply, 4 bytes", "byte 4: SetupOutputsReply",
                             "  time_scale_source            0"]),
    ],
)  # fmt: skip
def test_a_look_at_a_box_that_runs(box, interface, port, count, expected, capsys):
    where = f"{box.host}:{getattr(box.ports, port)}"
    options = ["--live", where, "--count", str(count), "--names", "time_scale_source"]
    assert main(["decode", interface, *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(expected[0])
    assert all(any(line.startswith(start) for line in lines) for start in expected)


def test_a_variable_that_the_box_lacks_is_named(box, capsys):
    where = f"{box.host}:{box.ports.rtde}"
    assert main(["decode", "rtde", "--live", where, "--names", "timestamp,actual_Q"]) == 2
    assert capsys.readouterr().err == "error: this box has no actual_Q: `layout rtde` lists the variables\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["decode", "/nowhere/capture.bin"], "error: [Errno 2] No such file"),
        (["layout", "--version", "three"], "error: 'three' is not a software version"),
        (["layout", "--version", "4.0"], "error: no controller software 4.0.0"),
        (["decode", "--live", "127.0.0.1", "capture.bin"], "error: with --live, name one interface and no"),
        (["decode", "rtde", "capture.bin", "--live", "127.0.0.1"], "error: with --live, name one interface"),
        (["decode", "rtde"], "error: 0 files given"),
        (["decode", "a", "b"], "error: 2 files given"),
        (["decode", "rtde", "--live", "127.0.0.1:port"], "error: '127.0.0.1:port' is not an address"),
        (["decode", "rtde", "--live", "127.0.0.1:70000"], "error: '127.0.0.1:70000' is not an address"),
        (["decode", "rtde", "--live", ":30004"], "error: ':30004' is not an address"),
    ],
)
def test_wrong_arguments_are_one_line(arguments, message, capsys):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith(message)
    assert captured.err.count("\n") == 1
    assert captured.out == ""


@pytest.mark.parametrize("interface", ["realtime", "primary", "rtde"])
def test_the_layout_of_one_interface(interface, capsys):
    assert main(["layout", interface, "--version", "3.4"]) == 0
    out = capsys.readouterr().out
    assert ("1060 bytes" in out) == (interface == "realtime")
    assert ("first 1306 bytes, later 636" in out) == (interface == "primary")
    assert ("RTDE inputs, port 30004, software 3.4.0" in out) == (interface == "rtde")
    assert ("input_int_register_24" in out) is False
