"""How errors and lives of programs are told: on port 30001, with texts, places, levels and order; in the log.

Port 30002 says nothing of them.
"""

import threading

import pytest
from box_support import TIMEOUT, VERSION, Bench, FrameReader, MessageReader, connect
from dashboard_support import Dashboard

from protocol.primary.messages import (
    ErrorCodeMessage,
    KeyMessage,
    ReportLevel,
    RequestedType,
    RobotMessage,
    RuntimeExceptionMessage,
    StartupMessage,
    TextMessage,
    VersionMessage,
)
from protocol.primary.packages import RobotState, decode_package
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.host.box_log import MAX_ENTRIES, MAX_TEXT, BoxLog, LogEntry
from ur_emulator.host.ports.primary.port import PrimaryPort
from ur_emulator.host.ports.primary.robot_state import StateEncoder
from ur_emulator.machine.commands.programs import ResumeProgram, StartProgram
from ur_emulator.machine.commands.safety import UnlockProtectiveStop
from ur_emulator.machine.controller import events
from ur_emulator.machine.models.generations import CB3
from urscript import compile_program

# Program, line, column, text. The chunks of the language and of the box have all texts.
PRIMARY = {
    "compile error": ("def f():\n  nowhere()\nend\n", 2, 3, "compile_error_name_not_found:nowhere:"),
    "run-time error": ("def f():\n  sync()\n  x = 1 / 0\nend\n", 3, 7, "division by zero"),
}


@pytest.fixture(scope="module")
def box():
    with ControlBox(pace="lockstep", port_base=None) as box:
        yield box


def told(box, program, is_last):
    """Send a program; all messages of 30001 up to one for which `is_last` is true, and any behind it."""
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.state()
        sock.sendall(program.encode())
        messages = []
        while not is_last(message := reader.message(RobotMessage)):
            messages.append(message)
        messages.append(message)
        sock.sendall(b'sec marker():\n  textmsg("marker")\nend\n')
        while not (
            isinstance(message := reader.message(RobotMessage), TextMessage) and message.text == "marker"
        ):
            messages.append(message)
    return messages


@pytest.mark.parametrize(("program", "line", "column", "text"), PRIMARY.values(), ids=PRIMARY.keys())
def test_errors_of_primary_programs(box, program, line, column, text):
    messages = told(box, program, lambda m: isinstance(m, RuntimeExceptionMessage))
    (error,) = [m for m in messages if isinstance(m, RuntimeExceptionMessage)]
    assert (error.line, error.column, error.text, error.source) == (line, column, text, -3)
    if messages[0] is not error:  # it ran: the error comes before the news of the end
        kinds = [(m.title if isinstance(m, KeyMessage) else type(m).__name__) for m in messages]
        assert kinds == ["PROGRAM_XXX_STARTED", "RuntimeExceptionMessage", "PROGRAM_XXX_STOPPED"]


@pytest.mark.parametrize(
    ("body", "text"), [("x = 1 / 0", "division by zero"), ('x = str_sub("a")', "Type error: str_sub takes")]
)
def test_errors_of_secondary_programs_are_key_messages_and_the_primary_goes_on(box, body, text):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.state()
        sock.sendall(b"def main():\n  while True:\n    sync()\n  end\nend\n")
        assert reader.message(KeyMessage).title == "PROGRAM_XXX_STARTED"
        sock.sendall(f"sec s():\n  {body}\nend\n".encode())
        message = reader.message((KeyMessage, RuntimeExceptionMessage))
        assert isinstance(message, KeyMessage)
        assert (message.title, message.code, message.argument) == ("SECONDARY_PROGRAM_EXCEPTION_XXX", 0, 0)
        assert message.text.startswith(text)
        sock.sendall(b'sec t():\n  textmsg("still here")\nend\n')
        assert reader.message(TextMessage).text == "still here"
        sock.sendall(b"stop program\n")
        assert (message := reader.message(KeyMessage)).title == "PROGRAM_XXX_STOPPED"
        assert message.text == "main"


