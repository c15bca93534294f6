"""Port 29999 over real sockets: every command with every reply of its table, what it does, and bad clients."""

import gc
import json
import random
import re
import socket
import subprocess
import sys
import zipfile

import pytest
from box_support import FrameReader, MessageReader, connect, inside
from dashboard_support import Dashboard, external_control, urp, write_programs

from protocol.dashboard.commands import COMMANDS, commands_of, match_command
from protocol.primary.messages import PopupMessage
from protocol.ur_types import RobotMode, SoftwareVersion
from ur_emulator.emulator import ControlBox
from ur_emulator.host.reports.report_files import BoxFacts
from ur_emulator.machine.commands.safety import TriggerProtectiveStop

OPTIONS = {"pace": "lockstep", "port_base": None, "seed": 7}

PAUSE = """
def guarded():
  socket_open("127.0.0.1", 29999, "dashboard")
  socket_send_line("pause", "dashboard")
  socket_send_line("popup why", "dashboard")
  socket_close("dashboard")
  sleep(9)
end
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "programs").mkdir()
    return write_programs(tmp_path / "programs")


@pytest.fixture
def box(folder):
    with ControlBox(in_process=True, programs=folder, **OPTIONS) as box:
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
LOADED, PLAYING = ["load wait.urp"], ["load wait.urp", "play"]
# (command, key of its reply): what happens before, the argument, the reply.
CASES = {
    ("load", "ok"): ([], "wait.urp", "Loading program: /programs/wait.urp"),
    ("load", "not_found"): ([], "nothing.urp", "File not found: nothing.urp"),
    ("load", "failed"): ([], "strange.urp", "Error while loading program: strange.urp"),
    ("play", "ok"): (LOADED, "", "Starting program"),
    ("play", "failed"): ([], "", "Failed to execute: play"),
    ("stop", "ok"): (PLAYING, "", "Stopped"),
    ("stop", "failed"): ([booting], "", "Failed to execute: stop"),
    ("pause", "ok"): (PLAYING, "", "Pausing program"),
    ("pause", "failed"): (LOADED, "", "Failed to execute: pause"),
    ("quit", "ok"): ([], "", "Disconnected"),
    ("shutdown", "ok"): ([], "", "Shutting down"),
    ("running", "ok"): (PLAYING, "", "Program running: true"),
    ("robotmode", "ok"): ([], "", "Robotmode: RUNNING"),
    ("get loaded program", "ok"): (LOADED, "", "Loaded program: /programs/wait.urp"),
    ("get loaded program", "none"): ([], "", "No program loaded"),
    ("popup", "ok"): ([], "Look here", "showing popup"),
    ("close popup", "ok"): ([], "", "closing popup"),
    ("addToLog", "ok"): ([], "shift 2", "Added log message"),
    ("addToLog", "empty"): ([], "", "No log message to add"),
    ("isProgramSaved", "ok"): (LOADED, "", "true wait.urp"),
    ("programState", "ok"): (LOADED, "", "STOPPED wait.urp"),
    ("PolyscopeVersion", "ok"): ([], "", r"URSoftware 3\.15\.8\.\d+ \(Nov 30 2021\)"),
    ("setUserRole", "ok"): ([], "OPERATOR", "Setting user role: OPERATOR"),
    ("setUserRole", "failed"): ([], "boss", "Failed setting user role: boss"),
    ("getUserRole", "ok"): (["setUserRole LOCKED"], "", "LOCKED"),
    ("power on", "ok"): (["power off"], "", "Powering on"),
    ("power off", "ok"): ([], "", "Powering off"),
    ("brake release", "ok"): (["power off"], "", "Brake releasing"),
    ("safetymode", "ok"): ([protective_stop], "", "Safetymode: PROTECTIVE_STOP"),
    ("safetystatus", "ok"): ([protective_stop], "", "Safetystatus: PROTECTIVE_STOP"),
    ("unlock protective stop", "ok"): ([five_seconds_later], "", "Protective stop releasing"),
    ("unlock protective stop", "too_early"): ([protective_stop], "", FIVE_SECONDS),
    ("close safety popup", "ok"): ([], "", "closing safety popup"),
    ("load installation", "ok"): ([], "default.installation", "Loading installation: /programs/default.installation"),
    ("load installation", "not_found"): ([], "no.installation", "File not found: no.installation"),
    ("load installation", "failed"): ([], "odd.installation", "Failed to load installation: odd.installation"),
    ("restart safety", "ok"): ([], "", "Restarting safety"),
    ("get serial number", "ok"): ([], "", "20993000007"),
    ("get robot model", "ok"): ([], "", "UR3"),
    ("generate flight report", "ok"): ([], "controller", "Flight Report generated with id:1"),
    ("generate flight report", "failed"): ([], "weather", "Unknown report type: weather"),
    ("generate support file", "ok"): ([], ".", r"Completed successfully:ur_20993000007_2021-11-30_00-01-\d\d\.zip"),
    ("generate support file", "failed"): ([], "../..", r"Directory not found: \.\./\.\."),
    ("saveLog", "ok"): ([], "", "Log saved to disk"),
    ("saveLog", "failed"): ([no_place_for_the_log], "", "Failed to execute: saveLog"),
}  # fmt: skip
# What a UR5e answers, in this order, to commands that CB3 has not, or in another way: the line, the reply.
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


def test_replies_of_a_ur5e(folder):
    box = ControlBox("ur5e", version="5.15.0", in_process=True, programs=folder, **OPTIONS)
    with box, Dashboard(box) as dashboard:
        for line, expected in E_SERIES_CASES.items():
            assert re.fullmatch(expected, dashboard.ask(line)), line


def test_every_reply_has_a_case():
    assert set(CASES) == {(row.name, key) for row in COMMANDS if row.since.cb3 for key in row.replies}
    known = commands_of(SoftwareVersion(5, 15))
    asked = {match_command(line, known)[0].name for line in E_SERIES_CASES}
    assert asked >= {row.name for row in COMMANDS if row.since.cb3 is None}


# A box of its own has what cuts power or connections, and what needs more than commands before it.
CUTS = ("quit", "shutdown", "power on", "power off", "brake release", "restart safety")
ALONE = [key for key, (before, *_) in CASES.items() if key[0] in CUTS or any(map(callable, before))]
# The others are asked one after the other, first those before which nothing happens.
TOGETHER = [key for key in CASES if key not in ALONE]
TOGETHER.sort(key=lambda key: (len(CASES[key][0]), key[0] == "load"))


def check_reply(box, dashboard, folder, key):
    before, argument, expected = CASES[key]
    for step in before:
        step(box, dashboard, folder) if callable(step) else dashboard.ask(step)
    assert re.fullmatch(expected, dashboard.ask(f"{key[0]} {argument}".strip())), key


def test_replies_of_one_box(box, dashboard, folder):
    for key in TOGETHER:
        check_reply(box, dashboard, folder, key)
        dashboard.ask("stop")


@pytest.mark.parametrize("key", ALONE, ids=" ".join)
def test_reply_of_a_box_of_its_own(box, dashboard, folder, key):
    check_reply(box, dashboard, folder, key)


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


def test_a_popup_is_shown_to_all_clients_and_stays_without_power_until_it_is_closed(box, dashboard):
    operator = inside(box)._box.controller.state.pendant
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.next()
        dashboard.ask("popup first")
        popup = reader.message(PopupMessage)
    assert popup.text == "first"
    assert (popup.is_blocking, popup.is_warning, popup.is_error) == (False, False, False)
    dashboard.ask_all("power off", "popup second")
    assert operator.shown == ("first", "second")
    assert "Popup: Popup: first" in [entry.text for entry in box.log]
    dashboard.ask("power on")
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


def test_user_roles(dashboard):
    for role in ("PROGRAMMER", "OPERATOR", "NONE", "LOCKED", "RESTRICTED"):
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


@pytest.mark.parametrize(("robot", "version"), [("ur3", "3.0"), ("ur5e", "5.0")])
def test_each_software_knows_its_commands_and_no_others(robot, version):
    known = commands_of(SoftwareVersion.parse(version))
    rows = [row for row in COMMANDS if row.name not in ("quit", "shutdown")]
    lines = [f"{row.name} x" if row.argument else row.name for row in rows]
    box = ControlBox(robot, version=version, in_process=True, **OPTIONS)
    with box, Dashboard(box) as dashboard:
        replies = zip(lines, dashboard.ask_all(*lines), strict=True)
    unknown = [line for line, reply in replies if "understand" in reply]
    assert unknown == [line for line in lines if match_command(line, known) is None]
    assert unknown


def test_software_up_to_3_2_answers_load_before_it_is_done(folder):
    box = ControlBox(in_process=True, version="3.2", programs=folder, **OPTIONS)
    with box, Dashboard(box) as dashboard:
        assert dashboard.ask_all("load strange.urp", "load nothing.urp", "load wait.urp") == [
            "Loading program: /programs/strange.urp", "File not found: nothing.urp", "Loading program: /programs/wait.urp",
        ]  # fmt: skip
        dashboard.until("programState", "STOPPED wait.urp")
        assert dashboard.ask_all("play", "stop", "pause") == [
            "Starting program",
            "Stopped",
            "Failed to execute: pause",
        ]
    assert any("load strange.urp failed" in entry.text for entry in box.log)


# --- logs, flight reports and support files


def session(folder, *lines):
    """Let a box answer lines; return the replies and the log."""
    box = ControlBox(in_process=True, programs=folder, **OPTIONS)
    with box, Dashboard(box) as dashboard:
        return dashboard.ask_all(*lines), [str(entry) for entry in box.log]


def test_the_log_is_written_line_by_line(folder):
    _, log = session(folder, "addToLog first", "load hello.urp", "saveLog")
    saved = (folder / "log_history.txt").read_text().splitlines()
    assert saved == log[: len(saved)]
    assert saved[-1].endswith("Dashboard: Loaded program: /programs/hello.urp")
    session(folder, "addToLog second", "saveLog")
    assert "first" not in (folder / "log_history.txt").read_text()


def test_a_support_file_holds_all_reports_and_the_state(folder):
    replies, _ = session(
        folder, "load hello.urp", "generate flight report", "generate flight report software", "generate support file cell",
        "generate flight report controller",
    )  # fmt: skip
    name = replies[3].removeprefix("Completed successfully:")
    assert [reply.rpartition(":")[2] for reply in replies[1:3]] == ["1", "2"]
    assert replies[4].endswith("id:4")  # the support file has made the third
    with zipfile.ZipFile(folder / "cell" / name) as archive:
        assert archive.namelist() == [
            "flightreports/flightreport_1.zip", "flightreports/flightreport_2.zip", "flightreports/flightreport_3.zip",
            "log_history.txt", "program.script", "programs.json", "state.json", "versions.json",
        ]  # fmt: skip
        assert json.loads(archive.read("versions.json"))["software"] == "3.15.8.106339"
        assert json.loads(archive.read("programs.json")) == {
            "program": "/programs/hello.urp",
            "installation": "/programs/default.installation",
        }
        assert len(json.loads(archive.read("state.json"))["actual_q"]) == 6
        assert "def hello()" in archive.read("program.script").decode()
        assert "Loaded program" in archive.read("log_history.txt").decode()
    kinds = []
    for number in (1, 2, 3, 4):
        with zipfile.ZipFile(folder / "flightreports" / f"flightreport_{number}.zip") as archive:
            kinds.append(json.loads(archive.read("report.json"))["kind"])
    assert kinds == ["system", "software", "system", "controller"]


def test_equal_runs_write_equal_bytes(tmp_path):
    written = []
    for run in ("a", "b"):
        (tmp_path / run).mkdir()
        folder = write_programs(tmp_path / run)
        session(folder, "load wait.urp", "play", "stop", "generate flight report")
        with zipfile.ZipFile(folder / "flightreports" / "flightreport_1.zip") as archive:
            # Everything but the log, which has the client's port, is the same to the last bit.
            files = [info for info in archive.infolist() if "log" not in info.filename]
            written.append([(info.filename, info.date_time, archive.read(info)) for info in files])
    assert written[0] == written[1]


def test_without_a_folder_the_files_go_to_a_temporary_one_that_goes_with_the_box(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with ControlBox(in_process=True, pace="lockstep", port_base=None) as box, Dashboard(box) as dashboard:
        replies = dashboard.ask_all("saveLog", "generate support file .", "generate support file .")
        assert replies[0] == "Log saved to disk"
        (written,) = tmp_path.iterdir()
        assert sorted(path.suffix for path in written.iterdir()) == ["", ".txt", ".zip", ".zip"]
        assert not any(str(tmp_path) in str(entry) for entry in box.log)
    assert not list(tmp_path.iterdir())
    box.close()  # harmless


def test_places_that_are_none(folder):
    places = ("", "..", "/etc", "/programs/..", "no/such", "wait.urp", "a\0b")
    replies, _ = session(folder, *(f"generate support file {place}" for place in places))
    assert replies == [f"Directory not found: {place}" for place in places]
    assert not list(folder.glob("*.zip"))


def test_a_report_that_is_refused_leaves_nothing_to_the_garbage_collector(folder):
    """What goes into a report is long: the log alone may have 5 MB."""
    gc.collect()
    gc.disable()
    try:
        session(folder, *["generate support file nowhere"] * 3, *["generate flight report unknown"] * 3)
        assert [kept for kept in gc.get_objects() if isinstance(kept, BoxFacts)] == []
    finally:
        gc.enable()


# --- bad, hasty and vanishing clients


def still_serves(box):
    with Dashboard(box) as other:
        assert other.ask("robotmode") == "Robotmode: RUNNING"


def a_pc_that_never_answers(folder):
    """A program that asks a PC which takes the connection and says nothing."""
    server = socket.create_server(("127.0.0.1", 0))
    (folder / "silent.urp").write_bytes(urp(external_control("127.0.0.1", server.getsockname()[1])))
    return server


def test_a_client_that_says_no_more_still_hears_all_answers(box):
    """As `printf 'load x\\nplay\\n' | nc -N` does it."""
    with Dashboard(box) as dashboard:
        dashboard.send("load wait.urp", "play", "programState", "stop", "saveLog")
        dashboard.sock.shutdown(socket.SHUT_WR)
        assert [dashboard.reply() for _ in range(5)] == [
            "Loading program: /programs/wait.urp", "Starting program", "PLAYING wait.urp", "Stopped", "Log saved to disk",
        ]  # fmt: skip
        assert dashboard.is_closed()
    still_serves(box)


def test_what_a_client_asked_before_it_went_is_done(box):
    dashboard = Dashboard(box)
    dashboard.send("load wait.urp", "play")
    dashboard.sock.shutdown(socket.SHUT_WR)
    with dashboard:
        pass
    with Dashboard(box) as other:
        other.until("programState", "PLAYING wait.urp")


def test_a_program_pauses_its_own_box_and_says_why(box):
    """It closes at once, reads nothing, and expects the dashboard at its usual port."""
    box.run_program(PAUSE)
    assert box.wait_until(popup=True, program_state="PAUSED").popups == ("why",)
    box.close_popups()


def test_others_are_answered_while_one_waits(folder, box):
    with a_pc_that_never_answers(folder), Dashboard(box) as waiting:
        waiting.send("load silent.urp", "play", "robotmode")
        assert waiting.reply() == "Loading program: /programs/silent.urp"
        still_serves(box)
        with Dashboard(box) as other:
            assert other.ask_all("programState", "power off", "robotmode") == [
                "STOPPED silent.urp", "Powering off", "Robotmode: POWER_OFF",
            ]  # fmt: skip


def test_a_client_that_reads_nothing_is_cut_off(box):
    """Its replies cannot be dropped one by one, the rest would answer the wrong lines."""
    with connect(box, "dashboard") as greedy, pytest.raises(ConnectionError):
        greedy.sendall((b"load " + b"z" * 60_000 + b"\n") * 1_000)
    still_serves(box)


ARGUMENTS = [
    "wait.urp", "hello.urp", "strange.urp", "cell/count me.script", "default.installation", "x", "OPERATOR", ".", "system",
]  # fmt: skip


def test_random_sessions_get_one_fitting_reply_a_line(folder):
    draw = random.Random(0)
    rows = [row for row in COMMANDS if row.since.cb3 and row.name not in ("quit", "shutdown")]
    patterns = {
        row.name: "|".join(re.sub(r"\\\{\w+\\\}", ".*", re.escape(reply)) for reply in row.replies.values())
        for row in rows
    }
    with ControlBox(in_process=True, programs=folder, **OPTIONS) as box:
        clients = [Dashboard(box) for _ in range(3)]
        for _ in range(60):
            asked = []
            for client in clients:
                row = draw.choice(rows)
                has_argument = row.argument and draw.random() < 0.9
                line = f"{row.name} {draw.choice(ARGUMENTS)}" if has_argument else row.name
                client.send(line)
                asked.append((client, row, line))
            for client, row, line in asked:
                reply = client.reply()
                assert re.fullmatch(patterns[row.name], reply), (line, reply)
        clients[0].until("stop", "Stopped")
        assert clients[0].ask("running") == "Program running: false"
        for client in clients:
            client.__exit__()


# --- switched off


def test_shutdown_closes_all_ports_of_one_box():
    with ControlBox.many(2, pace="lockstep", port_base=None) as (box, neighbour):
        with Dashboard(box) as dashboard, connect(box, "realtime") as frames:
            assert not box.is_shut_down
            assert dashboard.ask("shutdown") == "Shutting down"
            assert dashboard.is_closed()
            with pytest.raises((EOFError, OSError)):
                FrameReader(frames).until(lambda frame: False)
        for name in ("dashboard", "primary", "rtde"):
            with pytest.raises(ConnectionRefusedError):
                connect(box, name)
        assert box.is_shut_down
        assert any(entry.text.startswith("Shut down by 127.0.0.1") for entry in box.log)
        still_serves(neighbour)
        assert not neighbour.is_shut_down


@pytest.mark.nightly
def test_serve_ends_when_its_box_is_switched_off(tmp_path, folder):
    options = ["--port-base", "4000", "--programs", folder, "--host", "127.0.0.93"]
    command = [sys.executable, "-m", "ur_emulator", "serve", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert " ready at " in process.stdout.readline()
        with socket.create_connection(("127.0.0.93", 33999)) as sock, sock.makefile("rb") as lines:
            sock.sendall(b"load hello.urp\nshutdown\n")
            assert [lines.readline() for _ in range(3)][1:] == [
                b"Loading program: /programs/hello.urp\n",
                b"Shutting down\n",
            ]
        assert process.wait(timeout=20) == 0
