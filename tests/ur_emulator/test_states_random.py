"""Random commands in random order: whatever people and clients do, a stopped arm stands still."""

from dataclasses import replace

import numpy as np
from box_support import Bench
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from states_support import BRAKING, COMMANDS, ENDLESS, ENTRY, check_wires, failures

from protocol.ur_types import JointMode, ProgramState, RobotMode, SafetyMode
from ur_emulator.commands.power import (
    ChooseModeByDashboard,
    MoveEnablingDevice,
    PowerOn,
    ReleaseBrakes,
    SetOperationalMode,
    StartFreedrive,
)
from ur_emulator.commands.programs import (
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
    UnlockProtectiveStop,
)
from ur_emulator.controller.safety.inputs import OperationalMode
from ur_emulator.controller.safety.modes import MOVING_MODES, ROW
from ur_emulator.models.generations import CB3, E_SERIES
from urscript import compile_program

STREAM = "def s():\n  while True:\n    speedj([0, 0, 0, 0, 0, 0.8], 4, 0.008)\n  end\nend\n"
FORCE = (
    "def c():\n  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,5,0,0,0], 2, [.1,.1,.05,.2,.2,.2])\n"
    "  while True:\n    sync()\n  end\nend\n"
)
SHORT = 'def t():\n  textmsg("short")\nend\n'
SECONDARY = "sec p():\n  set_digital_out(0, True)\nend\n"
PROGRAMS = tuple(compile_program(text) for text in (ENDLESS, STREAM, FORCE, SHORT, SECONDARY))
ANYTHING = (
    *COMMANDS.values(),
    *(StartProgram(program) for program in PROGRAMS),
    StopProgram(),
    PauseProgram(),
    ResumeProgram(),
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


class AnyBox(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.bench = None
        self.stopped_for = self.unpowered_for = 0

    @initialize(generation=st.sampled_from((CB3, WITH_MODES)))
    def begin(self, generation):
        self.bench = Bench(generation=generation)

    def tick(self, *commands):
        mode = self.bench.now.safety_mode
        self.bench.tick(1, *commands)
        now = self.bench.now
        changed = now.safety_mode != mode
        is_stopped = now.safety_mode not in MOVING_MODES
        self.stopped_for = (0 if changed else self.stopped_for + 1) if is_stopped else 0
        self.unpowered_for = 0 if now.robot_mode == RobotMode.RUNNING else self.unpowered_for + 1
        self.look()

    def look(self):
        """What must hold in every cycle."""
        now = self.bench.now
        row = ROW[SafetyMode(now.safety_mode)]
        assert np.abs(np.array(now.target_qd)).max() < 10.0
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


AnyBox.TestCase.settings = settings(
    max_examples=20,
    stateful_step_count=20,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
TestAnyBox = AnyBox.TestCase
