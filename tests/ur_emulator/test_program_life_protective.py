"""A protective stop pauses a loaded program; after the unlocking it goes on, ends or gives way to another one."""

import numpy as np
import pytest
from box_support import Bench

from protocol.primary.messages import ReportLevel
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.power import PowerOff
from ur_emulator.commands.programs import PauseProgram, ResumeProgram, StopProgram
from ur_emulator.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.controller.events import (
    ErrorReported,
    ProgramPaused,
    ProgramResumed,
    ProgramStarted,
    ProgramStopped,
    SafetyModeChanged,
    ScriptFailed,
)

GOAL = [0.9, -1.6, -1.9, -0.2, 1.2, 1.6]
MOVE = f'def m():\n  movej({GOAL}, a=1.4, v=1.0)\n  textmsg("there")\nend\n'
TRIGGER, UNLOCK = TriggerProtectiveStop(), UnlockProtectiveStop()
RESUME, STOP = ResumeProgram(), StopProgram()


@pytest.fixture
def stopped():
    """A box whose arm was stopped in the middle of a move."""
    bench = Bench(fidelity="ideal")
    bench.start(MOVE, loaded=True)
    bench.tick(60)
    assert bench.now.target_qd[0] > 0.3
    bench.tick(80, TRIGGER)
    return bench


def printed(bench):
    return [event.text for event in bench.events if type(event).__name__ == "TextPrinted"]


def at_rest(bench):
    return bench.now.target_qd == (0.0,) * 6


def test_the_program_is_paused_and_the_arm_rests(stopped):
    assert stopped.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert stopped.now.runtime_state == ProgramState.PAUSED
    assert stopped.now.robot_mode == RobotMode.RUNNING
    assert at_rest(stopped)
    speeds = np.array([s.target_qd for s in stopped.snapshots])
    assert np.abs(
        np.diff(speeds, axis=0)
    ).max() <= stopped.controller.state.robot.stop_deceleration * 0.008 * (1 + 1e-9)
    assert [type(e) for e in stopped.events if not type(e).__name__.startswith("Text")] == [
        ProgramStarted,
        ErrorReported,
        SafetyModeChanged,
        ProgramPaused,
    ]
    (report,) = [e for e in stopped.events if isinstance(e, ErrorReported)]
    assert (report.code, report.argument, report.level) == (209, 0, ReportLevel.WARNING)


def test_it_stays_paused_when_the_stop_is_unlocked(stopped):
    stopped.tick(200, UNLOCK)
    assert stopped.now.safety_mode == SafetyMode.NORMAL
    assert stopped.now.runtime_state == ProgramState.PAUSED
    assert at_rest(stopped)
    assert printed(stopped) == []


def test_after_the_unlocking_it_goes_on_to_its_goal(stopped):
    stopped.tick(5, UNLOCK)
    stopped.tick(600, RESUME)
    assert stopped.now.target_q == pytest.approx(GOAL)
    assert printed(stopped) == ["there"]
    assert stopped.now.runtime_state == ProgramState.STOPPED
    assert [type(e) for e in stopped.events][-3:] != [ScriptFailed]


def test_threads_wait_until_the_arm_is_back_on_its_path(stopped):
    bench = Bench(fidelity="ideal")
    bench.start(
        "def m():\n  thread t():\n    n = 0\n    while True:\n      n = n + 1\n      write_output_integer_register(0, n)\n"
        f"      sync()\n    end\n  end\n  run t()\n  movej({GOAL}, a=1.4, v=1.0)\nend\n",
        loaded=True,
    )
    bench.tick(60)
    left_at = bench.now.target_q
    bench.tick(80, TRIGGER)
    assert bench.now.target_q != left_at
    bench.tick(5, UNLOCK)
    count = bench.controller.state.registers.outputs.integers[0]
    bench.tick(1, RESUME)
    n_resuming = 0
    while bench.now.runtime_state == ProgramState.RESUMING:
        assert bench.controller.state.registers.outputs.integers[0] == count
        n_resuming += 1
        bench.tick()
    assert n_resuming > 5
    assert bench.controller.state.registers.outputs.integers[0] == count + 1


def test_nothing_goes_on_while_the_stop_lasts(stopped):
    stopped.tick(50, RESUME)
    assert stopped.now.runtime_state == ProgramState.PAUSED
    assert at_rest(stopped)
    (text,) = [e.text for e in stopped.events if isinstance(e, ErrorReported) and e.code == 0]
    assert "m stays paused: the robot is in PROTECTIVE_STOP" in text


def test_another_program_is_refused_while_the_stop_lasts_and_the_first_stays(stopped):
    stopped.start('def other():\n  textmsg("other")\nend\n')
    stopped.tick(10)
    (failed,) = [e for e in stopped.events if isinstance(e, ScriptFailed)]
    assert "other not started: the robot is in PROTECTIVE_STOP" in failed.text
    assert stopped.now.runtime_state == ProgramState.PAUSED
    stopped.tick(5, UNLOCK)
    stopped.tick(600, RESUME)
    assert printed(stopped) == ["there"]


