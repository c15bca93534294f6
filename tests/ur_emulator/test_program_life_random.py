"""Commands in any order at any time: the box lives, the arm keeps its limits, states and flags agree."""

import numpy as np
from box_support import Bench
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.power import PowerOff, ReleaseBrakes
from ur_emulator.commands.programs import (
    ClosePopup,
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    StartProgram,
    StopProgram,
)
from ur_emulator.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.controller.events import ProgramPaused, ProgramResumed, ProgramStarted, ProgramStopped
from ur_emulator.models.robots import robot_by_name
from urscript import compile_program

PROGRAMS = [
    compile_program(text)
    for text in (
        "def moves():\n  while True:\n    movej([0.5,-1.6,-1.9,-0.2,1.2,1.6], a=3, v=1.5, r=0.05)\n"
        "    movej([0.2,-1.4,-1.9,-0.2,1.2,1.6], a=3, v=1.5)\n  end\nend\n",
        "def lines():\n  p1 = get_target_tcp_pose()\n  while True:\n    movel(pose_add(p1, p[0,0.04,0,0,0,0]), a=2, v=0.3)\n"
        "    movel(p1, a=2, v=0.3)\n  end\nend\n",
        "def stream():\n  while True:\n    speedj([0.4,0.1,0,0,0,0.2], 3, 0.008)\n  end\nend\n",
        "def turns():\n  thread t():\n    while True:\n      speedj([0.2,0,0,0,0,0], 2, 0.1)\n      stopj(2)\n    end\n  end\n"
        "  h = run t()\n  sleep(0.3)\n  kill h\n  stopj(1)\n  popup(\"x\", blocking=True)\nend\n",
        "def watched():\n  rtde_set_watchdog(\"input_int_register_24\", 5)\n  movej([0.6,-1.6,-1.9,-0.2,1.2,1.6])\n  sleep(1)\nend\n",
        "def fails():\n  sleep(0.1)\n  speedj([9,0,0,0,0,0], 40, 1)\n  x = 1 / 0\nend\n",
        "sec out():\n  set_standard_digital_out(1, True)\nend\n",
        "movej([0.3,-1.5,-1.8,0,1.2,1.5], a=2, v=1)\n",
    )
]  # fmt: skip
COMMANDS = [
    PauseProgram(),
    ResumeProgram(),
    StopProgram(),
    TriggerProtectiveStop(),
    UnlockProtectiveStop(),
    ClosePopup(),
    PowerOff(),
    ReleaseBrakes(),
    SetSpeedSlider(0.3),
    SetSpeedSlider(1.0),
    *(StartProgram(program) for program in PROGRAMS),
]
STEPS = st.lists(
    st.tuples(st.lists(st.sampled_from(COMMANDS), max_size=3), st.integers(1, 25)), min_size=4, max_size=20
)
NEXT = {
    None: {ProgramStarted},
    ProgramStarted: {ProgramPaused, ProgramStopped},
    ProgramPaused: {ProgramResumed, ProgramStopped},
    ProgramResumed: {ProgramPaused, ProgramStopped},
    ProgramStopped: {ProgramStarted},
}
QD_MAX = np.array(robot_by_name("ur3").qd_safety) * (1 + 1e-6)


@settings(max_examples=30)
@given(STEPS)
def test_commands_in_any_order(steps):
    bench = Bench(fidelity="ideal")
    before = bench.now
    for commands, n in steps:
        for _ in range(n):
            now = bench.tick(1, *commands)
            commands = []
            state = ProgramState(now.runtime_state)
            assert (np.abs(now.target_qd) <= QD_MAX).all()
            if (
                now.robot_mode == before.robot_mode == RobotMode.RUNNING
                and now.safety_mode == SafetyMode.NORMAL
            ):
                assert (np.abs(np.subtract(now.target_q, before.target_q)) <= QD_MAX * 0.008).all()
            if state is ProgramState.PAUSED:
                assert not any(now.target_qd)
            if now.safety_mode == SafetyMode.PROTECTIVE_STOP == before.safety_mode:
                assert state is not ProgramState.PLAYING
            before = now
    last = None
    for event in bench.events:
        if type(event) in NEXT:
            # A pause that is taken back before the arm rests is not news, but its end is.
            allowed = NEXT[last] | ({ProgramResumed} if last in (ProgramStarted, ProgramResumed) else set())
            assert type(event) in allowed
            last = type(event)
    bench.tick(1, StopProgram(), UnlockProtectiveStop(), ReleaseBrakes(), SetSpeedSlider(1.0))
    bench.tick(400)
    assert bench.now.robot_mode == RobotMode.RUNNING
    assert bench.run('def last():\n  movej([0.4,-1.7,-1.9,-0.2,1.2,1.6])\n  textmsg("works")\nend\n')[
        -1:
    ] == ["works"]
