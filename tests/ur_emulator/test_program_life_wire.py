"""Pausing and resuming as clients do it and see it: words on the script ports, dashboard, states."""

import pytest
from box_support import Bench, FrameReader, MessageReader, connect

from protocol.primary.layout import RobotModeData
from protocol.primary.messages import ErrorCodeMessage, KeyMessage, ReportLevel, TextMessage
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import ProgramState, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.commands.programs import PauseProgram, ResumeProgram, StartProgram, StopProgram
from ur_emulator.commands.safety import TriggerProtectiveStop
from ur_emulator.ports.primary.robot_state import state_records
from urscript import compile_program

MOVE = 'def m():\n  movej([0.9,-1.6,-1.9,-0.2,1.2,1.6], a=1.4, v=0.5)\n  textmsg("there")\nend\n'
COUNT = "def count():\n  n = 0\n  while True:\n    n = n + 1\n    write_output_integer_register(0, n)\n    sync()\n  end\nend\n"


@pytest.fixture
def box():
    with ControlBox(pace="lockstep", port_base=None) as box:
        yield box


def play(box, text):
    """Start a program as one that was loaded."""
    box.submit(StartProgram(compile_program(text), loaded=True))


class Dashboard:
    """A dashboard client."""

    def __init__(self, box):
        self.sock = connect(box, "dashboard")
        self.lines = self.sock.makefile("rb")
        self.lines.readline()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.lines.close()
        self.sock.close()

    def ask(self, line):
        self.sock.sendall(line.encode() + b"\n")
        return self.lines.readline().decode().rstrip("\n")

    def until(self, line, answer):
        """Poll as clients do."""
        for _ in range(100_000):
            if (got := self.ask(line)) == answer:
                return
        raise AssertionError(f"{line} still answers {got}")


@pytest.mark.parametrize("port", ["primary", "secondary", "realtime"])
def test_words_on_the_script_ports(box, port):
    with connect(box, port) as sock, connect(box, "realtime") as frames, connect(box, "primary") as messages:
        reader, told = FrameReader(frames), MessageReader(messages)
        told.state()
        sock.sendall(MOVE.encode())
        reader.until(lambda f: f.target_qd.any())
        sock.sendall(b"pause program\n")
        reader.until(lambda f: f.runtime_state == ProgramState.PAUSING and f.target_qd.any())
        held = reader.until(lambda f: f.runtime_state == ProgramState.PAUSED)
        assert not held.target_qd.any()
        assert told.message(KeyMessage).title == "PROGRAM_XXX_STARTED"
        assert (message := told.message(KeyMessage)).title == "PROGRAM_XXX_PAUSED"
        assert message.text == "m"
        sock.sendall(b"resume program\n")
        reader.until(lambda f: f.runtime_state == ProgramState.PLAYING)
        assert told.message(TextMessage).text == "there"
        assert told.message(KeyMessage).title == "PROGRAM_XXX_STOPPED"
        reader.until(lambda f: f.runtime_state == ProgramState.STOPPED)


def test_the_dashboard_pauses_plays_and_stops(box):
    with Dashboard(box) as dashboard, connect(box, "secondary") as sock:
        for line in ("play", "pause"):
            assert dashboard.ask(line) == f"Failed to execute: {line}"
        assert dashboard.ask("programState") == "STOPPED <unnamed>"
        sock.sendall(COUNT.encode())
        dashboard.until("programState", "PLAYING <unnamed>")
        assert dashboard.ask("running") == "Program running: true"
        assert dashboard.ask("play") == "Failed to execute: play"
        assert dashboard.ask("pause") == "Pausing program"
        dashboard.until("programState", "PAUSED <unnamed>")
        assert dashboard.ask("running") == "Program running: false"
        assert dashboard.ask("pause") == "Failed to execute: pause"
        assert dashboard.ask("play") == "Starting program"
        dashboard.until("programState", "PLAYING <unnamed>")
        assert dashboard.ask("pause") == "Pausing program"
        dashboard.until("programState", "PAUSED <unnamed>")
        assert dashboard.ask("stop") == "Stopped"
        dashboard.until("programState", "STOPPED <unnamed>")
        assert dashboard.ask("play") == "Failed to execute: play"
        assert dashboard.ask("stop") == "Stopped"


