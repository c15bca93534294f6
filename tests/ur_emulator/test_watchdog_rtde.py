"""Watchdogs over RTDE inputs."""

import pytest
from box_support import Bench

from protocol.ur_types import ProgramState
from ur_emulator.commands.client_writes import WriteInputs
from ur_emulator.commands.programs import ResumeProgram, StopProgram

REGISTER = "input_int_register_24"
WRITE = WriteInputs(((REGISTER, 5),))


def watching(call):
    bench = Bench()
    bench.start(f"def p():\n  {call}\n  while True:\n    sync()\n  end\nend\n")
    return bench


def reports(bench):
    return [event.text for event in bench.events if getattr(event, "code", None) == 207]


@pytest.mark.parametrize("action", ["stop", "STOP"])
def test_a_variable_that_nobody_writes_ends_the_program(action):
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10, "{action}")')
    bench.tick(13)  # 0.1 s are 12.5 cycles
    assert bench.controller.programs.is_running
    bench.tick()
    assert not bench.controller.programs.is_running
    (text,) = reports(bench)
    assert REGISTER in text
    assert "watchdog action stop: the program is stopped" in text


@pytest.mark.parametrize("action", [', "pause"', ', "PAUSE"', ""])
def test_a_variable_that_nobody_writes_pauses_the_program(action):
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10{action})')
    bench.tick(13)
    assert not bench.controller.programs.is_paused
    bench.tick(2)
    assert bench.now.runtime_state == ProgramState.PAUSED
    (text,) = reports(bench)
    assert REGISTER in text
    assert "watchdog action pause: the program is paused" in text
    bench.tick(100)
    assert len(reports(bench)) == 1


def test_a_paused_program_is_watched_again_when_it_goes_on():
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10)')
    bench.tick(50)
    bench.tick(1, ResumeProgram())
    for _ in range(30):
        bench.tick(1, WRITE)
    bench.tick(10)
    assert bench.now.runtime_state == ProgramState.PLAYING
    bench.tick(10)
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert len(reports(bench)) == 2


def test_of_two_late_variables_the_one_that_stops_counts():
    bench = watching(
        f'rtde_set_watchdog("{REGISTER}", 10, "pause")\n  rtde_set_watchdog("input_int_register_25", 10, "stop")'
    )
    bench.tick(14)
    assert not bench.controller.programs.is_running
    assert "input_int_register_25" in reports(bench)[0]


@pytest.mark.parametrize(("frequency", "cycles"), [(125, 1), (62.5, 2), (25, 5), (10, 13), (200, 1)])
def test_packages_at_the_minimum_frequency_are_enough_and_one_cycle_more_is_not(frequency, cycles):
    bench = watching(f'rtde_set_watchdog("{REGISTER}", {frequency}, "stop")')
    for _ in range(10):
        bench.tick(1, WRITE)
        bench.tick(cycles - 1)
    assert bench.controller.programs.is_running
    bench.tick(1, WRITE)
    bench.tick(cycles)
    assert bench.controller.programs.is_running
    bench.tick()
    assert not bench.controller.programs.is_running


def test_only_the_named_variable_counts():
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10, "stop")')
    for _ in range(20):
        bench.tick(1, WriteInputs((("input_int_register_25", 5),)))
    assert not bench.controller.programs.is_running


@pytest.mark.parametrize(
    "call", [f'rtde_set_watchdog("{REGISTER}", 10, "ignore")', f'rtde_set_watchdog("{REGISTER}", 0)']
)
def test_no_watchdog(call):
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10, "stop")\n  {call}')
    bench.tick(100)
    assert bench.controller.programs.is_running


def test_watchdogs_end_with_their_program():
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10, "stop")')
    bench.tick(1, StopProgram())
    bench.start("def p():\n  while True:\n    sync()\n  end\nend\n")
    bench.tick(100)
    assert bench.controller.programs.is_running
    assert not reports(bench)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ('rtde_set_watchdog("actual_q", 10)', 'no RTDE input "actual_q"'),
        (f'rtde_set_watchdog("{REGISTER}", 10, "halt")', "choose ignore, pause or stop"),
    ],
)
def test_errors(call, words):
    bench = watching(call)
    assert words in next(event.text for event in bench.events if type(event).__name__ == "ScriptFailed")
