"""Script items become commands in the order in which they came, whatever takes how long."""

import pytest

from protocol.script_channel import ControlLine, Overflow, ProgramText
from ur_emulator.commands.programs import SetSpeedSlider, StartProgram, StopProgram
from ur_emulator.controller.events import ErrorReported, ScriptFailed
from ur_emulator.errors import WorkerError
from ur_emulator.servers.programs.intake import MAX_WAITING, ProgramIntake

STOP = ControlLine("stop program", "stop program", "")


class Tasks:
    """Tasks that end when the test says so."""

    def __init__(self):
        self.begun, self.dropped = [], []

    def submit(self, done, failed, function, *arguments):
        self.begun.append((done, arguments[0]))
        return done

    def drop(self, task):
        self.dropped.append(task)

    def finish(self, result=None, error=None):
        done, text = self.begun.pop(0)
        done(result or text, error)


@pytest.fixture
def tasks():
    return Tasks()


@pytest.fixture
def done():
    return []


@pytest.fixture
def intake(tasks, done):
    return ProgramIntake(tasks, None, done.append, done.append)


def program(text, kind="def"):
    return ProgramText(text, 1, kind)


def test_what_needs_no_compiling_waits_for_the_programs_before_it(intake, tasks, done):
    intake.take("one", [STOP, program("a")])
    intake.take("two", [STOP, program("b")])
    intake.take("one", [ControlLine("set speed 0.5", "set speed", "0.5")])
    assert done == [StopProgram()]
    assert [text for _, text in tasks.begun] == ["a"]
    tasks.finish()
    assert done == [StopProgram(), StartProgram("a"), StopProgram()]
    tasks.finish()
    assert done[3:] == [StartProgram("b"), SetSpeedSlider(0.5)]
    assert not intake._waiting


def test_a_program_that_is_not_compiled_is_refused_and_the_next_one_goes_on(intake, tasks, done):
    intake.take("one", [program("a"), program("b")])
    tasks.finish(error=WorkerError("it has ended: try again"))
    tasks.finish(ScriptFailed(2, 3, "wrong"))
    assert done == [
        ScriptFailed(1, 1, "the program cannot be compiled: it has ended: try again"),
        ScriptFailed(2, 3, "wrong"),
    ]


def test_who_floods_the_port_loses_programs_and_nobody_else_does(intake, tasks, done):
    half = "x" * (MAX_WAITING // 2)
    intake.take("one", [program(half)] * 4)
    intake.take("two", [program("b")])
    assert [type(event) for event in done] == [ErrorReported]
    tasks.finish()
    tasks.finish()
    assert done[1:] == [StartProgram(half), StartProgram("b")]
    intake.take("one", [Overflow("program", 5)])
    assert "more than 5 bytes" in done[3].text


def test_a_box_that_closes_forgets_what_waits(intake, tasks, done):
    intake.take("one", [program("a"), program("b"), STOP])
    intake.close()
    assert tasks.dropped == [tasks.begun[0][0]]
    assert not done