def test_a_secondary_program_has_no_news_of_its_life(box):
    messages = told(box, 'sec quiet():\n  textmsg("x")\nend\n', lambda m: isinstance(m, TextMessage))
    assert [type(m) for m in messages] == [TextMessage]


def test_the_secondary_port_reports_nothing_but_states():
    class Client:
        sent = ()

        def send(self, package):
            self.sent = (*self.sent, package)

    bench, client = Bench(), Client()
    port = PrimaryPort(
        CB3.software(VERSION),
        bench.controller,
        None,
        StateEncoder(CB3.software(VERSION), bench.controller.state.arm, bench.controller.state.safety),
        all_messages=False,
    )
    port.opened(client)
    greeting = [
        type(decode_package(package[: int.from_bytes(package[:4], "big")], VERSION))
        for package in client.sent
    ]
    assert greeting == [VersionMessage, StartupMessage, RobotState]
    client.sent = ()
    bench.start(
        'def f():\n  $ 1 "x"\n  global a = 1\n  textmsg(a)\n  popup("x")\n  protective_stop()\n  x = 1 / 0\nend\n'
    )
    bench.tick(5)
    kinds = {type(event).__name__ for event in bench.events}
    assert {"ScriptFailed", "TextPrinted", "PopupShown", "ErrorReported", "SafetyModeChanged"} <= kinds
    for event in bench.events:
        port.send_message(event)
    sent = [decode_package(package, VERSION) for package in client.sent]
    assert [type(package) for package in sent] == [RobotState]  # of the stop


def test_on_the_wire_a_code_has_its_argument(box):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.state()
        sock.sendall(b"def f():\n  speedj([0,0,0,50,0,0], 40, 1)\nend\n")
        report = reader.message(ErrorCodeMessage)
        assert (report.code, report.argument, report.report_level) == (204, 3, ReportLevel.WARNING)
        assert report.source == 7
        sock.sendall(b"stop program\nset unlock protective stop\n")
        while (state := reader.state().sub_packages[0]).is_protective_stopped or state.is_program_paused:
            pass


# --- the log


@pytest.fixture
def log(box):
    """What is noted from now on."""
    n_before = len(box.log)
    return lambda: box.log[n_before:]


def run(box, program):
    """Send a program and wait for its end."""
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.state()
        sock.sendall(program.encode("latin-1"))
        while reader.message(KeyMessage).title != "PROGRAM_XXX_STOPPED":
            pass


@pytest.mark.parametrize(
    ("program", "line"),
    [
        ("def f():\n  y = nowhere(1)\nend\n", "Compile error: name 'nowhere' is not defined"),
        ("sec s():\n  x = [1][2]\nend\n", "Secondary program: Runtime error (2:7)"),
    ],
)
def test_errors_have_the_words_of_a_log(box, log, program, line):
    with connect(box, "primary") as sock:
        sock.sendall(program.encode())
        MessageReader(sock).message((KeyMessage, RuntimeExceptionMessage))
    (fault,) = [entry for entry in log() if entry.level is ReportLevel.FAULT]
    assert fault.text.startswith(line)


def test_a_protective_stop_and_what_follows(box, log):
    with connect(box, "realtime") as frames:
        reader = FrameReader(frames)
        program = compile_program('def f():\n  textmsg("x = ", 5)\n  protective_stop()\n  sleep(1)\nend\n')
        box.submit(StartProgram(program, loaded=True))
        reader.until(lambda f: f.runtime_state == ProgramState.PAUSED)
        box.submit(UnlockProtectiveStop())
        reader.until(lambda f: f.safety_mode == SafetyMode.NORMAL)
        box.submit(ResumeProgram())
        reader.until(lambda f: f.runtime_state == ProgramState.STOPPED)
    found = [entry for entry in log() if entry.source != "Client"]
    warning, info = ReportLevel.WARNING, ReportLevel.INFO
    assert [(e.source, e.code, e.text, e.level) for e in found] == [
        ("Program", "", "Starting program: f", info),
        ("Program", "", "x = 5", info),
        ("Controller", "C209A0", "Protective stop requested", warning),
        ("Safety", "", "Safety mode: PROTECTIVE_STOP", warning),
        ("Program", "", "Program paused: f", info),
        ("Safety", "", "Safety mode: NORMAL", info),
        ("Program", "", "Program resumed: f", info),
        ("Program", "", "Program stopped: f", info),
    ]
    ticks = [entry.tick for entry in found]
    assert ticks == sorted(ticks)
    assert all(entry.time == entry.tick * 8 / 1000 >= 60 for entry in found)


