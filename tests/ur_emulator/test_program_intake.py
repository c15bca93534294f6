"""Script text becomes commands: words at once, programs in the turns of their senders, and never too much of it."""

import time
from dataclasses import replace
from types import SimpleNamespace

import pytest

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import WorkerError
from ur_emulator.host.ports import script_intake as module
from ur_emulator.host.ports.script_intake import ProgramIntake, Sender
from ur_emulator.host.served_box import ServedBox
from ur_emulator.machine.commands.power import PowerOff
from ur_emulator.machine.commands.programs import PauseProgram, SetSpeedSlider, StartProgram, StopProgram
from ur_emulator.machine.controller.events import ErrorReported, ScriptFailed
from ur_emulator.machine.models.generations import CB3, E_SERIES


class Tasks:
    """Tasks that end when the test says so, in the order of their tickets."""

    def __init__(self):
        self.begun = []

    def submit(self, done, failed, ticket, function, text, *arguments):
        task = SimpleNamespace(done=done, ticket=ticket, text=text)
        self.begun.append(task)
        return task

    def drop(self, task):
        if task in self.begun:
            self.begun.remove(task)

    def finish(self, n_tasks=1, error=None):
        for _ in range(n_tasks):
            task = min(self.begun, key=lambda task: (task.ticket.turn, task.ticket.arrived))
            self.begun.remove(task)
            name = task.text.split("(")[0].split()[-1]
            task.done(SimpleNamespace(name=name), error)


class Box:
    """Notes what it takes: names of programs that start, commands, texts."""

    def __init__(self):
        self.stops = 0
        self.remote_period = 1
        self.newest = 0.0
        self.controller = SimpleNamespace(period_s=CB3.period_s)
        self.identity = SimpleNamespace(software=SimpleNamespace(catalogue=None))
        self.done = []

    start_command = ServedBox.start_command

    def submit(self, command, *, in_place_of=""):
        self.stops += isinstance(command, StopProgram | PowerOff)
        if isinstance(command, StartProgram):
            command = command.program.name + " paused" * command.pauses
        self.done.append(command)

    def announce(self, event):
        self.done.append(event.text if isinstance(event, ErrorReported) else event)

    def take(self):
        done, self.done = self.done, []
        return done


@pytest.fixture
def tasks():
    return Tasks()


@pytest.fixture
def box():
    return Box()


@pytest.fixture
def intake(tasks, box):
    return ProgramIntake(tasks, box)


@pytest.fixture
def one():
    return Sender()


@pytest.fixture
def two():
    return Sender()


@pytest.fixture
def budgets(monkeypatch):
    def lower(**limits):
        monkeypatch.setattr(module, "BUDGETS", replace(BUDGETS, **limits))

    return lower


