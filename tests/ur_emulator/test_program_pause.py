"""Programs that pause and go on: threads, time, arm, outputs, and what clients are told.

A protective stop pauses a loaded program; after the unlocking it goes on, ends or gives way to another one.
"""

import json

import numpy as np
import pytest
from box_support import Bench, FrameReader, MessageReader, connect

from protocol.primary.layout import RobotModeData
from protocol.primary.messages import KeyMessage, ReportLevel, TextMessage
from protocol.rtde.types import RobotStatusBits
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator import ControlBox
from ur_emulator.host.ports.primary.robot_state import state_records
from ur_emulator.machine.commands.power import PowerOff, ReleaseBrakes, StartFreedrive
from ur_emulator.machine.commands.programs import (
    ClosePopup,
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    StopProgram,
)
from ur_emulator.machine.commands.safety import SafeguardStop, TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.machine.controller.events import (
    ErrorReported,
    ProgramPaused,
    ProgramResumed,
    ProgramStarted,
    ProgramStopped,
    SafetyModeChanged,
)
from ur_emulator.machine.models.generations import CB3, E_SERIES

COUNT = "def count():\n  n = 0\n  while True:\n    n = n + 1\n    write_output_integer_register(0, n)\n    sync()\n  end\nend\n"
GOAL = [0.9, -1.6, -1.9, -0.2, 1.2, 1.6]
MOVE = f'def m():\n  movej({GOAL}, a=1.4, v=1.0)\n  textmsg("there")\nend\n'
PAUSE, RESUME, STOP = PauseProgram(), ResumeProgram(), StopProgram()


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


def lives(bench):
    return [type(e) for e in bench.events if type(e).__name__.startswith("Program")]


def states(snapshots):
    order = [ProgramState(s.runtime_state) for s in snapshots]
    return [state for i, state in enumerate(order) if i == 0 or state is not order[i - 1]]


def at_rest(bench):
    return bench.now.target_qd == (0.0,) * 6


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
    assert bench.texts == ["on"]
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert at_rest(bench)


def test_what_comes_in_a_pause_is_there_after_it(bench):
    bench.start('def p():\n  socket_open("10.0.0.1", 1)\n  textmsg(socket_read_line(timeout=0.1))\nend\n')
    bench.tick(5)
    bench.tick(50, PAUSE)
    bench.network.sockets[0].inbox += b"hello\n"
    bench.tick(50)
    assert bench.texts == []
    bench.tick(1, RESUME)
    assert bench.texts == ["hello"]


def test_a_secondary_program_runs_beside_a_paused_one(bench):
    bench.start(COUNT)
    bench.tick(5, PAUSE)
    bench.start("sec out():\n  set_standard_digital_out(2, True)\nend\n")
    assert bench.now.actual_digital_output_bits == 0b100
    assert bench.now.runtime_state == ProgramState.PAUSED
    bench.start("sec bad():\n  x = 1 / 0\nend\n")
    assert bench.now.runtime_state == ProgramState.PAUSED
    before = bench.controller.state.registers.outputs.integers[0]
    bench.tick(1, RESUME)
    assert bench.controller.state.registers.outputs.integers[0] == before + 1


def test_a_popup_that_is_closed_in_a_pause_lets_the_program_go_on_after_it(bench):
    bench.start('def p():\n  popup("stop", blocking=True)\n  textmsg("closed")\nend\n')
    bench.tick(5, PAUSE)
    bench.tick(5, ClosePopup())
    assert bench.texts == []
    bench.tick(1, RESUME)
    assert bench.texts == ["closed"]


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
    assert bench.texts == ["other"]
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
    assert bench.texts == ["there"]


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
    assert max(map(abs, bench.now.actual_qd)) < 1e-3  # joints creep to their targets


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


def test_critical_sections_outlive_a_pause(bench):
    bench.start(
        "def p():\n  thread other():\n    while True:\n      write_output_integer_register(1, 1)\n      sync()\n    end\n  end\n"
        "  enter_critical\n  run other()\n  n = 0\n  while n < 5:\n    n = n + 1\n    sync()\n  end\n  exit_critical\n"
        '  textmsg("out")\n  sleep(1)\nend\n'
    )
    bench.tick(2)
    bench.tick(20, PAUSE)
    assert bench.texts == []
    bench.tick(10, RESUME)
    assert bench.texts == ["out"]