def test_modes_and_clients_are_noted(box, log):
    with Dashboard(box) as dashboard:
        dashboard.ask("power off")
        dashboard.until("robotmode", "Robotmode: POWER_OFF")
        dashboard.ask("brake release")
        dashboard.until("robotmode", "Robotmode: RUNNING")
    assert "Robot mode: POWER_OFF" in [entry.text for entry in log()]
    with connect(box, "secondary") as sock:
        mine = "{}:{}".format(*sock.getsockname())
        MessageReader(sock).state()
    run(box, "textmsg(1)\n")
    port = box.ports.secondary
    assert [entry.text for entry in log() if entry.text.startswith(mine)] == [
        f"{mine} connected to secondary port {port}",
        f"{mine} disconnected from secondary port {port}",
    ]


def test_followers_hear_what_happens_such_as_a_socket_that_does_not_open(box, log):
    heard, done = [], threading.Event()

    def follower(entry: LogEntry):
        heard.append(entry)
        if entry.text.startswith("Program stopped"):
            done.set()

    box.follow_log(follower)
    run(box, 'def f():\n  socket_open("127.0.0.1", 1, "peer")\nend\n')
    assert done.wait(TIMEOUT)
    assert heard[-1] in log()
    refused = "Not able to open socket [peer] to host: 127.0.0.1 at port: 1: Connection refused"
    assert refused in [entry.text for entry in heard]


def test_the_log_forgets_the_oldest_and_cuts_long_lines():
    log = BoxLog(CB3)
    for i in range(MAX_ENTRIES + 10):
        log.note(events.TextPrinted(f"line {i}"), i)
    assert len(log.entries) == MAX_ENTRIES
    assert log.entries[0].text == "line 10"
    log.note(events.TextPrinted("x" * 10**6), 1)
    assert len(log.entries[-1].text) == MAX_TEXT
    assert log.entries[-1].text.endswith("...")


EVENTS = [
    (
        events.ErrorReported(0, 0, ReportLevel.WARNING, "Overlapping Blends"),
        "WARNING Controller: Overlapping Blends",
    ),
    (events.ErrorReported(153, 2, ReportLevel.WARNING, "deviates"), "WARNING Controller: C153A2 deviates"),
    (events.PopupShown("T", "x", True, False, False), "WARNING Program: Popup: T: x"),
    (events.PopupShown("T", "x", False, True, False), "FAULT Program: Popup: T: x"),
    (events.PopupShown("T", "x", False, False, False), "INFO Program: Popup: T: x"),
    (events.ScriptFailed(1, 2, "wire"), "FAULT Program: wire"),
    (events.ScriptFailed(1, 2, "wire", True, "log"), "FAULT Program: Secondary program: log"),
    (events.TextPrinted("a\nb\n"), r"INFO Program: a\nb"),
    (
        events.ValueRequested(1, RequestedType.INTEGER, "n?"),
        "INFO Program: Waiting for a value (integer): n?",
    ),
]


@pytest.mark.parametrize(("event", "line"), EVENTS, ids=[line for _, line in EVENTS])
def test_lines_of_events(event, line):
    log = BoxLog(CB3)
    heard = []
    log.follow(heard.append)
    log.note(event, 7500)
    assert str(log.entries[0]) == f"60.000 {line}"
    assert heard == list(log.entries)
