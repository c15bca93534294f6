"""Random commands in random order: the arm keeps its limits, a stopped arm stands still, the box goes on.

Whatever programs, hands and clients do to a compliant arm, it ends at rest as well.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from box_support import Bench
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from states_support import BRAKING, COMMANDS, ENDLESS, ENTRY, check_wires, failures

from protocol.ur_types import ControlMode, JointMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.power import (
    ChooseModeByDashboard,
    MoveEnablingDevice,
    PowerOff,
    PowerOn,
    ReleaseBrakes,
    SetOperationalMode,
    StartFreedrive,
)
from ur_emulator.commands.programs import (
    ClosePopup,
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    StartProgram,
    StopProgram,
)
from ur_emulator.commands.safety import (
    AssignSafetyInput,
    ChangeSafetySettings,
    ConfirmSafety,
    PressButton,
    ReducedMode,
    ReleaseEmergencyStop,
    RequireSafeguardReset,
    ResetSafeguard,
    RestartSafety,
    SafeguardStop,
    TriggerProtectiveStop,
    UnlockProtectiveStop,
)
from ur_emulator.commands.surroundings import AttachPayload, Push
from ur_emulator.controller.events import ProgramPaused, ProgramResumed, ProgramStarted, ProgramStopped
from ur_emulator.controller.safety.inputs import OperationalMode
from ur_emulator.controller.safety.modes import MOVING_MODES, ROW
from ur_emulator.models.generations import CB3, E_SERIES
from ur_emulator.motion.overlay import LastDisplacement
from urscript import compile_program

STREAM = "def s():\n  while True:\n    speedj([0, 0, 0, 0, 0, 0.8], 4, 0.008)\n  end\nend\n"
FORCE = (
    "def c():\n  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,5,0,0,0], 2, [.1,.1,.05,.2,.2,.2])\n"
    "  while True:\n    sync()\n  end\nend\n"
)
SHORT = 'def t():\n  textmsg("short")\nend\n'
SECONDARY = "sec p():\n  set_digital_out(0, True)\nend\n"
LINES = (
    "def lines():\n  p1 = get_target_tcp_pose()\n  while True:\n    movel(pose_add(p1, p[0,0.04,0,0,0,0]), a=2, v=0.3, r=0.01)\n"
    "    movel(p1, a=2, v=0.3)\n  end\nend\n"
)
TURNS = (
    "def turns():\n  thread t():\n    while True:\n      speedj([0.2,0,0,0,0,0], 2, 0.1)\n      stopj(2)\n    end\n  end\n"
    '  h = run t()\n  sleep(0.3)\n  kill h\n  stopj(1)\n  popup("x", blocking=True)\nend\n'
)
WATCHED = 'def w():\n  rtde_set_watchdog("input_int_register_24", 5)\n  movej([0.6,-1.6,-1.9,-0.2,1.2,1.6])\n  sleep(1)\nend\n'
FAILING = "def fails():\n  sleep(0.1)\n  speedj([9,0,0,0,0,0], 40, 1)\n  x = 1 / 0\nend\n"
TEXTS = (ENDLESS, STREAM, FORCE, SHORT, SECONDARY, LINES, TURNS, WATCHED, FAILING)
PROGRAMS = tuple(compile_program(text) for text in TEXTS)
ANYTHING = (
    *COMMANDS.values(),
    *(StartProgram(program) for program in PROGRAMS),
    StopProgram(),
    PauseProgram(),
    ResumeProgram(),
    ClosePopup(),
    PowerOn(),
    ReleaseBrakes(),
    StartFreedrive(),
    SetSpeedSlider(0.3),
    SetSpeedSlider(1.0),
    RequireSafeguardReset(True),
    RequireSafeguardReset(False),
    ResetSafeguard(),
    ChangeSafetySettings(),
    ConfirmSafety(),
    PressButton("teach", True),
    PressButton("teach", False),
    AssignSafetyInput(0, "emergency stop"),
    AssignSafetyInput(0, "reduced"),
    AssignSafetyInput(0, "none"),
    # Refused where there are no operational modes.
    *(SetOperationalMode(mode) for mode in ("none", "manual", "automatic")),
    *(ChooseModeByDashboard(mode) for mode in (None, OperationalMode.MANUAL, OperationalMode.AUTOMATIC)),
    *(MoveEnablingDevice(position) for position in ("none", "released", "pressed", "fully pressed")),
    *(SafeguardStop(active, "automatic mode") for active in (True, False)),
    *(RequireSafeguardReset(required, "automatic mode") for required in (True, False)),
    ResetSafeguard("automatic mode"),
    *(AssignSafetyInput(1, function) for function in ("operational mode", "three-position enabling", "none")),
)
# An e-Series box in the states, with the cycle that the numbers of this file are for.
WITH_MODES = replace(CB3, has_operational_modes=True, limits=E_SERIES.limits)
# What wakes an arm up, three times as likely: else most boxes would sleep.
LIKELY = (*ANYTHING, *3 * (ReleaseEmergencyStop(), RestartSafety(), SafeguardStop(False)))
LIKELY += 3 * (UnlockProtectiveStop(), ReleaseBrakes(), StartProgram(PROGRAMS[0]))
STOPS = tuple(COMMANDS[event] for mode, event in ENTRY.items() if mode not in MOVING_MODES)
RESTING = 0.03  # rad/s, what sensors may say of an arm at rest
# What may happen to a program after what has happened to it.
NEXT = {
    None: {ProgramStarted},
    ProgramStarted: {ProgramPaused, ProgramStopped},
    ProgramPaused: {ProgramResumed, ProgramStopped},
    ProgramResumed: {ProgramPaused, ProgramStopped},
    ProgramStopped: {ProgramStarted},
}


class AnyBox(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.bench = None
        self.stopped_for = self.unpowered_for = 0

    @initialize(generation=st.sampled_from((CB3, WITH_MODES)))
    def begin(self, generation):
        self.bench = Bench(generation=generation)

    def tick(self, *commands):
        before = self.bench.now
        self.bench.tick(1, *commands)
        now = self.bench.now
        changed = now.safety_mode != before.safety_mode
        is_stopped = now.safety_mode not in MOVING_MODES
        self.stopped_for = (0 if changed else self.stopped_for + 1) if is_stopped else 0
        self.unpowered_for = 0 if now.robot_mode == RobotMode.RUNNING else self.unpowered_for + 1
        self.look(before)

    def look(self, before):
        """What must hold in every cycle."""
        now = self.bench.now
        row = ROW[SafetyMode(now.safety_mode)]
        qd_max = np.array(self.bench.controller.state.robot.qd_safety) * (1 + 1e-6)
        assert (np.abs(now.target_qd) <= qd_max).all()
        if now.robot_mode == before.robot_mode == RobotMode.RUNNING and now.safety_mode == SafetyMode.NORMAL:
            assert (np.abs(np.subtract(now.target_q, before.target_q)) <= qd_max * 0.008).all()
        if now.runtime_state == ProgramState.PAUSED and now.control_mode == ControlMode.POSITION:
            assert not any(now.target_qd)
        if self.stopped_for > BRAKING or self.unpowered_for > 3:
            assert now.target_qd == (0.0,) * 6
            assert max(map(abs, now.actual_qd)) < RESTING
            assert now.runtime_state not in (ProgramState.STOPPING, ProgramState.RESUMING)
        if self.stopped_for > 1:
            # Paused by the stop, before it, or about to be; never at work.
            assert now.runtime_state not in (ProgramState.PLAYING, ProgramState.RESUMING)
            assert now.control_mode == 0
        if not row.may_have_power and self.stopped_for > BRAKING:
            assert now.robot_mode in (RobotMode.POWER_OFF, RobotMode.CONFIRM_SAFETY)
        if now.safety_mode == SafetyMode.PROTECTIVE_STOP and now.robot_mode == RobotMode.RUNNING:
            assert now.joint_mode == (JointMode.RUNNING,) * 6

    @rule(commands=st.lists(st.sampled_from(LIKELY), min_size=1, max_size=3), ticks=st.integers(1, 60))
    def do(self, commands, ticks):
        self.tick(*commands)
        for _ in range(ticks - 1):
            self.tick()

    @rule(program=st.sampled_from(PROGRAMS[:3]), ticks=st.integers(1, 40), stop=st.sampled_from(STOPS))
    def stop_at_work(self, program, ticks, stop):
        """A program is at work, and something stops it."""
        self.the_return_is_always_possible()
        self.tick(StartProgram(program))
        for _ in range(ticks):
            self.tick()
        self.tick(stop)
        assert self.bench.now.safety_mode not in MOVING_MODES
        for _ in range(ticks):
            self.tick()

    @rule(ticks=st.integers(150, 250))
    def wait(self, ticks):
        for _ in range(ticks):
            self.tick()

    @rule(level=st.sampled_from((0, 0x0300, 0xFF00)))
    def wire(self, level):
        self.bench.controller.state.io.digital_in = level
        self.tick()

    @rule()
    def a_program_in_a_wrong_state_is_refused_with_a_reason(self):
        now = self.bench.now
        if now.robot_mode == RobotMode.RUNNING and now.safety_mode in MOVING_MODES:
            return
        if self.bench.controller.state.mode.is_changing:
            return
        known = len(failures(self.bench))
        self.tick(StartProgram(PROGRAMS[3]))
        (text,) = failures(self.bench)[known:]
        assert text.startswith("program t not started: the robot is in ")
        assert text.count("\n") == 0

    @rule()
    def the_return_is_always_possible(self):
        """Whatever has happened: release, close, restart, confirm, release the brakes; then programs run."""
        for command in (
            AssignSafetyInput(0, "none"),
            AssignSafetyInput(1, "none"),
            ChooseModeByDashboard(None),
            SetOperationalMode("none"),
            PressButton("teach", False),
            ReleaseEmergencyStop(),
            RequireSafeguardReset(False),
            SafeguardStop(False),
            ReducedMode(False),
            RestartSafety(),
            ConfirmSafety(),
            ReleaseBrakes(),
        ):
            self.tick(command)
        for _ in range(200):
            self.tick()
        assert (self.bench.now.robot_mode, self.bench.now.safety_mode) == (
            RobotMode.RUNNING,
            SafetyMode.NORMAL,
        )
        self.tick(SetSpeedSlider(1.0), StartProgram(PROGRAMS[0]))
        for _ in range(20):
            self.tick()
        assert any(self.bench.now.target_qd)

    @invariant()
    def ports_agree(self):
        if self.bench is not None:
            check_wires(self.bench)

    def teardown(self):
        last = None
        for event in self.bench.events if self.bench is not None else ():
            if type(event) in NEXT:
                # A pause that is taken back before the arm rests is not news, but its end is.
                taken_back = {ProgramResumed} if last in (ProgramStarted, ProgramResumed) else set()
                assert type(event) in NEXT[last] | taken_back
                last = type(event)


AnyBox.TestCase.settings = settings(
    max_examples=12,
    stateful_step_count=15,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
TestAnyBox = AnyBox.TestCase


# --- compliant arms

number = st.floats(-1.0, 1.0).map(lambda x: round(x, 3))
bits = st.lists(st.integers(0, 1), min_size=6, max_size=6)
force_mode = st.builds(
    lambda frame, selection, wrench, kind, limit: (
        f"force_mode(p{frame}, {selection}, {[60 * x for x in wrench]}, {kind}, {[limit] * 6})"
    ),
    st.lists(number, min_size=6, max_size=6),
    bits,
    st.lists(number, min_size=6, max_size=6),
    st.integers(1, 3),
    st.floats(0.0, 1.0).map(lambda x: round(x, 3)),
)
statement = st.one_of(
    force_mode,
    st.sampled_from(
        [
            "end_force_mode()",
            "freedrive_mode_no_incorrect_payload_check()",
            "end_freedrive_mode()",
            "teach_mode()",
            "zero_ftsensor()",
            "textmsg(tool_contact())",
            "set_tcp(p[0,0,0.1,0,0.2,0])",
            "set_payload(1.5, [0,0,0.05])",
            "force_mode_set_damping(0.4)",
            "force_mode_set_gain_scaling(2)",
            "movel(pose_add(get_target_tcp_pose(), p[0.02,0,-0.05,0,0,0]), v=0.2)",
            "speedl([0,0.05,-0.05,0,0,0.2], 1, 0.1)",
            "stopl(2)",
            "sleep(0.2)",
            'set_standard_digital_input_action(0, "freedrive")',
        ]
    ),
)
program = st.lists(statement, min_size=1, max_size=5).map(
    lambda body: "def f():\n  " + "\n  ".join(body) + "\n  sleep(1)\nend\n"
)
event = st.one_of(
    program,
    st.builds(
        lambda x, y, z: Push((80 * x, 80 * y, 80 * z), (0.1 * x, 0.1 * z, 0.1 * y)), number, number, number
    ),
    st.builds(AttachPayload, st.floats(0.0, 3.0)),
    st.sampled_from(
        [
            StartFreedrive(),
            StopProgram(),
            PauseProgram(),
            ResumeProgram(),
            TriggerProtectiveStop(),
            UnlockProtectiveStop(),
            ReleaseBrakes(),
            PowerOff(),
            SetSpeedSlider(0.3),
            "input",
        ]
    ),
)


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.tuples(event, st.integers(1, 60)), min_size=1, max_size=10), st.integers(0, 5))
def test_nothing_breaks_a_compliant_arm(events, seed):
    bench = Bench(fidelity=("ideal", "typical", "poor")[seed % 3], seed=seed)
    state = bench.controller.state
    for what, cycles in events:
        if what == "input":
            state.io.digital_in ^= 1
        else:
            command = StartProgram(compile_program(what)) if isinstance(what, str) else what
            bench.tick(1, command)
        bench.tick(cycles)
        assert all(
            map(math.isfinite, (*bench.now.actual_q, *bench.now.target_q, *bench.now.actual_tcp_force))
        )
    state.io.digital_in = 0
    bench.tick(1, StopProgram(), ReleaseBrakes(), Push((0.0, 0.0, 0.0)))
    bench.tick(400)
    assert bench.now.control_mode == ControlMode.POSITION
    assert state.mode.mode is RobotMode.RUNNING
    assert not any(bench.now.target_qd)
    assert np.abs(bench.controller.plant.qd_true).max() < 0.02
    assert not any(not isinstance(overlay, LastDisplacement) for overlay in state.motion._overlays)