MOVES_AND_STREAMS = (
    "def p():\n  movej([0.5,-1.6,-1.9,-0.2,1.2,1.6], a=4, v=2)\n  a = get_target_joint_positions()\n"
    "  movej([0.6,-1.6,-1.9,-0.2,1.2,1.6], a=4, v=2, r=0.02)\n  movej([0.6,-1.4,-1.9,-0.2,1.2,1.6], a=4, v=2)\n"
    "  speedj([0.3,0,0,0,0,0], 4, 0.1)\n  stopj(4)\n  sleep(0.05)\n  textmsg(a)\n  textmsg(get_target_joint_positions())\nend\n"
)


@pytest.fixture(scope="module")
def without_pause():
    return Bench(fidelity="ideal").run(MOVES_AND_STREAMS)


@pytest.mark.parametrize("pause_at", range(0, 120, 17))
def test_a_pause_anywhere_changes_no_result(bench, without_pause, pause_at):
    bench.start(MOVES_AND_STREAMS)
    bench.tick(pause_at)
    bench.tick(45, PAUSE)
    bench.tick(400, RESUME)
    first_move, end = bench.texts
    assert first_move == without_pause[0]
    # A stream that was paused gets less far: it begins anew from rest.
    gap = np.subtract(json.loads(end), json.loads(without_pause[1]))
    assert np.abs(gap[1:]).max() < 1e-6
    assert abs(gap[0]) < 0.1


# --- protective stops

TRIGGER, UNLOCK = TriggerProtectiveStop(), UnlockProtectiveStop()


@pytest.fixture
def at_work(bench):
    """A box whose arm is in the middle of a move of a loaded program."""
    bench.start(MOVE, loaded=True)
    bench.tick(60)
    assert bench.now.target_qd[0] > 0.3
    return bench


@pytest.fixture
def stopped(at_work):
    at_work.tick(80, TRIGGER)
    return at_work


FORCE = "force_mode(get_target_tcp_pose(), [0,0,1,0,0,0], [0,0,5,0,0,0], 2, [.1,.1,.05,.2,.2,.2])"
BELT = "encoder_enable_set_tick_count(0, 0)\n  track_conveyor_linear(p[0,1,0,0,0,0], 1000)"


@pytest.mark.parametrize("guided", [False, True], ids=["protective stop", "hand"])
@pytest.mark.parametrize(
    "lines",
    [
        "speedj([0.5,0,0,0,0,0], 1, 0.3)\n  stopj(0.5)",
        "speedl(p[0,0.1,0,0,0,0], 0.2, 0.3)\n  stopl(0.1)",
        f"speedj([0.5,0,0,0,0,0], 1, 0.6)\n  movej({GOAL}, a=2, v=1)",
        "speedj([0.8,0,0,0,0,0], 0.8)",
        f"{FORCE}\n  speedj([0.8,0,0,0,0,0], 0.8)",
        f"{BELT}\n  speedl(p[0,0.1,0,0,0,0], 0.1)",
        f"{FORCE}\n  movel(pose_add(get_target_tcp_pose(), p[0,0.1,0,0,0,0]), v=0.1)",
        f"{BELT}\n  sleep(0.4)\n  stop_conveyor_tracking(0.2)",
    ],
    ids=[
        "stopj",
        "stopl",
        "stop before a move",
        "speedj",
        "force",
        "conveyor",
        "force, move",
        "conveyor, stop",
    ],
)
@pytest.mark.parametrize("after", [40, 85])
def test_no_instruction_waits_for_ever_for_an_arm_that_was_taken_from_it(lines, guided, after):
    bench = Bench()
    bench.start(f'def p():\n  {lines}\n  textmsg("on")\nend\n', loaded=True)
    bench.tick(after)
    if guided:
        bench.tick(60, StartFreedrive())
        bench.tick(1, ReleaseBrakes())
    else:
        bench.tick(80, TRIGGER)
        bench.tick(1, UNLOCK, RESUME)
    bench.tick(600)
    assert bench.texts == ["on"]
    assert bench.now.runtime_state == ProgramState.STOPPED
    assert at_rest(bench)


