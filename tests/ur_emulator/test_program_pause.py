"""Programs that pause and go on: threads, time, arm, outputs, and what clients are told.

A protective stop pauses a loaded program; after the unlocking it goes on, ends or gives way to another one.
"""

import math

import numpy as np
import pytest
from box_support import Bench, FrameReader, MessageReader, connect

from protocol.primary.layout import RobotModeData
from protocol.primary.messages import ErrorCodeMessage, KeyMessage, ReportLevel, TextMessage
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.commands.power import PowerOff
from ur_emulator.commands.programs import ClosePopup, PauseProgram, ResumeProgram, StartProgram, StopProgram
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
from ur_emulator.ports.primary.robot_state import state_records
from urscript import compile_program

COUNT = "def count():\n  n = 0\n  while True:\n    n = n + 1\n    write_output_integer_register(0, n)\n    sync()\n  end\nend\n"
GOAL = [0.9, -1.6, -1.9, -0.2, 1.2, 1.6]
MOVE = f'def m():\n  movej({GOAL}, a=1.4, v=1.0)\n  textmsg("there")\nend\n'
PAUSE, RESUME, STOP = PauseProgram(), ResumeProgram(), StopProgram()


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


def counter(bench):
    return bench.controller.state.registers.outputs.integers[0]


def printed(bench):
    return [event.text for event in bench.events if type(event).__name__ == "TextPrinted"]


def lives(bench):
    return [type(e) for e in bench.events if type(e).__name__.startswith("Program")]


def states(snapshots):
    order = [ProgramState(s.runtime_state) for s in snapshots]
    return [state for i, state in enumerate(order) if i == 0 or state is not order[i - 1]]


def at_rest(bench):
    return bench.now.target_qd == (0.0,) * 6


def test_threads_stand_still_in_a_pause_and_go_on_after_it(bench):
    bench.start(COUNT)
    bench.tick(9)
    assert counter(bench) == 10
    bench.tick(100, PAUSE)
    assert counter(bench) == 10
    bench.tick(10, RESUME)
    assert counter(bench) == 20


def test_the_states_of_a_pause_in_order(bench):
    bench.start(MOVE)
    bench.tick(20)
    bench.tick(100, PAUSE)
    bench.tick(400, RESUME)
    S = ProgramState
    assert states(bench.snapshots) == [S.PLAYING, S.PAUSING, S.PAUSED, S.RESUMING, S.PLAYING, S.STOPPED]
    for before, after in zip(bench.snapshots[:-1], bench.snapshots[1:], strict=True):
        if after.runtime_state == S.PAUSED:
            assert not any(after.target_qd)
        if before.runtime_state == S.PLAYING and after.runtime_state == S.PAUSING:
            assert any(after.target_qd)
    assert lives(bench) == [ProgramStarted, ProgramPaused, ProgramResumed, ProgramStopped]


def test_a_pause_at_rest_takes_a_cycle(bench):
    bench.start("def p():\n  sleep(10)\nend\n")
    assert bench.tick(1, PAUSE).runtime_state == ProgramState.PAUSING
    assert bench.tick().runtime_state == ProgramState.PAUSED
    assert bench.tick(1, RESUME).runtime_state == ProgramState.RESUMING
    assert bench.tick().runtime_state == ProgramState.PLAYING


def test_a_move_that_was_paused_arrives_as_if_nothing_had_been(bench):
    bench.run(MOVE)
    plain = [s.target_q for s in bench.snapshots]
    other = Bench(fidelity="ideal")
    other.start(MOVE)
    other.tick(40)
    assert not at_rest(other)
    other.tick(60, PAUSE)
    assert at_rest(other)
    paused_at = other.now.target_q
    other.tick(100)
    assert other.now.target_q == paused_at
    other.tick(300, RESUME)
    assert other.now.target_q == pytest.approx(GOAL)
    assert printed(other) == ["there"]
    # The same path: every point of it lies between two neighbours of the plain one.
    plain, paused = np.array(plain), np.array([s.target_q for s in other.snapshots])
    distance = np.abs(paused[:, None, :] - plain[None, :, :]).max(axis=2).min(axis=1)
    assert distance.max() < 1.05 * 0.008


