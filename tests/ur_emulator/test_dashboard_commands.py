"""Every command of the dashboard with every reply of its table, over real sockets."""

import re

import pytest
from box_support import MessageReader, connect, inside
from dashboard_support import Dashboard, write_programs

from protocol.dashboard.commands import COMMANDS, commands_of, match_command
from protocol.primary.messages import PopupMessage
from protocol.ur_types import RobotMode, SoftwareVersion
from ur_emulator.commands.safety import TriggerProtectiveStop
from ur_emulator.emulator import ControlBox


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "programs").mkdir()
    return write_programs(tmp_path / "programs")


@pytest.fixture
def box(folder):
    with ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7, programs=folder) as box:
        yield box


@pytest.fixture
def dashboard(box):
    with Dashboard(box) as dashboard:
        yield dashboard


def protective_stop(box, dashboard, folder):
    box.submit(TriggerProtectiveStop())
    dashboard.until("safetymode", "Safetymode: PROTECTIVE_STOP")


def five_seconds_later(box, dashboard, folder):
    protective_stop(box, dashboard, folder)
    controller = inside(box)._box.controller
    while not controller.state.safety.may_unlock(controller.snapshot.timestamp):
        dashboard.ask("safetymode")


def booting(box, dashboard, folder):
    inside(box)._box.controller.state.mode.mode = RobotMode.BOOTING
    dashboard.ask("close popup")


def no_place_for_the_log(box, dashboard, folder):
    (folder / "ur-emulator.part").mkdir()


