"""Programs that pause and go on, beside what chunks show (`chunks/watched/pause.script`): time, threads, clients."""

import json
from itertools import product

import numpy as np
import pytest
from box_support import Bench, FrameReader, MessageReader, connect

from protocol.primary.messages import KeyMessage, TextMessage
from protocol.ur_types import ProgramState
from ur_emulator import ControlBox
from ur_emulator.machine.commands.power import ReleaseBrakes, StartFreedrive
from ur_emulator.machine.commands.programs import PauseProgram, ResumeProgram, StopProgram
from ur_emulator.machine.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.machine.models.generations import CB3, E_SERIES

GOAL = [0.9, -1.6, -1.9, -0.2, 1.2, 1.6]
MOVE = f'def m():\n  movej({GOAL}, a=1.4, v=1.0)\n  textmsg("there")\nend\n'
PAUSE, RESUME, STOP = PauseProgram(), ResumeProgram(), StopProgram()


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


def at_rest(bench):
    return bench.now.target_qd == (0.0,) * 6


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


MOVES_AND_STREAMS = (
    "def p():\n  movej([0.5,-1.6,-1.9,-0.2,1.2,1.6], a=4, v=2)\n  a = get_target_joint_positions()\n"
    "  movej([0.6,-1.6,-1.9,-0.2,1.2,1.6], a=4, v=2, r=0.02)\n  movej([0.6,-1.4,-1.9,-0.2,1.2,1.6], a=4, v=2)\n"
    "  speedj([0.3,0,0,0,0,0], 4, 0.1)\n  stopj(4)\n  sleep(0.05)\n  textmsg(a)\n  textmsg(get_target_joint_positions())\nend\n"
)


@pytest.fixture(scope="module")
def without_pause():
    return Bench(fidelity="ideal").run(MOVES_AND_STREAMS)


@pytest.mark.parametrize("pause_at", range(0, 120, 30))
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


FORCE = "force_mode(get_target_tcp_pose(), [0,0,1,0,0,0], [0,0,5,0,0,0], 2, [.1,.1,.05,.2,.2,.2])"
BELT = "encoder_enable_set_tick_count(0, 0)\n  track_conveyor_linear(p[0,1,0,0,0,0], 1000)"


BEGINS = ["freedrive_mode()\n  sleep(0.1)", f"freedrive_mode()\n  sync()\n  {FORCE}"]
LINES_AFTER = [
    f"movej({GOAL})",
    "movel(pose_add(get_target_tcp_pose(), p[0,0.05,0,0,0,0]))",
    f"stopj(3)\n  movej({GOAL})",
    f"speedj([0,0,0,0,0,0.5], 4)\n  movej({GOAL})",
]


@pytest.mark.parametrize("guided", [False, True], ids=["protective stop", "hand"])
@pytest.mark.parametrize(
    ("lines", "after"),
    [
        ("speedj([0.5,0,0,0,0,0], 1, 0.3)\n  stopj(0.5)", 40),
        ("speedl(p[0,0.1,0,0,0,0], 0.2, 0.3)\n  stopl(0.1)", 40),
        (f"speedj([0.5,0,0,0,0,0], 1, 0.6)\n  movej({GOAL}, a=2, v=1)", 85),
        ("speedj([0.8,0,0,0,0,0], 0.8)", 40),
        (f"{FORCE}\n  speedj([0.8,0,0,0,0,0], 0.8)", 85),
        (f"{BELT}\n  speedl(p[0,0.1,0,0,0,0], 0.1)", 40),
        (f"{FORCE}\n  movel(pose_add(get_target_tcp_pose(), p[0,0.1,0,0,0,0]), v=0.1)", 85),
        (f"{BELT}\n  sleep(0.4)\n  stop_conveyor_tracking(0.2)", 85),
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


@pytest.mark.parametrize(
    ("lines", "begin", "generation"),
    [
        *product(LINES_AFTER, BEGINS, [CB3]),
        (LINES_AFTER[0], BEGINS[1], E_SERIES),
        (LINES_AFTER[3], BEGINS[0], E_SERIES),
    ],
)
def test_a_motion_right_after_freedrive_is_executed(lines, begin, generation):
    bench = Bench(generation=generation)
    end = "end_freedrive_mode()" if "force" not in begin else "end_force_mode()"
    before = bench.now.target_q
    assert bench.run(f'def p():\n  {begin}\n  {end}\n  {lines}\n  textmsg("done")\nend\n') == ["done"]
    assert np.abs(np.subtract(bench.now.target_q, before)).max() > 0.05
    if "movej" in lines:
        assert bench.now.target_q == pytest.approx(GOAL, abs=1e-6)


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
