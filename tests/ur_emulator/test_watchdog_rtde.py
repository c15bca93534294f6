"""Watchdogs over RTDE inputs."""

import pytest
from box_support import Bench

from ur_emulator.controller.commands import StopProgram, WriteInputs

REGISTER = "input_int_register_24"
WRITE = WriteInputs(((REGISTER, 5),))


def watching(call):
    bench = Bench()
    bench.start(f"def p():\n  {call}\n  while True:\n    sync()\n  end\nend\n")
    return bench


def reports(bench):
    return [event.text for event in bench.events if getattr(event, "code", None) == 207]


@pytest.mark.parametrize("action", ["stop", "pause", "STOP", "Pause"])
def test_a_variable_that_nobody_writes_ends_the_program(action):
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10, "{action}")')
    bench.tick(13)  # 0.1 s are 12.5 cycles
    assert bench.controller.programs.is_running
    bench.tick()
    assert not bench.controller.programs.is_running
    (text,) = reports(bench)
    assert REGISTER in text
    assert action.lower() in text


def test_the_default_action_is_pause():
    bench = watching(f'rtde_set_watchdog("{REGISTER}", 10)')
    bench.tick(20)
    assert "watchdog action pause" in reports(bench)[0]


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