def program(name, kind="def", size=0):
    return (f"{kind} {name}():\n" + ("#" * 63 + "\n") * (size // 64) + "end\n").encode()


TOO_MUCH = "programs come faster than they compile, some were dropped"


def test_words_wait_for_no_program(intake, tasks, box, one, two):
    intake.received(one, program("a") + b"set speed 0.5\npower off\n")
    intake.received(two, b"stop program\nset speed 7\n")
    *commands, warning = box.take()
    assert commands == [SetSpeedSlider(0.5), PowerOff(), StopProgram()]
    assert warning == "'set speed 7' was ignored: the speed slider takes 0 to 1"


def test_programs_begin_in_the_order_of_arrival(intake, tasks, box, one, two):
    intake.received(one, program("a") + program("b"))
    intake.received(two, program("c"))
    intake.received(one, program("d"))
    tasks.finish(4)
    assert box.take() == ["a", "b", "c", "d"]


def test_who_sends_many_lets_others_go_first(intake, tasks, box, one, two):
    intake.received(one, b"a()\n" * 20)
    intake.received(two, program("b"))
    for _ in range(5):
        tasks.finish(4)
        intake.publish(None)
    assert box.take()[14:18] == [
        "a",
        "b",
        *["program a does not begin: a newer one was compiled before it"] * 2,
    ]


def test_a_short_program_goes_before_a_long_one_that_waits(intake, tasks, box, one, two):
    intake.received(one, program("a", size=20_000))
    intake.received(two, program("b"))
    tasks.finish()
    assert box.take() == ["b"]


def test_one_program_of_a_client_that_has_gone_is_compiled_however_long_it_is(intake, tasks, box, one):
    intake.received(one, program("a", size=MAX_PROGRAM // 2) * 2)
    intake.closed(one)
    tasks.finish()
    assert box.take() == [TOO_MUCH, "a"]


def test_a_program_that_takes_long_holds_up_nobody_and_does_not_replace_a_newer_one(
    intake, tasks, box, one, two
):
    intake.received(one, program("long"))
    intake.received(two, program("b") + b"pause program\n")
    long = tasks.begun.pop(0)
    tasks.finish()
    long.done(SimpleNamespace(name="long"), None)
    assert box.take() == [
        PauseProgram(),
        "b paused",
        "program long does not begin: a newer one was compiled before it",
    ]


def test_a_program_does_not_replace_one_that_somebody_else_started_since(intake, tasks, box, one):
    intake.received(one, program("long"))
    box.newest = time.monotonic()  # `play`, or the control API
    tasks.finish()
    intake.received(one, program("next"))
    tasks.finish()
    assert box.take() == ["program long does not begin: a newer one was compiled before it", "next"]


def test_a_stop_ends_all_that_came_before_it_and_nothing_else(intake, tasks, box, one, two):
    intake.received(one, program("a") + program("s", "sec"))
    intake.received(two, program("b") + b"stop program\n" + program("c"))
    assert box.take() == [StopProgram()]
    tasks.finish()
    assert box.take() == ["program a was stopped before it began"]
    intake.publish(None)
    assert box.take() == ["programs that were stopped before they began: 1"]
    assert [task.text for task in tasks.begun] == [program("s", "sec").decode(), program("c").decode()]
    tasks.finish(2)
    assert box.take() == ["s", "c"]
    assert one.held == two.held == intake._held == 0


@pytest.mark.parametrize(
    ("words", "is_paused"), [("pause program", True), ("pause program\nresume program", False)]
)
def test_a_program_that_somebody_has_paused_before_it_began_begins_with_a_pause(
    intake, tasks, box, one, two, words, is_paused
):
    intake.received(one, program("a"))
    intake.received(two, words.encode() + b"\n" + program("b"))
    assert PauseProgram() in box.take()
    tasks.finish(2)
    assert box.take() == ["a" + " paused" * is_paused, "b"]


def test_a_program_that_is_not_compiled_is_refused_and_the_next_one_goes_on(intake, tasks, box, one):
    intake.received(one, program("a") + program("b"))
    tasks.finish(error=WorkerError("it has ended: try again"))
    tasks.finish()
    assert box.take() == [ScriptFailed(1, 1, "the program cannot be compiled: it has ended: try again"), "b"]


def test_a_client_may_let_so_much_wait_and_is_informed_once(intake, tasks, box, one, two):
    intake.received(one, program("a", size=MAX_PROGRAM - 64) + program("b", size=MAX_PROGRAM // 6) * 3)
    intake.received(two, program("c"))
    assert box.take() == [TOO_MUCH]
    tasks.finish(3)
    assert box.take()[:2] == ["c", "program a does not begin: a newer one was compiled before it"]
    assert not tasks.begun
    assert intake._held == 0
    assert not one.is_told


def test_text_that_is_not_complete_counts_too_and_the_rest_of_it_is_dropped(
    intake, tasks, box, budgets, one, two
):
    budgets(script_bytes=100_000)
    for sender in (one, two):
        intake.received(sender, b"def a():\n" + b"#\n" * 40_000)
    assert box.take() == [TOO_MUCH]
    assert (one.held, two.held) == (80_009, 0)
    intake.received(two, b"b()\nend\nc()\n")
    assert [task.text for task in tasks.begun] == ["c()\n"]


def test_what_others_send_leaves_room_for_a_small_program(intake, tasks, box, budgets, one, two):
    budgets(script_bytes=100_000)
    intake.received(one, b"def a():\n" + b"#\n" * 49_000)
    intake.received(two, program("b", size=50_000))
    assert len(tasks.begun) == 1
    assert not box.take()


def test_only_so_many_programs_start_in_a_cycle_and_the_others_wait(intake, tasks, box, budgets, one, two):
    budgets(programs_per_cycle=2)
    intake.received(one, b"a()\n" * 5)
    intake.received(two, b"b()\n")
    for left in ([2, 1, 0, 0], [2, 0], [0]):
        for n in left:
            tasks.finish(min(len(tasks.begun), 1 + n))
        assert len(box.take()) <= 2
        intake.publish(None)
    assert intake._held == len(box.take()) == 0


def test_a_shorter_cycle_starts_fewer_programs(tasks, box, one):
    box.controller.period_s = E_SERIES.period_s
    intake = ProgramIntake(tasks, box)
    intake.received(one, b"a()\n" * 3)
    for _ in range(3):
        tasks.finish()
        assert len(box.take()) == 1
        intake.publish(None)


def test_a_million_mistakes_are_few_warnings(intake, box, one):
    intake.received(one, b"set speed 7\n" * 1000)
    assert len(box.take()) == BUDGETS.script_warnings_per_cycle
    intake.publish(None)
    intake.received(one, b"set speed 7\n")
    assert len(box.take()) == 1


def test_of_a_client_that_has_gone_so_much_is_still_compiled(intake, tasks, box, budgets, one, two):
    budgets(script_bytes_gone=22_000)
    for sender in (one, two):
        intake.received(sender, program("a", size=5000) * 3 + b"def b():\n")
        intake.closed(sender)
    assert box.take() == [TOO_MUCH, TOO_MUCH]
    assert [len(sender.programs) for sender in (one, two)] == [2, 2]
    tasks.finish(4)
    assert not tasks.begun
    assert intake._held == 0


def test_who_sends_one_program_and_goes_loses_nothing_by_those_who_sent_many(
    intake, tasks, box, budgets, one, two
):
    budgets(script_bytes_gone=22_000)
    intake.received(one, b"end\n" * 200)
    intake.closed(one)
    intake.received(two, program("hello"))
    intake.closed(two)
    assert [program.text for program in two.programs] == [program("hello").decode()]
    assert one.held + two.held < 30_000


def test_a_box_that_closes_forgets_what_waits(intake, tasks, box, one):
    intake.received(one, program("a") + program("b"))
    intake.close()
    assert not tasks.begun
    assert not box.done