@pytest.mark.parametrize("generation", [CB3, E_SERIES])
@pytest.mark.parametrize(
    "begin",
    ["freedrive_mode()\n  sleep(0.1)", f"freedrive_mode()\n  sync()\n  {FORCE}"],
    ids=["freedrive", "into force mode"],
)
@pytest.mark.parametrize(
    "lines",
    [
        f"movej({GOAL})",
        "movel(pose_add(get_target_tcp_pose(), p[0,0.05,0,0,0,0]))",
        f"stopj(3)\n  movej({GOAL})",
        f"speedj([0,0,0,0,0,0.5], 4)\n  movej({GOAL})",
    ],
    ids=["movej", "movel", "stopj", "speedj"],
)
def test_a_motion_right_after_freedrive_is_executed(lines, begin, generation):
    bench = Bench(generation=generation)
    end = "end_freedrive_mode()" if "force" not in begin else "end_force_mode()"
    before = bench.now.target_q
    assert bench.run(f'def p():\n  {begin}\n  {end}\n  {lines}\n  textmsg("done")\nend\n') == ["done"]
    assert np.abs(np.subtract(bench.now.target_q, before)).max() > 0.05
    if "movej" in lines:
        assert bench.now.target_q == pytest.approx(GOAL, abs=1e-6)


def test_a_freedrive_for_no_time_leaves_nothing_for_the_next():
    """A wrong payload that it began with."""
    bench = Bench()
    bench.controller.plant.attach_load(3.0)
    bench.run(
        "def p():\n  sleep(1)\n  freedrive_mode()\n  end_freedrive_mode()\n  set_payload(3, [0,0,0])\nend\n"
    )
    bench.tick(50, StartFreedrive())
    assert not [e for e in bench.events if isinstance(e, ErrorReported)]


def test_an_arm_that_is_paused_at_slider_0_stays_where_it_is(at_work):
    at_work.tick(100, SetSpeedSlider(0.0))
    q = at_work.now.target_q
    at_work.tick(1, PAUSE)
    at_work.tick(1, SetSpeedSlider(1.0))
    while at_work.now.runtime_state != ProgramState.PAUSED:
        at_work.tick()
    held = at_work.now.target_q
    at_work.tick(100)
    assert at_work.now.target_q == held
    assert np.abs(np.subtract(held, q)).max() < 0.1
    at_work.tick(400, RESUME)
    assert at_work.texts == ["there"]


@pytest.mark.parametrize("stop", ["pause", "safeguard", "protective stop"])
@pytest.mark.parametrize("cycles", [1, 2, 4])
def test_a_stream_that_goes_on_before_the_arm_rests_has_no_step_in_its_speed(stop, cycles):
    bench = Bench(fidelity="ideal")
    bench.start("def s():\n  while True:\n    speedj([1.5,0,0,0,0,0], 3, 0.008)\n  end\nend\n", loaded=True)
    bench.tick(80)
    begin, end, most = {
        "pause": ([PAUSE], [RESUME], 4.0),
        "safeguard": ([SafeguardStop(True)], [SafeguardStop(False)], 20.0),
        "protective stop": ([TRIGGER], [UNLOCK, RESUME], 20.0),
    }[stop]
    for _ in range(3):
        bench.tick(cycles, *begin)
        bench.tick(cycles, *end)
    bench.tick(100)
    qd = np.array([s.target_qd[0] for s in bench.snapshots])
    assert qd[-1] == pytest.approx(1.5)
    assert np.abs(np.diff(qd)).max() <= most * 0.008 * (1 + 1e-9)


def test_the_program_is_paused_and_the_arm_rests(stopped):
    assert stopped.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert stopped.now.runtime_state == ProgramState.PAUSED
    assert stopped.now.robot_mode == RobotMode.RUNNING
    assert at_rest(stopped)
    speeds = np.array([s.target_qd for s in stopped.snapshots])
    largest = stopped.controller.state.robot.stop_deceleration * 0.008
    assert np.abs(np.diff(speeds, axis=0)).max() <= largest * (1 + 1e-9)
    assert [type(e) for e in stopped.events] == [
        ProgramStarted,
        ErrorReported,
        SafetyModeChanged,
        ProgramPaused,
    ]
    (report,) = [e for e in stopped.events if isinstance(e, ErrorReported)]
    assert (report.code, report.argument, report.level) == (209, 0, ReportLevel.WARNING)


