"""Programs that pause and go on: threads, time, arm, outputs, and what clients are told."""

import math

import numpy as np
import pytest
from box_support import Bench

from protocol.ur_types import ProgramState
from ur_emulator.commands.programs import ClosePopup, PauseProgram, ResumeProgram, StopProgram
from ur_emulator.controller.events import (
    ErrorReported,
    ProgramPaused,
    ProgramResumed,
    ProgramStarted,
    ProgramStopped,
    ScriptFailed,
)

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