def test_an_arm_that_streams_ramps_to_rest_and_follows_again(bench):
    bench.start("def s():\n  while True:\n    speedj([0.3,0,0,0,0,0], 2.0, get_steptime())\n  end\nend\n")
    bench.tick(40)
    assert bench.now.target_qd[0] == pytest.approx(0.3)
    bench.tick(60, PAUSE)
    assert at_rest(bench)
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.tick(60, RESUME)
    assert bench.now.target_qd[0] == pytest.approx(0.3)
    assert not [e for e in bench.events if isinstance(e, ScriptFailed | ErrorReported)]


@pytest.mark.parametrize(
    "move", ["stopj(2)", "speedj([0.3,0,0,0,0,0], 0.5)", "movej([1,-1.5,-1.8,0,1.2,1.5], r=0.05)"]
)
def test_every_kind_of_motion_call_ends_after_a_pause_in_it(bench, move):
    bench.start(f'def p():\n  speedj([0.5,0,0,0,0,0], 5, 0.4)\n  {move}\n  textmsg("on")\nend\n')
    bench.tick(55)
    for _ in range(3):
        bench.tick(7, PAUSE)
        bench.tick(3, RESUME)
    bench.tick(500)
    assert printed(bench) == ["on"]
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert at_rest(bench)


def test_sleep_and_time_outs_stand_still(bench):
    bench.start(
        'def p():\n  socket_open("10.0.0.1", 1)\n  thread t():\n    sleep(0.4)\n    textmsg("slept")\n  end\n'
        "  h = run t()\n  textmsg(socket_read_binary_integer(1, timeout=0.8))\n  join h\nend\n"
    )
    bench.tick(30)
    bench.tick(1000, PAUSE)
    assert printed(bench) == []
    bench.tick(19, RESUME)
    assert printed(bench) == []
    bench.tick(2)
    assert printed(bench) == ["slept"]
    bench.tick(45)
    assert printed(bench) == ["slept"]
    bench.tick(10)
    assert printed(bench) == ["slept", "[0,-1]"]


def test_what_comes_in_a_pause_is_there_after_it(bench):
    bench.start('def p():\n  socket_open("10.0.0.1", 1)\n  textmsg(socket_read_line(timeout=0.1))\nend\n')
    bench.tick(5)
    bench.tick(50, PAUSE)
    bench.network.sockets[0].inbox += b"hello\n"
    bench.tick(50)
    assert printed(bench) == []
    bench.tick(1, RESUME)
    assert printed(bench) == ["hello"]


def test_a_secondary_program_runs_beside_a_paused_one(bench):
    bench.start(COUNT)
    bench.tick(5, PAUSE)
    bench.start("sec out():\n  set_standard_digital_out(2, True)\nend\n")
    assert bench.now.actual_digital_output_bits == 0b100
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.start("sec bad():\n  x = 1 / 0\nend\n")
    assert bench.now.runtime_state == ProgramState.PAUSED
    before = counter(bench)
    bench.tick(1, RESUME)
    assert counter(bench) == before + 1


def test_a_popup_that_is_closed_in_a_pause_lets_the_program_go_on_after_it(bench):
    bench.start('def p():\n  popup("stop", blocking=True)\n  textmsg("closed")\nend\n')
    bench.tick(5, PAUSE)
    bench.tick(5, ClosePopup())
    assert printed(bench) == []
    bench.tick(1, RESUME)
    assert printed(bench) == ["closed"]


def test_a_popup_does_not_count_as_a_pause(bench):
    bench.start('def p():\n  popup("stop", blocking=True)\nend\n')
    bench.tick(20)
    assert bench.now.runtime_state == ProgramState.PLAYING


