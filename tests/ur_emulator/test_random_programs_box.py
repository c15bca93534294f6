"""Whatever a program or a client does, the box ticks on, the arm keeps to its limits, states and flags agree.

`RANDOM_PROGRAMS=20000 pytest tests/ur_emulator/test_random_programs_box.py` tries that many of each.
"""

import math
import os
import threading

import numpy as np
import pytest
from box_support import Bench
from driver_program import PROGRAMS, driver_text
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from program_support import Box, frames
from random_arguments import HOME, ROWS, calls, text_of, values

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
from urscript.catalogue.types import Support

EXAMPLES = int(os.environ.get("RANDOM_PROGRAMS", "25"))
some = settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck), print_blob=True)
TOLERANCE = 1.001


def peer(unread):
    """Answers everything with a bit of everything."""
    return len(unread), b"(1.5,2,-3)\r\nack 12\n" + bytes(8) if unread else b""


class Server:
    """Has any method, and returns its arguments."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *arguments: list(arguments) if len(arguments) != 1 else arguments[0]


class WatchedBox(Box):
    """A box that checks every cycle that the arm and what is published of it stay within reason."""

    def __init__(self):
        super().__init__(
            peers={30001: frames(b"(1,2)"), 63352: peer, 1: None}, servers={"http://a": Server()}
        )
        self.robot = self.controller.state.robot

    def tick(self, n=1, *commands):
        for _ in range(n):
            before = self.now
            super().tick(1, *commands)
            commands = ()
            self._check(before, self.now)
            del self.snapshots[:-2]
        return self.now

    def _check(self, before, now):
        for vector in (now.target_q, now.target_qd, now.actual_q, now.actual_qd, now.actual_tcp_pose):
            assert all(map(math.isfinite, vector)), vector
        limits = zip(
            now.target_q,
            before.target_q,
            self.robot.qd_safety,
            self.robot.q_min,
            self.robot.q_max,
            strict=True,
        )
        for q, q_before, speed, low, high in limits:
            assert low <= q <= high
            if not self._placed(before, now):
                assert abs(q - q_before) <= speed * 0.008 * TOLERANCE + 1e-12
        for qd, speed in zip(now.target_qd, self.robot.qd_safety, strict=True):
            assert abs(qd) <= speed * TOLERANCE

    def _placed(self, before, now):
        """Whether the set-point may have jumped: the arm was placed, or is held or guided where it is."""
        return self.placing or RobotMode.RUNNING not in (before.robot_mode, now.robot_mode)

    placing = False

    def leave(self):
        """Stop what runs; nothing of it may stay."""
        state = self.controller.state
        self.tick(1, StopProgram())
        self.finish(limit=3000)
        assert not self.controller.programs.is_running
        assert state.motion.owner is None
        assert not any(getattr(end, "is_open", False) for end in self.network.ends)
        assert not [text for text in self.failures if "internal error" in text], self.failures
        assert not [error for error in self.compile_errors if "internal" in error.message]

    def send_text(self, text):
        self.send(text.encode("latin-1", "replace") + b"\n")


def run_and_leave(text, cycles=60):
    """Run a text as programs for some cycles, whatever they are."""
    system_threads = threading.active_count()
    box = WatchedBox()
    box.placing = "set_pos" in text or "freedrive" in text or "teach_mode" in text
    box.send_text(text)
    box.tick(cycles)
    if box.now.safety_mode != SafetyMode.NORMAL:
        box.tick(1, UnlockProtectiveStop())
    box.leave()
    assert threading.active_count() == system_threads
    return box


# --- builtins ----------------------------------------------------------------------------------------------


def program_of(lines):
    body = "".join(f"  {line}\n" for line in lines)
    return f"def p():\n  thread side():\n    sync()\n  end\n{body}end\n"


@some
@given(st.lists(calls(), min_size=1, max_size=4))
def test_builtins_with_random_arguments_give_a_value_or_an_error_in_words(some_calls):
    for call in some_calls:
        run_and_leave(program_of([f"x = {call}", "textmsg(x)"]), 25)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_every_builtin_survives_a_few_random_arguments(row):
    @settings(max_examples=2, database=None, suppress_health_check=list(HealthCheck))
    @given(calls(row.name))
    def survive(call):
        box = run_and_leave(program_of([f"x = {call}"]), 15)
        if row.support is Support.DECLARED_ONLY:
            assert box.failures or box.compile_errors

    survive()


# --- programs ----------------------------------------------------------------------------------------------

lines = st.one_of(
    calls(module="motion"),
    calls(),
    text_of("{} = {}", st.sampled_from(["x", "x1", "x2", "x3"]), values),
    text_of("y[{}] = {}", st.integers(-1, 7), values),
    text_of("global {} = {}", st.sampled_from(["z", "z1", "z2"]), calls()),
    text_of("kill {}", st.sampled_from(["h", "g[0]", "run mover()", "0", "x"])),
    text_of("join {}", st.sampled_from(["h", "g[1]", "0", "run watcher()"])),
    st.sampled_from(["sync()", "sleep(0.02)", "h = run mover()", "g[0] = run watcher()", "halt"]),
    st.sampled_from(["enter_critical", "exit_critical", "g[1] = run side()", f"movej({HOME})", "return x"]),
)
blocks = st.recursive(
    lines,
    lambda inner: st.one_of(
        text_of("{}\n{}", inner, inner),
        text_of("{}\n{}\n{}", inner, inner, inner),
        text_of("while True:\n{}\nsync()\nend", inner),
        text_of("while True:\n{}\nend", inner),
        text_of("enter_critical\n{}\nexit_critical", inner),
        text_of("if x == {}:\n{}\nelse:\n{}\nend", values, inner, inner),
    ),
    max_leaves=5,
)


@some
@given(blocks, blocks, blocks, st.integers(1, 120), st.sampled_from(["def", "sec"]))
def test_random_programs_with_threads_and_moves_leave_the_box_as_it_was(body, mover, watcher, cycles, kind):
    text = (
        f"{kind} p():\nx = None x1 = None x2 = None x3 = None z = None z1 = None z2 = None\n"
        f"y = [0, 0, 0, 0, 0, 0]\nh = 0\ng = [0, 0]\n"
        f"thread side():\nsync()\nend\nthread mover():\n{mover}\nend\nthread watcher():\n{watcher}\nend\n"
        f"{body}\nend\n"
    )
    run_and_leave(text, cycles)


# --- mutated programs --------------------------------------------------------------------------------------

ORIGINALS = [path.read_bytes() for path in sorted(PROGRAMS.glob("*.script"))] + [driver_text(3).encode()]
PIECES = [
    b"end\n",
    b"\ndef f():\n",
    b"[",
    b")",
    b'"',
    b"=",
    b" 1e308 ",
    b" None ",
    b"kill ",
    b"#",
    b"\n",
    b"-",
    b"\xff",
]


@st.composite
def mutated(draw):
    """A program of ours with a few pieces cut out, doubled, swapped or put in."""
    text = draw(st.sampled_from(ORIGINALS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 60)))
        piece = draw(st.sampled_from([b"", text[start:end] * 2, *PIECES]))
        text = text[:start] + piece + text[end:]
    return text


@some
@given(mutated())
def test_mutated_programs_run_or_are_refused(text):
    box = run_and_leave(text.decode("latin-1"), 40)
    for error in box.compile_errors:
        assert error.line >= 1
        assert error.column >= 1
        assert error.wire_text


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