FIVE_SECONDS = "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking"
# (command, key of its reply): what happens before, the line, the reply.
CASES = {
    ("load", "ok"): ([], "load wait.urp", "Loading program: /programs/wait.urp"),
    ("load", "not_found"): ([], "load nothing.urp", "File not found: nothing.urp"),
    ("load", "failed"): ([], "load strange.urp", "Error while loading program: strange.urp"),
    ("play", "ok"): (["load wait.urp"], "play", "Starting program"),
    ("play", "failed"): ([], "play", "Failed to execute: play"),
    ("stop", "ok"): (["load wait.urp", "play"], "stop", "Stopped"),
    ("stop", "failed"): ([booting], "stop", "Failed to execute: stop"),
    ("pause", "ok"): (["load wait.urp", "play"], "pause", "Pausing program"),
    ("pause", "failed"): (["load wait.urp"], "pause", "Failed to execute: pause"),
    ("quit", "ok"): ([], "quit", "Disconnected"),
    ("shutdown", "ok"): ([], "shutdown", "Shutting down"),
    ("running", "ok"): (["load wait.urp", "play"], "running", "Program running: true"),
    ("robotmode", "ok"): ([], "robotmode", "Robotmode: RUNNING"),
    ("get loaded program", "ok"): (
        ["load wait.urp"],
        "get loaded program",
        "Loaded program: /programs/wait.urp",
    ),
    ("get loaded program", "none"): ([], "get loaded program", "No program loaded"),
    ("popup", "ok"): ([], "popup Look here", "showing popup"),
    ("close popup", "ok"): ([], "close popup", "closing popup"),
    ("addToLog", "ok"): ([], "addToLog shift 2", "Added log message"),
    ("addToLog", "empty"): ([], "addToLog", "No log message to add"),
    ("isProgramSaved", "ok"): (["load wait.urp"], "isProgramSaved", "true wait.urp"),
    ("programState", "ok"): (["load wait.urp"], "programState", "STOPPED wait.urp"),
    ("PolyscopeVersion", "ok"): ([], "PolyscopeVersion", r"URSoftware 3\.15\.8\.\d+ \(Nov 30 2021\)"),
    ("setUserRole", "ok"): ([], "setUserRole OPERATOR", "Setting user role: OPERATOR"),
    ("setUserRole", "failed"): ([], "setUserRole boss", "Failed setting user role: boss"),
    ("getUserRole", "ok"): (["setUserRole LOCKED"], "getUserRole", "LOCKED"),
    ("power on", "ok"): (["power off"], "power on", "Powering on"),
    ("power off", "ok"): ([], "power off", "Powering off"),
    ("brake release", "ok"): (["power off"], "brake release", "Brake releasing"),
    ("safetymode", "ok"): ([protective_stop], "safetymode", "Safetymode: PROTECTIVE_STOP"),
    ("safetystatus", "ok"): ([protective_stop], "safetystatus", "Safetystatus: PROTECTIVE_STOP"),
    ("unlock protective stop", "ok"): (
        [five_seconds_later],
        "unlock protective stop",
        "Protective stop releasing",
    ),
    ("unlock protective stop", "too_early"): (
        [protective_stop],
        "unlock protective stop",
        re.escape(FIVE_SECONDS),
    ),
    ("close safety popup", "ok"): ([], "close safety popup", "closing safety popup"),
    ("load installation", "ok"): (
        [],
        "load installation default.installation",
        "Loading installation: /programs/default.installation",
    ),
    ("load installation", "not_found"): (
        [],
        "load installation no.installation",
        "File not found: no.installation",
    ),
    ("load installation", "failed"): (
        [],
        "load installation odd.installation",
        "Failed to load installation: odd.installation",
    ),
    ("restart safety", "ok"): ([], "restart safety", "Restarting safety"),
    ("get serial number", "ok"): ([], "get serial number", "20993000007"),
    ("get robot model", "ok"): ([], "get robot model", "UR3"),
    ("generate flight report", "ok"): (
        [],
        "generate flight report controller",
        "Flight Report generated with id:1",
    ),
    ("generate flight report", "failed"): (
        [],
        "generate flight report weather",
        "Unknown report type: weather",
    ),
    ("generate support file", "ok"): (
        [],
        "generate support file .",
        r"Completed successfully:ur_20993000007_2021-11-30_00-01-\d\d\.zip",
    ),
    ("generate support file", "failed"): (
        [],
        "generate support file ../..",
        r"Directory not found: \.\./\.\.",
    ),
    ("saveLog", "ok"): ([], "saveLog", "Log saved to disk"),
    ("saveLog", "failed"): ([no_place_for_the_log], "saveLog", "Failed to execute: saveLog"),
}
# What a UR5e answers to commands that CB3 has not, or in another way: the line, the reply.
E_SERIES_CASES = {
    "PolyscopeVersion": r"URSoftware 5\.15\.0\.126572 \(Oct 01 2023\)",
    "version": r"5\.15\.0\.126572",
    "get robot model": "UR5",
    "get serial number": "20991000007",
    "get operational mode": "NONE",
    "set operational mode automatic": "Operational mode AUTOMATIC is set",
    "set operational mode Manual": "Operational mode MANUAL is set",
    "set operational mode none": "Failed setting operational mode: none",
    "clear operational mode": r"No longer controlling the operational mode\. Current operational mode: 'NONE'\.",
    "is in remote control": "true",
    "safetystatus": "Safetystatus: NORMAL",
    "load wait.urp": "Loading program: /programs/wait.urp, /programs/default.installation",
    "load nothing.urp": "File not found: nothing.urp",
}


@pytest.mark.parametrize(("line", "expected"), E_SERIES_CASES.items())
def test_reply_of_a_ur5e(folder, line, expected):
    with (
        ControlBox(
            in_process=True,
            robot="ur5e",
            version="5.15.0",
            pace="lockstep",
            port_base=None,
            seed=7,
            programs=folder,
        ) as box,
        Dashboard(box) as dashboard,
    ):
        assert re.fullmatch(expected, dashboard.ask(line))


def test_every_reply_has_a_case():
    assert set(CASES) == {(row.name, key) for row in COMMANDS if row.since.cb3 for key in row.replies}
    known = commands_of(SoftwareVersion(5, 15))
    asked = {match_command(line, known)[0].name for line in E_SERIES_CASES}
    assert asked >= {row.name for row in COMMANDS if row.since.cb3 is None}


