"""Numbers and names that both ends share."""

from __future__ import annotations

import dataclasses

import pytest

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.serial_numbers import parse_serial, simulated_serial
from protocol.ur_types import (
    JOINT_NAMES,
    JointMode,
    Ports,
    ProgramState,
    RobotMode,
    RobotType,
    SafetyMode,
    SoftwareVersion,
)
from protocol.wire_record import since


@pytest.mark.parametrize(
    ("text", "version", "again"),
    [("3.15", (3, 15, 0, 0), "3.15.0"), ("3.15.8", (3, 15, 8, 0), "3.15.8"),
     (" 5.12.0.1101319\n", (5, 12, 0, 1101319), "5.12.0.1101319")],
)  # fmt: skip
def test_versions_are_read_and_written(text, version, again):
    assert SoftwareVersion.parse(text) == version
    assert str(SoftwareVersion.parse(text)) == again


@pytest.mark.parametrize("text", ["", "3", "3.x", "3.15.8.1.2", "-3.15", "3..15", "³.15", "3. 15"])
def test_other_texts_are_no_versions(text):
    with pytest.raises(LocalProtocolError, match=r"3\.15\.8"):
        SoftwareVersion.parse(text)


def test_ports_move_together():
    standard = dataclasses.asdict(Ports())
    assert standard == dataclasses.asdict(Ports.standard())
    moved = dataclasses.asdict(Ports.standard(1000))
    assert {name: port - 1000 for name, port in moved.items()} == standard
    for offset in (35516, -29999):
        with pytest.raises(LocalProtocolError, match="-29998 to 35515"):
            Ports.standard(offset)
    assert Ports.standard(35515).interpreter == 65535
    lowest = Ports.standard(-29998)
    assert (lowest.dashboard, lowest.modbus, lowest.robot_api) == (1, 0, 0)
    assert (Ports.standard(-501).modbus, Ports.standard(-502).modbus) == (1, 0)
    assert (Ports.standard(-79).robot_api, Ports.standard(-80).robot_api) == (1, 0)


def test_simulated_serials_say_so_and_carry_the_seed():
    assert simulated_serial(RobotType.UR3, 7) == "20993000007"
    assert parse_serial("20993000007\n") == ("20993000007", True, 7)
    assert parse_serial(simulated_serial(3, 12_345_678)).seed == 345_678
    assert parse_serial("20175599999") == ("20175599999", False, None)
    assert not parse_serial("209930000070").simulated
    with pytest.raises(LocalProtocolError, match="1 to 9"):
        simulated_serial(10, 0)
    with pytest.raises(RemoteProtocolError, match="digits"):
        parse_serial("2017-1")


def test_numbers_of_the_documents():
    assert (RobotMode.NO_CONTROLLER, RobotMode.POWER_OFF, RobotMode.IDLE, RobotMode.RUNNING) == (-1, 3, 5, 7)
    assert (JointMode.POWER_OFF, JointMode.BOOTING, JointMode.RUNNING, JointMode.IDLE) == (239, 247, 253, 255)
    assert (SafetyMode.NORMAL, SafetyMode.PROTECTIVE_STOP, SafetyMode.FAULT) == (1, 3, 9)
    assert (SafetyMode.SYSTEM_THREE_POSITION_ENABLING_STOP, SafetyMode.TP_THREE_POSITION_ENABLING_STOP) == (
        13,
        14,
    )
    assert (SafetyMode.SAFETY_API_SAFEGUARD_STOP, SafetyMode.IO_PLANE_STOP) == (22, 23)
    assert (ProgramState.STOPPED, ProgramState.PLAYING, ProgramState.PAUSED) == (1, 2, 4)
    assert len(JOINT_NAMES) == 6


@pytest.mark.parametrize(
    ("version", "same"), [((10, 8), (5, 21)), ((10, 13, 2), (5, 26, 2)), ((5, 9), (5, 9))]
)
def test_polyscope_x_has_the_wire_formats_of_its_time(version, same):
    assert SoftwareVersion(*version).as_e_series == SoftwareVersion(*same)
    assert since((3, 1), (5, 22)).covers(SoftwareVersion(10, 9))
    assert not since((3, 1), (5, 22)).covers(SoftwareVersion(10, 8))
