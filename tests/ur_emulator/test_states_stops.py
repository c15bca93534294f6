"""Stops beside what chunks show (`chunks/watched/stops.script`): who is refused what in which state, and the limiter."""

from types import SimpleNamespace

import numpy as np
import pytest
from box_support import Bench
from states_support import ENDLESS, moving

from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.errors import EmulatorError, RefusedError
from ur_emulator.machine.commands.power import PowerOff, PowerOn, ReleaseBrakes, StartFreedrive
from ur_emulator.machine.commands.programs import PauseProgram, ResumeProgram, StartProgram, StopProgram
from ur_emulator.machine.commands.safety import (
    AssignSafetyInput,
    ChangeSafetySettings,
    ConfirmSafety,
    PressEmergencyStop,
    ReducedMode,
    RestartSafety,
    SafeguardStop,
    TriggerFault,
    TriggerProtectiveStop,
    TriggerViolation,
    UnlockProtectiveStop,
)
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.controller.safety.speed_scaling import TOLERANCE
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.motion.arm_motion import ArmMotion
from ur_emulator.machine.motion.generators import SpeedJ
from urscript import compile_program

PRESS, OPEN, REDUCE = PressEmergencyStop("robot"), SafeguardStop(True), ReducedMode(True)


@pytest.fixture
def bench():
    """A bench whose arm is moving for ever."""
    return moving()


def speeds(bench, first=0):
    return np.array([s.target_qd for s in bench.snapshots[first:]])


def test_unknown_kinds_and_pairs_are_refused():
    with pytest.raises(EmulatorError, match="allowed is robot or system"):
        PressEmergencyStop("red")
    with pytest.raises(EmulatorError, match="allowed is 0 to 3"):
        AssignSafetyInput(4, "none")


# --- protective stop


def test_unlocking_waits_five_seconds_for_the_dashboard_only(bench):
    bench.tick(1, TriggerProtectiveStop())
    stopped_at, safety = bench.now.timestamp, bench.controller.state.safety
    while not safety.may_unlock(bench.now.timestamp):
        assert bench.controller.is_active
        bench.tick()
    assert bench.now.timestamp - stopped_at == pytest.approx(5.0, abs=0.01)
    bench.tick(1, UnlockProtectiveStop())
    assert bench.now.safety_mode == SafetyMode.NORMAL
    bench.tick(1, TriggerProtectiveStop())
    assert not safety.may_unlock(bench.now.timestamp)


# --- reduced mode, recovery


def test_who_is_too_fast_for_too_long_is_stopped():
    bench = Bench(fidelity="ideal")
    bench.tick(1, REDUCE)
    limiter, plant = bench.controller.state.speed.limiter, bench.controller.plant.sense()
    fast = plant._replace(actual_qd=(0.0, 0.0, 3.0, 0.0, 0.0, 0.0))
    space = bench.now.space
    found = [limiter.find_violation(fast, space, 0.008) for _ in range(70)]
    assert found[:60] == [None] * 60
    assert found[-1].error.code == 191
    assert "elbow at 3.000 rad/s" in found[-1].error.text
    assert limiter.find_violation(plant, space, 0.008) is None
    assert limiter.find_violation(fast, space, 0.008) is None


def test_an_arm_that_wakes_up_out_of_range_is_in_recovery_until_it_is_back():
    bench = Bench(fidelity="ideal", mode=RobotMode.POWER_OFF)
    high = bench.controller.state.robot.q_max[0]
    q = (high + 0.05, *bench.now.actual_q[1:])
    bench.controller.plant.reset(q)
    bench.controller.state.motion.place(q)
    bench.tick(5)
    bench.tick(220, ReleaseBrakes())
    assert (bench.now.robot_mode, bench.now.safety_mode) == (RobotMode.RUNNING, SafetyMode.RECOVERY)
    bench.start(
        "def back():\n  q = get_actual_joint_positions()\n  movej([q[0] - 1, q[1], q[2], q[3], q[4], q[5]], a=2, v=2)\nend\n"
    )
    while bench.now.safety_mode == SafetyMode.RECOVERY:
        bench.tick()
        assert abs(bench.now.target_qd[0]) <= CB3.limits.recovery_speed + TOLERANCE
    assert bench.now.safety_mode == SafetyMode.NORMAL
    assert bench.now.actual_q[0] <= high
    bench.tick(100)
    assert min(speeds(bench)[:, 0]) < -1.0  # fast again


def test_the_scale_of_an_arm_at_rest_is_that_of_the_slider():
    motion = ArmMotion((0.0,) * 6, 20.0)
    bench = Bench()
    bench.tick(1, REDUCE)
    limiter = bench.controller.state.speed.limiter
    arm, tcp = bench.controller.state.arm, (0.0,) * 6
    assert limiter.step(motion, arm, tcp, 0.4, 0.008) == 0.4
    assert limiter.step(motion, arm, tcp, 0.0, 0.008) == 0.0
    motion.command(SimpleNamespace(), SpeedJ((0.0,) * 6, 1.0))
    assert limiter.step(motion, arm, tcp, 1.0, 0.008) == 1.0


# --- the pendant and the start


def test_a_controller_that_starts_from_nothing_boots():
    bench = Bench(mode=RobotMode.NO_CONTROLLER)
    seen = [bench.now.robot_mode]
    while bench.controller.is_active:
        if bench.tick().robot_mode != seen[-1]:
            seen.append(bench.now.robot_mode)
    assert seen == [RobotMode.NO_CONTROLLER, RobotMode.DISCONNECTED, RobotMode.BOOTING, RobotMode.POWER_OFF]