@pytest.mark.parametrize(("before", "line", "expected"), CASES.values(), ids=map(" ".join, CASES))
def test_reply(box, dashboard, folder, before, line, expected):
    for step in before:
        if callable(step):
            step(box, dashboard, folder)
        else:
            dashboard.ask(step)
    assert re.fullmatch(expected, dashboard.ask(line))


# --- what the commands do


def test_a_program_from_load_to_stop(dashboard):
    """The client library's own test: states follow the buttons, the name stays after a stop."""
    assert dashboard.ask_all(
        "programState", "load wait.urp", "programState", "get loaded program", "play", "programState", "running",
        "pause", "programState", "running", "play", "programState", "stop", "programState", "running",
        "get loaded program", "stop",
    ) == [
        "STOPPED <unnamed>", "Loading program: /programs/wait.urp", "STOPPED wait.urp",
        "Loaded program: /programs/wait.urp", "Starting program", "PLAYING wait.urp", "Program running: true",
        "Pausing program", "PAUSED wait.urp", "Program running: false", "Starting program", "PLAYING wait.urp",
        "Stopped", "STOPPED wait.urp", "Program running: false", "Loaded program: /programs/wait.urp", "Stopped",
    ]  # fmt: skip


def test_power_takes_its_time_and_commands_repeat_harmlessly(dashboard):
    assert dashboard.ask_all("power on", "robotmode") == ["Powering on", "Robotmode: RUNNING"]
    assert dashboard.ask_all("power off", "robotmode", "power off", "robotmode") == [
        "Powering off", "Robotmode: POWER_OFF", "Powering off", "Robotmode: POWER_OFF",
    ]  # fmt: skip
    assert dashboard.ask_all("power on", "robotmode") == ["Powering on", "Robotmode: POWER_ON"]
    dashboard.until("robotmode", "Robotmode: IDLE")
    assert dashboard.ask_all("brake release", "robotmode") == ["Brake releasing", "Robotmode: BACKDRIVE"]
    dashboard.until("robotmode", "Robotmode: RUNNING")
    dashboard.ask_all("power off", "brake release")
    dashboard.until("robotmode", "Robotmode: RUNNING")


@pytest.mark.parametrize(
    "before", [["power off"], [protective_stop], ["play"]], ids=["off", "stopped", "plays"]
)
def test_play_is_refused_while_the_robot_cannot(box, dashboard, folder, before):
    dashboard.ask("load wait.urp")
    for step in before:
        step(box, dashboard, folder) if callable(step) else dashboard.ask(step)
    assert dashboard.ask("play") == "Failed to execute: play"
    assert any("play failed" in entry.text for entry in box.log)


def test_play_is_refused_while_a_paused_program_waits_for_its_popup(folder, dashboard):
    (folder / "asks.script").write_text(
        'popup("ready?", blocking=True)\ntextmsg("on")\nwhile True:\n  sync()\nend\n'
    )
    assert dashboard.ask_all("load asks.script", "play", "pause", "play", "close popup", "play", "programState") == [
        "Loading program: /programs/asks.script", "Starting program", "Pausing program",
        "Failed to execute: play", "closing popup", "Starting program", "PLAYING asks.script",
    ]  # fmt: skip


def test_a_popup_is_shown_to_all_clients(box, dashboard):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.next()
        dashboard.ask("popup look here")
        popup = reader.message(PopupMessage)
        assert (popup.text, popup.is_blocking, popup.is_warning, popup.is_error) == (
            "look here",
            False,
            False,
            False,
        )