def test_after_the_unlocking_it_stays_paused_until_it_is_resumed_and_goes_on_to_its_goal(stopped):
    stopped.tick(200, UNLOCK)
    assert stopped.now.safety_mode == SafetyMode.NORMAL
    assert stopped.now.runtime_state == ProgramState.PAUSED
    assert at_rest(stopped)
    stopped.tick(300, RESUME)
    assert stopped.now.target_q == pytest.approx(GOAL)
    assert stopped.texts == ["there"]
    assert stopped.now.runtime_state == ProgramState.STOPPED


def test_threads_wait_until_the_arm_is_back_on_its_path(bench):
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


def test_after_the_unlocking_another_program_takes_its_place(stopped):
    stopped.tick(1, UNLOCK)
    stopped.run("def other():\n  movej([0.1,-1.6,-1.9,-0.2,1.2,1.6])\nend\n")
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
    stopped.tick(6, end)
    assert stopped.now.runtime_state == ProgramState.STOPPED
    assert stopped.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert lives(stopped)[-1] is ProgramStopped
    stopped.tick(1, UNLOCK)
    stopped.tick(20, RESUME)
    assert stopped.now.runtime_state == ProgramState.STOPPED


@pytest.mark.parametrize("cycles", [1, 4, 10, 60])
def test_a_stop_in_a_pause_on_the_way_into_it_or_out_of_it(at_work, cycles):
    bench = at_work
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
    bench.tick(400, RESUME)
    assert bench.texts == ["there"]
    assert bench.now.target_q == pytest.approx(GOAL)
    assert np.abs(np.diff([s.target_q for s in bench.snapshots], axis=0)).max() <= 1.01 * 0.008


def test_a_secondary_program_that_stops_the_arm_gives_one_report():
    """Source: the public client library's tests."""
    bench = Bench()
    bench.start("sec s():\n  protective_stop()\nend\n")
    bench.tick(20)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    reports = [(e.code, e.argument) for e in bench.events if isinstance(e, ErrorReported)]
    assert reports == [(209, 0)]
    assert bench.now.runtime_state == ProgramState.STOPPED


def test_a_path_that_leads_nowhere_stops_again_when_it_goes_on(bench):
    bench.start("def f():\n  movel(p[10,0,0,0,0,0])\nend\n", loaded=True)
    for _ in range(2):
        bench.tick(300)
        assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
        assert bench.now.runtime_state == ProgramState.PAUSED
        bench.tick(1, UNLOCK)
        bench.tick(1, RESUME)
    assert len([e for e in bench.events if isinstance(e, ErrorReported) and e.code == 204]) == 2
    bench.tick(300)
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
    bench.tick(400, RESUME)
    assert bench.texts == ["there"]
    assert bench.now.target_q == pytest.approx(GOAL)
    assert [e for e in bench.events if isinstance(e, ProgramResumed)]


def test_a_stop_without_a_program_needs_no_resuming(bench):
    bench.start("def s():\n  speedj([0.5,0,0,0,0,0], 5, 0.2)\nend\n")
    bench.tick(25)
    assert not at_rest(bench)
    bench.tick(40, TRIGGER)
    assert at_rest(bench)
    assert bench.now.runtime_state == ProgramState.STOPPED
    bench.tick(1, UNLOCK)
    assert bench.run(MOVE) == ["there"]


SLOW_MOVE = 'def m():\n  movej([0.9,-1.6,-1.9,-0.2,1.2,1.6], a=1.4, v=0.5)\n  textmsg("there")\nend\n'


@pytest.fixture(scope="module")
def box():
    with ControlBox(pace="lockstep", port_base=None) as box:
        yield box


def test_words_of_a_client_pause_and_resume(box):
    with connect(box, "realtime") as sock, connect(box, "primary") as messages:
        reader, told = FrameReader(sock), MessageReader(messages)
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


def flags(snapshot):
    """Running and paused as robot mode data say, running as RTDE says."""
    (mode,) = [record for record in state_records(snapshot) if isinstance(record, RobotModeData)]
    rtde = bool(snapshot.robot_status_bits & RobotStatusBits.PROGRAM_RUNNING)
    return mode.is_program_running, mode.is_program_paused, rtde


def test_flags_of_the_states(bench):
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
    # The public client library waits for that after `stop program` in a pause.
    bench.start(SLOW_MOVE)
    bench.tick(40)
    bench.tick(5, PAUSE)
    bench.tick(1, STOP)
    assert flags(bench.now) == stopped