@pytest.mark.parametrize("mode", [RobotMode.RUNNING, RobotMode.IDLE, RobotMode.POWER_OFF])
def test_a_requested_stop_is_one_whatever_the_robot_mode(mode):
    """A program may ask for it in the cycle in which the arm loses its power."""
    bench = Bench(mode=mode)
    bench.tick(20)
    bench.controller.state.requests.protective_stop = True
    bench.tick(5)
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP
    assert [e.code for e in bench.events if isinstance(e, ErrorReported)] == [209]


# --- what a box does not do it refuses, for every command in every state

POWERED = (RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING)
GOES = (ProgramState.PLAYING, ProgramState.RESUMING)
PAUSES = (ProgramState.PAUSED, ProgramState.PAUSING)


def has(*causes):
    return lambda box: any(box.state.safety.has(cause) for cause in causes)


# Each command, and what it has done half a second later, or had before.
EFFECTS = [
    (PowerOn(), lambda box: box.state.mode.mode in POWERED),
    (ReleaseBrakes(), lambda box: box.state.mode.mode is RobotMode.RUNNING or box.state.mode.is_changing),
    (PowerOff(), lambda box: box.state.mode.mode not in POWERED),
    (StartFreedrive(), lambda box: box.state.compliance.is_in_freedrive),
    (TriggerProtectiveStop(), has(SafetyMode.PROTECTIVE_STOP)),
    (UnlockProtectiveStop(), lambda box: not has(SafetyMode.PROTECTIVE_STOP)(box)),
    (TriggerViolation(), has(SafetyMode.VIOLATION)),
    (TriggerFault(), has(SafetyMode.FAULT)),
    (
        RestartSafety(),
        lambda box: (
            not has(SafetyMode.FAULT, SafetyMode.VIOLATION, SafetyMode.PROTECTIVE_STOP)(box)
            and box.state.mode.mode not in POWERED
        ),
    ),
    (PRESS, has(SafetyMode.ROBOT_EMERGENCY_STOP)),
    (OPEN, has(SafetyMode.SAFEGUARD_STOP)),
    (REDUCE, has(SafetyMode.REDUCED)),
    (ChangeSafetySettings(), lambda box: box.state.mode.mode is RobotMode.CONFIRM_SAFETY),
    (ConfirmSafety(), lambda box: box.state.mode.mode is RobotMode.POWER_OFF),
    (StartProgram(compile_program(ENDLESS)), lambda box: box.programs.runtime_state in GOES),
    (PauseProgram(), lambda box: box.programs.runtime_state in PAUSES),
    (ResumeProgram(), lambda box: box.programs.runtime_state in GOES),
    (StopProgram(), lambda box: not box.programs.is_running),
]
# How a moving arm gets into each state, and the commands that are refused there.
SWITCH_ON = [PowerOn, ReleaseBrakes]
MOVE = [StartFreedrive, StartProgram, ResumeProgram]
NONE_STANDS = [UnlockProtectiveStop, ConfirmSafety]
REFUSED = {
    "plays": ([], [*NONE_STANDS, ResumeProgram]),
    "paused": ([PauseProgram()], [*NONE_STANDS, PauseProgram]),
    "stopped": ([StopProgram()], [*NONE_STANDS, PauseProgram, ResumeProgram]),
    "reduced": ([REDUCE], [*NONE_STANDS, ResumeProgram]),
    "off": ([PowerOff()], [*NONE_STANDS, PauseProgram, *MOVE]),
    "on": ([PowerOff(), PowerOn()], [*NONE_STANDS, PauseProgram, *MOVE]),
    "safeguard": ([OPEN], [*NONE_STANDS, PauseProgram, *MOVE]),
    "protective": ([TriggerProtectiveStop()], [ConfirmSafety, PauseProgram, *MOVE]),
    "emergency": ([PRESS], [*NONE_STANDS, *SWITCH_ON, TriggerProtectiveStop, PauseProgram, *MOVE]),
    "violation": (
        [TriggerViolation()],
        [*NONE_STANDS, *SWITCH_ON, TriggerProtectiveStop, PauseProgram, *MOVE],
    ),
    "fault": (
        [TriggerFault()],
        [*NONE_STANDS, *SWITCH_ON, TriggerProtectiveStop, TriggerViolation, PauseProgram, *MOVE],
    ),
    "to confirm": ([ChangeSafetySettings()], [UnlockProtectiveStop, *SWITCH_ON, PauseProgram, *MOVE]),
}


@pytest.mark.parametrize("state", [*REFUSED, "boots"])
def test_what_a_box_does_not_do_it_refuses(state):
    boots = [*NONE_STANDS, *SWITCH_ON, ChangeSafetySettings, PauseProgram, *MOVE]
    way, refused = REFUSED.get(state, ([], boots))
    for command, has_effect in EFFECTS:
        bench = (
            Bench(mode=RobotMode.NO_CONTROLLER) if state == "boots" else moving(loaded=True, fidelity="exact")
        )
        for step in way:
            bench.tick(50, step)
        bench.tick(1, command)
        ((_, error),) = bench.controller.outcomes
        assert isinstance(error, RefusedError) is (type(command) in refused), f"{command}: {error}"
        if error is None:
            bench.tick(60)
            assert has_effect(bench.controller), command