def test_a_popup_stays_without_power_until_it_is_closed(box, dashboard):
    operator = inside(box)._box.controller.state.pendant
    dashboard.ask_all("popup first", "power off", "popup second")
    assert operator.shown == ("first", "second")
    assert "Popup: Popup: first" in [entry.text for entry in box.log]
    dashboard.ask_all("power on")
    assert operator.shown == ("first", "second")
    dashboard.ask("close popup")
    assert operator.shown == ()


def test_stop_ends_when_the_arm_rests(box, folder, dashboard):
    (folder / "go.script").write_text(
        "while True:\n  speedj([1, 0, 0, 0, 0, 0], 5, 0.5)\n  speedj([-1, 0, 0, 0, 0, 0], 5, 0.5)\nend\n"
    )
    dashboard.ask_all("load go.script", "play")
    motion = inside(box)._box.controller.state.motion
    while abs(motion.target.qd[0]) < 0.5:
        dashboard.ask("running")
    assert dashboard.ask("stop") == "Stopped"
    assert not any(motion.target.qd)


def test_the_log_keeps_what_is_added(box, dashboard):
    dashboard.ask("addToLog shift 2 begins")
    assert ("Dashboard", "shift 2 begins") in [(entry.source, entry.text) for entry in box.log]


@pytest.mark.parametrize("role", ["PROGRAMMER", "OPERATOR", "NONE", "LOCKED", "RESTRICTED"])
def test_user_roles(dashboard, role):
    assert dashboard.ask_all(f"setUserRole {role}", "getUserRole") == [f"Setting user role: {role}", role]


def test_restart_safety_forgets_the_stop_and_cuts_the_power(box, dashboard, folder):
    protective_stop(box, dashboard, folder)
    assert dashboard.ask_all("restart safety", "safetymode", "robotmode") == [
        "Restarting safety", "Safetymode: NORMAL", "Robotmode: POWER_OFF",
    ]  # fmt: skip


def test_a_client_reads_what_another_has_done(box, dashboard):
    with Dashboard(box) as other:
        dashboard.ask("load hello.urp")
        assert other.ask("programState") == "STOPPED hello.urp"
        assert other.ask("quit") == "Disconnected"
        assert other.is_closed()
    assert dashboard.ask("running") == "Program running: false"


# --- versions


@pytest.mark.parametrize(
    ("robot", "version"),
    [
        *(("ur3", version) for version in ("3.0", "3.1", "3.2", "3.7", "3.11", "3.12", "3.13", "3.15.8")),
        *(("ur5e", version) for version in ("5.0", "5.6", "5.9.4", "5.13")),
    ],
)
def test_each_software_knows_its_commands_and_no_others(folder, robot, version):
    software = SoftwareVersion.parse(version)
    lines = [
        f"{row.name} x" if row.argument else row.name
        for row in COMMANDS
        if row.name not in ("quit", "shutdown")
    ]
    with (
        ControlBox(
            in_process=True, robot=robot, version=version, pace="lockstep", port_base=None, programs=folder
        ) as box,
        Dashboard(box) as dashboard,
    ):
        unknown = [
            line
            for line, reply in zip(lines, dashboard.ask_all(*lines), strict=True)
            if "understand" in reply
        ]
    assert unknown == [line for line in lines if match_command(line, commands_of(software)) is None]
    assert unknown


def test_software_up_to_3_2_answers_load_before_it_is_done(folder):
    with (
        ControlBox(in_process=True, version="3.2", pace="lockstep", port_base=None, programs=folder) as box,
        Dashboard(box) as dashboard,
    ):
        assert dashboard.ask("load strange.urp") == "Loading program: /programs/strange.urp"
        assert dashboard.ask("load nothing.urp") == "File not found: nothing.urp"
        assert dashboard.ask("load wait.urp") == "Loading program: /programs/wait.urp"
        dashboard.until("programState", "STOPPED wait.urp")
        assert dashboard.ask_all("play", "stop", "pause") == [
            "Starting program",
            "Stopped",
            "Failed to execute: pause",
        ]
    assert any("load strange.urp failed" in entry.text for entry in box.log)