def test_after_the_unlocking_another_program_takes_its_place(stopped):
    stopped.tick(1, UNLOCK)
    assert stopped.run('def other():\n  movej([0.1,-1.6,-1.9,-0.2,1.2,1.6])\n  textmsg("other")\nend\n') == [
        "other"
    ]
    assert stopped.now.target_q[0] == pytest.approx(0.1)
    lives = [(type(e), e.name) for e in stopped.events if type(e) in (ProgramStarted, ProgramStopped)]
    assert lives == [
        (ProgramStarted, "m"),
        (ProgramStopped, "m"),
        (ProgramStarted, "other"),
        (ProgramStopped, "other"),
    ]


@pytest.mark.parametrize("end", [STOP, PowerOff()])
def test_it_can_be_ended_during_the_stop(stopped, end):
    stopped.tick(1, end)
    stopped.tick(5)
    assert stopped.now.runtime_state == ProgramState.STOPPED
    assert stopped.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert isinstance(
        [e for e in stopped.events if type(e).__name__.startswith("Program")][-1], ProgramStopped
    )
    stopped.tick(1, UNLOCK)
    stopped.tick(20, RESUME)
    assert stopped.now.runtime_state == ProgramState.STOPPED


def test_a_pause_before_the_stop_changes_nothing():
    bench = Bench(fidelity="ideal")
    bench.start(MOVE, loaded=True)
    bench.tick(60)
    bench.tick(60, PauseProgram())
    bench.tick(10, TRIGGER)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    bench.tick(5, UNLOCK)
    bench.tick(600, RESUME)
    assert printed(bench) == ["there"]
    assert bench.now.target_q == pytest.approx(GOAL)


@pytest.mark.parametrize("cycles", [1, 4, 10])
def test_a_stop_on_the_way_into_a_pause_or_out_of_it(cycles):
    bench = Bench(fidelity="ideal")
    bench.start(MOVE, loaded=True)
    bench.tick(60)
    bench.tick(cycles, PauseProgram())
    bench.tick(80, TRIGGER)
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.tick(1, UNLOCK)
    bench.tick(cycles, RESUME)
    bench.tick(80, TRIGGER)
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert at_rest(bench)
    bench.tick(1, UNLOCK)
    bench.tick(800, RESUME)
    assert printed(bench) == ["there"]
    assert bench.now.target_q == pytest.approx(GOAL)
    assert np.abs(np.diff([s.target_q for s in bench.snapshots], axis=0)).max() <= 1.01 * 0.008


def test_a_program_that_asks_for_a_stop_goes_on_after_it():
    bench = Bench(fidelity="ideal")
    bench.start('def p():\n  protective_stop()\n  sleep(0.1)\n  textmsg("on")\nend\n', loaded=True)
    bench.tick(50)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.tick(1, UNLOCK)
    bench.tick(50, RESUME)
    assert printed(bench) == ["on"]


def test_a_secondary_program_that_stops_the_arm_gives_one_report():
    """Source: the public client library's tests."""
    bench = Bench()
    bench.start("sec s():\n  protective_stop()\nend\n")
    bench.tick(20)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    reports = [(e.code, e.argument) for e in bench.events if isinstance(e, ErrorReported)]
    assert reports == [(209, 0)]
    assert bench.now.runtime_state == ProgramState.STOPPED


def test_a_path_that_leads_nowhere_stops_again_when_it_goes_on():
    bench = Bench(fidelity="ideal")
    bench.start("def f():\n  movel(p[10,0,0,0,0,0])\nend\n", loaded=True)
    for _ in range(2):
        bench.tick(700)
        assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
        assert bench.now.runtime_state == ProgramState.PAUSED
        bench.tick(1, UNLOCK)
        bench.tick(1, RESUME)
    assert len([e for e in bench.events if isinstance(e, ErrorReported) and e.code == 204]) == 2
    bench.tick(700)
    bench.tick(1, UNLOCK)
    assert bench.run(MOVE) == ["there"]


def test_an_arm_that_was_pushed_off_its_path_goes_back_to_it():
    bench = Bench()
    bench.start(MOVE, loaded=True)
    bench.tick(40)
    bench.controller.plant.push((0.0, 0.0, -400.0))
    bench.tick(200)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert {e.code for e in bench.events if isinstance(e, ErrorReported)} <= {153, 157}
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.controller.plant.push((0.0, 0.0, 0.0))
    bench.tick(100)
    bench.tick(1, UNLOCK)
    bench.tick(1, RESUME)
    limit = 3000
    while bench.now.runtime_state != ProgramState.STOPPED and limit:
        bench.tick()
        limit -= 1
    assert printed(bench) == ["there"]
    assert bench.now.target_q == pytest.approx(GOAL)
    assert [e for e in bench.events if isinstance(e, ProgramResumed)]


def test_a_stop_without_a_program_needs_no_resuming():
    bench = Bench(fidelity="ideal")
    bench.start("def s():\n  speedj([0.5,0,0,0,0,0], 5, 0.2)\nend\n")
    bench.tick(25)
    assert not at_rest(bench)
    bench.tick(40, TRIGGER)
    assert at_rest(bench)
    assert bench.now.runtime_state == ProgramState.STOPPED
    bench.tick(1, UNLOCK)
    assert bench.run(MOVE) == ["there"]


def test_time_passes_until_the_stop_may_be_unlocked_and_then_may_stand_still(stopped):
    start = stopped.now.tick - 80
    while stopped.controller.is_active:
        stopped.tick()
    assert 5.0 <= (stopped.now.tick - start) * 0.008 < 6.0
    assert stopped.now.runtime_state == ProgramState.PAUSED