def test_play_is_refused_in_a_protective_stop_and_possible_after_it(box):
    with Dashboard(box) as dashboard, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        play(box, 'def p():\n  protective_stop()\n  sleep(0.1)\n  textmsg("on")\nend\n')
        dashboard.until("programState", "PAUSED <unnamed>")
        assert dashboard.ask("safetymode") == "Safetymode: PROTECTIVE_STOP"
        assert dashboard.ask("play") == "Failed to execute: play"
        report = reader.message(ErrorCodeMessage)
        assert (report.code, report.argument, report.report_level) == (209, 0, ReportLevel.WARNING)
        sock.sendall(b"set unlock protective stop\n")
        dashboard.until("safetymode", "Safetymode: NORMAL")
        assert dashboard.ask("programState") == "PAUSED <unnamed>"
        assert dashboard.ask("play") == "Starting program"
        assert reader.message(TextMessage).text == "on"


def test_a_paused_program_that_may_not_go_on_is_no_warning(box):
    """A client of the public library ends its script on warnings."""
    with connect(box, "primary") as sock, connect(box, "realtime") as frames:
        reader = MessageReader(sock)
        play(box, "def p():\n  protective_stop()\n  sleep(9)\nend\n")
        FrameReader(frames).until(lambda f: f.runtime_state == ProgramState.PAUSED)
        assert reader.message(ErrorCodeMessage).code == 209
        sock.sendall(b"resume program\n")
        report = reader.message(ErrorCodeMessage)
        assert report.report_level == ReportLevel.INFO
        assert "p stays paused: the robot is in PROTECTIVE_STOP" in report.text


def flags(snapshot):
    """Running and paused as robot mode data say, running as RTDE says."""
    (mode,) = [record for record in state_records(snapshot) if isinstance(record, RobotModeData)]
    rtde = bool(snapshot.robot_status_bits & RobotStatusBits.PROGRAM_RUNNING)
    return mode.is_program_running, mode.is_program_paused, rtde


def test_flags_of_the_states():
    bench = Bench(fidelity="ideal")
    bench.start(MOVE)
    bench.tick(40)
    bench.tick(60, PauseProgram())
    bench.tick(300, ResumeProgram())
    seen = {ProgramState(s.runtime_state): flags(s) for s in bench.snapshots}
    running, paused, stopped = (True, False, True), (False, True, False), (False, False, False)
    assert seen == {
        ProgramState.PLAYING: running,
        ProgramState.PAUSING: running,
        ProgramState.PAUSED: paused,
        ProgramState.RESUMING: running,
        ProgramState.STOPPED: stopped,
    }


def test_after_a_stop_neither_flag_is_set():
    """The public client library waits for that after `stop program`."""
    bench = Bench(fidelity="ideal")
    bench.start(MOVE)
    bench.tick(40)
    bench.tick(5, PauseProgram())
    bench.tick(1, StopProgram())
    assert flags(bench.now) == (False, False, False)


def test_time_stands_still_over_a_pause_in_lockstep(box):
    with connect(box, "secondary") as sock, connect(box, "realtime") as frames:
        reader = FrameReader(frames)
        sock.sendall(COUNT.encode())
        reader.until(lambda f: f.runtime_state == ProgramState.PLAYING)
        sock.sendall(b"pause program\n")
        last = reader.until(lambda f: f.runtime_state == ProgramState.PAUSED)
        same = 0
        while same < 20:
            frame = reader.next()
            same = same + 1 if frame.timestamp == last.timestamp else 0
            last = frame
        assert last.runtime_state == ProgramState.PAUSED
        sock.sendall(b"resume program\n")
        assert reader.until(lambda f: f.runtime_state == ProgramState.PLAYING).timestamp > last.timestamp


def test_a_client_that_reuploads_after_a_protective_stop(box):
    """As ur_rtde does: unlock, upload while the state is not playing, wait for playing."""
    with connect(box, "realtime") as frames, connect(box, "secondary") as sock:
        reader = FrameReader(frames)
        sock.sendall(COUNT.encode())
        reader.until(lambda f: f.runtime_state == ProgramState.PLAYING)
        box.submit(TriggerProtectiveStop())
        reader.until(lambda f: f.safety_mode == SafetyMode.PROTECTIVE_STOP)
        sock.sendall(b"set unlock protective stop\n")
        frame = reader.until(lambda f: f.safety_mode == SafetyMode.NORMAL)
        assert frame.runtime_state != ProgramState.PLAYING
        sock.sendall(COUNT.encode())
        reader.until(lambda f: f.runtime_state == ProgramState.PLAYING)
