"""The box's log, and commands to a box of one's own program."""

import threading

import pytest
from box_support import TIMEOUT, FrameReader, MessageReader, connect

from protocol.primary.messages import (
    KeyMessage,
    PopupMessage,
    ReportLevel,
    RuntimeExceptionMessage,
    TextMessage,
)
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.box_log import MAX_ENTRIES, MAX_TEXT, BoxLog, LogEntry
from ur_emulator.commands.programs import AnswerRequest, ClosePopup, ResumeProgram, StartProgram
from ur_emulator.commands.safety import UnlockProtectiveStop
from ur_emulator.controller import events
from ur_emulator.models.generations import CB3
from urscript import compile_program


@pytest.fixture
def box():
    with ControlBox(pace="lockstep", port_base=None) as box:
        yield box


def texts(entries, source=None):
    return [entry.text for entry in entries if source in (None, entry.source)]


def run(box, program):
    """Send a program and wait for its end."""
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        reader.state()
        sock.sendall(program.encode("latin-1"))
        while reader.message(KeyMessage).title != "PROGRAM_XXX_STOPPED":
            pass


def test_the_life_of_a_program(box):
    run(box, 'def hello():\n  textmsg("x = ", 5)\nend\n')
    assert texts(box.log, "Program") == ["Starting program: hello", "x = 5", "Program stopped: hello"]
    (started, *_) = [entry for entry in box.log if entry.source == "Program"]
    assert started.level is ReportLevel.INFO
    assert started.time == started.tick * 0.008 >= 60


@pytest.mark.parametrize(
    ("program", "line"),
    [
        ("def f():\n  y = nowhere(1)\nend\n", "Compile error: name 'nowhere' is not defined"),
        ("sec s():\n  x = [1][2]\nend\n", "Secondary program: Runtime error (2:7)"),
    ],
)
def test_errors_have_the_words_of_a_log(box, program, line):
    with connect(box, "primary") as sock:
        sock.sendall(program.encode())
        MessageReader(sock).message((KeyMessage, RuntimeExceptionMessage))
    (fault,) = [entry for entry in box.log if entry.level is ReportLevel.FAULT]
    assert fault.text.startswith(line)


def test_a_protective_stop_and_what_follows(box):
    with connect(box, "realtime") as frames:
        reader = FrameReader(frames)
        program = compile_program("def f():\n  protective_stop()\n  sleep(1)\nend\n")
        box.submit(StartProgram(program, loaded=True))
        reader.until(lambda f: f.runtime_state == ProgramState.PAUSED)
        box.submit(UnlockProtectiveStop())
        reader.until(lambda f: f.safety_mode == SafetyMode.NORMAL)
        box.submit(ResumeProgram())
        reader.until(lambda f: f.runtime_state == ProgramState.STOPPED)
    found = [(e.source, e.code, e.text) for e in box.log if e.source != "Client"]
    assert found == [
        ("Program", "", "Starting program: f"),
        ("Controller", "C209A0", "Protective stop requested"),
        ("Safety", "", "Safety mode: PROTECTIVE_STOP"),
        ("Program", "", "Program paused: f"),
        ("Safety", "", "Safety mode: NORMAL"),
        ("Program", "", "Program resumed: f"),
        ("Program", "", "Program stopped: f"),
    ]
    assert [e.level for e in box.log if e.code] == [ReportLevel.WARNING]
    ticks = [e.tick for e in box.log]
    assert ticks == sorted(ticks)


def test_modes_clients_and_notes_of_the_dashboard(box):
    with connect(box, "dashboard") as sock:
        lines = sock.makefile("rb")
        lines.readline()
        for line in (b"addToLog all is well\n", b"power off\n"):
            sock.sendall(line)
            lines.readline()
        with connect(box, "realtime") as frames:
            FrameReader(frames).until(lambda f: f.robot_mode == 3)
    log = box.log
    assert ("Dashboard", "all is well") in [(e.source, e.text) for e in log]
    assert "Robot mode: POWER_OFF" in texts(log, "Controller")
    (first, *_) = texts(log, "Client")
    assert first.endswith(f"connected to dashboard port {box.ports.dashboard}")


def test_who_leaves_is_noted(box):
    with connect(box, "secondary") as sock:
        mine = "{}:{}".format(*sock.getsockname())
        MessageReader(sock).state()
    run(box, "textmsg(1)\n")
    notes = [text for text in texts(box.log, "Client") if text.startswith(mine)]
    port = box.ports.secondary
    assert notes == [
        f"{mine} connected to secondary port {port}",
        f"{mine} disconnected from secondary port {port}",
    ]


def test_a_socket_that_does_not_open_is_noted(box):
    run(box, 'def f():\n  socket_open("127.0.0.1", 1, "peer")\nend\n')
    assert "Not able to open socket [peer] to host: 127.0.0.1 at port: 1: Connection refused" in texts(
        box.log, "Program"
    )


def test_a_client_of_ones_own_can_close_popups_and_answer(box):
    with connect(box, "primary") as sock:
        reader = MessageReader(sock)
        sock.sendall(
            b'def f():\n  popup("go?", "Wait", blocking=True)\n'
            b'  n = request_integer_from_primary_client("how many?")\n  textmsg("got ", n)\nend\n'
        )
        assert reader.message(PopupMessage).text == "go?"
        box.submit(ClosePopup())
        box.submit(AnswerRequest("not a number"))
        while "Waiting for a value (integer): how many?" not in texts(box.log):
            reader.state()
        box.submit(AnswerRequest(7))
        assert reader.message(TextMessage).text == "got 7"
    assert "Popup: Wait: go?" in texts(box.log, "Program")


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
]


@pytest.mark.parametrize(("event", "line"), EVENTS, ids=[line for _, line in EVENTS])
def test_lines_of_events(event, line):
    log = BoxLog(CB3)
    heard = []
    log.follow(heard.append)
    log.note(event, 7500)
    assert str(log.entries[0]) == f"60.000 {line}"
    assert heard == list(log.entries)


def test_followers_hear_what_happens(box):
    heard, done = [], threading.Event()

    def follower(entry: LogEntry):
        heard.append(entry)
        if entry.text.startswith("Program stopped"):
            done.set()

    box.follow_log(follower)
    run(box, "textmsg(1)\n")
    assert done.wait(TIMEOUT)
    assert heard[-len(box.log) :][-1] in box.log
