"""Port 29999: the table of commands, and the robot's side of a session."""

from __future__ import annotations

import pytest
from codec_ways import events_of, in_pieces

from protocol.dashboard.commands import COMMANDS, commands_of, match_command, unknown_command_reply
from protocol.dashboard.connection import MAX_LINE, CommandReceived, DashboardConnection, UnknownCommand
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.ur_types import SoftwareVersion

V3_15 = SoftwareVersion(3, 15, 8)
KNOWN = commands_of(V3_15)


def events(connection, data):
    return events_of(connection)(data)


@pytest.mark.parametrize("size", [1, 1000])
def test_a_session(size):
    robot = DashboardConnection(KNOWN)
    assert robot.greet() == b"Connected: Universal Robots Dashboard Server\n"

    received = in_pieces(events_of(robot), b"robotmode\nload my program.urp\nquit\n", size)
    assert received == [
        CommandReceived(KNOWN["robotmode"], ""),
        CommandReceived(KNOWN["load"], "my program.urp"),
        CommandReceived(KNOWN["quit"], ""),
    ]
    answers = robot.reply(received[0].command.reply(mode="RUNNING"))
    answers += robot.reply(received[1].command.reply("not_found", name=received[1].argument))
    assert not robot.is_closed
    answers += robot.reply(received[2].command.reply())
    assert robot.is_closed
    assert events(robot, b"robotmode\n") == []
    assert answers == b"Robotmode: RUNNING\nFile not found: my program.urp\nDisconnected\n"


@pytest.mark.parametrize(
    ("line", "name", "argument"),
    [
        ("play", "play", ""),
        ("  play \r", "play", ""),
        ("load a.urp", "load", "a.urp"),
        ("load", "load", ""),
        ("load installation default.installation", "load installation", "default.installation"),
        ("popup hello  world", "popup", "hello  world"),
        ("get  serial  number", "get serial number", ""),
        ("generate flight report system", "generate flight report", "system"),
    ],
)
def test_lines_that_are_commands(line, name, argument):
    (event,) = events(DashboardConnection(KNOWN), line.encode() + b"\n")
    assert event == CommandReceived(KNOWN[name], argument)


@pytest.mark.parametrize(
    "line",
    ["brake_release", "PLAY", "play now", "get", "power", "", "is in remote control", "\x00\xff", "loadx"],
)
def test_lines_that_are_not(line):
    robot = DashboardConnection(KNOWN)
    (event,) = events(robot, line.encode("latin-1") + b"\n")
    assert event == UnknownCommand(line, f"could not understand: '{line}'")
    assert robot.reply(event.answer) == unknown_command_reply(line).encode("latin-1") + b"\n"


@pytest.mark.parametrize(
    ("name", "cb3", "e_series"),
    [
        ("play", "3.0", "5.0"), ("setUserRole", "3.1", None), ("getUserRole", "3.1", None),
        ("set operational mode", None, "5.0"), ("clear operational mode", None, "5.0"),
        ("get operational mode", None, "5.6"), ("is in remote control", None, "5.6"), ("version", None, "5.13"),
        ("restart safety", "3.7", "5.1"), ("safetystatus", "3.11", "5.4"), ("get serial number", "3.12", "5.6"),
        ("get robot model", "3.12", "5.6"), ("generate flight report", "3.13", "5.8"),
        ("generate support file", "3.13", "5.8"), ("saveLog", "3.13", "5.8"),
    ],
)  # fmt: skip
def test_first_software_of_a_command(name, cb3, e_series):
    for first, newest in ((cb3, V3_15), (e_series, SoftwareVersion(5, 25, 1))):
        assert (name in commands_of(newest)) is (first is not None)
        if first:
            since = SoftwareVersion.parse(first)
            assert name in commands_of(since)
            if since.minor:
                assert name not in commands_of(since._replace(minor=since.minor - 1, bugfix=99))


def test_what_an_e_series_robot_refuses_in_local_control():
    """The column R of the maker's e-Series document."""
    assert {row.name for row in COMMANDS if row.needs_remote} == {
        "load", "play", "stop", "pause", "power on", "power off", "brake release", "unlock protective stop",
        "close safety popup", "load installation", "restart safety",
    }  # fmt: skip


def test_software_without_a_command_takes_its_line_for_another_one():
    """Before `load installation` of 3.2, the line is a program's name."""
    found = match_command("load installation x", commands_of(SoftwareVersion(3, 1)))
    assert found == (KNOWN["load"], "installation x")


def test_a_reply_needs_a_known_key_and_its_values():
    too_early = KNOWN["unlock protective stop"].reply("too_early")
    assert too_early.startswith("Cannot unlock protective stop until 5s")
    with pytest.raises(LocalProtocolError, match="'play' has no reply 'nope': use ok, failed"):
        KNOWN["play"].reply("nope")
    with pytest.raises(LocalProtocolError, match=r"'Robotmode: \{mode\}' of 'robotmode' needs 'mode'"):
        KNOWN["robotmode"].reply()


def test_one_reply_a_command_one_line_a_reply():
    robot = DashboardConnection(KNOWN)
    with pytest.raises(LocalProtocolError, match="answers nothing"):
        robot.reply("Stopped")
    robot.receive_data(b"stop\n")
    robot.next_event()
    with pytest.raises(LocalProtocolError, match="line break"):
        robot.reply("Stopped\nreally")
    assert robot.reply("Stopped") == b"Stopped\n"  # the refused one changed nothing


@pytest.mark.parametrize("data", [b"x" * (MAX_LINE + 1), b"x" * (MAX_LINE + 1) + b"\nplay\n"])
def test_endless_lines_are_refused(data):
    with pytest.raises(RemoteProtocolError, match="more than"):
        DashboardConnection(KNOWN).receive_data(data)
    robot = DashboardConnection(KNOWN)
    robot.receive_data(b"play\n")
    robot.next_event()
    with pytest.raises(LocalProtocolError, match="longer than"):
        robot.reply("x" * MAX_LINE)


def test_which_software_answers_when_it_is_done():
    for name, since in {"load": (3, 3), "play": (3, 3), "stop": (3, 3), "pause": (3, 3)}.items():
        row = KNOWN[name]
        assert row.replies_when_done(SoftwareVersion(*since))
        assert not row.replies_when_done(SoftwareVersion(3, 2, 9))
    assert not KNOWN["power on"].replies_when_done(V3_15)
