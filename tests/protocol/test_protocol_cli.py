"""`python -m protocol`: captures in, named fields out, one-line errors."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import pytest

from protocol.__main__ import main
from protocol.primary.framing import encode_package
from protocol.primary.layout import SUB_PACKAGES
from protocol.primary.messages import version_message
from protocol.primary.packages import encode_message_package, encode_state
from protocol.realtime.layout import COLUMNS, SNAPSHOT_FIELDS, layout_for_size
from protocol.ur_types import SoftwareVersion

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
    ("arguments", "status", "message"),
    [
        (["decode", "/nowhere/capture.bin"], 2, "error: [Errno 2] No such file"),
        (["layout", "--version", "three"], 2, "error: 'three' is not a software version"),
        (["layout", "--version", "4.0"], 2, "error: no controller software 4.0.0"),
    ],
)
def test_mistakes_are_one_line(arguments, status, message, capsys):
    assert main(arguments) == status
    captured = capsys.readouterr()
    assert captured.err.startswith(message)
    assert captured.err.count("\n") == 1
    assert captured.out == ""


@pytest.mark.parametrize(
    "data", [b"SSH-2.0-OpenSSH_9\r\n", b"\0\0\0\x40" + bytes(60), realtime_capture()[1:]]
)
def test_other_captures_are_refused(data, tmp_path, capsys):
    capture = tmp_path / "capture.bin"
    capture.write_bytes(data)
    assert main(["decode", str(capture)]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_an_empty_capture_is_nothing(tmp_path, capsys):
    capture = tmp_path / "capture.bin"
    capture.write_bytes(b"")
    assert main(["decode", str(capture)]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("version", "size"), [("3.15.8", 1140), ("5.12", 1220)])
def test_layout(version, size, capsys):
    assert main(["layout", "--version", version]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0].endswith(f"{size} bytes")
    assert ("robot_mode" in out) == (size > 756)
    assert ("first 1352 bytes, later 682" in out) == (version == "3.15.8")