@pytest.mark.parametrize("cycles", [1, 60])
def test_a_paused_program_can_be_stopped(bench, cycles):
    bench.start(MOVE)
    bench.tick(30)
    bench.tick(cycles, PAUSE)
    bench.tick(1, STOP)
    bench.tick(60)
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert at_rest(bench)
    assert lives(bench)[-1] is ProgramStopped
    assert bench.run(MOVE) == ["there"]


@pytest.mark.parametrize("cycles", [1, 60])
def test_a_paused_program_can_be_replaced(bench, cycles):
    bench.start(COUNT)
    bench.start(MOVE)
    bench.tick(30)
    bench.tick(cycles, PAUSE)
    goal = [0.1, *GOAL[1:]]
    bench.run(f'def other():\n  movej({goal})\n  textmsg("other")\nend\n')
    assert printed(bench) == ["other"]
    assert bench.now.target_q == pytest.approx(goal)
    assert not bench.controller.state.motion.is_paused


def test_nothing_to_pause_or_to_resume(bench):
    bench.tick(3, PAUSE)
    bench.tick(3, RESUME)
    assert bench.now.runtime_state == ProgramState.STOPPED
    bench.start(COUNT)
    bench.tick(5, RESUME)
    assert bench.now.runtime_state == ProgramState.PLAYING
    bench.tick(5, PAUSE)
    bench.tick(5, PAUSE)
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert lives(bench) == [ProgramStarted, ProgramPaused]
    assert not [e for e in bench.events if isinstance(e, ErrorReported)]


def test_pause_and_resume_in_one_cycle_lose_nothing(bench):
    bench.start(MOVE)
    bench.tick(30)
    bench.tick(300, PAUSE, RESUME)
    assert bench.now.target_q == pytest.approx(GOAL)
    assert printed(bench) == ["there"]


def test_time_may_stand_still_while_paused_at_rest(bench):
    bench.start('def p():\n  socket_open("10.0.0.1", 1)\n  socket_read_line(timeout=0)\nend\n')
    bench.tick(5)
    assert bench.controller.waits_outside
    bench.tick(1, PAUSE)
    assert bench.controller.is_active
    bench.tick(60)
    assert not bench.controller.is_active
    assert not bench.controller.waits_outside
    bench.tick(2, RESUME)
    assert bench.controller.is_active
    assert bench.controller.waits_outside


def test_time_does_not_stand_still_while_the_arm_pauses(bench):
    bench.start(MOVE)
    bench.tick(40)
    bench.tick(1, PAUSE)
    while bench.controller.is_active:
        bench.tick()
    assert at_rest(bench)
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert bench.now.actual_qd == (0.0,) * 6


def test_outputs_that_follow_the_program_take_a_pause_as_not_running(bench):
    bench.start(
        "def p():\n  set_runstate_standard_digital_output_to_value(0, 1)\n"
        "  set_runstate_standard_digital_output_to_value(1, 2)\n"
        "  set_runstate_standard_digital_output_to_value(2, 3)\n  set_standard_digital_out(0, True)\n"
        "  set_standard_digital_out(4, True)\n  while True:\n    sync()\n  end\nend\n"
    )
    bench.tick(3)
    assert bench.now.actual_digital_output_bits == 0b10101
    bench.tick(5, PAUSE)
    assert bench.now.actual_digital_output_bits == 0b10010
    bench.tick(5, RESUME)
    assert bench.now.actual_digital_output_bits == 0b10110


def test_pause_on_error_code(bench):
    bench.start(
        "def p():\n  position_deviation_warning(True, 0.0001)\n  pause_on_error_code(174)\n"
        "  q = get_actual_joint_positions()\n  movej([q[0] + 0.3, q[1], q[2], q[3], q[4], q[5]])\n"
        '  textmsg("there")\nend\n'
    )
    bench.tick(200)
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert at_rest(bench)
    reached = bench.now.target_q[0]
    bench.tick(100, RESUME)  # the arm sets out and deviates again
    assert bench.now.runtime_state == ProgramState.PAUSED
    assert lives(bench).count(ProgramPaused) == 2
    assert bench.now.target_q[0] > reached


@pytest.mark.parametrize(("asked", "pauses"), [("174, 0", True), ("174, 5", False), ("175", False)])
def test_pause_on_error_code_looks_at_code_and_argument(bench, asked, pauses):
    bench.start(
        f"def p():\n  position_deviation_warning(True, 0.0001)\n  pause_on_error_code({asked})\n"
        "  q = get_actual_joint_positions()\n  movej([q[0] + 0.3, q[1], q[2], q[3], q[4], q[5]])\nend\n"
    )
    bench.tick(250)
    warnings = {e.argument for e in bench.events if getattr(e, "code", None) == 174}
    assert 0 in warnings
    assert 5 not in warnings
    assert bench.now.runtime_state == (ProgramState.PAUSED if pauses else ProgramState.STOPPED)


def test_critical_sections_outlive_a_pause(bench):
    bench.start(
        "def p():\n  thread other():\n    while True:\n      write_output_integer_register(1, 1)\n      sync()\n    end\n  end\n"
        "  enter_critical\n  run other()\n  n = 0\n  while n < 5:\n    n = n + 1\n    sync()\n  end\n  exit_critical\n"
        '  textmsg("out")\n  sleep(1)\nend\n'
    )
    bench.tick(2)
    bench.tick(20, PAUSE)
    assert printed(bench) == []
    bench.tick(10, RESUME)
    assert printed(bench) == ["out"]


@pytest.mark.parametrize("pause_at", range(0, 120, 7))
def test_a_pause_anywhere_changes_no_result(pause_at):
    """A program of two movers' turns, blends and waits says the same whenever it is paused."""
    text = (
        "def p():\n  movej([0.5,-1.6,-1.9,-0.2,1.2,1.6], a=4, v=2)\n  a = get_target_joint_positions()\n"
        "  movej([0.6,-1.6,-1.9,-0.2,1.2,1.6], a=4, v=2, r=0.02)\n  movej([0.6,-1.4,-1.9,-0.2,1.2,1.6], a=4, v=2)\n"
        "  speedj([0.3,0,0,0,0,0], 4, 0.1)\n  stopj(4)\n  sleep(0.05)\n  textmsg(a)\n  textmsg(get_target_joint_positions())\nend\n"
    )
    plain = Bench(fidelity="ideal")
    expected = plain.run(text)
    paused = Bench(fidelity="ideal")
    paused.start(text)
    paused.tick(pause_at)
    paused.tick(45, PAUSE)
    paused.tick(400, RESUME)
    said = printed(paused)
    assert said[0] == expected[0]
    assert len(said) == 2
    # A stream that was paused gets less far: it begins anew from rest.
    first, second = (
        np.array([float(x) for x in text.strip("[]").split(",")]) for text in (expected[1], said[1])
    )
    assert np.abs(first - second)[1:].max() < 1e-6
    assert abs(first[0] - second[0]) < 0.1
    assert math.isfinite(second[0])


TRIGGER, UNLOCK = TriggerProtectiveStop(), UnlockProtectiveStop()


@pytest.fixture
def stopped():
    """A box whose arm was stopped in the middle of a move."""
    bench = Bench(fidelity="ideal")
    bench.start(MOVE, loaded=True)
    bench.tick(60)
    assert bench.now.target_qd[0] > 0.3
    bench.tick(80, TRIGGER)
    return bench


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
    bench.tick(60, PAUSE)
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
    bench.tick(cycles, PAUSE)
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


SLOW_MOVE = 'def m():\n  movej([0.9,-1.6,-1.9,-0.2,1.2,1.6], a=1.4, v=0.5)\n  textmsg("there")\nend\n'


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
        sock.sendall(SLOW_MOVE.encode())
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
    bench.start(SLOW_MOVE)
    bench.tick(40)
    bench.tick(60, PAUSE)
    bench.tick(300, RESUME)
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
    bench.start(SLOW_MOVE)
    bench.tick(40)
    bench.tick(5, PAUSE)
    bench.tick(1, STOP)
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
